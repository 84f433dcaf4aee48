//! Frames of a sound that stood in it shortly before.

use super::active::ActiveSound;
use foley_fft::RealFftPlanner;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealToComplex};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Frames that one task takes.
const TASK: usize = 256;
/// Ratio of energies up to which the past may be softer than the frame to count.
const SOFTEST: f64 = 1e-4;

/// The search for repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepeatRules {
    /// Time before a frame that is searched, s.
    pub window: f64,
    /// Normalised correlation above which a frame is repeated.
    pub threshold: f64,
}

impl Default for RepeatRules {
    fn default() -> Self {
        Self { window: 2.0, threshold: 0.9 }
    }
}

/// The most similar earlier time of one active frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRepeat {
    /// First sample of the frame.
    pub start: usize,
    /// Samples by which the most similar interval is earlier, at least a frame; 0 if there is none.
    pub lag: usize,
    /// Their normalised correlation.
    pub correlation: f64,
    /// Greatest correlation with itself, later by less than a frame, behind the first lag without correlation.
    pub periodicity: f64,
}

impl FrameRepeat {
    /// True if the frame repeats its past and is not part of a tone.
    #[must_use]
    pub fn is_repeated(&self, threshold: f64) -> bool {
        self.correlation > threshold && !self.is_periodic(threshold)
    }

    /// True if the frame is part of a tone: it repeats itself within its own length, and matches its past, copied or not.
    #[must_use]
    pub fn is_periodic(&self, threshold: f64) -> bool {
        self.periodicity > threshold
    }
}

/// An interval that stood in the sound before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RepeatStretch {
    /// Its beginning, s.
    pub from: f64,
    /// Its end, s.
    pub to: f64,
    /// Time by which it stood earlier, s.
    pub lag: f64,
    /// Greatest correlation of its frames.
    pub correlation: f64,
}

/// Transforms for frames of a length and blocks of the past.
struct Plans {
    frame: usize,
    size: usize,
    forward: Arc<dyn RealToComplex<f32>>,
    inverse: Arc<dyn ComplexToReal<f32>>,
}

impl Plans {
    fn new(frame: usize) -> Self {
        let size = (4 * frame).next_power_of_two();
        let mut planner = RealFftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
        Self { frame, size, forward, inverse }
    }

    /// Positions that the correlation with one block covers.
    fn step(&self) -> usize {
        self.size - self.frame + 1
    }

    fn spectrum(&self, x: &[f32]) -> Vec<Complex<f32>> {
        let (mut time, mut bins) = (self.forward.make_input_vec(), self.forward.make_output_vec());
        time[..x.len()].copy_from_slice(x);
        // The lengths are those of the plan.
        let _ = self.forward.process(&mut time, &mut bins);
        bins
    }
}

/// Correlates a frame with all intervals that begin in a range before it: `out[k]` is of the one that begins at `from + k`.
struct Correlator<'a> {
    plans: &'a Plans,
    /// First sample of the first block.
    origin: usize,
    blocks: Vec<Vec<Complex<f32>>>,
    product: Vec<Complex<f32>>,
    time: Vec<f32>,
    scratch: Vec<Complex<f32>>,
}

impl<'a> Correlator<'a> {
    /// For intervals that begin in `from..to`.
    fn new(plans: &'a Plans, x: &[f32], from: usize, to: usize) -> Self {
        let block = |start: usize| plans.spectrum(&x[start..(start + plans.size).min(x.len())]);
        Self {
            plans,
            origin: from,
            blocks: (from..to).step_by(plans.step()).map(block).collect(),
            product: plans.inverse.make_input_vec(),
            time: plans.inverse.make_output_vec(),
            scratch: plans.inverse.make_scratch_vec(),
        }
    }

