//! Distances between a recording and its resynthesis.

use super::onset::onset;
use realfft::RealFftPlanner;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::PI;

/// Level below that of the loudest third of an octave from which on bands do not count, dB.
const RANGE: f64 = 40.0;
/// Levels of the energy decay curve between which a decay is measured, dB: T20.
const DECAY: [f64; 2] = [-5.0, -25.0];
/// Time over which the spectral distance is measured, s.
const FIRST: f64 = 0.3;

/// One band of a comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandLevel {
    /// Centre, Hz.
    pub centre: f64,
    /// Energy of the reference, dB, full scale per sample.
    pub reference_db: f64,
    /// Energy of the other sound.
    pub audio_db: f64,
}

/// The decay of an octave in both sounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandDecay {
    /// Centre, Hz.
    pub centre: f64,
    /// Three times T20 of the reference, s.
    pub reference_s: f64,
    /// Three times T20 of the other sound, s.
    pub audio_s: f64,
}

/// Distances between a reference and another sound that begin together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Index of the onset in the reference.
    pub onset: usize,
    /// Energy of the difference relative to the reference from the onset to the end, dB.
    pub difference_db: f64,
    /// The same from 5 ms after the onset on.
    pub late_difference_db: f64,
    /// Thirds of an octave within 40 dB of the loudest, from the onset to the end.
    pub levels: Vec<BandLevel>,
    /// Octaves whose decay by 25 dB stands above the noise of the reference.
    pub decays: Vec<BandDecay>,
    /// Root mean square difference of the levels of thirds of an octave in the first 300 ms, dB.
    pub spectral_distance_db: f64,
}

fn median(mut x: Vec<f64>) -> Option<f64> {
    x.sort_by(f64::total_cmp);
    (!x.is_empty()).then(|| 0.5 * (x[(x.len() - 1) / 2] + x[x.len() / 2]))
}

impl Comparison {
    /// Median and largest difference of the levels of thirds of an octave, dB.
    #[must_use]
    pub fn level_differences(&self) -> Option<[f64; 2]> {
        let all: Vec<f64> = self.levels.iter().map(|b| (b.audio_db - b.reference_db).abs()).collect();
        let max = all.iter().copied().fold(0.0, f64::max);
        median(all).map(|median| [median, max])
    }

    /// Median relative difference of the decay times.
    #[must_use]
    pub fn decay_difference(&self) -> Option<f64> {
        median(self.decays.iter().map(|b| (b.audio_s / b.reference_s - 1.0).abs()).collect())
    }
}

/// Compares a sound with a reference; both have the sample rate `rate` and begin at the same time.
///
/// # Complexity
/// O(samples log samples).
///
/// # Source
/// Schroeder, "New method of measuring reverberation time" (JASA 37, 1965), for decay times.
#[must_use]
pub fn compare(reference: &[f32], audio: &[f32], rate: f64) -> Comparison {
    if reference.is_empty() {
        return Comparison::default();
    }
    let onset = onset(reference, rate);
    let length = reference.len() - onset;
    let from = |x: &[f32]| -> Vec<f64> {
        (0..length).map(|n| x.get(onset + n).copied().map_or(0.0, f64::from)).collect()
    };
    let [a, b] = [reference, audio].map(from);
    let difference_db = |from: usize| {
        let difference: f64 = a[from..].iter().zip(&b[from..]).map(|(a, b)| (a - b).powi(2)).sum();
        let energy: f64 = a[from..].iter().map(|a| a * a).sum();
        10.0 * (difference.max(1e-30) / energy.max(1e-30)).log10()
    };
    let late = ((0.005 * rate) as usize).min(length / 2);
    let first = ((FIRST * rate) as usize).min(length);
    let [all, start] = [length, first].map(|n| {
        let [a, b] = [&a[..n], &b[..n]].map(|x| third_octaves(x, rate));
        let loudest = a.iter().map(|b| b.1).fold(f64::NEG_INFINITY, f64::max);
        let near = |((centre, x), (_, y)): (&(f64, f64), &(f64, f64))| {
            (*x > loudest - RANGE).then_some(BandLevel { centre: *centre, reference_db: *x, audio_db: *y })
        };
        a.iter().zip(&b).filter_map(near).collect::<Vec<_>>()
    });
    let square = |b: &BandLevel| (b.audio_db - b.reference_db).clamp(-RANGE, RANGE).powi(2);
    let spectral_distance_db = (start.iter().map(square).sum::<f64>() / start.len().max(1) as f64).sqrt();
    let [x, y] = [&a, &b].map(|x| decay_times(x, rate));
    let decays = x
        .into_iter()
        .zip(y)
        .filter_map(|((centre, x), (_, y))| Some(BandDecay { centre, reference_s: x?, audio_s: y? }));
    Comparison {
        onset,
        difference_db: difference_db(0),
        late_difference_db: difference_db(late),
        levels: all,
        decays: decays.collect(),
        spectral_distance_db,
    }
}

fn spectrum(x: &[f64], length: usize) -> Vec<Complex<f64>> {
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let (mut time, mut bins) = (plan.make_input_vec(), plan.make_output_vec());
    time[..x.len()].copy_from_slice(x);
    if plan.process(&mut time, &mut bins).is_err() {
        bins.fill(Complex::default());
    }
    bins
}

