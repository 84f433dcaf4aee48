//! Transfer of interaural cues from one sound to another, frame by frame.

use foley_fft::RealFftPlanner;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealToComplex};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::fmt;
use std::sync::Arc;

use super::mel_bands::MelBands;
use crate::impl_state;

/// Length of a frame, s; rounded to a power of two in samples.
const FRAME: f64 = 0.021;
/// Frames that overlap at each sample: their squared sine windows add up to half of it.
const OVERLAP: usize = 4;
/// Frames before and after a frame whose powers are averaged with its own.
const SMOOTHING: usize = 6;
/// Delays of the decorrelated part, in hops, of one band after the other: 11 to 21 ms.
const DECORRELATION: [usize; 3] = [2, 3, 4];
/// Distance of the centres of bands, mel: about 100 Hz at low frequencies.
const BAND: f64 = 130.0;
/// Longest delay between the ears, s.
const MAX_DELAY: f64 = 0.001;
/// Power of a bin below which a target is silent: -150 dB.
const SILENT: f64 = 1e-12;
/// Largest gain of a channel of audio of several channels: 20 dB.
const MAX_GAIN: f64 = 10.0;

/// Frames that are in memory: those of the average, and those of the decorrelated part.
const FRAMES: usize = 2 * SMOOTHING + 1;

/// Length and interval of frames at a sample rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CueFrames {
    /// Samples of a frame.
    pub length: usize,
    /// Samples from one frame to the next.
    pub hop: usize,
}

impl CueFrames {
    /// Frames of about 21 ms at a rate in Hz.
    #[must_use]
    pub fn at_rate(rate: f64) -> Self {
        let exponent = libm::round(libm::log2(FRAME * rate)).clamp(4.0, 15.0);
        let length = 1 << exponent as u32;
        Self { length, hop: length / OVERLAP }
    }

    /// Samples after an output sample that are read for it.
    #[must_use]
    pub fn look_ahead(self) -> usize {
        self.length - 1 + SMOOTHING * self.hop
    }

    /// Frames before the first one of an output hop that add to it.
    #[must_use]
    pub fn overlapping(self) -> usize {
        OVERLAP - 1
    }
}

/// One analysed frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Frame {
    /// Powers of the target, `[channels, bands]`.
    target: Vec<f64>,
    /// Cross-spectrum of two channels of the target.
    cross: Vec<[f64; 2]>,
    /// Powers of the audio, `[inputs, bands]`.
    power: Vec<f64>,
    /// Spectra of the audio, `[inputs, bins]`.
    audio: Vec<[f64; 2]>,
}

fn complex([re, im]: [f64; 2]) -> Complex<f64> {
    Complex::new(re, im)
}

/// Gives a sound the level differences of a target and, if it is mono, also its delay and its coherence between the ears.
///
/// Each band of frame `f` has the mean powers `E_c` of the target over the frames around it. Channel `c` of a mono sound gets the gain
/// `sqrt(E_c / mean E)`; that of a sound of several channels is divided by its own `sqrt(E_c / mean E)`, so that its power in the band
/// remains. The delay is the lag of the largest cross-correlation of both ears over all frequencies, half of it for each ear. With the
/// coherence `r` of a band at this lag, the ears get `sqrt((1 + r) / 2)` of the sound and plus or minus `sqrt((1 - r) / 2)` of a
/// decorrelated part: the same sound 11 to 21 ms earlier, by another delay in each band.
///
/// # Complexity
/// One transform per channel of target, audio and output, and one for the delay, for each hop of a quarter frame.
///
/// # Source
/// Faller and Baumgarte, "Binaural cue coding, part II: schemes and applications" (IEEE Trans. Speech and Audio Processing 11(6),
/// 2003), for cues by band; Breebaart, van de Par, Kohlrausch and Schuijers, "Parametric coding of stereo audio" (EURASIP JASP 2005:9),
/// section 5, for the mix with a decorrelated part.
pub struct CueTransfer {
    frames: CueFrames,
    channels: usize,
    inputs: usize,
    bands: MelBands,
    window: Vec<f64>,
    /// Weights of the frames of an average.
    weights: [f64; FRAMES],
    max_lag: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    scratch: Vec<Complex<f64>>,
    inverse_scratch: Vec<Complex<f64>>,
    samples: Vec<f64>,
    spectra: Vec<Vec<Complex<f64>>>,
    target_power: Vec<f64>,
    audio_power: Vec<f64>,
    cross: Vec<Complex<f64>>,
    coherence: Vec<f64>,
    gains: Vec<f64>,
    /// Analysed frames, frame `f` at `f` modulo [`FRAMES`].
    history: Vec<Frame>,
    /// Number of analysed frames.
    count: usize,
    /// Sums of the frames that overlap, per channel, from the next hop on.
    sums: Vec<Vec<f64>>,
}

