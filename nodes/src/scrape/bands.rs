//! A loop of noise that can be read at any speed, forwards and backwards, without images and without anything folding down.

use super::law::log2;
use super::voices::{CELL, Cell};
use crate::texture::NoiseProfile;
use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner};
use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::Range;
use std::sync::Arc;

/// Samples that one reading weighs.
pub const TAPS: usize = 32;
/// Places between two samples for which weights are stored.
const PHASES: usize = 1024;
/// Bands to the octave.
const OCTAVE: f64 = 8.0;
/// Step in samples up to which the loop is read as it is.
const WHOLE: f64 = 0.9;
/// What of the rate of the sound is kept whole, and what is kept out.
const KEPT: [f64; 2] = [0.4, 0.5];
/// Most bands: steps of 2^12 samples.
const MOST: usize = 96;
/// Samples of the shortest band.
const SHORTEST: usize = 64;
/// Where the content of a stored band may end, in parts of its density.
const CONTENT: f64 = 0.3;

/// One band-limited form of a loop: its samples with those around the seam, and samples of it per sample of the whole.
#[derive(Clone, Debug, PartialEq)]
struct Band {
    samples: Vec<f32>,
    density: f64,
}

/// Weights of the samples at one stored place, and what they change by up to the next one.
type Row = [[f32; TAPS]; 2];

/// A loop of noise with what is left of it below each eighth of an octave.
///
/// Between two samples a sinc of 32 taps under a squared cosine is read, of which 1024 places are stored and what is between
/// them is interpolated. Steps of more than a sample read a form of the loop that holds nothing above half of the rate of the sound: for
/// steps between two forms, a mixture of both. All of it up to 0.4 of the rate stays.
///
/// # Complexity
/// `O(n log n)` and 17 times the memory of the loop to make; 32 products a reading. For steps of more than a sample 32 more to mix
/// two forms, and once an octave, where these are of unequal density, 32 more again.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseBands {
    bands: Vec<Band>,
    weights: Vec<Row>,
    /// Samples of one round.
    len: f64,
    /// Metres from one sample to the next.
    spacing: f64,
}

/// How a line of noise is read between its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseInterp {
    /// A sinc of 32 taps under a squared cosine.
    Sinc32,
    /// Straight lines.
    Linear,
    /// Cubic through the samples.
    Catmull,
    /// Cubic B-spline.
    Bspline3,
}

impl NoiseInterp {
    /// Weight of a sample at a distance.
    fn weight(self, x: f64) -> f64 {
        let d = x.abs();
        match self {
            Self::Sinc32 => {
                let sinc = if x == 0.0 { 1.0 } else { libm::sin(PI * x) / (PI * x) };
                let reach = TAPS as f64 / 2.0;
                if d >= reach { 0.0 } else { sinc * libm::cos(FRAC_PI_2 * x / reach).powi(2) }
            }
            Self::Linear => (1.0 - d).max(0.0),
            Self::Catmull if d < 1.0 => 1.0 + d * d * (1.5 * d - 2.5),
            Self::Catmull if d < 2.0 => 2.0 + d * (-4.0 + d * (2.5 - 0.5 * d)),
            Self::Bspline3 if d < 1.0 => 2.0 / 3.0 + d * d * (0.5 * d - 1.0),
            Self::Bspline3 if d < 2.0 => (2.0 - d).powi(3) / 6.0,
            Self::Catmull | Self::Bspline3 => 0.0,
        }
    }
}

fn weights(interp: NoiseInterp) -> Vec<Row> {
    let taps = |phase: usize| -> [f32; TAPS] {
        let place = phase as f64 / PHASES as f64;
        std::array::from_fn(|t| interp.weight(t as f64 - (TAPS / 2 - 1) as f64 - place) as f32)
    };
    let row = |phase: usize| {
        let (here, next) = (taps(phase), taps(phase + 1));
        [here, std::array::from_fn(|t| next[t] - here[t])]
    };
    // A place just below a sample may round up to it.
    (0..=PHASES).map(row).collect()
}

/// A band with the samples that a reading needs beyond its seam.
fn closed(samples: &[f32], density: f64) -> Band {
    let n = samples.len() as i64;
    let around = -(TAPS as i64 / 2)..n + TAPS as i64 / 2 + 2;
    let sample = |k: i64| samples.get(k.rem_euclid(n) as usize).copied().unwrap_or_default();
    Band { samples: around.map(sample).collect(), density }
}

