//! Bands of noise for what the modes leave of a recording.

use super::exponentials::energy;
use super::noise_floor::NoiseFloor;
use crate::modal::residual::noise_band::NoiseBand;
use realfft::RealFftPlanner;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::{LN_10, PI};

/// Centre of band 0, Hz, and the first and last band: thirds of an octave from 25 Hz to 20 kHz.
const CENTRE: f64 = 1000.0;
const BANDS: std::ops::RangeInclusive<i32> = -16..=13;
/// Energy of a band relative to the recording below which it is left out.
const SMALLEST: f64 = 1e-7;
/// Range of the decay rates of bands, 1/s.
const DECAYS: [f64; 2] = [0.5, 5000.0];
/// Levels of the energy decay curve between which the decay is measured, dB.
const RANGES: [[f64; 2]; 3] = [[-5.0, -25.0], [-5.0, -15.0], [-1.0, -8.0]];
/// Width of the filter for decays, relative to its centre: the integral of its squared weights.
const WIDTH: f64 = 0.715;
/// Points of a decay curve that are compared, and decay rates that are tried.
const POINTS: usize = 60;
const STEPS: i32 = 100;
/// Points on each side of the mean of energies.
const SMOOTH: usize = 4;
/// Zeros after the sound, s, so that filters that look back do not wrap around.
const PADDING: f64 = 0.5;

/// A spectrum with the energies of bands.
struct Spectrum {
    bins: Vec<Complex<f64>>,
    /// Length of the transform.
    length: usize,
    rate: f64,
}

impl Spectrum {
    fn new(x: &[f64], rate: f64) -> Self {
        let length = (x.len() + (PADDING * rate) as usize).next_multiple_of(1 << 10);
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let (mut time, mut bins) = (plan.make_input_vec(), plan.make_output_vec());
        time[..x.len()].copy_from_slice(x);
        if plan.process(&mut time, &mut bins).is_err() {
            bins.fill(Complex::default());
        }
        Self { bins, length, rate }
    }

    fn bin(&self, frequency: f64) -> usize {
        ((frequency * self.length as f64 / self.rate).round() as usize).min(self.bins.len() - 1)
    }

    /// Energy of the signal between two frequencies.
    fn energy(&self, low: f64, high: f64) -> f64 {
        let sum: f64 = self.bins[self.bin(low)..self.bin(high)].iter().map(|z| z.norm_sqr()).sum();
        2.0 * sum / self.length as f64
    }

    /// Energies of an octave around a frequency over time, and the time between two of them, s.
    fn envelope(&self, centre: f64, planner: &mut FftPlanner<f64>) -> (Vec<f64>, f64) {
        let (low, high) = (self.bin(centre / 2.0), self.bin(centre * 2.0).max(self.bin(centre / 2.0) + 1));
        let count = (high - low).next_power_of_two().max(64);
        let mut band = vec![Complex::default(); count];
        for (k, z) in self.bins[low..high].iter().enumerate() {
            // Half a cosine over an octave on each side of the centre, by log frequency.
            let octaves = (((low + k) as f64 * self.rate / self.length as f64) / centre).max(1e-9).log2();
            let weight = if octaves.abs() < 1.0 { libm::cos(0.5 * PI * octaves) } else { 0.0 };
            band[k] = z * weight;
        }
        planner.plan_fft_inverse(count).process(&mut band);
        let scale = 2.0 / (self.length as f64).powi(2);
        let step = self.length as f64 / count as f64 / self.rate;
        (band.iter().map(|z| scale * z.norm_sqr()).collect(), step)
    }
}

