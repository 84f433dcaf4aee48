//! Maps of discontinuities and their codes, as value nodes.

use super::code::{CodedMap, Coding};
use super::filter::{Kernel, smooth};
use super::item::{DiscontinuityMap, FeatureMap, Luma};
use super::sobel::gradient;
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::{choices, params, ports};

params! {
    /// Where the luminance of a surface changes, and which way: its gradient by the Sobel operator, in luminance per pixel.
    ///
    /// A step of luminance is two to three pixels wide in the map; a thin line gives a pair of opposite signs. The density of the image
    /// decides how sharp an edge can sound: nothing above half the density times the speed. A tap as SVG draws the map.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.1 and figure 3.
    pub struct SobelMapParams {
        /// Standard deviation of a Gaussian before the operator, for grainy images.
        pre_blur: f64 = 0.0, unit "px", range 0.0..=20.0;
    }
}

ports! {
    pub struct SobelMapPorts / SobelMapIo {
        in {
            /// The luminance.
            luma: Value<Luma>,
        }
        out {
            /// The gradient.
            map: Value<DiscontinuityMap>,
        }
    }
}

/// The node over [`gradient`].
#[derive(Debug)]
pub struct SobelMap;

impl Func for SobelMap {
    type Params = SobelMapParams;
    type Ports = SobelMapPorts;
    const NAME: &'static str = "SobelMap";

    fn eval(p: &SobelMapParams, _: &Build<'_>, mut io: SobelMapIo<'_>) -> Result<Summary, Fault> {
        let surface = io.luma.surface;
        let soft = smooth(&io.luma.grid, &Kernel::gaussian(p.pre_blur, 4.0), surface.wrap);
        let [gx, gy] = gradient(&soft, surface.wrap);
        let pairs = gx.samples.iter().zip(&gy.samples);
        let greatest = pairs.fold(0.0_f32, |most, (x, y)| most.max(x * x + y * y)).sqrt();
        io.map.set(DiscontinuityMap { gx, gy, surface });
        Ok(vec![("greatest_per_pixel", greatest.into())])
    }
}

choices! { @param Coding {
    /// A pair of signed bytes to a pixel: the gradient along x and y.
    Signed,
    /// One byte: the length of the gradient up to its 99.9 percentile.
    Byte,
    /// One bit: whether the gradient exceeds a threshold. The paper.
    Bit,
} }

params! {
    /// A map of discontinuities as it is stored: a bit, a byte or a pair of signed bytes to a pixel.
    ///
    /// `coded` is the code, which `MapExcitation` plays and a tap as `.bin` writes for `MapFile`; `magnitude` is what is read back: the
    /// length of the gradient, 1 at most.
    /// Bits are read through a Gaussian of 0.7 pixels, for unblurred they would tie the sound to the rate of audio.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.1; Otsu (1979) for the threshold.
    pub struct MapCoderParams {
        /// How the map is stored.
        coding: Coding = Coding::Signed;
        /// Gradient, in luminance per pixel, above which a bit is set; `None` finds it by Otsu's method.
        threshold: Option<f32> = None, unit "", range 0.0..=1000.0;
    }
}

ports! {
    pub struct MapCoderPorts / MapCoderIo {
        in {
            /// The gradient.
            map: Value<DiscontinuityMap>,
        }
        out {
            /// The code.
            coded: Value<CodedMap>,
            /// The length of the gradient as it is read back.
            magnitude: Value<FeatureMap>,
        }
    }
}

/// The node over [`CodedMap`].
#[derive(Debug)]
pub struct MapCoder;

impl Func for MapCoder {
    type Params = MapCoderParams;
    type Ports = MapCoderPorts;
    const NAME: &'static str = "MapCoder";

    fn eval(p: &MapCoderParams, _: &Build<'_>, mut io: MapCoderIo<'_>) -> Result<Summary, Fault> {
        let coded = CodedMap::new(io.map, p.coding, p.threshold);
        let summary = vec![("bytes", coded.bytes.len().into()), ("scale", coded.scale.into())];
        io.magnitude.set(FeatureMap { grid: coded.magnitude(), surface: coded.surface });
        io.coded.set(coded);
        Ok(summary)
    }
}