impl NoiseBands {
    /// All bands of a loop of at least one sample.
    #[must_use]
    pub fn new(profile: &NoiseProfile) -> Self {
        Self::made(profile, NoiseInterp::Sinc32, f64::INFINITY)
    }

    /// The same, read in another way.
    #[must_use]
    pub fn read_by(profile: &NoiseProfile, interp: NoiseInterp) -> Self {
        Self::made(profile, interp, f64::INFINITY)
    }

    /// Those of the bands that steps of up to `fastest` samples read: they give the same, and slow ones need only the loop itself.
    #[must_use]
    pub fn up_to(profile: &NoiseProfile, fastest: f64) -> Self {
        Self::made(profile, NoiseInterp::Sinc32, fastest)
    }

    fn made(profile: &NoiseProfile, interp: NoiseInterp, fastest: f64) -> Self {
        let n = profile.samples.len().max(1);
        let mut bands = vec![closed(profile.samples.get(..n).unwrap_or(&[0.0]), 1.0)];
        let mut planner = RealFftPlanner::<f64>::new();
        let ratio = 2_f64.powf(1.0 / OCTAVE);
        let parts = (1..MOST).map_while(|k| {
            let step = WHOLE * ratio.powi(k as i32);
            // It is mixed in from the step before it, and is still read at the next.
            let [pass, stop] = [KEPT[0] * ratio / step, KEPT[1] / (ratio * step)];
            let halvings = (CONTENT / stop).log2().floor().max(0.0);
            let len = (n as f64 / halvings.exp2()).ceil() as usize;
            let read = step <= fastest * ratio && len >= SHORTEST.min(n);
            read.then(|| ([pass, stop], planner.plan_fft_inverse(len)))
        });
        let parts: Vec<_> = parts.collect();
        if !parts.is_empty() {
            let spectrum = spectrum(&profile.samples, n, &mut planner);
            let band = |([pass, stop], inverse): ([f64; 2], Arc<dyn ComplexToReal<f64>>)| {
                band(&spectrum, n, [pass, stop], &*inverse)
            };
            bands.par_extend(parts.into_par_iter().map(band));
        }
        Self { bands, weights: weights(interp), len: n as f64, spacing: profile.spacing }
    }

    /// Samples of one round.
    #[must_use]
    pub fn round(&self) -> f64 {
        self.len
    }

    /// Metres from one sample to the next.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// What stands at `place` (0 to [`round`](Self::round)) for steps of `step` samples.
    #[inline(always)]
    #[must_use]
    pub(super) fn read(&self, simd: impl Simd, place: f64, step: f32) -> f32 {
        if step <= WHOLE as f32 {
            return self.band(simd, 0, place);
        }
        let last = self.bands.len() - 1;
        let depth = (log2(step * (1.0 / WHOLE as f32)) * OCTAVE as f32).clamp(0.0, last as f32);
        let below = depth as usize;
        let (part, above) = (depth - below as f32, (below + 1).min(last));
        let (Some(a), Some(b)) = (self.bands.get(below), self.bands.get(above)) else { return 0.0 };
        if a.density != b.density {
            let near = self.band(simd, below, place);
            return near + part * (self.band(simd, above, place) - near);
        }
        // Mixed before they are weighed.
        let spot = Spot::new(place * a.density);
        let (Some(near), Some(far), Some(row)) =
            (spot.samples(a), spot.samples(b), self.weights.get(spot.row))
        else {
            return 0.0;
        };
        let part = f32x8::splat(simd, part);
        total(weigh(simd, row, spot.between, |group| {
            let (near, far) = (eight(simd, near, group), eight(simd, far, group));
            near + part * (far - near)
        }))
    }

    /// The same for each sample of `range` in a cell.
    #[inline(always)]
    #[must_use]
    pub(super) fn read_cell(
        &self,
        simd: impl Simd,
        places: &[f64; CELL],
        steps: &Cell,
        range: Range<usize>,
    ) -> Cell {
        let mut made = [0.0; CELL];
        let slow = range.clone().all(|n| steps[n] <= WHOLE as f32);
        let Some(band) = self.bands.first().filter(|_| slow) else {
            for n in range {
                made[n] = self.read(simd, places[n], steps[n]);
            }
            return made;
        };
        // In three loops, in the first and the last of which several samples are treated at once.
        let (mut wholes, mut rows, mut betweens) = ([0; CELL], [0; CELL], [0.0; CELL]);
        for n in 0..CELL {
            (wholes[n], rows[n], betweens[n]) = parts(places[n]);
        }
        let mut sums = [[0.0; 4]; CELL];
        for n in range {
            let spot = Spot { whole: wholes[n] as usize, row: rows[n] as usize, between: betweens[n] };
            if let (Some(samples), Some(row)) = (spot.samples(band), self.weights.get(spot.row)) {
                sums[n] = weigh(simd, row, spot.between, |group| eight(simd, samples, group));
            }
        }
        for n in 0..CELL {
            made[n] = total(sums[n]);
        }
        made
    }

