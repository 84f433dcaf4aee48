//! Bands of noise for the residual of a recording without its modes.

use super::bands::{Spectrum, decay_curve, third_octaves};
use super::exponentials::energy;
use super::noise_floor::NoiseFloor;
use crate::modal::residual::noise_band::NoiseBand;
use foley_fft::FftPlanner;

/// Energy of a band relative to the recording below which it is left out.
const SMALLEST: f64 = 1e-7;
/// Range of the decay rates of bands, 1/s.
const DECAYS: [f64; 2] = [0.5, 5000.0];
/// Points of a decay curve that are compared, and decay rates that are tried.
const POINTS: usize = 60;
const STEPS: i32 = 100;
/// Energy relative to the whole down to which curves are compared, and the least that noise adds to them: -30 dB.
const RANGE: f64 = 1e-3;
/// Points on each side of the mean of energies.
const SMOOTH: usize = 4;

/// Bands of noise that complete the modes: at each third of an octave the energy by which the recording exceeds its modes. `gain` is full
/// scale.
///
/// A band decays such that the octaves around it decay as in the recording. The energy of the noise before the impact or at the end of the recording is not part of it.
///
/// # Complexity
/// O(samples log samples).
pub(super) fn noise_bands(sound: &[f64], residual: &[f64], rate: f64, noise: &NoiseFloor) -> Vec<NoiseBand> {
    let modes: Vec<f64> = sound.iter().zip(residual).map(|(x, r)| x - r).collect();
    let [recorded, explained] = [sound, &modes].map(|x| Spectrum::new(x, rate));
    let total = energy(sound);
    let mut planner = FftPlanner::new();
    let band = |[low, centre, high]: [f64; 3]| {
        // Power of the noise per Hz.
        let density = noise.variance(centre) / (0.5 * rate);
        let floor = density * (high - low) * sound.len() as f64;
        let energy = recorded.energy(low, high) - floor - explained.energy(low, high);
        if energy <= SMALLEST * total {
            return None;
        }
        let [recorded, explained] = [&recorded, &explained].map(|x| x.octave(centre, 0.0, &mut planner));
        let power = density * recorded.width;
        let damping = completing_decay(&recorded.energies, &explained.energies, recorded.step, power);
        // The energy of `gain exp(-d t) cos` is `gain^2 rate / (4 d)`.
        let gain = (4.0 * damping * energy / rate).sqrt() as f32;
        Some(NoiseBand { low, high, damping, gain })
    };
    third_octaves(rate).filter_map(band).collect()
}

/// Decay rate of noise with which the energy decay curve of modes and noise is nearest to that of the recording, from 0 to -30 dB.
fn completing_decay(recorded: &[f64], explained: &[f64], step: f64, noise: f64) -> f64 {
    let end = sound_end(recorded, noise);
    let (recorded, explained) = (decay_curve(&recorded[..end], noise), decay_curve(&explained[..end], 0.0));
    // Where the modes have all of the energy, the little that is added must not outlast them.
    let missing = (recorded[0] - explained[0]).max(RANGE * recorded[0]);
    let last = recorded.iter().position(|e| *e < RANGE * recorded[0]).unwrap_or(end).max(1);
    let stride = (last / POINTS).max(1);
    let distance = |d: f64| -> f64 {
        let at = |k: usize| {
            let left = explained[k] + missing * libm::exp(-2.0 * d * k as f64 * step);
            (left.max(1e-30) / recorded[k].max(1e-30)).ln().powi(2)
        };
        (0..last).step_by(stride).map(at).sum()
    };
    let ratio = (DECAYS[1] / DECAYS[0]).powf(1.0 / STEPS as f64);
    let rates = (0..=STEPS).map(|k| DECAYS[0] * ratio.powi(k));
    rates.map(|d| (distance(d), d)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(DECAYS[1], |best| best.1)
}

/// Index after the energies that stand above a power of noise.
fn sound_end(energies: &[f64], noise: f64) -> usize {
    // The sound ends where its energy first falls to that of the noise.
    let smooth: Vec<f64> = (0..energies.len())
        .map(|k| {
            let part = &energies[k.saturating_sub(SMOOTH)..(k + SMOOTH + 1).min(energies.len())];
            part.iter().sum::<f64>() / part.len() as f64
        })
        .collect();
    let loudest = (0..smooth.len()).max_by(|a, b| smooth[*a].total_cmp(&smooth[*b])).unwrap_or(0);
    (loudest..smooth.len()).find(|k| smooth[*k] < 2.0 * noise).unwrap_or(energies.len()).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn noise_has_the_level_and_decay_of_its_bands() {
        let rate = 44_100.0;
        let mut rng = Rng::new(2);
        let residual: Vec<f64> = (0..66_150)
            .map(|n| libm::exp(-25.0 * f64::from(n) / rate) * 3.0_f64.sqrt() * rng.between(-1.0, 1.0))
            .collect();
        let floor = NoiseFloor::new(&[0.0; 10], 0, rate);
        let bands = noise_bands(&residual, &residual, rate, &floor);
        assert!(bands.len() >= 28, "{}", bands.len());
        let mut energies = 0.0;
        for b in &bands {
            energies += f64::from(b.gain).powi(2) * rate / (4.0 * b.damping);
            if b.low > 300.0 {
                assert!((b.damping / 25.0 - 1.0).abs() < 0.25, "{b:?}");
            }
        }
        let share = (bands.last().unwrap().high - bands[0].low) / 22_050.0;
        assert!((energies / (share * energy(&residual)) - 1.0).abs() < 0.05);
    }

    #[test]
    fn steady_noise_is_no_part_of_an_impact() {
        let rate = 44_100.0;
        let mut rng = Rng::new(2);
        let recording: Vec<f64> = (0..88_200)
            .map(|n| {
                let impact = if n < 22_050 { 0.0 } else { libm::exp(-60.0 * f64::from(n - 22_050) / rate) };
                (impact + 0.01) * rng.between(-1.0, 1.0)
            })
            .collect();
        let single: Vec<f32> = recording.iter().map(|x| *x as f32).collect();
        let floor = NoiseFloor::new(&single, 22_050, rate);
        let sound = &recording[22_050..];
        let bands = noise_bands(sound, sound, rate, &floor);
        for b in bands.iter().filter(|b| b.low > 500.0) {
            assert!((b.damping / 60.0 - 1.0).abs() < 0.3, "{b:?}");
        }
    }
}