/// Bands of noise that complete the modes: at each third of an octave the energy by which the recording exceeds its modes, with the decay
/// of the residual there. `gain` is full scale.
///
/// The energy of the noise before the impact or at the end of the recording is not part of it.
///
/// # Complexity
/// O(samples log samples).
pub(super) fn noise_bands(sound: &[f64], residual: &[f64], rate: f64, noise: &NoiseFloor) -> Vec<NoiseBand> {
    let modes: Vec<f64> = sound.iter().zip(residual).map(|(x, r)| x - r).collect();
    let [recorded, explained, left] = [sound, &modes, residual].map(|x| Spectrum::new(x, rate));
    let total = energy(sound);
    let mut planner = FftPlanner::new();
    let seconds = sound.len() as f64 / rate;
    let band = |k: i32| {
        let centre = CENTRE * 2.0_f64.powf(f64::from(k) / 3.0);
        let edge = 2.0_f64.powf(1.0 / 6.0);
        let (low, high) = (centre / edge, centre * edge);
        if high > 0.5 * rate {
            return None;
        }
        let floor = noise.variance(centre) * sound.len() as f64 * (high - low) / (0.5 * rate);
        let energy = recorded.energy(low, high) - floor - explained.energy(low, high);
        if energy <= SMALLEST * total {
            return None;
        }
        let [(recorded, step), (explained, _), (left, _)] =
            [&recorded, &explained, &left].map(|x| x.envelope(centre, &mut planner));
        let samples = ((seconds / step) as usize).clamp(1, left.len());
        let power = noise.variance(centre) * WIDTH * centre / (0.5 * rate);
        let first = decay(&left[..samples], step, power).clamp(DECAYS[0], DECAYS[1]);
        let damping =
            completing_decay(&recorded[..samples], &explained[..samples], step, power).unwrap_or(first);
        // The energy of `gain exp(-d t) cos` is `gain^2 rate / (4 d)`.
        let gain = (4.0 * damping * energy / rate).sqrt() as f32;
        Some(NoiseBand { low, high, damping, gain })
    };
    BANDS.filter_map(band).collect()
}

/// Decay rate of noise with which the energy decay curve of modes and noise is nearest to that of the recording, from 0 to -30 dB; `None`
/// where the modes have all of the energy.
fn completing_decay(recorded: &[f64], explained: &[f64], step: f64, noise: f64) -> Option<f64> {
    let end = sound_end(recorded, noise);
    let curve = |x: &[f64], noise: f64| {
        let mut curve = vec![0.0; end + 1];
        for k in (0..end).rev() {
            curve[k] = curve[k + 1] + (x[k] - noise).max(0.0);
        }
        curve
    };
    let (recorded, explained) = (curve(recorded, noise), curve(explained, 0.0));
    let missing = recorded[0] - explained[0];
    if missing <= 1e-3 * recorded[0] {
        return None;
    }
    let last = recorded.iter().position(|e| *e < 1e-3 * recorded[0]).unwrap_or(end).max(1);
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
    rates.map(|d| (distance(d), d)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
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

/// Decay rate of the amplitude, 1/s, of energies over time above a power of noise.
///
/// The slope of the energy decay curve from -5 to -25 dB, or from -5 to -15 dB where the noise hides the rest.
///
/// # Source
/// Schroeder, "New method of measuring reverberation time" (JASA 37, 1965).
fn decay(energies: &[f64], step: f64, noise: f64) -> f64 {
    let end = sound_end(energies, noise);
    let mut curve = vec![0.0; end];
    let mut sum = 0.0;
    for k in (0..end).rev() {
        sum += (energies[k] - noise).max(0.0);
        curve[k] = sum;
    }
    if sum <= 0.0 {
        return DECAYS[1];
    }
    let level = |k: usize| 10.0 * (curve[k] / sum).max(1e-30).log10();
    let first = |db: f64| (0..end).find(|k| level(*k) <= db);
    let slope = RANGES.iter().find_map(|[from, to]| {
        let (a, b) = (first(*from)?, first(*to)?);
        (b >= a + 2).then(|| (level(b) - level(a)) / ((b - a) as f64 * step))
    });
    match slope {
        Some(slope) => -slope * LN_10 / 20.0,
        // The centroid of `exp(-2 d t)` is `1 / (2 d)`.
        None => {
            let centroid: f64 = energies[..end]
                .iter()
                .enumerate()
                .map(|(k, e)| (k as f64 + 0.5) * step * (e - noise).max(0.0))
                .sum();
            0.5 * sum / centroid.max(1e-12 * sum)
        }
    }
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
        let floor = NoiseFloor::new(&residual[..10], 0, rate);
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
        let floor = NoiseFloor::new(&recording, 22_050, rate);
        let sound = &recording[22_050..];
        let bands = noise_bands(sound, sound, rate, &floor);
        for b in bands.iter().filter(|b| b.low > 500.0) {
            assert!((b.damping / 60.0 - 1.0).abs() < 0.3, "{b:?}");
        }
    }
}
