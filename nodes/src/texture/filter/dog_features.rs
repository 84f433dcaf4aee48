//! Main features of a texture, as a value node.

use super::dog::{DogParams, features, features_masked};
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::grid::Grid;
use crate::texture::maps::{FeatureMap, Luma};
use crate::{params, ports};

params! {
    /// The main features of a texture: lines on the dark side of its edges and along its grooves, 0 to 1.
    ///
    /// They are a difference of two Gaussians with a soft threshold. The defaults are for luminance from 0 to 100; other kinds are
    /// scaled to it. A tap as SVG draws the features.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2 and figure 5, with the operator of Winnemoeller, Olsen and Gooch,
    /// "Real-time video abstraction" (SIGGRAPH 2006). The root of 1.6 is the square root; the printed cube root results
    /// in thinner lines.
    pub struct DogFeaturesParams {
        /// Standard deviation of the narrow Gaussian.
        sigma_e: f64 = 1.0, unit "px", range 0.1..=10.0;
        /// Standard deviation of the wide Gaussian over that of the narrow one.
        ratio: f64 = 1.264_911_064_067_351_8, unit "", range 1.01..=4.0;
        /// Weight of the wide Gaussian: sensitivity to features.
        tau: f64 = 0.998, unit "", range 0.0..=1.0;
        /// Sharpness of the soft threshold.
        phi_e: f64 = 4.0, unit "", range 0.01..=1000.0;
    }
}

ports! {
    pub struct DogFeaturesPorts / DogFeaturesIo {
        in {
            /// The luminance, usually smoothed by `Bilateral`.
            luma: Value<Luma>,
        }
        out {
            /// The features.
            features: Value<FeatureMap>,
        }
    }
}

/// The node over [`features`].
#[derive(Debug)]
pub struct DogFeatures;

impl Func for DogFeatures {
    type Params = DogFeaturesParams;
    type Ports = DogFeaturesPorts;
    const NAME: &'static str = "DogFeatures";
    const VERSION: u32 = 2;

    fn eval(p: &DogFeaturesParams, _: &Build<'_>, mut io: DogFeaturesIo<'_>) -> Result<Summary, Fault> {
        let params = DogParams { sigma_e: p.sigma_e, ratio: p.ratio, tau: p.tau, phi_e: p.phi_e };
        let (luma, scale) = (io.luma, 100.0 / io.luma.kind.max());
        let scaled;
        let grid = if scale == 1.0 {
            &luma.grid
        } else {
            scaled = Grid { samples: luma.grid.samples.iter().map(|x| x * scale).collect(), ..luma.grid };
            &scaled
        };
        let brightest = grid.samples.iter().copied().fold(0.0, f32::max);
        let grid = if luma.holes.is_empty() {
            features(grid, params, luma.surface.wrap)
        } else {
            features_masked(grid, &luma.holes, params, luma.surface.wrap)
        };
        let share =
            grid.samples.iter().filter(|f| **f > 0.5).count() as f64 / grid.samples.len().max(1) as f64;
        let mut summary: Summary = vec![("share", share.into())];
        if brightest <= 1.5 {
            let text = format!(
                "the brightest pixel has a luminance of {brightest:.2} of 100, which is too dark for features"
            );
            summary.push(("warning", text.into()));
        } else if share == 0.0 {
            summary.push((
                "warning",
                "there are no features: only the noise of this texture makes sound".into(),
            ));
        }
        io.features.set(FeatureMap { grid, surface: luma.surface });
        Ok(summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::texture::maps::{LumaKind, Surface};

    fn luma(kind: LumaKind, tone: impl Fn(usize) -> f32) -> Luma {
        let grid = Grid::from_fn(40, 20, |x, _| tone(x));
        Luma { grid, holes: Vec::new(), kind, surface: Surface::default() }
    }

    fn dog(luma: Luma) -> (FeatureMap, Summary) {
        let p = DogFeaturesParams::read(&|_| None).unwrap();
        let run = Standalone::func::<DogFeatures>(p).value(DogFeaturesPorts::luma, luma).run().unwrap();
        (run.value(0).unwrap().get::<FeatureMap>().unwrap().clone(), run.summary.clone())
    }

    #[test]
    fn other_luminance_is_scaled_to_100_first() {
        let tone = |x: usize| if x % 20 < 3 { 10.0 } else { 60.0 };
        let (a, summary) = dog(luma(LumaKind::Lstar, tone));
        let (b, _) = dog(luma(LumaKind::Rec601, |x| 2.55 * tone(x)));
        for (a, b) in a.grid.samples.iter().zip(&b.grid.samples) {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
        assert!(!summary.iter().any(|(key, _)| *key == "warning"), "{summary:?}");
        let (_, summary) = dog(luma(LumaKind::Lstar, |x| 0.01 * tone(x)));
        let (_, warning) = summary.iter().find(|(key, _)| *key == "warning").unwrap();
        assert!(warning.to_string().contains("0.60 of 100"), "{warning}");
        for (max, warned) in [(1.5, true), (1.6, false)] {
            let (_, summary) = dog(luma(LumaKind::Lstar, |x| if x % 20 < 10 { 0.0 } else { max }));
            let text = summary.iter().find(|(key, _)| *key == "warning").map(|(_, text)| text.to_string());
            assert_eq!(text.is_some_and(|text| text.contains("of 100")), warned, "{max}");
        }
    }
}
