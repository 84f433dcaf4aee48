//! The sizes of the codes of maps, as a value node.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4: 786 kB for an image of 512 x 512 pixels, 1.09 MB for its isophotes and 544 kB
//! for features and noise.

use super::report::{MAP_COST, NOISE_COST, SizeReport};
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::map_code::code::{CodedMap, Coding, pack};
use crate::texture::maps::{DiscontinuityMap, FeatureMap, NoiseMap};
use crate::texture::noise::profile::PROFILE;
use crate::texture::noise::spectrum::NoiseModel;
use crate::texture::noise::split::statistics;
use crate::{params, ports};

params! {
    /// The size of each code of a texture, and the cost of a contact on it.
    ///
    /// The codes are bits, bytes and signed pairs of the discontinuity map, and features as bits with noise as a profile or as
    /// statistics. A tap as `.json` lists them.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.
    pub struct MapSizesParams {}
}

ports! {
    pub struct MapSizesPorts / MapSizesIo {
        in {
            /// The gradient.
            map: Value<DiscontinuityMap>,
            /// The features.
            features: Value<FeatureMap>,
            /// The noise.
            noise: Value<NoiseMap>,
        }
        out {
            /// Sizes and costs.
            sizes: Value<SizeReport>,
        }
    }
}

/// The node over [`SizeReport`].
#[derive(Debug)]
pub struct MapSizes;

impl Func for MapSizes {
    type Params = MapSizesParams;
    type Ports = MapSizesPorts;
    const NAME: &'static str = "MapSizes";
    const VERSION: u32 = 4;

    fn eval(_: &MapSizesParams, _: &Build<'_>, mut io: MapSizesIo<'_>) -> Result<Summary, Fault> {
        let mut report = SizeReport::new([io.map.gx.width, io.map.gx.height]);
        let mut summary: Summary = vec![("image", report.image.into())];
        let map = |coding| CodedMap::new(io.map, coding, None).bytes.len();
        let features = pack(io.features.grid.samples.iter().map(|f| *f > 0.5)).len();
        let kurtosis = statistics(&io.noise.grid, &io.noise.holes).kurtosis;
        let model = NoiseModel::poles(io.noise, kurtosis).bytes();
        let bands = NoiseModel::bands(io.noise, kurtosis).bytes();
        for (key, what, bytes) in [
            ("map_bit", "map, one bit", map(Coding::Bit)),
            ("map_byte", "map, one byte", map(Coding::Byte)),
            ("map_signed", "map, signed pairs", map(Coding::Signed)),
            ("features_and_profile", "features as bits, noise as a profile", features + 2 * PROFILE),
            ("features_and_spectrum", "features as bits, noise as a spectrum", features + model),
            ("features_and_bands", "features as bits, noise as bands of a spectrum", features + bands),
        ] {
            report.add(what, bytes);
            summary.push((key, bytes.into()));
        }
        report.add_cost("map", MAP_COST);
        report.add_cost("features and noise", MAP_COST + NOISE_COST);
        report.add_cost("noise", NOISE_COST);
        io.sizes.set(report);
        Ok(summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::texture::{Grid, Surface};

    #[test]
    fn codes_of_512_by_512_pixels_are_within_their_targets() {
        let (grid, surface) = (Grid::from_fn(512, 512, |x, y| ((x * y) % 7) as f32), Surface::default());
        let map = DiscontinuityMap { gx: grid.clone(), gy: grid.clone(), surface };
        let standalone = Standalone::func::<MapSizes>(MapSizesParams::read(&|_| None).unwrap())
            .value(MapSizesPorts::map, map)
            .value(MapSizesPorts::features, FeatureMap { grid: grid.clone(), surface })
            .value(MapSizesPorts::noise, NoiseMap { grid, holes: Vec::new(), surface });
        let run = standalone.run().unwrap();
        let value = run.value(0).unwrap();
        let report = value.get::<SizeReport>().unwrap();
        let bytes: Vec<u64> = report.entries.iter().map(|entry| entry.bytes).collect();
        assert_eq!((report.image, &bytes[..4]), (786_432, &[32_768, 262_144, 524_288, 49_152][..]));
        assert_eq!(report.costs.len(), 3);
        assert!(bytes[3] <= 60_000 && bytes[4] < bytes[5] && bytes[5] < bytes[3], "{bytes:?}");
    }
}