    fn correlate(&mut self, frame: &[f32], from: usize, to: usize, out: &mut Vec<f32>) {
        out.clear();
        let (spectrum, step) = (self.plans.spectrum(frame), self.plans.step());
        let scale = 1.0 / self.plans.size as f32;
        let mut at = from;
        while at < to {
            let index = (at - self.origin) / step;
            let start = self.origin + index * step;
            let end = (start + step).min(to);
            let pairs = self.blocks[index].iter().zip(&spectrum);
            self.product.iter_mut().zip(pairs).for_each(|(p, (a, b))| *p = a * b.conj());
            // Both are real up to rounding, as the transform requires.
            self.product[0].im = 0.0;
            if let Some(last) = self.product.last_mut() {
                last.im = 0.0;
            }
            let _ =
                self.plans.inverse.process_with_scratch(&mut self.product, &mut self.time, &mut self.scratch);
            out.extend(self.time[at - start..end - start].iter().map(|x| x * scale));
            at = end;
        }
    }
}

/// The most similar interval before each active frame of 25 ms, one every 12.5 ms.
///
/// Correlations are normalised by the energies of both intervals, so a copy that is louder or softer counts, up to 40 dB softer.
///
/// # Complexity
/// O(n w log f / f) for n samples, w samples of the past and f samples of a frame.
#[must_use]
pub fn frame_repeats(sound: &ActiveSound, rules: &RepeatRules) -> Vec<FrameRepeat> {
    let (x, frame) = (&sound.samples[..], sound.frame());
    let window = ((rules.window * sound.rate).round() as usize).max(frame);
    let starts: Vec<usize> = (0..x.len().saturating_sub(frame - 1))
        .step_by((frame / 2).max(1))
        .filter(|start| sound.is_active(*start + frame / 2))
        .collect();
    let plans = Plans::new(frame);
    let task = |starts: &[usize]| {
        let (first, last) = (starts[0].saturating_sub(window), starts[starts.len() - 1]);
        let mut correlator = Correlator::new(&plans, x, first, last);
        // Energies of all intervals from the first on.
        let mut sums = vec![0.0; last + frame - first + 1];
        for k in first..last + frame {
            sums[k - first + 1] = sums[k - first] + f64::from(x[k]).powi(2);
        }
        let energy = |start: usize| sums[start + frame - first] - sums[start - first];
        let mut found = Vec::new();
        let one = |start: &usize| {
            let from = start.saturating_sub(window);
            correlator.correlate(&x[*start..*start + frame], from, *start, &mut found);
            best(*start, frame, energy(*start), &found, |k| energy(from + k))
        };
        starts.iter().map(one).collect::<Vec<_>>()
    };
    starts.par_chunks(TASK).flat_map_iter(task).collect()
}

/// The best of the correlations with the intervals that end with the one a sample before `start`.
fn best(start: usize, frame: usize, own: f64, found: &[f32], energy: impl Fn(usize) -> f64) -> FrameRepeat {
    let normalised = |k: usize| {
        let past = energy(k);
        if past < SOFTEST * own { 0.0 } else { (f64::from(found[k]) / (past * own).sqrt()).clamp(-1.0, 1.0) }
    };
    let mut out = FrameRepeat { start, lag: 0, correlation: 0.0, periodicity: 0.0 };
    let mut is_behind = false;
    for k in (0..found.len()).rev() {
        let (lag, correlation) = (found.len() - k, normalised(k));
        is_behind |= correlation <= 0.0;
        if lag < frame && is_behind {
            out.periodicity = correlation.max(out.periodicity);
        }
        if lag >= frame && correlation > out.correlation {
            (out.lag, out.correlation) = (lag, correlation);
        }
    }
    out
}

