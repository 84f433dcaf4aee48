//! Noise of a texture without its features, as a value node.

use super::split::{noise, statistics};
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::grid::Grid;
use crate::texture::maps::{FeatureMap, Luma, NoiseMap};
use crate::{params, ports};

params! {
    /// The residual of a texture without its smoothed image and its features: noise of mean 0.
    ///
    /// The report has its variance, its kurtosis, the power of differences along rows over that along columns (`isotropy`), and the
    /// largest over the smallest variance of its tiles (`stationarity`). A single profile represents the noise only if both are near 1.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2 and figure 5.
    pub struct FeatureNoiseSplitParams {
        /// True to multiply the noise by 1 less the features.
        mask_features: bool = true;
    }
}

ports! {
    pub struct FeatureNoiseSplitPorts / FeatureNoiseSplitIo {
        in {
            /// The luminance.
            luma: Value<Luma>,
            /// The luminance smoothed by `Bilateral`.
            smooth: Value<Luma>,
            /// The features of the smoothed luminance.
            features: Value<FeatureMap>,
        }
        out {
            /// The noise.
            noise: Value<NoiseMap>,
        }
    }
}

/// The node over [`noise`].
#[derive(Debug)]
pub struct FeatureNoiseSplit;

/// Returns an error for a map that has another size than the luminance.
fn same_size(field: &str, luma: &Grid, other: &Grid) -> Result<(), Fault> {
    if (luma.width, luma.height) == (other.width, other.height) {
        return Ok(());
    }
    let message = format!(
        "`{field}` has {} x {} pixels, `luma` {} x {}",
        other.width, other.height, luma.width, luma.height
    );
    Err(Fault::new("F124", message).at(field).help("use maps of the same image"))
}

impl Func for FeatureNoiseSplit {
    type Params = FeatureNoiseSplitParams;
    type Ports = FeatureNoiseSplitPorts;
    const NAME: &'static str = "FeatureNoiseSplit";
    const VERSION: u32 = 2;

    fn eval(
        p: &FeatureNoiseSplitParams,
        _: &Build<'_>,
        mut io: FeatureNoiseSplitIo<'_>,
    ) -> Result<Summary, Fault> {
        let luma = io.luma;
        same_size("smooth", &luma.grid, &io.smooth.grid)?;
        same_size("features", &luma.grid, &io.features.grid)?;
        let mask = p.mask_features.then_some(&io.features.grid);
        let grid = noise(&luma.grid, &io.smooth.grid, mask, &luma.holes);
        let found = statistics(&grid, &luma.holes);
        let mut summary: Summary = vec![
            ("variance", found.variance.into()),
            ("isotropy", found.isotropy.into()),
            ("stationarity", found.stationarity.into()),
            ("kurtosis", found.kurtosis.into()),
        ];
        if let Some(warning) = found.warning() {
            summary.push(("warning", warning.into()));
        }
        io.noise.set(NoiseMap { grid, holes: luma.holes.clone(), surface: luma.surface });
        Ok(summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::texture::filter::bilateral::{Bilateral, BilateralNodeParams, BilateralPorts};
    use crate::texture::filter::dog_features::{DogFeatures, DogFeaturesParams, DogFeaturesPorts};
    use crate::texture::maps::{LumaKind, Surface};

    fn luma(kind: LumaKind, tone: impl Fn(usize) -> f32) -> Luma {
        let grid = Grid::from_fn(40, 20, |x, _| tone(x));
        Luma { grid, holes: Vec::new(), kind, surface: Surface::default() }
    }

    fn dog(luma: Luma) -> FeatureMap {
        let p = DogFeaturesParams::read(&|_| None).unwrap();
        let run = Standalone::func::<DogFeatures>(p).value(DogFeaturesPorts::luma, luma).run().unwrap();
        run.value(0).unwrap().get::<FeatureMap>().unwrap().clone()
    }

    #[test]
    fn maps_of_two_images_are_refused() {
        let image = luma(LumaKind::Lstar, |x| x as f32);
        let mut other = image.clone();
        other.grid = Grid::from_fn(39, 20, |_, _| 0.0);
        let features = FeatureMap { grid: image.grid.clone(), surface: image.surface };
        let standalone =
            Standalone::func::<FeatureNoiseSplit>(FeatureNoiseSplitParams::read(&|_| None).unwrap());
        let standalone = standalone
            .value(FeatureNoiseSplitPorts::luma, image)
            .value(FeatureNoiseSplitPorts::smooth, other);
        let fault = standalone.value(FeatureNoiseSplitPorts::features, features).run().err().unwrap();
        assert!(fault.code == "F124" && fault.message.contains("39 x 20"), "{fault}");
    }

    fn split(luma: &Luma) -> (NoiseMap, Summary) {
        let p = BilateralNodeParams::read(&|_| None).unwrap();
        let run = Standalone::func::<Bilateral>(p).value(BilateralPorts::luma, luma.clone()).run().unwrap();
        let smooth = run.value(0).unwrap().get::<Luma>().unwrap().clone();
        let features = dog(smooth.clone());
        let p = FeatureNoiseSplitParams::read(&|_| None).unwrap();
        let run = Standalone::func::<FeatureNoiseSplit>(p)
            .value(FeatureNoiseSplitPorts::luma, luma.clone())
            .value(FeatureNoiseSplitPorts::smooth, smooth)
            .value(FeatureNoiseSplitPorts::features, features)
            .run()
            .unwrap();
        (run.value(0).unwrap().get::<NoiseMap>().unwrap().clone(), run.summary.clone())
    }

    #[test]
    fn half_a_hole_gives_the_noise_of_the_other_half() {
        // Dark stones: a hole of luminance 0 looks like them.
        let mut rng = crate::core::random::Rng::new(31);
        let tone = |x: usize, rng: &mut crate::core::random::Rng| {
            (if x % 32 < 4 { 3.0 } else { 12.0 }) + rng.between(-2.0, 2.0) as f32
        };
        let half = Grid::from_fn(128, 128, |x, _| tone(x, &mut rng));
        let wide = Grid::from_fn(256, 128, |x, y| if x < 128 { half.samples[128 * y + x] } else { 0.0 });
        let surface = Surface { wrap: crate::texture::Wrap::Clamp, ..Surface::default() };
        let luma = |grid, holes| Luma { grid, holes, kind: LumaKind::Lstar, surface };
        let (right, summary) = split(&luma(half, Vec::new()));
        let holes: Vec<bool> = (0..256 * 128).map(|k| k % 256 >= 128).collect();
        let (ours, our_summary) = split(&luma(wide, holes.clone()));
        assert_eq!(ours.holes, holes);
        for key in ["variance", "kurtosis", "isotropy"] {
            let of = |summary: &Summary| summary.iter().find(|(k, _)| *k == key).unwrap().1.as_f64().unwrap();
            assert!(
                (of(&our_summary) / of(&summary) - 1.0).abs() < 0.02,
                "{key}: {} {}",
                of(&our_summary),
                of(&summary)
            );
        }
        // Far from the border of the hole the noise is the same.
        for (k, x) in right.grid.samples.iter().enumerate().filter(|(k, _)| k % 128 < 110) {
            let other = ours.grid.samples[k / 128 * 256 + k % 128];
            assert!((x - other).abs() < 0.05, "{k}: {x} {other}");
        }
    }
}
