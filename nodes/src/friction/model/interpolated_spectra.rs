//! A friction model at given speeds.

use super::displacement::Gain;
use super::friction_model::{FrictionModel, ModelError};
use super::interpolate::SpectrumInterpolator;
use super::report::model_summary;
use super::speed_bracket::Bracket;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{choices, params, ports};

choices! {
    /// Interpolation of spectra between two measured speeds.
    pub enum Interpolation {
        /// Displacement, as synthesis does: peaks move between frequencies.
        Displacement,
        /// Crossfade of amplitudes, to compare: one peak falls while another rises.
        Crossfade,
    }
}

/// Returns a model of the spectra of `model` at `speeds`, in m/s.
///
/// # Errors
/// [`ModelError`] when the model is invalid, and for fewer than two speeds, and for speeds that are not above 0 and
/// strictly increasing.
///
/// # Complexity
/// O(speeds * bins).
pub fn at_speeds(
    model: &FrictionModel,
    speeds: &[f64],
    gain: Gain,
    interpolation: Interpolation,
) -> Result<FrictionModel, ModelError> {
    let interpolator = SpectrumInterpolator::new(model, gain)?;
    let (mut low_end, mut high_end) = (vec![0.0; model.bins()], vec![0.0; model.bins()]);
    let mut amplitude = vec![0.0; model.bins()];
    let mut psd = Vec::with_capacity(model.bins() * speeds.len());
    for &speed in speeds {
        match (interpolation, Bracket::of(&model.speeds, speed)) {
            (Interpolation::Crossfade, Bracket::Between { low, alpha }) => {
                interpolator.amplitude(model.speeds[low], &mut low_end);
                interpolator.amplitude(model.speeds[low + 1], &mut high_end);
                for ((mixed, a), b) in amplitude.iter_mut().zip(&low_end).zip(&high_end) {
                    *mixed = (1.0 - alpha) * a + alpha * b;
                }
            }
            _ => interpolator.amplitude(speed, &mut amplitude),
        }
        psd.extend(amplitude.iter().map(|a| (a * a / model.df) as f32));
    }
    let clips = vec![0; speeds.len()];
    let interpolated = FrictionModel { speeds: speeds.to_vec(), psd, clips, ..model.clone() };
    interpolated.validate()?;
    Ok(interpolated)
}

params! {
    /// Interpolates the spectra of a friction model at given speeds, as synthesis does between measured speeds.
    ///
    /// A tap of the output as SVG shows how peaks move between frequencies with speed, or with `Crossfade` how both peaks sound at once.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2,
    /// equations 1 to 3 and figure 5.
    pub struct InterpolatedSpectraParams {
        /// At least two speeds, strictly increasing.
        speeds: Vec<f64> = vec![0.05, 0.1, 0.2, 0.4, 0.8], unit "m/s", range 0.000001..=1000.0;
        /// Level of spectra between measured speeds.
        gain: Gain = Gain::Rms;
        /// Interpolation between measured speeds.
        interpolation: Interpolation = Interpolation::Displacement;
    }
}

ports! {
    pub struct InterpolatedSpectraPorts / InterpolatedSpectraIo {
        in {
            /// The measured model.
            model: Value<FrictionModel>,
        }
        out {
            /// The model at the given speeds.
            between: Value<FrictionModel>,
        }
    }
}

/// The node over [`at_speeds`].
#[derive(Debug)]
pub struct InterpolatedSpectra;

impl Func for InterpolatedSpectra {
    type Params = InterpolatedSpectraParams;
    type Ports = InterpolatedSpectraPorts;
    const NAME: &'static str = "InterpolatedSpectra";

    fn check(
        p: &InterpolatedSpectraParams,
        _: &mut Shape<'_, '_, InterpolatedSpectraPorts>,
    ) -> Result<(), Reject> {
        if p.speeds.len() >= 2 && p.speeds.is_sorted_by(|a, b| a < b) {
            return Ok(());
        }
        let message = format!("{} speeds that are not strictly increasing", p.speeds.len());
        Err(Reject::new("F076", message)
            .at("speeds")
            .help("give at least two speeds, each above the previous one"))
    }

    fn eval(
        p: &InterpolatedSpectraParams,
        _: &Build<'_>,
        mut io: InterpolatedSpectraIo<'_>,
    ) -> Result<Summary, Fault> {
        let interpolated = at_speeds(io.model, &p.speeds, p.gain, p.interpolation)
            .map_err(|e| Fault::new("F076", e.to_string()))?;
        let summary = model_summary(&interpolated);
        io.between.set(interpolated);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (InterpolatedSpectraParams, crate::core::files::MemoryFiles) {
        let speeds = (1..3 + rng.below(3)).map(|k| 0.07 * k as f64).collect();
        let interpolation = [Interpolation::Displacement, Interpolation::Crossfade][rng.below(2)];
        (
            InterpolatedSpectraParams { speeds, gain: Gain::Rms, interpolation },
            crate::core::files::MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::testing::bump_model;

    const MOVED: Interpolation = Interpolation::Displacement;

    #[test]
    fn a_crossfade_has_both_peaks_at_their_own_frequencies() {
        let model = bump_model(&[(0.1, 2000.0), (0.5, 8000.0)], 300.0, 48_000.0, 480);
        let between = at_speeds(&model, &[0.3, 0.5], Gain::Rms, Interpolation::Crossfade).unwrap();
        let (row, moved) = (between.row(0), at_speeds(&model, &[0.3, 0.5], Gain::Rms, MOVED).unwrap());
        let [low, middle, high] = [2000.0, 5000.0, 8000.0].map(|f| row[(f / model.df) as usize]);
        assert!((low / (0.25 * model.row(0)[20]) - 1.0).abs() < 1e-2);
        assert!((high / (0.25 * model.row(1)[80]) - 1.0).abs() < 1e-2);
        assert!(middle < 1e-4 * low && moved.row(0)[50] > 1e3 * middle);
    }

    #[test]
    fn a_peak_moves_with_speed_and_measured_speeds_have_their_own_peaks() {
        let model = bump_model(&[(0.1, 2000.0), (0.5, 8000.0)], 300.0, 48_000.0, 480);
        let interpolated = at_speeds(&model, &[0.1, 0.2, 0.3, 0.4, 0.5], Gain::Rms, MOVED).unwrap();
        let peak = |k: usize| {
            let row = interpolated.row(k);
            let peak = (0..row.len()).max_by(|&a, &b| row[a].total_cmp(&row[b])).unwrap_or(0);
            peak as f64 * interpolated.df
        };
        for (k, wanted) in [2000.0, 3500.0, 5000.0, 6500.0, 8000.0].into_iter().enumerate() {
            assert!((peak(k) - wanted).abs() <= 100.0, "{k}: {}", peak(k));
        }
        let worst =
            interpolated.row(0).iter().zip(model.row(0)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst <= 1e-6 * model.row(0).iter().copied().fold(0.0, f32::max));
        assert!(matches!(
            at_speeds(&model, &[0.2, 0.1], Gain::Rms, MOVED),
            Err(ModelError::Speed { index: 1, .. })
        ));
        assert!(at_speeds(&model, &[0.2], Gain::Rms, MOVED).is_err());
    }
}
