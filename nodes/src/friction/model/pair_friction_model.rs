//! The friction model of two materials, inferred from the models of each material on itself.

use super::conventions::{Conventions, Origin, Rejections};
use super::displacement::{Gain, displace};
use super::friction_model::{FrictionModel, ModelError};
use super::interpolate::SpectrumInterpolator;
use super::report::model_summary;
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::{params, ports};

/// Relative difference up to which two speeds are equal.
const SAME_SPEED: f64 = 1e-6;

/// Infers the model of a pair of materials: at each speed the spectrum half-way between those of the two materials,
/// with the geometric mean of their powers.
///
/// The model has the speeds of both models and the finer of their grids. Its origin is [`Origin::Inferred`].
///
/// # Errors
/// [`ModelError`] when one of the models is invalid.
///
/// # Complexity
/// O((K_a + K_b) bins).
///
/// # Source
/// An addition to An, James and Marschner (SIGGRAPH 2012), with their displacement interpolation (section 2).
pub fn inferred_pair(a: &FrictionModel, b: &FrictionModel) -> Result<FrictionModel, ModelError> {
    a.validate()?;
    b.validate()?;
    let (finer, other) = if (b.fs, b.bins()) > (a.fs, a.bins()) { (b, a) } else { (a, b) };
    let other = other.resampled(finer.fs, 2 * (finer.bins() - 1))?;
    let ends = [SpectrumInterpolator::new(finer, Gain::Rms)?, SpectrumInterpolator::new(&other, Gain::Rms)?];
    let bins = finer.bins();
    let (mut first, mut second, mut halfway) = (vec![0.0; bins], vec![0.0; bins], vec![0.0; bins]);
    let speeds = merged_speeds(&a.speeds, &b.speeds);
    let mut psd = Vec::with_capacity(bins * speeds.len());
    for &speed in &speeds {
        ends[0].amplitude(speed, &mut first);
        ends[1].amplitude(speed, &mut second);
        displace(&first, &second, 0.5, Gain::Rms, &mut halfway);
        let [p, q, r] = [&first, &second, &halfway].map(|x| x.iter().map(|v| v * v).sum::<f64>());
        // If one material is silent, the geometric mean is 0.
        let scale = if r > 0.0 { (p * q).sqrt() / r } else { 0.0 };
        psd.extend(halfway.iter().map(|v| (v * v * scale / finer.df) as f32));
    }
    let [first, second] = [a, b].map(|model| model.material_pair[0].clone());
    let model = FrictionModel {
        material_pair: [first, second],
        clips: vec![0; speeds.len()],
        speeds,
        psd,
        floor: Vec::new(),
        rejected: Rejections::default(),
        conventions: Conventions { origin: Origin::Inferred, ..finer.conventions.clone() },
        sources: a.sources.iter().chain(&b.sources).cloned().collect(),
        ..*finer
    };
    model.validate()?;
    Ok(model)
}

/// Returns the speeds of both, sorted and without duplicates.
fn merged_speeds(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut all: Vec<f64> = a.iter().chain(b).copied().collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|next, previous| *next - *previous <= SAME_SPEED * *next);
    all
}

params! {
    /// Infers the friction model of two materials on each other from recordings of each material on itself.
    ///
    /// At each speed the spectrum lies half-way between the two: every quantile is the mean of their two frequencies,
    /// and the power is their geometric mean. The result is an estimate (`origin: Inferred`); a recording of the pair
    /// is better.
    ///
    /// # Source
    /// An addition to An, James and Marschner (SIGGRAPH 2012), with the interpolation of their section 2.
    pub struct PairFrictionModelParams {}
}

ports! {
    pub struct PairFrictionModelPorts / PairFrictionModelIo {
        in {
            /// Model of the first material on itself.
            first: Value<FrictionModel>,
            /// Model of the second material on itself.
            second: Value<FrictionModel>,
        }
        out {
            /// Model of the two materials on each other.
            model: Value<FrictionModel>,
        }
    }
}