/// Intervals of repeated frames that overlap or touch, with about one lag each.
#[must_use]
pub fn stretches(frames: &[FrameRepeat], sound: &ActiveSound, threshold: f64) -> Vec<RepeatStretch> {
    let (frame, rate) = (sound.frame(), sound.rate);
    let mut out: Vec<RepeatStretch> = Vec::new();
    for f in frames.iter().filter(|f| f.is_repeated(threshold)) {
        let (from, to) = (f.start as f64 / rate, (f.start + frame) as f64 / rate);
        let lag = f.lag as f64 / rate;
        match out.last_mut() {
            Some(last) if last.to >= from && (last.lag - lag).abs() * rate < 1.5 => {
                (last.to, last.correlation) = (to, last.correlation.max(f.correlation));
            }
            _ => out.push(RepeatStretch { from, to, lag, correlation: f.correlation }),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likeness::statistics::testing::gaussian;

    /// As `frame_repeats`, by its definition.
    fn naive(sound: &ActiveSound, rules: &RepeatRules) -> Vec<FrameRepeat> {
        let (x, frame) = (&sound.samples, sound.frame());
        let window = (rules.window * sound.rate).round() as usize;
        let dot = |a: usize, b: usize| -> f64 {
            (0..frame).map(|k| f64::from(x[a + k]) * f64::from(x[b + k])).sum()
        };
        let starts = (0..x.len() + 1 - frame).step_by(frame / 2);
        let one = |start: usize| {
            let from = start.saturating_sub(window);
            let found: Vec<f32> = (from..start).map(|k| dot(k, start) as f32).collect();
            best(start, frame, dot(start, start), &found, |k| dot(from + k, from + k))
        };
        starts.filter(|start| sound.is_active(start + frame / 2)).map(one).collect()
    }

    #[test]
    fn transforms_find_what_the_definition_finds() {
        // Noise with a softer copy, a tone and silence.
        let mut x = gaussian(9000, 1);
        for k in 3000..4000 {
            x[k] = 0.1 * x[k - 1234];
        }
        for (k, x) in x[5000..6500].iter_mut().enumerate() {
            *x = (0.3 * k as f32).sin() * 0.1 + 0.01 * *x;
        }
        x[7000..7800].fill(0.0);
        let sound = ActiveSound::new(&x, 4000.0);
        for window in [0.1, 0.5, 2.0] {
            let rules = RepeatRules { window, threshold: 0.9 };
            let (fast, slow) = (frame_repeats(&sound, &rules), naive(&sound, &rules));
            assert_eq!(fast.len(), slow.len());
            for (a, b) in fast.iter().zip(&slow) {
                // Of two lags that are as good, either may be found.
                let is_same = a.lag == b.lag || !b.is_repeated(0.9);
                assert!(a.start == b.start && is_same, "{a:?} {b:?}");
                assert!((a.correlation - b.correlation).abs() < 1e-4, "{a:?} {b:?}");
                assert!((a.periodicity - b.periodicity).abs() < 1e-4, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn independent_noise_does_not_repeat() {
        let sound = ActiveSound::new(&gaussian(88_200, 2), 22_050.0);
        let found = frame_repeats(&sound, &RepeatRules::default());
        assert!(found.len() > 300 && found.iter().all(|f| f.correlation < 0.5 && f.periodicity < 0.5));
        assert!(stretches(&found, &sound, 0.9).is_empty());
    }

    #[test]
    fn a_copy_is_found_where_it_stands() {
        // From 1.4 s to 2.1 s a copy of the 0.7 s before.
        let rate = 22_050;
        let mut x = gaussian(3 * rate, 3);
        let lag = 7 * rate / 10;
        for k in 2 * lag..3 * lag {
            x[k] = 0.5 * x[k - lag];
        }
        let sound = ActiveSound::new(&x, rate as f64);
        let found = frame_repeats(&sound, &RepeatRules::default());
        let share = found.iter().filter(|f| f.is_repeated(0.9)).count() as f64 / found.len() as f64;
        assert!((share - 0.7 / 3.0).abs() < 0.01, "{share}");
        let all = stretches(&found, &sound, 0.9);
        assert_eq!(all.len(), 1);
        let one = all[0];
        assert!((one.from - 1.4).abs() < 0.013 && (one.to - 2.1).abs() < 0.013, "{one:?}");
        assert!((one.lag - 0.7).abs() < 1e-9 && one.correlation > 0.999, "{one:?}");
        // Half a second before it, it did not stand.
        let short = frame_repeats(&sound, &RepeatRules { window: 0.5, threshold: 0.9 });
        assert!(short.iter().all(|f| !f.is_repeated(0.9)));
    }

    #[test]
    fn a_tone_is_periodic_and_no_repeat() {
        let x: Vec<f32> = (0..44_100).map(|k| (0.2 * (k as f64 * 0.13).sin()) as f32).collect();
        let sound = ActiveSound::new(&x, 22_050.0);
        let found = frame_repeats(&sound, &RepeatRules::default());
        // The first frames have no past, or hold the transient of the high-pass.
        for f in &found[8..] {
            assert!(f.is_periodic(0.9) && f.correlation > 0.9 && !f.is_repeated(0.9), "{f:?}");
        }
    }
}
