//! Smoothing, main features and noise of textures, as value nodes.

use super::bilateral::{BilateralParams as Widths, bilateral};
use super::dog::{DogParams, features, features_around};
use super::holes::apart;
use super::item::{FeatureMap, Grid, Luma, NoiseMap};
use super::luma::most;
use super::split::{noise, statistics};
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::{params, ports};

params! {
    /// Smooths a texture and keeps its edges: each pixel becomes the mean of those near it that look like it.
    ///
    /// The circle reaches two standard deviations far. The defaults are for lightness from 0 to 100.
    ///
    /// # Source
    /// Tomasi and Manduchi, "Bilateral filtering for gray and color images" (ICCV 1998), in the place that Picard, Tsingos and Faure
    /// (VRIPHYS 2008), section 4.2, give it.
    pub struct BilateralParams {
        /// Standard deviation of the distance.
        sigma_d: f64 = 3.0, unit "px", range 0.1..=30.0;
        /// Standard deviation of the difference, in units of luminance.
        sigma_r: f64 = 4.25, unit "", range 0.01..=1000.0;
        /// How often the filter is run.
        passes: usize = 1, unit "", range 1..=10;
    }
}

ports! {
    pub struct BilateralPorts / BilateralIo {
        in {
            /// The luminance.
            luma: Value<Luma>,
        }
        out {
            /// The smoothed luminance.
            smooth: Value<Luma>,
        }
    }
}

/// The node over [`bilateral`].
#[derive(Debug)]
pub struct Bilateral;

impl Func for Bilateral {
    type Params = BilateralParams;
    type Ports = BilateralPorts;
    const NAME: &'static str = "Bilateral";
    const VERSION: u32 = 2;

    fn eval(p: &BilateralParams, _: &Build<'_>, mut io: BilateralIo<'_>) -> Result<Summary, Fault> {
        let widths = Widths { sigma_d: p.sigma_d, sigma_r: p.sigma_r };
        let wrap = io.luma.surface.wrap;
        let holes = &io.luma.holes;
        let mut grid = io.luma.grid.clone();
        for _ in 0..p.passes {
            let image = if holes.is_empty() { grid } else { apart(&grid, holes) };
            grid = bilateral(&image, widths, wrap);
        }
        grid.samples.iter_mut().zip(holes).for_each(|(x, hole)| *x = if *hole { 0.0 } else { *x });
        io.smooth.set(Luma { grid, holes: holes.clone(), ..*io.luma });
        Ok(Summary::new())
    }
}

params! {
    /// The main features of a texture: lines on the dark side of its edges and along its grooves, 0 to 1.
    ///
    /// A difference of two Gaussians, softly thresholded. It is tuned to luminance from 0 to 100; other kinds are scaled to that. A tap as
    /// SVG draws the features.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2 and figure 5, with the operator of Winnemoeller, Olsen and Gooch,
    /// "Real-time video abstraction" (SIGGRAPH 2006). The root of 1.6 is the square root; the printed cube root gives thinner lines.
    pub struct DogFeaturesParams {
        /// Standard deviation of the narrow Gaussian.
        sigma_e: f64 = 1.0, unit "px", range 0.1..=10.0;
        /// The wide one over the narrow one.
        ratio: f64 = 1.264_911_064_067_351_8, unit "", range 1.01..=4.0;
        /// Weight of the wide one: the nearer to 1, the more is a feature.
        tau: f64 = 0.998, unit "", range 0.0..=1.0;
        /// How sharply features set in.
        phi_e: f64 = 4.0, unit "", range 0.01..=1000.0;
    }
}

ports! {
    pub struct DogFeaturesPorts / DogFeaturesIo {
        in {
            /// The luminance, best smoothed by `Bilateral`.
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
        let (luma, scale) = (io.luma, 100.0 / most(io.luma.kind));
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
            features_around(grid, &luma.holes, params, luma.surface.wrap)
        };
        let share =
            grid.samples.iter().filter(|f| **f > 0.5).count() as f64 / grid.samples.len().max(1) as f64;
        let mut summary: Summary = vec![("share", share.into())];
        if brightest <= 1.5 {
            let text = format!(
                "the brightest pixel has a luminance of {brightest:.2} of 100: no feature can stand out"
            );
            summary.push(("warning", text.into()));
        } else if share == 0.0 {
            summary.push((
                "warning",
                "there are no features: all that is heard of this texture is its noise".into(),
            ));
        }
        io.features.set(FeatureMap { grid, surface: luma.surface });
        Ok(summary)
    }
}

