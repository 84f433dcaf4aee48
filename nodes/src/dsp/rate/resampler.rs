//! Sample rate conversion as a pure function of the input around a position.
//!
//! Output `j` is the windowed-sinc sum at input time `j * in_rate / out_rate`, in exact integers. Any block, start and thread therefore
//! produce the same bits, and sample 0 stays sample 0. In `rubato`, chunks, delay and the position of the first output
//! are state of the object. The price is the speed of an FFT.
//!
//! # Source
//! J. O. Smith, "Digital Audio Resampling" (bandlimited interpolation); Kaiser's window and length formulas.

use std::f64::consts::PI;
use std::ops::Range;

use super::taps::{Taps, weighted_sums};
use crate::core::time::Rate;
use crate::dsp::DspError;
use fearless_simd::Level;

/// The quality and cost of a resampler.
///
/// Figures were measured between 44.1 and 48 kHz: the largest error of a full-scale sine in the pass-band, and the largest alias of one
/// above it. Taps are per output sample for upsampling; for downsampling they grow with the ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// Flat to 0.75 of the lower Nyquist frequency: error -56 dB (0.013 dB), alias -57 dB; 30 taps.
    Draft,
    /// Flat to 0.88: error -98 dB (0.0001 dB), alias -98 dB; 108 taps.
    Standard,
    /// Flat to 0.92 (20.2 kHz at 44.1 kHz): error -118 dB (0.00001 dB), alias -118 dB; 196 taps.
    High,
}

impl Quality {
    /// Returns the stop-band attenuation in dB and the width of the transition band relative to the lower Nyquist frequency.
    const fn design(self) -> (f64, f64) {
        match self {
            Self::Draft => (60.0, 0.25),
            Self::Standard => (100.0, 0.12),
            Self::High => (120.0, 0.08),
        }
    }
}

/// Largest number of phases with taps of their own; for more, taps are interpolated between this many phases.
const PHASES: u64 = 4096;
/// Largest number of taps of all phases together: 128 MB.
const MAX_TAPS: f64 = 16_777_216.0;

/// A converter between two fixed rates.
///
/// # Example
/// ```
/// use foley_nodes::core::time::Rate;
/// use foley_nodes::dsp::{Quality, Resampler};
/// let up = Resampler::new(Rate::hz(44_100), Rate::hz(48_000), Quality::High)?;
/// let inputs = up.inputs(0..480);
/// let input = vec![0.5; (inputs.end - inputs.start) as usize];
/// let mut out = vec![0.0; 480];
/// up.process(0, &input, inputs.start, 1, &mut out)?;
/// assert!(out.iter().all(|x| (x - 0.5).abs() < 1e-6));
/// # Ok::<(), foley_nodes::dsp::DspError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Resampler {
    /// Input samples per output sample, reduced.
    step: i128,
    per: i128,
    /// Taps on each side of a position.
    half: usize,
    /// `2 * half` taps for each phase; an interpolated table has one more phase.
    table: Vec<f64>,
    phases: u64,
    interpolated: bool,
    level: Level,
}

impl Resampler {
    /// Designs the filter.
    ///
    /// # Errors
    /// Ratios above 1024 or below 1/1024, and ratios whose filter exceeds 128 MB.
    ///
    /// # Complexity
    /// O(taps) per output sample and channel; when downsampling, taps grow with in / out.
    /// The design is O(taps) for each phase of the ratio, at most 4096.
    pub fn new(input: Rate, output: Rate, quality: Quality) -> Result<Self, DspError> {
        let ratio = Ratio::new(input, output)?;
        let (step, per, half) = (ratio.step, ratio.per, ratio.half(quality)?);
        if half == 0 {
            return Ok(Self {
                step: 1,
                per: 1,
                half: 0,
                table: Vec::new(),
                phases: 0,
                interpolated: false,
                level: Level::new(),
            });
        }
        let (attenuation, transition) = quality.design();
        let (phases, interpolated) = ratio.phases();
        let beta = 0.1102 * (attenuation - 8.7);
        let kernel = Kernel {
            cutoff: ratio.scale() * (1.0 - transition / 2.0),
            half: half as f64,
            beta,
            peak: bessel_i0(beta),
        };
        let mut table = Vec::with_capacity((phases as usize + 1) * 2 * half);
        for phase in 0..phases + u64::from(interpolated) {
            let fraction = phase as f64 / phases as f64;
            let start = table.len();
            table.extend((0..2 * half).map(|k| kernel.at(k as f64 - (half - 1) as f64 - fraction)));
            // Every phase has unit gain at DC.
            let sum: f64 = table[start..].iter().sum();
            table[start..].iter_mut().for_each(|tap| *tap /= sum);
        }
        Ok(Self {
            step: step as i128,
            per: per as i128,
            half,
            table,
            phases,
            interpolated,
            level: Level::new(),
        })
    }

