//! Spectral flux: the change of the shape of a spectrum from one frame to the next.

use crate::impl_state;
use foley_fft::RealFftPlanner;
use realfft::RealToComplex;
use realfft::num_complex::Complex;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Lowest amplitude that counts as sound, as a fraction of the peak of a recording: -140 dB.
const RELATIVE_SILENCE: f64 = 1e-7;
/// Lowest amplitude that counts as sound, of full scale: -120 dB.
pub const ABSOLUTE_SILENCE: f64 = 1e-6;

/// Frames of a spectral flux.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FluxFrames {
    /// Samples of a frame.
    pub frame: usize,
    /// Samples from one frame to the next.
    pub hop: usize,
    /// Exponent of the magnitudes: 1, or 2 for the power spectrum.
    pub exponent: u32,
}

impl FluxFrames {
    /// Frames of 512 samples every 128 samples at 44.1 kHz, of about the same duration at other rates.
    #[must_use]
    pub fn at_rate(rate: f64) -> Self {
        let octaves = (rate / 44_100.0).log2().round().clamp(-4.0, 4.0) as i32;
        let frame = if octaves >= 0 { 512 << octaves } else { 512 >> -octaves };
        Self { frame, hop: frame / 4, exponent: 1 }
    }
}

/// Flux from one frame to the next: the Euclidean distance of their spectra, each normalised to unit length.
///
/// It is 0 for frames that differ by a factor, and at most the square root of 2. A silent frame has the spectrum 0: one silent frame of
/// two gives 1, two give 0.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 3.2, with the
/// power spectrum, `exponent: 2`; magnitudes are dominated less by the strongest peak.
pub struct FluxMeter {
    plan: Arc<dyn RealToComplex<f32>>,
    window: Vec<f32>,
    window_sum: f64,
    exponent: u32,
    input: Vec<f32>,
    spectrum: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
    /// Normalised spectra of the latest frame and of the one before.
    shapes: [Vec<f32>; 2],
    silence: f64,
}

impl FluxMeter {
    /// A meter of frames in which amplitudes below `silence` are silent.
    #[must_use]
    pub fn new(frames: FluxFrames, silence: f64) -> Self {
        let n = frames.frame.max(2);
        let plan = RealFftPlanner::new().plan_fft_forward(n);
        let window: Vec<f32> =
            (0..n).map(|i| (0.5 - 0.5 * (TAU * i as f64 / n as f64).cos()) as f32).collect();
        let shape = vec![0.0; n / 2 + 1];
        Self {
            window_sum: window.iter().map(|w| f64::from(*w)).sum(),
            input: plan.make_input_vec(),
            spectrum: plan.make_output_vec(),
            scratch: plan.make_scratch_vec(),
            shapes: [shape.clone(), shape],
            exponent: frames.exponent.clamp(1, 2),
            plan,
            window,
            silence,
        }
    }

    /// Takes the next frame and returns the flux from the frame before; silence precedes the first frame.
    ///
    /// # Shapes
    /// `frame: [frames.frame]`.
    pub fn next(&mut self, frame: &[f32]) -> f32 {
        self.shapes.swap(0, 1);
        self.input.fill(0.0);
        for ((x, s), w) in self.input.iter_mut().zip(frame).zip(&self.window) {
            *x = s * w;
        }
        // Lengths agree by construction.
        let transformed =
            self.plan.process_with_scratch(&mut self.input, &mut self.spectrum, &mut self.scratch);
        let shape = &mut self.shapes[0];
        let magnitude: f64 = self.spectrum.iter().map(|x| f64::from(x.norm_sqr())).sum::<f64>().sqrt();
        if transformed.is_err() || magnitude <= self.silence * self.window_sum {
            shape.fill(0.0);
        } else {
            let scale = 1.0 / magnitude as f32;
            for (u, x) in shape.iter_mut().zip(&self.spectrum) {
                let power = x.norm_sqr() * scale * scale;
                *u = if self.exponent == 2 { power } else { power.sqrt() };
            }
            if self.exponent == 2 {
                let norm = shape.iter().map(|u| f64::from(u * u)).sum::<f64>().sqrt();
                let scale = if norm > 0.0 { (1.0 / norm) as f32 } else { 0.0 };
                shape.iter_mut().for_each(|u| *u *= scale);
            }
        }
        let [now, before] = &self.shapes;
        now.iter().zip(before).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt() as f32
    }
}

