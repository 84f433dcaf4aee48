//! Strengths with which excitations are equally loud.

use super::standard_stroke::RATE;
use crate::dsp::{LevelMeter, Weighting, weighted_rms};
use crate::modal::{Bank, BankOutput, Modes, ModesError};
use crate::params;
use crate::scrape::force::speed_curve::{POINTS, SpeedCurve};
use crate::texture::{Grid, NoiseValue};

params! {
    /// Force of the strokes that are compared.
    pub struct StrokeParams {
        /// Strengths depend on the speed of the contact.
        by_speed: bool = true;
        /// Normal force of the stroke.
        force: f64 = 1.0, unit "N", range 0.001..=100_000.0;
        /// Frequency weighting of the loudness that is compared.
        weighting: Weighting = Weighting::K;
        /// Quantity of noise that becomes force, as in NoiseExcitation.
        noise_value: NoiseValue = NoiseValue::Slope;
    }
}

params! {
    /// Tuning of the modes with which excitations are compared.
    pub struct TuningParams {
        /// Factor of the frequencies of `modes`.
        pitch: f64 = 1.0, unit "", range 0.01..=100.0;
        /// Factor of the dampings of `modes`.
        damping: f64 = 1.0, unit "", range 0.001..=1000.0;
    }
}

/// Greatest factor between two excitations.
pub const MAX_FACTOR: f64 = 1e6;

/// Strength in the middle of those found at each speed of a curve (or at one speed), and the ratio of the others to it.
/// A speed without a strength has that in the middle.
#[must_use]
pub fn by_speed(found: impl Fn(usize) -> f64, speeds: usize) -> (f64, [f64; POINTS]) {
    let middle = found(speeds / 2);
    let at = |k: usize| if k < speeds { found(k) } else { 0.0 };
    (middle, std::array::from_fn(|k| if at(k) > 0.0 && middle > 0.0 { at(k) / middle } else { 1.0 }))
}

/// Maximum speed of a stroke that finds a strength at a speed, or by speed, m/s: a circle of cubics is a little uneven.
#[must_use]
pub fn fastest(speed: f64, by_speed: bool) -> f64 {
    let [.., highest] = SpeedCurve::speeds(speed);
    1.05 * if by_speed { highest } else { speed }
}

/// Returns the sound of a force that excites modes with other dampings and frequencies, or the force itself without modes.
///
/// # Errors
/// As [`Modes::validate`].
pub fn rendered(
    force: Vec<f32>,
    modes: Option<&Modes>,
    [damping, pitch]: [f64; 2],
) -> Result<Vec<f32>, ModesError> {
    let Some(modes) = modes else { return Ok(force) };
    let mut bank = Bank::new(modes, f64::from(RATE), BankOutput::Acceleration)?;
    bank.start(damping, pitch, 0);
    let mut sound = vec![0.0; force.len()];
    bank.process(&force, &mut sound);
    Ok(sound)
}

/// Root of the mean square.
#[must_use]
pub fn rms(x: &[f32]) -> f64 {
    let mut meter = LevelMeter::default();
    meter.process(x);
    meter.level().rms
}

/// Root of the mean square under a weighting.
#[must_use]
pub fn loudness(x: &[f32], weighting: Weighting) -> f64 {
    weighted_rms(x, RATE.into(), weighting)
}

/// The factor from `found` to `wanted`; 0 if `found` is silent.
#[must_use]
pub fn factor(wanted: f64, found: f64) -> f64 {
    let factor = wanted / found;
    if factor.is_finite() && found * MAX_FACTOR > wanted { factor } else { 0.0 }
}

/// Two sounds, each times its factor, added up; the shorter one ends in silence.
#[must_use]
pub fn sum([a, b]: [&[f32]; 2], [p, q]: [f64; 2]) -> Vec<f32> {
    let sample = |x: &[f32], k: usize| f64::from(x.get(k).copied().unwrap_or(0.0));
    (0..a.len().max(b.len())).map(|k| (p * sample(a, k) + q * sample(b, k)) as f32).collect()
}

/// The share that the slopes of a noise map have in the power of the slopes of the whole.
#[must_use]
pub fn share(whole: [&Grid; 2], noise: [&Grid; 2]) -> f64 {
    let power = |grids: [&Grid; 2]| {
        let squares = grids.map(|g| g.samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>());
        (squares[0] + squares[1]) / grids[0].samples.len().max(1) as f64
    };
    let (whole, noise) = (power(whole), power(noise));
    if whole > 0.0 { (noise / whole).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_bounded_and_sums_are_as_long_as_the_longer_sound() {
        assert_eq!(
            [factor(1.0, 1e-7), factor(0.0, 0.0), factor(0.0, 2.0), factor(3.0, 2.0)],
            [0.0, 0.0, 0.0, 1.5]
        );
        assert_eq!(sum([&[1.0, 2.0], &[3.0]], [2.0, 1.0]), [5.0, 4.0]);
    }

    #[test]
    fn the_share_of_noise_is_that_of_its_slopes() {
        let whole = Grid::from_fn(8, 8, |x, _| if x % 2 == 0 { 2.0 } else { -2.0 });
        let part = Grid::from_fn(8, 8, |x, _| if x % 2 == 0 { 1.0 } else { -1.0 });
        let none = Grid::from_fn(8, 8, |_, _| 0.0);
        assert_eq!(share([&whole, &none], [&part, &none]), 0.25);
        assert_eq!([share([&none; 2], [&part; 2]), share([&part; 2], [&whole; 2])], [0.0, 1.0]);
    }
}