impl_state!(CueTransfer { history, count, sums });

impl fmt::Debug for CueTransfer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CueTransfer({:?}, {} to {} channels)", self.frames, self.inputs, self.channels)
    }
}

impl CueTransfer {
    /// A transfer from a target of `channels` to audio of `inputs`, 1 or as many, at a sample rate in Hz.
    #[must_use]
    pub fn new(rate: f64, channels: usize, inputs: usize) -> Self {
        let frames = CueFrames::at_rate(rate);
        let n = frames.length;
        let mut planner = RealFftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(n), planner.plan_fft_inverse(n));
        let bands = MelBands::new(rate, n, BAND);
        let bins = n / 2 + 1;
        let hann = |k: usize| 0.5 - 0.5 * (TAU * (k + 1) as f64 / (FRAMES + 1) as f64).cos();
        let total: f64 = (0..FRAMES).map(hann).sum();
        let frame = Frame {
            target: vec![0.0; channels * bands.len()],
            cross: vec![[0.0; 2]; bins],
            power: vec![0.0; inputs * bands.len()],
            audio: vec![[0.0; 2]; inputs * bins],
        };
        Self {
            frames,
            channels,
            inputs,
            window: (0..n).map(|i| (PI * (i as f64 + 0.5) / n as f64).sin()).collect(),
            weights: std::array::from_fn(|k| hann(k) / total),
            max_lag: ((MAX_DELAY * rate).ceil() as usize).min(n / 2 - 1),
            scratch: forward.make_scratch_vec(),
            inverse_scratch: inverse.make_scratch_vec(),
            samples: vec![0.0; n],
            spectra: vec![vec![Complex::default(); bins]; channels.max(inputs)],
            target_power: vec![0.0; channels * bands.len()],
            audio_power: vec![0.0; inputs * bands.len()],
            cross: vec![Complex::default(); bins],
            coherence: vec![1.0; bands.len()],
            gains: vec![1.0; channels * bands.len()],
            history: vec![frame; FRAMES],
            count: 0,
            sums: vec![vec![0.0; n]; channels],
            forward,
            inverse,
            bands,
        }
    }

    /// Frames by which the hop of [`CueTransfer::next`] is behind the frame that it takes.
    #[must_use]
    pub fn latency(&self) -> usize {
        SMOOTHING
    }

    /// Takes the next frame of target and audio, and writes the hop that is complete with it: the one where the frame
    /// [`CueTransfer::latency`] frames ago begins.
    ///
    /// # Shapes
    /// `target: [length, channels]`, `audio: [length, inputs]`, `out: [hop, channels]`.
    pub fn next(&mut self, target: &[f32], audio: &[f32], out: &mut [f32]) {
        self.analyse(target, audio);
        self.count += 1;
        self.synthesise();
        let scale = 2.0 / OVERLAP as f64;
        for (c, sums) in self.sums.iter_mut().enumerate() {
            for (out, sum) in out.iter_mut().skip(c).step_by(self.channels.max(1)).zip(&*sums) {
                *out = (scale * sum) as f32;
            }
            sums.copy_within(self.frames.hop.., 0);
            let rest = sums.len() - self.frames.hop;
            sums[rest..].fill(0.0);
        }
    }

    /// Spectra of the channels of a frame of interleaved samples.
    fn transform(&mut self, samples: &[f32], channels: usize) {
        for (c, spectrum) in self.spectra.iter_mut().enumerate().take(channels) {
            let channel = samples.iter().skip(c).step_by(channels);
            for ((out, x), w) in self.samples.iter_mut().zip(channel).zip(&self.window) {
                *out = f64::from(*x) * w;
            }
            // Lengths agree by construction.
            let done = self.forward.process_with_scratch(&mut self.samples, spectrum, &mut self.scratch);
            debug_assert!(done.is_ok());
        }
    }

    fn analyse(&mut self, target: &[f32], audio: &[f32]) {
        let (count, bins) = (self.bands.len(), self.cross.len());
        let at = self.count % FRAMES;
        self.transform(target, self.channels);
        let frame = &mut self.history[at];
        for (spectrum, power) in self.spectra.iter().zip(frame.target.chunks_exact_mut(count)) {
            self.bands.sums(|k| spectrum[k].norm_sqr(), power);
        }
        if let ([left, right], 1) = (&self.spectra[..self.channels], self.inputs) {
            for ((cross, l), r) in frame.cross.iter_mut().zip(left).zip(right) {
                let product = l * r.conj();
                *cross = [product.re, product.im];
            }
        }
        self.transform(audio, self.inputs);
        let frame = &mut self.history[at];
        let powers = frame.power.chunks_exact_mut(count).zip(frame.audio.chunks_exact_mut(bins));
        for (spectrum, (power, bins)) in self.spectra.iter().zip(powers) {
            self.bands.sums(|k| spectrum[k].norm_sqr(), power);
            bins.iter_mut().zip(spectrum).for_each(|(bin, x)| *bin = [x.re, x.im]);
        }
    }

    /// The frame `ago` frames before the newest one.
    fn before(&self, ago: usize) -> &Frame {
        &self.history[(self.count + FRAMES - 1 - ago) % FRAMES]
    }

    /// Averages the powers of all frames in memory.
    fn average(&mut self) {
        self.target_power.fill(0.0);
        self.audio_power.fill(0.0);
        self.cross.fill(Complex::default());
        for (k, weight) in self.weights.iter().enumerate() {
            let frame = &self.history[(self.count + k) % FRAMES];
            self.target_power.iter_mut().zip(&frame.target).for_each(|(sum, x)| *sum += weight * x);
            self.audio_power.iter_mut().zip(&frame.power).for_each(|(sum, x)| *sum += weight * x);
            self.cross.iter_mut().zip(&frame.cross).for_each(|(sum, x)| *sum += complex(*x) * weight);
        }
    }

    /// Sets the gains of all channels and bands.
    fn set_gains(&mut self) {
        let count = self.bands.len();
        for band in 0..count {
            let relative = |powers: &[f64], channel: usize| {
                let of = powers.iter().skip(band).step_by(count);
                let mean = of.sum::<f64>() * count as f64 / powers.len() as f64;
                (powers[channel * count + band] + SILENT) / (mean + SILENT)
            };
            for channel in 0..self.channels {
                let wanted = relative(&self.target_power, channel);
                let own = if self.inputs > 1 { relative(&self.audio_power, channel) } else { 1.0 };
                self.gains[channel * count + band] = (wanted / own).sqrt().min(MAX_GAIN);
            }
        }
    }

    /// Delay of the first ear after the second, in samples, of the averaged cross-spectrum.
    fn delay(&mut self) -> f64 {
        self.spectra[0].copy_from_slice(&self.cross);
        self.invert(0);
        let n = self.samples.len();
        let at = |lag: i64| self.samples[lag.rem_euclid(n as i64) as usize];
        let mut best = 0;
        for lag in 1..=self.max_lag as i64 {
            for lag in [lag, -lag] {
                if at(lag) > at(best) {
                    best = lag;
                }
            }
        }
        let (before, peak, after) = (at(best - 1), at(best), at(best + 1));
        let curvature = before - 2.0 * peak + after;
        let max = self.max_lag as f64;
        let offset = if curvature < 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
        (best as f64 + offset.clamp(-0.5, 0.5)).clamp(-max, max)
    }

    /// Sets the coherence of the ears in each band once the delay is made up for.
    fn set_coherence(&mut self, delay: f64) {
        let count = self.bands.len();
        let step = TAU * delay / self.frames.length as f64;
        let cross = &self.cross;
        self.bands.sums(|k| (cross[k] * Complex::cis(step * k as f64)).re, &mut self.coherence);
        let (left, right) = self.target_power.split_at(count);
        for ((coherence, l), r) in self.coherence.iter_mut().zip(left).zip(right) {
            *coherence = ((*coherence + SILENT) / ((l * r).sqrt() + SILENT)).clamp(-1.0, 1.0);
        }
    }

    /// Adds the frame in the middle of those in memory to the output.
    fn synthesise(&mut self) {
        self.average();
        self.set_gains();
        let ears = self.inputs == 1 && self.channels == 2;
        if ears {
            let delay = self.delay();
            self.set_coherence(delay);
            self.place_at_ears(delay);
        } else {
            self.scale_channels();
        }
        for channel in 0..self.channels {
            self.invert(channel);
            let scale = 1.0 / self.samples.len() as f64;
            for ((sum, x), w) in self.sums[channel].iter_mut().zip(&self.samples).zip(&self.window) {
                *sum += scale * x * w;
            }
        }
    }

    /// Spectra of the channels: those of the audio, times the gains.
    fn scale_channels(&mut self) {
        let (count, bins) = (self.bands.len(), self.cross.len());
        let frame = &self.history[(self.count + FRAMES - 1 - SMOOTHING) % FRAMES];
        for (c, spectrum) in self.spectra.iter_mut().enumerate().take(self.channels) {
            let audio = &frame.audio[c.min(self.inputs - 1) * bins..];
            let gains = &self.gains[c * count..(c + 1) * count];
            for (k, (out, x)) in spectrum.iter_mut().zip(audio).enumerate() {
                *out = complex(*x) * self.bands.interpolated(k, gains);
            }
        }
    }

    /// Spectra of two ears from mono audio and its decorrelated part.
    fn place_at_ears(&mut self, delay: f64) {
        let count = self.bands.len();
        let step = 0.5 * TAU * delay / self.frames.length as f64;
        for k in 0..self.cross.len() {
            let direct = complex(self.before(SMOOTHING).audio[k]);
            let diffuse: Complex<f64> = self
                .bands
                .weights(k)
                .into_iter()
                .map(|(band, weight)| {
                    let ago = SMOOTHING + DECORRELATION[band % DECORRELATION.len()];
                    complex(self.before(ago).audio[k]) * weight.sqrt()
                })
                .sum();
            let coherence = self.bands.interpolated(k, &self.coherence);
            let direct = direct * (0.5 * (1.0 + coherence)).sqrt();
            let diffuse = diffuse * (0.5 * (1.0 - coherence)).sqrt();
            let turn = Complex::cis(-step * k as f64);
            let gain = |ear: usize| self.bands.interpolated(k, &self.gains[ear * count..(ear + 1) * count]);
            let (left, right) =
                ((direct + diffuse) * gain(0) * turn, (direct - diffuse) * gain(1) * turn.conj());
            (self.spectra[0][k], self.spectra[1][k]) = (left, right);
        }
    }

    /// Samples of a spectrum, times their number.
    fn invert(&mut self, channel: usize) {
        let spectrum = &mut self.spectra[channel];
        // Both ends of the spectrum of a real signal are real.
        let last = spectrum.len() - 1;
        (spectrum[0].im, spectrum[last].im) = (0.0, 0.0);
        let done = self.inverse.process_with_scratch(spectrum, &mut self.samples, &mut self.inverse_scratch);
        debug_assert!(done.is_ok());
    }
}

#[cfg(test)]
mod tests;