    /// Returns [`Resampler::look_behind`] and [`Resampler::look_ahead`] of such a resampler without its design.
    ///
    /// # Errors
    /// As [`Resampler::new`].
    pub fn lookaround(input: Rate, output: Rate, quality: Quality) -> Result<(usize, usize), DspError> {
        let half = Ratio::new(input, output)?.half(quality)?;
        Ok((half.saturating_sub(1), half))
    }

    /// Returns the number of input samples before the one at an output's [`position`](Self::position) on which the output depends.
    #[must_use]
    pub fn look_behind(&self) -> usize {
        self.half.saturating_sub(1)
    }

    /// Returns the number of input samples after the one at an output's [`position`](Self::position) on which the output depends.
    #[must_use]
    pub fn look_ahead(&self) -> usize {
        self.half
    }

    /// Returns the last input sample at or before the time of output `j`.
    #[must_use]
    pub fn position(&self, j: i64) -> i64 {
        (i128::from(j) * self.step).div_euclid(self.per) as i64
    }

    /// Returns the range of input samples on which a range of outputs depends.
    #[must_use]
    pub fn inputs(&self, outputs: Range<i64>) -> Range<i64> {
        if outputs.is_empty() {
            let at = self.position(outputs.start);
            return at..at;
        }
        let last = self.position(outputs.end - 1);
        self.position(outputs.start) - self.look_behind() as i64..last + self.look_ahead() as i64 + 1
    }

    /// Resamples a whole mono signal, with silence before and after it.
    ///
    /// # Errors
    /// As [`Resampler::process`].
    pub fn whole(&self, x: &[f32]) -> Result<Vec<f32>, DspError> {
        let outputs = (x.len() as i128 * self.per).div_euclid(self.step);
        let outputs = outputs as i64 + i64::from(outputs * self.step < x.len() as i128 * self.per);
        let needed = self.inputs(0..outputs);
        let mut input = vec![0.0; (needed.end - needed.start).max(0) as usize];
        for (index, sample) in (needed.start..).zip(&mut input) {
            *sample = usize::try_from(index).ok().and_then(|k| x.get(k)).copied().unwrap_or(0.0);
        }
        let mut out = vec![0.0; outputs.max(0) as usize];
        self.process(0, &input, needed.start, 1, &mut out)?;
        Ok(out)
    }

    /// Computes outputs `first_out..`.
    ///
    /// # Shapes
    /// `input`: interleaved frames from input index `first_in` on, at least [`Resampler::inputs`], with zeros outside the signal.
    /// `out`: interleaved frames.
    ///
    /// # Errors
    /// Input with too few frames.
    pub fn process(
        &self,
        first_out: i64,
        input: &[f32],
        first_in: i64,
        channels: usize,
        out: &mut [f32],
    ) -> Result<(), DspError> {
        let channels = channels.max(1);
        let frames = (out.len() / channels) as i64;
        let needed = self.inputs(first_out..first_out + frames);
        let end = first_in + (input.len() / channels) as i64;
        DspError::check(
            needed.is_empty() || (first_in <= needed.start && end >= needed.end),
            "input frames",
            (end - first_in) as f64,
            "those of `inputs` for these outputs",
        )?;
        let first = i128::from(first_out) * self.step;
        let (mut position, mut remainder) = (first.div_euclid(self.per), first.rem_euclid(self.per));
        let (whole, part) = (self.step / self.per, self.step % self.per);
        for frame in out.chunks_exact_mut(channels) {
            let start = (position as i64 - self.look_behind() as i64 - first_in) as usize * channels;
            if self.half == 0 {
                frame.copy_from_slice(&input[start..start + channels]);
            } else {
                let window = &input[start..start + 2 * self.half * channels];
                weighted_sums(self.level, self.taps(remainder as u64), window, frame);
            }
            position += whole;
            remainder += part;
            if remainder >= self.per {
                position += 1;
                remainder -= self.per;
            }
        }
        Ok(())
    }