impl_state!(FluxMeter { shapes });

/// Index of an item of a sequence of `len` items that is reflected at both ends, the item at the end twice; a sequence without a known
/// length is reflected at its start.
pub(crate) fn reflected(i: i64, len: Option<i64>) -> i64 {
    let Some(len) = len.filter(|len| *len > 0) else { return i.max(-1 - i) };
    let j = i.rem_euclid(2 * len);
    j.min(2 * len - 1 - j)
}

/// A part of a recording.
#[derive(Clone, Copy, Debug)]
pub struct Excerpt<'a> {
    /// Its samples.
    pub samples: &'a [f32],
    /// Index of the first of them in the recording.
    pub first: i64,
    /// Samples of the recording, if it has an end.
    pub len: Option<i64>,
}

impl Excerpt<'_> {
    /// Samples from `from` on, if all of them are in the excerpt and in the recording.
    fn inside(&self, from: i64, count: usize) -> Option<&[f32]> {
        let at = usize::try_from(from - self.first).ok().filter(|_| from >= 0)?;
        let ends = self.len.is_none_or(|len| from + count as i64 <= len);
        self.samples.get(at..at + count).filter(|_| ends)
    }

    /// A sample of the reflected recording; 0 outside the excerpt.
    fn sample(&self, i: i64) -> f32 {
        let at = usize::try_from(reflected(i, self.len) - self.first).ok();
        at.and_then(|at| self.samples.get(at)).copied().unwrap_or(0.0)
    }
}

/// Spectral flux, item by item.
///
/// Item `k` is the flux between the frames that are centred on the samples `(k - 1) hop` and `k hop`; item 0 equals item 1.
pub struct FluxStream {
    frames: FluxFrames,
    meter: FluxMeter,
    frame: Vec<f32>,
    /// The next frame.
    next: i64,
    /// The latest item.
    value: f32,
}

impl_state!(FluxStream { meter, next, value });

impl FluxStream {
    /// A stream in which amplitudes below `silence` are silent.
    #[must_use]
    pub fn new(frames: FluxFrames, silence: f64) -> Self {
        let frames = FluxFrames { frame: frames.frame.max(2), hop: frames.hop.max(1), ..frames };
        let (meter, frame) = (FluxMeter::new(frames, silence), vec![0.0; frames.frame]);
        Self { frames, meter, frame, next: 0, value: 0.0 }
    }

    /// Samples that an item requires before and after that of its number times the hop.
    #[must_use]
    pub fn lookaround(frames: FluxFrames) -> [usize; 2] {
        [frames.frame / 2 + frames.hop, frames.hop + frames.frame - frames.frame / 2 - 1]
    }

    /// Returns the next item, or any later one.
    pub fn item(&mut self, k: i64, x: Excerpt<'_>) -> f32 {
        let hop = self.frames.hop as i64;
        if x.len.is_some_and(|len| len < hop) {
            return 0.0;
        }
        let latest = k.max(1);
        // After a gap, the frame before it is still there.
        self.next = self.next.max(latest - 1);
        while self.next <= latest {
            let first = self.next * hop - (self.frames.frame / 2) as i64;
            self.value = match x.inside(first, self.frames.frame) {
                Some(frame) => self.meter.next(frame),
                None => {
                    for (i, sample) in (first..).zip(self.frame.iter_mut()) {
                        *sample = x.sample(i);
                    }
                    self.meter.next(&self.frame)
                }
            };
            self.next += 1;
        }
        self.value
    }
}