/// Centres and energies in dB of thirds of an octave from 25 Hz to 20 kHz.
fn third_octaves(x: &[f64], rate: f64) -> Vec<(f64, f64)> {
    let length = x.len().next_multiple_of(1 << 10).max(1 << 13);
    let bins = spectrum(x, length);
    let edge = 2.0_f64.powf(1.0 / 6.0);
    let band = |k: i32| {
        let centre = 1000.0 * 2.0_f64.powf(f64::from(k) / 3.0);
        let bin = |f: f64| ((f * length as f64 / rate).round() as usize).min(bins.len());
        let (low, high) = (bin(centre / edge), bin(centre * edge));
        let energy: f64 = bins[low..high.max(low)].iter().map(|z| z.norm_sqr()).sum();
        (high > low && centre * edge < 0.5 * rate)
            .then(|| (centre, 10.0 * (2.0 * energy / length as f64).max(1e-30).log10()))
    };
    (-16..=13).filter_map(band).collect()
}

/// Three times T20 of the octaves from 125 Hz to 16 kHz, s; `None` where a decay by 25 dB does not stand above the noise.
fn decay_times(x: &[f64], rate: f64) -> Vec<(f64, Option<f64>)> {
    let length = (x.len() + rate as usize / 2).next_multiple_of(1 << 10);
    let bins = spectrum(x, length);
    let mut planner = FftPlanner::new();
    (-3..=4)
        .map(|k| 1000.0 * 2.0_f64.powi(k))
        .filter(|centre| centre * 2.0_f64.sqrt() < 0.5 * rate)
        .map(|centre| (centre, decay_time(&bins, length, centre, x.len(), rate, &mut planner)))
        .collect()
}

fn decay_time(
    bins: &[Complex<f64>],
    length: usize,
    centre: f64,
    samples: usize,
    rate: f64,
    planner: &mut FftPlanner<f64>,
) -> Option<f64> {
    let bin = |f: f64| ((f * length as f64 / rate).round() as usize).min(bins.len());
    let (low, high) = (bin(centre / 2.0), bin(centre * 2.0));
    let count = (high - low).next_power_of_two().max(64);
    let mut band = vec![Complex::default(); count];
    for (k, z) in bins[low..high].iter().enumerate() {
        let octaves = (((low + k) as f64 * rate / length as f64) / centre).max(1e-9).log2();
        // Flat within half of the octave, with slopes of half a cosine.
        let weight = (1.0 - (octaves.abs() - 0.5).max(0.0) / 0.5).clamp(0.0, 1.0);
        band[k] = z * libm::sin(0.5 * PI * weight);
    }
    planner.plan_fft_inverse(count).process(&mut band);
    let step = length as f64 / count as f64 / rate;
    let points = ((samples as f64 / rate / step) as usize).clamp(1, count);
    let energies: Vec<f64> = band[..points].iter().map(|z| z.norm_sqr()).collect();
    // The noise is that of the last tenth: it must lie 35 dB below the maximum of a smoothed envelope.
    let width = (0.01 / step).ceil() as usize;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len().max(1) as f64;
    let max = energies.chunks(width.max(1)).map(mean).fold(0.0, f64::max);
    let noise = mean(&energies[points - (points / 10).max(1).min(points)..]);
    if max <= 0.0 || noise > 10f64.powf(-3.5) * max {
        return None;
    }
    let mut curve = energies;
    for k in (0..curve.len().saturating_sub(1)).rev() {
        curve[k] += curve[k + 1];
    }
    let total = curve[0];
    let below = |db: f64| curve.iter().position(|e| *e <= total * 10f64.powf(0.1 * db));
    let (from, to) = (below(DECAY[0])?, below(DECAY[1])?);
    (to > from).then(|| 3.0 * (to - from) as f64 * step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    fn burst(d: f64, gain: f64, seed: u64) -> Vec<f32> {
        let mut rng = Rng::new(seed);
        (0..88_200)
            .map(|n| {
                if n < 1000 {
                    0.0
                } else {
                    (gain * libm::exp(-d * f64::from(n - 1000) / 44_100.0) * rng.between(-1.0, 1.0)) as f32
                }
            })
            .collect()
    }

    #[test]
    fn a_sound_equals_itself() {
        let x = burst(20.0, 0.5, 1);
        let found = compare(&x, &x, 44_100.0);
        assert!(found.difference_db < -200.0 && found.spectral_distance_db == 0.0);
        assert_eq!(
            (found.level_differences().unwrap(), found.decay_difference().unwrap()),
            ([0.0, 0.0], 0.0)
        );
        // T60 is 6.908 / d.
        let decay = found.decays.iter().find(|b| b.centre == 4000.0).unwrap().reference_s;
        assert!((decay / (6.908 / 20.0) - 1.0).abs() < 0.1, "{decay}");
    }

    #[test]
    fn levels_and_decays_differ_by_what_was_changed() {
        let (a, b) = (burst(20.0, 0.5, 1), burst(40.0, 1.0, 2));
        let found = compare(&a, &b, 44_100.0);
        let [median, _] = found.level_differences().unwrap();
        // Twice the amplitude, half of the time: 3 dB.
        assert!((median - 3.0).abs() < 0.5, "{median}");
        assert!((found.decay_difference().unwrap() - 0.5).abs() < 0.05, "{found:?}");
        assert!((found.difference_db - 4.8).abs() < 0.3, "{}", found.difference_db);
    }

    #[test]
    fn silence_and_short_sounds_have_distances_too() {
        assert_eq!(compare(&[], &[], 44_100.0), Comparison::default());
        let found = compare(&[0.0; 100], &[0.5], 44_100.0);
        assert!(found.difference_db.is_finite() && found.decays.is_empty());
        assert!(compare(&burst(20.0, 0.5, 1), &[], 44_100.0).difference_db.abs() < 1e-6);
    }
}