    /// The taps of an output whose time is `remainder / per` after an input.
    fn taps(&self, remainder: u64) -> Taps<'_> {
        let taps = 2 * self.half;
        let row = |phase: usize| &self.table[phase * taps..][..taps];
        if !self.interpolated {
            return Taps { here: row(remainder as usize), next: None };
        }
        let position = u128::from(remainder) * u128::from(self.phases);
        let per = self.per as u128;
        let phase = (position / per) as usize;
        Taps { here: row(phase), next: Some((row(phase + 1), (position % per) as f64 / per as f64)) }
    }
}

/// Input samples per output sample, reduced.
struct Ratio {
    step: u128,
    per: u128,
}

impl Ratio {
    fn new(input: Rate, output: Rate) -> Result<Self, DspError> {
        let step = u128::from(input.num()) * u128::from(output.den());
        let per = u128::from(output.num()) * u128::from(input.den());
        let ratio = step as f64 / per as f64;
        let range = 1.0 / 1024.0..=1024.0;
        DspError::check(range.contains(&ratio), "ratio of the rates", ratio, "between 1/1024 and 1024")?;
        let divisor = gcd(step, per);
        let (step, per) = (step / divisor, per / divisor);
        // These are multiplied by a 64-bit index later.
        DspError::check(step.max(per) < 1 << 62, "reduced rate", step.max(per) as f64, "below 2^62")?;
        Ok(Self { step, per })
    }

    /// Returns the lower Nyquist frequency relative to that of the input.
    fn scale(&self) -> f64 {
        (1.0 / (self.step as f64 / self.per as f64)).min(1.0)
    }

    /// Returns the number of phases of the filter, and true if taps are interpolated between them.
    fn phases(&self) -> (u64, bool) {
        let interpolated = self.per > u128::from(PHASES);
        (if interpolated { PHASES } else { self.per as u64 }, interpolated)
    }

    /// Returns the number of taps on each side of a position; 0 for equal rates.
    fn half(&self, quality: Quality) -> Result<usize, DspError> {
        if self.step == self.per {
            return Ok(0);
        }
        let (attenuation, transition) = quality.design();
        let taps = (attenuation - 7.95) / (2.285 * PI * transition * self.scale());
        let half = (taps / 2.0).ceil();
        let table = 2.0 * half * self.phases().0 as f64;
        let expected = "at most 16777216: convert in two steps, or at a lower quality";
        DspError::check(table <= MAX_TAPS, "number of taps of all phases", table, expected)?;
        Ok(half as usize)
    }
}

/// A sinc with a Kaiser window.
struct Kernel {
    /// Cutoff relative to the Nyquist frequency of the input.
    cutoff: f64,
    half: f64,
    beta: f64,
    /// The Bessel function of the window at its centre.
    peak: f64,
}

impl Kernel {
    fn at(&self, t: f64) -> f64 {
        let edge = t / self.half;
        if edge.abs() >= 1.0 {
            return 0.0;
        }
        let x = PI * self.cutoff * t;
        let sinc = if x == 0.0 { 1.0 } else { libm::sin(x) / x };
        sinc * bessel_i0(self.beta * (1.0 - edge * edge).sqrt()) / self.peak
    }
}

/// Returns the modified Bessel function of the first kind and order 0, by its series.
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut sum, mut term) = (1.0, 1.0);
    for k in 1..200 {
        term *= quarter / (f64::from(k) * f64::from(k));
        sum += term;
        if term < sum * 1e-17 {
            break;
        }
    }
    sum
}

fn gcd(mut a: u128, mut b: u128) -> u128 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}
#[cfg(test)]
mod tests;
