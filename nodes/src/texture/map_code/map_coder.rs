//! The coding of discontinuity maps, as a value node.

use super::code::{CodedMap, Coding};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::{Build, Shape};
use crate::texture::maps::{DiscontinuityMap, FeatureMap};
use crate::{choices, params, ports};

choices! { @param Coding {
    /// A pair of signed bytes per pixel: the gradient along x and y.
    Signed,
    /// One byte: the magnitude of the gradient up to its 99.9th percentile.
    Byte,
    /// One bit: 1 where the gradient exceeds a threshold, as in the paper.
    Bit,
} }

params! {
    /// Codes a discontinuity map with a bit, a byte or a pair of signed bytes per pixel, or features with a byte per pixel.
    ///
    /// `coded` is the code, which `MapExcitation` plays and a tap as `.bin` writes for `MapFile`. `magnitude` is the decoded magnitude
    /// of the gradient, 0 to 1. Decoded bits are smoothed by a Gaussian of 0.7 pixels; without it their steps would make the sound
    /// depend on the sample rate.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.1, whose map is binary; Otsu (1979) for the threshold. Bytes, signed pairs and the
    /// Gaussian over decoded bits are choices.
    pub struct MapCoderParams {
        /// Coding of the map.
        coding: Coding = Coding::Signed;
        /// Gradient, in luminance per pixel, above which a bit is set; `None` finds it by Otsu's method.
        threshold: Option<f32> = None, unit "", range 0.0..=1000.0;
    }
}

ports! {
    pub struct MapCoderPorts / MapCoderIo {
        in {
            /// The gradient.
            map: Option<Value<DiscontinuityMap>>,
            /// Features, in place of a gradient.
            features: Option<Value<FeatureMap>>,
        }
        out {
            /// The code.
            coded: Value<CodedMap>,
            /// The decoded magnitude of the gradient.
            magnitude: Value<FeatureMap>,
        }
    }
}

/// Refuses none of the inputs, and both.
fn one_of(map: bool, features: bool) -> Result<(), Reject> {
    let found = match (map, features) {
        (true, true) => "both `map` and `features` are linked",
        (false, false) => "neither `map` nor `features` is linked",
        _ => return Ok(()),
    };
    Err(Reject::new("F128", found).at("map").help("link one of them"))
}

/// The node over [`CodedMap`].
#[derive(Debug)]
pub struct MapCoder;

impl Func for MapCoder {
    type Params = MapCoderParams;
    type Ports = MapCoderPorts;
    const NAME: &'static str = "MapCoder";
    const VERSION: u32 = 2;

    fn check(_: &MapCoderParams, s: &mut Shape<'_, '_, MapCoderPorts>) -> Result<(), Reject> {
        one_of(s.linked(MapCoderPorts::map), s.linked(MapCoderPorts::features))
    }

    fn eval(p: &MapCoderParams, _: &Build<'_>, mut io: MapCoderIo<'_>) -> Result<Summary, Fault> {
        let coded = match (io.map, io.features) {
            (Some(map), None) => CodedMap::new(map, p.coding, p.threshold),
            (None, Some(features)) => CodedMap::of_features(features),
            (map, features) => {
                return one_of(map.is_some(), features.is_some()).map(|()| Vec::new()).map_err(Into::into);
            }
        };
        let summary = vec![("bytes", coded.bytes.len().into()), ("scale", coded.scale.into())];
        io.magnitude.set(FeatureMap { grid: coded.magnitude(), surface: coded.surface });
        io.coded.set(coded);
        Ok(summary)
    }
}