    #[inline(always)]
    fn band(&self, simd: impl Simd, k: usize, place: f64) -> f32 {
        let Some(band) = self.bands.get(k) else { return 0.0 };
        let spot = Spot::new(place * band.density);
        let (Some(samples), Some(row)) = (spot.samples(band), self.weights.get(spot.row)) else { return 0.0 };
        total(weigh(simd, row, spot.between, |group| eight(simd, samples, group)))
    }
}

/// A place between samples.
#[derive(Clone, Copy)]
struct Spot {
    /// The sample before it.
    whole: usize,
    /// The stored place before it, and the way from there to the next, 0 to 1.
    row: usize,
    between: f32,
}

impl Spot {
    #[inline(always)]
    fn new(place: f64) -> Self {
        let (whole, row, between) = parts(place);
        Self { whole: whole as usize, row: row as usize, between }
    }

    /// The samples around it: the first stands 15 before the place, and the seam is padded by 16.
    #[inline(always)]
    fn samples(self, band: &Band) -> Option<&[f32; TAPS]> {
        let at = self.whole + 1;
        band.samples.get(at..at + TAPS).and_then(|samples| samples.try_into().ok())
    }
}

/// The sample before a place, the stored place before it, and the way from there to the next, 0 to 1.
///
/// Places are never negative, and loops so short that a cast to 32 bits, which is quick, is their floor.
#[inline(always)]
fn parts(place: f64) -> (i32, i32, f32) {
    let whole = place as i32;
    let phase = (place - f64::from(whole)) * PHASES as f64;
    let row = phase as i32;
    (whole, row, (phase - f64::from(row)) as f32)
}

/// Eight of the numbers for all taps.
#[inline(always)]
fn eight<S: Simd>(simd: S, all: &[f32; TAPS], group: usize) -> f32x8<S> {
    f32x8::from_slice(simd, &all[8 * group..8 * group + 8])
}

/// Samples times weights between two rows, in four sums side by side.
#[inline(always)]
fn weigh<S: Simd>(
    simd: S,
    [here, change]: &Row,
    between: f32,
    samples: impl Fn(usize) -> f32x8<S>,
) -> [f32; 4] {
    let between = f32x8::splat(simd, between);
    let part =
        |group: usize| samples(group) * (eight(simd, here, group) + between * eight(simd, change, group));
    let sum = (part(0) + part(1)) + (part(2) + part(3));
    let (low, high) = simd.split_f32x8(sum);
    (low + high).into()
}

/// The sum of four.
#[inline(always)]
fn total([a, b, c, d]: [f32; 4]) -> f32 {
    (a + b) + (c + d)
}

/// The half of the spectrum of a loop that says it all.
fn spectrum(samples: &[f32], n: usize, planner: &mut RealFftPlanner<f64>) -> Vec<Complex<f64>> {
    let forward = planner.plan_fft_forward(n);
    let (mut whole, mut bins) = (forward.make_input_vec(), forward.make_output_vec());
    whole.iter_mut().zip(samples).for_each(|(whole, x)| *whole = f64::from(*x));
    // The lengths are those of the plan.
    let _ = forward.process(&mut whole, &mut bins);
    bins
}