/// The node over [`inferred_pair`].
#[derive(Debug)]
pub struct PairFrictionModel;

impl Func for PairFrictionModel {
    type Params = PairFrictionModelParams;
    type Ports = PairFrictionModelPorts;
    const NAME: &'static str = "PairFrictionModel";
    const VERSION: u32 = 2;

    fn eval(
        _: &PairFrictionModelParams,
        _: &Build<'_>,
        mut io: PairFrictionModelIo<'_>,
    ) -> Result<Summary, Fault> {
        let model = inferred_pair(io.first, io.second).map_err(|e| Fault::new("F076", e.to_string()))?;
        let summary = model_summary(&model);
        io.model.set(model);
        Ok(summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bump around `centre` Hz at two speeds.
    fn bump(name: &str, centre: f64, level: f64, speeds: [f64; 2], fs: f64) -> FrictionModel {
        let bins = 1 + (fs / 40.0) as usize;
        let at = |k: usize| (-0.5 * ((20.0 * k as f64 - centre) / 200.0).powi(2)).exp();
        let row = |gain: f64| (0..bins).map(move |k| (level * gain * at(k).powi(2)) as f32);
        let psd = row(1.0).chain(row(4.0)).collect();
        FrictionModel::from_psd([name.into(), name.into()], speeds.to_vec(), psd, fs).unwrap()
    }

    fn centroid(model: &FrictionModel, k: usize) -> f64 {
        let row = model.row(k);
        let power: f64 = row.iter().map(|&s| f64::from(s)).sum();
        row.iter().enumerate().map(|(i, &s)| i as f64 * model.df * f64::from(s)).sum::<f64>() / power
    }

    #[test]
    fn the_peak_lies_half_way_and_the_power_is_the_geometric_mean() {
        let a = bump("cotton", 2000.0, 1.0, [0.1, 1.0], 24_000.0);
        let b = bump("nylon", 6000.0, 0.01, [0.1, 1.0], 24_000.0);
        let pair = inferred_pair(&a, &b).unwrap();
        assert_eq!(pair.material_pair, ["cotton", "nylon"]);
        assert_eq!((pair.speeds.len(), pair.conventions.origin), (2, Origin::Inferred));
        assert!((centroid(&pair, 0) - 4000.0).abs() < 20.0, "{}", centroid(&pair, 0));
        let wanted = (a.row_power(1) * b.row_power(1)).sqrt();
        assert!((pair.row_power(1) / wanted - 1.0).abs() < 1e-5);
        let swapped = inferred_pair(&b, &a).unwrap();
        assert!((swapped.row_power(0) / pair.row_power(0) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_material_paired_with_itself_is_unchanged_and_a_silent_one_gives_silence() {
        let a = bump("cotton", 2000.0, 1.0, [0.1, 1.0], 24_000.0);
        let same = inferred_pair(&a, &a).unwrap();
        let worst = same.psd.iter().zip(&a.psd).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-4, "{worst}");
        let silent = bump("silk", 2000.0, 0.0, [0.1, 1.0], 24_000.0);
        assert!(inferred_pair(&a, &silent).unwrap().psd.iter().all(|&s| s == 0.0));
    }

    #[test]
    fn models_of_different_speeds_and_rates_share_the_finer_grid() {
        let a = bump("cotton", 2000.0, 1.0, [0.1, 1.0], 24_000.0);
        let b = bump("nylon", 2000.0, 1.0, [0.1, 2.0], 48_000.0);
        let pair = inferred_pair(&a, &b).unwrap();
        assert_eq!((pair.fs, pair.speeds), (48_000.0, vec![0.1, 1.0, 2.0]));
        let mut wrong = a.clone();
        wrong.speeds[1] = 0.05;
        assert!(matches!(inferred_pair(&wrong, &b), Err(ModelError::Speed { index: 1, .. })));
    }
}