params! {
    /// What is left of a texture beside its smoothed image and its features: noise of mean 0.
    ///
    /// The report tells its variance, its kurtosis, how the change along rows compares with that along columns (`isotropy`) and the
    /// variance of its tiles, greatest over least (`stationarity`): one line can stand for the noise only where it is everywhere alike.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2 and figure 5.
    pub struct FeatureNoiseSplitParams {
        /// Whether the noise is silenced on features.
        mask_features: bool = true;
    }
}

ports! {
    pub struct FeatureNoiseSplitPorts / FeatureNoiseSplitIo {
        in {
            /// The luminance.
            luma: Value<Luma>,
            /// The same, smoothed by `Bilateral`.
            smooth: Value<Luma>,
            /// Its features.
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

/// Refuses a map of another size than the luminance.
fn same_size(field: &str, luma: &Grid, other: &Grid) -> Result<(), Fault> {
    if (luma.width, luma.height) == (other.width, other.height) {
        return Ok(());
    }
    let message = format!(
        "`{field}` has {} x {} pixels, `luma` {} x {}",
        other.width, other.height, luma.width, luma.height
    );
    Err(Fault::new("F124", message).at(field).help("make both of one image"))
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
    use crate::texture::item::{LumaKind, Surface};

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
        let (a, told) = dog(luma(LumaKind::Lstar, tone));
        let (b, _) = dog(luma(LumaKind::Rec601, |x| 2.55 * tone(x)));
        for (a, b) in a.grid.samples.iter().zip(&b.grid.samples) {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
        assert!(!told.iter().any(|(key, _)| *key == "warning"), "{told:?}");
        let (_, told) = dog(luma(LumaKind::Lstar, |x| 0.01 * tone(x)));
        let (_, warning) = told.iter().find(|(key, _)| *key == "warning").unwrap();
        assert!(warning.to_string().contains("0.60 of 100"), "{warning}");
        for (most, warned) in [(1.5, true), (1.6, false)] {
            let (_, told) = dog(luma(LumaKind::Lstar, |x| if x % 20 < 10 { 0.0 } else { most }));
            let text = told.iter().find(|(key, _)| *key == "warning").map(|(_, text)| text.to_string());
            assert_eq!(text.is_some_and(|text| text.contains("of 100")), warned, "{most}");
        }
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
        let p = BilateralParams::read(&|_| None).unwrap();
        let run = Standalone::func::<Bilateral>(p).value(BilateralPorts::luma, luma.clone()).run().unwrap();
        let smooth = run.value(0).unwrap().get::<Luma>().unwrap().clone();
        let (features, _) = dog(smooth.clone());
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
        let (right, told) = split(&luma(half, Vec::new()));
        let holes: Vec<bool> = (0..256 * 128).map(|k| k % 256 >= 128).collect();
        let (ours, ours_told) = split(&luma(wide, holes.clone()));
        assert_eq!(ours.holes, holes);
        for key in ["variance", "kurtosis", "isotropy"] {
            let of = |told: &Summary| told.iter().find(|(k, _)| *k == key).unwrap().1.as_f64().unwrap();
            assert!(
                (of(&ours_told) / of(&told) - 1.0).abs() < 0.02,
                "{key}: {} {}",
                of(&ours_told),
                of(&told)
            );
        }
        // Away from the border of the hole it is the same noise.
        for (k, x) in right.grid.samples.iter().enumerate().filter(|(k, _)| k % 128 < 110) {
            let other = ours.grid.samples[k / 128 * 256 + k % 128];
            assert!((x - other).abs() < 0.05, "{k}: {x} {other}");
        }
    }
}