/// What a loop of `n` samples holds up to `pass`, and less and less of it up to `stop`, both in cycles per sample, in as many samples as
/// `inverse` gives.
fn band(
    spectrum: &[Complex<f64>],
    n: usize,
    [pass, stop]: [f64; 2],
    inverse: &dyn ComplexToReal<f64>,
) -> Band {
    let (mut bins, mut part) = (inverse.make_input_vec(), inverse.make_output_vec());
    for (cycles, (bin, whole)) in bins.iter_mut().zip(spectrum).enumerate() {
        let f = cycles as f64 / n as f64;
        if f >= stop {
            break;
        }
        let way = ((f - pass) / (stop - pass)).max(0.0);
        *bin = whole * (0.5 + 0.5 * libm::cos(PI * way));
    }
    // The lengths are those of the plan, and nothing stands at half of the density.
    let _ = inverse.process(&mut bins, &mut part);
    let samples: Vec<f32> = part.iter().map(|x| (x / n as f64) as f32).collect();
    closed(&samples, part.len() as f64 / n as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::scrape::testing::{amplitude, db, peak, rms};
    use fearless_simd::{Level, dispatch};
    use rustfft::FftPlanner;
    use std::f64::consts::TAU;

    fn wave(cycles: usize, n: usize) -> NoiseBands {
        let samples = (0..n).map(|k| (TAU * (cycles * k) as f64 / n as f64).sin() as f32).collect();
        NoiseBands::new(&NoiseProfile { samples, spacing: 1e-3 })
    }

    fn read(bands: &NoiseBands, place: f64, step: f32) -> f32 {
        let level = Level::new();
        dispatch!(level, simd => bands.read(simd, place, step))
    }

    /// What is heard of a loop that is passed at `step` samples a sample.
    fn heard(bands: &NoiseBands, step: f64, samples: usize) -> Vec<f32> {
        let place = |k: usize| (k as f64 * step).rem_euclid(bands.round());
        (0..samples).map(|k| read(bands, place(k), step as f32)).collect()
    }

    #[test]
    fn a_grating_keeps_frequency_and_level_up_to_four_tenths_of_the_rate_and_then_is_gone() {
        let (n, fs) = (4096, 44_100.0);
        for cycles in [40, 210, 800, 1500] {
            let bands = wave(cycles, n);
            let k = cycles as f64 / n as f64;
            for part in [0.01, 0.05, 0.12, 0.2, 0.29, 0.35, 0.399, 0.52, 0.7, 1.1, 2.3] {
                let step = part / k;
                let out = heard(&bands, step, 8820);
                let whole = rms(&out) * 2_f64.sqrt();
                if part < 0.4 {
                    assert!(db(whole).abs() < 0.5, "{cycles} at {part}: {} dB", db(whole));
                    let f = peak(&out, part * fs, fs);
                    assert!((f / (part * fs) - 1.0).abs() < 1e-3, "{cycles} at {part}: {f}");
                } else {
                    assert!(db(whole) < -60.0, "{cycles} at {part}: {} dB", db(whole));
                }
            }
        }
    }

    #[test]
    fn images_and_aliases_stay_below_60_db() {
        let (n, fs) = (4096, 44_100.0);
        // Cycles per sample and steps; the images lie around each multiple of the density.
        for (cycles, step) in [(300, 0.05), (800, 0.3), (1400, 0.21), (300, 1.7), (1200, 1.1), (100, 6.3)] {
            let bands = wave(cycles, n);
            let k = cycles as f64 / n as f64;
            let out = heard(&bands, step, 22_050);
            let line = amplitude(&out, k * step * fs, fs);
            for image in [1.0 - k, 1.0 + k, 2.0 - k, 2.0 + k, 0.5 - k, 0.5 + k] {
                let f = (image * step).rem_euclid(1.0);
                let f = if f > 0.5 { 1.0 - f } else { f };
                if (f - k * step).abs() > 0.002 {
                    let level = db(amplitude(&out, f * fs, fs) / line);
                    assert!(level < -60.0, "{cycles} at {step}: {level} dB at {f}");
                }
            }
        }
    }

    #[test]
    fn a_white_profile_keeps_97_percent_and_has_no_images() {
        // Energy above 4 kHz of a profile at 4000 samples per second, and the variance kept.
        let table = [
            (NoiseInterp::Linear, -25.0, 3.0, 0.66),
            (NoiseInterp::Catmull, -43.0, 3.0, 0.81),
            (NoiseInterp::Bspline3, -52.0, 3.0, 0.48),
            (NoiseInterp::Sinc32, -108.0, 1.0, 0.97),
        ];
        for (interp, images, slack, variance) in table {
            let (level, kept) = images_of(interp);
            println!("{interp:?}: {level:.1} dB above 4 kHz, {kept:.3} of the variance");
            assert!(
                (kept - variance).abs() < 0.04 && (level - images).abs() < slack,
                "{interp:?}: {level} {kept}"
            );
        }
    }

    /// Level in dB of what is above 4 kHz, and the share of the variance that is kept.
    fn images_of(interp: NoiseInterp) -> (f64, f64) {
        let mut state = 7_u32;
        let samples: Vec<f32> = (0..8192)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (f64::from(state >> 8) / f64::from(1 << 24) - 0.5) as f32
            })
            .collect();
        let drawn = rms(&samples);
        let bands = NoiseBands::read_by(&NoiseProfile { samples, spacing: 1e-3 }, interp);
        let step = 4000.0 / 44_100.0;
        let out = heard(&bands, step, 44_100);
        let kept = (rms(&out) / drawn).powi(2);
        let n = out.len();
        let mut buffer: Vec<_> = (0..n)
            .map(|k| Complex::new(f64::from(out[k]) * (0.5 - 0.5 * (TAU * k as f64 / n as f64).cos()), 0.0))
            .collect();
        FftPlanner::new().plan_fft_forward(n).process(&mut buffer);
        let energy = |from: usize, to: usize| buffer[from..to].iter().map(Complex::norm_sqr).sum::<f64>();
        let level = 10.0 * (energy(4000, n / 2) / energy(0, n / 2)).log10();
        (level, kept)
    }

    #[test]
    fn what_is_read_is_the_sum_of_all_samples_times_their_weights() {
        let mut rng = Rng::new(12);
        let samples: Vec<f32> = (0..1000).map(|_| rng.between(-1.0, 1.0) as f32).collect();
        let bands = NoiseBands::new(&NoiseProfile { samples, spacing: 1e-3 });
        // The definition, of one band, in double precision.
        let naive = |k: usize, place: f64| -> f64 {
            let band = &bands.bands[k];
            let place = place * band.density;
            let first = place.floor() - 15.0;
            let weight = |t: usize| NoiseInterp::Sinc32.weight(first + t as f64 - place);
            (0..TAPS).map(|t| weight(t) * f64::from(band.samples[place as usize + 1 + t])).sum()
        };
        let mut worst = 0.0_f64;
        for k in 0..4000 {
            let place = (f64::from(k) * 1.618_034) % bands.round();
            for step in [0.3_f32, 1.07, 1.3, 1.71, 1.81, 2.9, 5.0] {
                let depth = f64::from(log2(step * (1.0 / WHOLE as f32)) * OCTAVE as f32).max(0.0);
                let (below, part) = (depth as usize, depth.fract());
                let right = naive(below, place) * (1.0 - part) + part * naive(below + 1, place);
                worst = worst.max((f64::from(read(&bands, place, step)) - right).abs());
            }
        }
        assert!(worst < 2e-5, "{worst}");
    }

    #[test]
    fn what_slow_steps_need_is_the_same_of_fewer_bands() {
        let mut rng = Rng::new(4);
        let samples: Vec<f32> = (0..3000).map(|_| rng.between(-1.0, 1.0) as f32).collect();
        let profile = NoiseProfile { samples, spacing: 1e-3 };
        let all = NoiseBands::new(&profile);
        for (fastest, count) in [(0.0, 1), (0.89, 1), (1.7, 9), (4.0, 19)] {
            let few = NoiseBands::up_to(&profile, fastest);
            assert_eq!((few.bands.len(), &few.bands[..]), (count, &all.bands[..count]), "{fastest}");
            for part in [0.1, 0.5, 0.7, 0.93, 0.99, 1.0] {
                let step = (part * fastest) as f32;
                assert_eq!(read(&few, 1234.5, step), read(&all, 1234.5, step), "{step} of {fastest}");
            }
        }
    }

    #[test]
    fn a_cell_is_read_as_its_samples_are() {
        let mut rng = Rng::new(5);
        let samples: Vec<f32> = (0..500).map(|_| rng.between(-1.0, 1.0) as f32).collect();
        let bands = NoiseBands::new(&NoiseProfile { samples, spacing: 1e-3 });
        for fastest in [0.5, 0.9, 1.8] {
            let steps: Cell = std::array::from_fn(|_| rng.between(0.0, fastest) as f32);
            let places = std::array::from_fn(|_| rng.between(0.0, bands.round()));
            let level = Level::new();
            let made = dispatch!(level, simd => bands.read_cell(simd, &places, &steps, 3..CELL - 2));
            for n in 0..CELL {
                let right = if (3..CELL - 2).contains(&n) { read(&bands, places[n], steps[n]) } else { 0.0 };
                assert_eq!(made[n], right, "{n} of steps up to {fastest}");
            }
        }
    }

    #[test]
    fn any_length_closes_to_a_loop() {
        for n in [1, 2, 63, 100, 1021] {
            let bands = wave(1, n);
            for step in [0.1_f32, 1.3, 40.0] {
                let seam = read(&bands, bands.round() - 1e-7, step) - read(&bands, 0.0, step);
                assert!(seam.abs() < 1e-4, "{n} at {step}: {seam}");
            }
        }
    }
}