/// Returns the spectral flux of a recording. Item `k` is the flux between the frames that are centred on the samples
/// `(k - 1) hop` and `k hop`; item 0 equals item 1.
///
/// The recording is reflected at its ends. Frames 140 dB below its peak, or 120 dB below full scale, are silent, so that a recording at any
/// gain has the same flux.
///
/// # Complexity
/// One transform a hop.
#[must_use]
pub fn spectral_flux(x: &[f32], frames: FluxFrames) -> Vec<f64> {
    if x.is_empty() {
        return Vec::new();
    }
    let peak = x.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
    let mut flux = FluxStream::new(frames, (RELATIVE_SILENCE * f64::from(peak)).max(ABSOLUTE_SILENCE));
    let whole = Excerpt { samples: x, first: 0, len: Some(x.len() as i64) };
    (0..=x.len() / frames.hop.max(1)).map(|k| f64::from(flux.item(k as i64, whole))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    fn noise(n: usize, seed: u64) -> Vec<f32> {
        let mut rng = Rng::new(seed);
        (0..n)
            .map(|_| {
                let (u, v) = (rng.uniform().max(1e-12), rng.uniform());
                (0.1 * (-2.0 * u.ln()).sqrt() * (TAU * v).cos()) as f32
            })
            .collect()
    }

    fn mean(x: &[f64]) -> f64 {
        x.iter().sum::<f64>() / x.len() as f64
    }

    #[test]
    fn noise_has_the_flux_of_rayleigh_magnitudes() {
        // Independent frames: sqrt(2 (1 - pi / 4)) = 0.6551.
        let apart = FluxFrames { frame: 512, hop: 512, exponent: 1 };
        let flux = spectral_flux(&noise(512 * 4000, 1), apart);
        assert!((mean(&flux[2..3999]) - 0.6551).abs() < 0.005, "{}", mean(&flux[2..3999]));
        let flux = spectral_flux(&noise(128 * 4000, 2), FluxFrames::at_rate(44_100.0));
        assert!((mean(&flux[4..3990]) - 0.503).abs() < 0.005, "{}", mean(&flux[4..3990]));
    }

    #[test]
    fn a_change_of_level_has_no_flux_and_an_attack_after_silence_has_1() {
        let mut meter = FluxMeter::new(FluxFrames::at_rate(44_100.0), ABSOLUTE_SILENCE);
        let x = noise(512, 3);
        meter.next(&x);
        let louder: Vec<f32> = x.iter().map(|x| 4.0 * x).collect();
        assert!(meter.next(&louder) < 1e-6);
        let silence = vec![0.0; 512];
        assert!((meter.next(&silence) - 1.0).abs() < 1e-6);
        assert!(meter.next(&silence) == 0.0 && (meter.next(&x) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_steady_tone_has_no_flux_and_a_gain_changes_nothing() {
        let tone: Vec<f32> = (0..20_000).map(|i| (TAU * 16.0 * i as f64 / 512.0).sin() as f32).collect();
        let flux = spectral_flux(&tone, FluxFrames::at_rate(44_100.0));
        assert!(flux[4..150].iter().all(|f| *f < 1e-3));
        let (x, quiet): (Vec<f32>, Vec<f32>) = noise(8000, 4).iter().map(|x| (*x, x / 1024.0)).unzip();
        assert_eq!(
            spectral_flux(&x, FluxFrames::at_rate(44_100.0)),
            spectral_flux(&quiet, FluxFrames::at_rate(44_100.0))
        );
    }

    #[test]
    fn short_recordings_and_digital_silence_are_finite() {
        for n in 0..5 {
            assert!(
                spectral_flux(&vec![0.3; n], FluxFrames::at_rate(44_100.0)).iter().all(|f| f.is_finite())
            );
        }
        assert!(spectral_flux(&[0.0; 4000], FluxFrames::at_rate(44_100.0)).iter().all(|f| *f == 0.0));
    }

    #[test]
    fn frames_have_about_the_same_duration_at_all_rates() {
        let lengths = [8000.0, 44_100.0, 48_000.0, 96_000.0, 192_000.0].map(|r| FluxFrames::at_rate(r).frame);
        assert_eq!(lengths, [128, 512, 512, 1024, 2048]);
    }
}
