//! The node `Limiter`.

use super::ramp::{db_to_linear, linear_to_db};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::Rate;
use crate::{archive_state, impl_state, params, ports};

params! {
    /// Limits the peaks of audio to a ceiling, and changes nothing below it.
    ///
    /// The gain begins to fall `attack` before a peak that exceeds the ceiling, is low enough when the peak comes, and returns
    /// exponentially. All channels have the same gain, so directions stay. The limiter looks ahead by `attack`, which is latency in a
    /// live run. Peaks between samples, which a converter may reach, are not measured: leave them 1 dB.
    ///
    /// # Source
    /// Hamalainen, "Smoothing of the control signal without clipped output in digital peak limiters" (DAFx 2002): the minimum of the gains
    /// ahead, smoothed by a mean over as many samples.
    pub struct LimiterParams {
        /// Largest magnitude of the output, relative to full scale.
        ceiling_db: f64 = -1.0, unit "dB", range -60.0..=0.0;
        /// Time by which the gain falls before a peak.
        attack: f64 = 0.005, unit "s", range 0.0..=0.1;
        /// Time in which the gain returns to within 1/e of 1.
        release: f64 = 0.1, unit "s", range 0.001..=10.0;
    }
}
ports! {
    /// Ports of `Limiter`.
    pub struct LimiterPorts / LimiterIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
        }
        out {
            /// The audio within the ceiling.
            out: Stream<f32>,
        }
    }
}

/// Deviation of the gain from 1 below which it is 1: -120 dB.
const NEGLIGIBLE: f64 = 1e-6;

/// A peak limiter that looks ahead.
///
/// ```
/// use foley_nodes::dsp::PeakLimiter;
///
/// // 5 ms ahead, a ceiling of half of full scale, and 100 ms of release at 48 kHz.
/// let sound: Vec<f32> = (0..4800).map(|k| (0.1 * k as f32).sin()).collect();
/// let mut limiter = PeakLimiter::new(240, sound.len(), 0.5, 4800.0);
/// // What lies ahead of the end is silence.
/// let around = [&sound[..], &[0.0; 240]].concat();
/// let mut limited = vec![0.0; sound.len()];
/// limiter.process(&around, 1, &mut limited);
/// assert!(limited.iter().all(|x| x.abs() <= 0.5));
/// ```
///
/// # Complexity
/// Constant time a frame on average. Nothing is allocated while windows have at most the length it was made for.
#[derive(Debug)]
pub struct PeakLimiter {
    /// Frames by which it looks ahead.
    ahead: usize,
    ceiling: f64,
    /// Share by which the distance of the gain from 1 decreases in a frame.
    recovery: f64,
    /// The gain before smoothing.
    gain: f64,
    /// The last `ahead + 1` of these gains, as a ring, and the next index in it.
    recent: Vec<f64>,
    next: usize,
    /// Sum of `recent`, and number of those below 1.
    sum: f64,
    reduced: usize,
    /// Gains that the frames of the window and those ahead allow.
    allowed: Vec<f64>,
    /// Indices into `allowed` of gains in ascending order, each the smallest from its index on.
    minima: Vec<usize>,
    /// The smallest gain so far.
    smallest: f64,
}

impl_state!(PeakLimiter { gain, recent, next, sum, reduced, smallest });

impl PeakLimiter {
    /// A limiter that looks `ahead` frames ahead, for windows of up to `window` frames, with a ceiling as a magnitude from 0 on (1 is full
    /// scale). The gain returns to within 1/e of 1 in `release_frames`.
    #[must_use]
    pub fn new(ahead: usize, window: usize, ceiling: f64, release_frames: f64) -> Self {
        let frames = ahead + 1;
        Self {
            ahead,
            ceiling: ceiling.max(0.0),
            recovery: recovery(release_frames),
            gain: 1.0,
            recent: vec![1.0; frames],
            next: 0,
            sum: frames as f64,
            reduced: 0,
            allowed: Vec::with_capacity(window + ahead),
            minima: Vec::with_capacity(window + ahead),
            smallest: 1.0,
        }
    }

    /// Limits a window.
    ///
    /// # Shapes
    /// `around`: `[len + ahead, channels]`, the window and what follows it, zeros after the end; `out`: `[len, channels]`.
    pub fn process(&mut self, around: &[f32], channels: usize, out: &mut [f32]) {
        let ceiling = self.ceiling;
        let allowed = around.chunks_exact(channels).map(|frame| {
            let peak = frame.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
            (ceiling / f64::from(peak)).min(1.0)
        });
        self.allowed.clear();
        self.allowed.extend(allowed);
        self.minima.clear();
        let (mut first, mut seen) = (0, 0);
        let frames = around.chunks_exact(channels).zip(out.chunks_exact_mut(channels));
        for (k, (frame, out)) in frames.enumerate() {
            while seen < self.allowed.len().min(k + self.ahead + 1) {
                while self.minima.len() > first
                    && self.minima.last().is_some_and(|&last| self.allowed[last] >= self.allowed[seen])
                {
                    self.minima.pop();
                }
                self.minima.push(seen);
                seen += 1;
            }
            first += usize::from(self.minima[first] < k);
            let gain = self.smooth(self.allowed[self.minima[first]]) as f32;
            for (x, y) in frame.iter().zip(out) {
                // The mean of gains may exceed the gain by rounding.
                *y = if gain < 1.0 { (x * gain).clamp(-ceiling as f32, ceiling as f32) } else { *x };
            }
        }
    }

    /// The gain of the next frame, from the smallest gain that it and those ahead allow.
    fn smooth(&mut self, smallest: f64) -> f64 {
        let recovered = self.gain + (1.0 - self.gain) * self.recovery;
        let recovered = if recovered > 1.0 - NEGLIGIBLE { 1.0 } else { recovered };
        self.gain = smallest.min(recovered);
        let frames = self.recent.len();
        let oldest = std::mem::replace(&mut self.recent[self.next], self.gain);
        self.next = (self.next + 1) % frames;
        self.reduced = self.reduced + usize::from(self.gain < 1.0) - usize::from(oldest < 1.0);
        self.sum += self.gain - oldest;
        if self.reduced == 0 {
            self.sum = frames as f64;
            return 1.0;
        }
        let gain = (self.sum / frames as f64).min(1.0);
        self.smallest = self.smallest.min(gain);
        gain
    }
}

/// Share by which a distance decreases in a frame, so that 1/e of it is left after this number of frames.
fn recovery(frames: f64) -> f64 {
    -(-1.0 / frames.max(1e-9)).exp_m1()
}

/// The node over [`PeakLimiter`].
#[derive(Debug)]
pub struct Limiter {
    limiter: PeakLimiter,
    rate: Rate,
}

fn ahead(p: &LimiterParams, rate: Rate) -> usize {
    (p.attack * rate.as_f64()).round() as usize
}

impl Node for Limiter {
    type Params = LimiterParams;
    type Ports = LimiterPorts;
    const NAME: &'static str = "Limiter";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 4.0;

    fn shape(p: &LimiterParams, s: &mut Shape<'_, '_, LimiterPorts>) -> Result<(), Reject> {
        let audio = s.input(LimiterPorts::audio);
        s.lookaround(LimiterPorts::audio, 0, ahead(p, audio.rate));
        s.when_ended(LimiterPorts::audio, Ends::Stop);
        s.output(LimiterPorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &LimiterParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let rate = cx.input(LimiterPorts::audio).rate;
        let (ceiling, release) = (db_to_linear(p.ceiling_db), p.release * rate.as_f64());
        let limiter = PeakLimiter::new(ahead(p, rate), cx.items_per_window(rate), ceiling, release);
        Ok(Self { limiter, rate })
    }

    fn run(&mut self, mut io: LimiterIo<'_>) -> Result<(), Fault> {
        self.limiter.process(io.audio.around(), io.audio.width().max(1), io.out.items());
        Ok(())
    }

    fn finish(&mut self, _: LimiterIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("largest_reduction_db", (-linear_to_db(self.limiter.smallest)).max(0.0).into())])
    }

    fn retune(&mut self, new: &LimiterParams) -> Retune {
        if ahead(new, self.rate) != self.limiter.ahead {
            return Retune::Rebuild;
        }
        self.limiter.ceiling = db_to_linear(new.ceiling_db);
        self.limiter.recovery = recovery(new.release * self.rate.as_f64());
        Retune::Done
    }

    archive_state!(limiter);

    fn trial(rng: &mut Rng) -> (LimiterParams, MemoryFiles) {
        let params = LimiterParams {
            ceiling_db: rng.between(-30.0, 0.0),
            attack: rng.between(0.0, 0.05),
            release: rng.between(0.001, 0.2),
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;

    fn limit(p: LimiterParams, channels: u16, audio: Vec<f32>) -> Vec<f32> {
        let standalone = Standalone::new::<Limiter>(p);
        let standalone = standalone.input(LimiterPorts::audio, Rate::hz(1000), Channels(channels), audio);
        standalone.run().unwrap().stream(LimiterPorts::out)
    }

    fn params(attack: f64) -> LimiterParams {
        LimiterParams { ceiling_db: db(0.5), attack, release: 0.02 }
    }

    fn db(linear: f64) -> f64 {
        linear_to_db(linear)
    }

    #[test]
    fn what_is_within_the_ceiling_has_the_same_bits() {
        let mut rng = Rng::new(1);
        let audio: Vec<f32> = (0..500).map(|_| rng.between(-0.49, 0.49) as f32).collect();
        assert_eq!(limit(params(0.01), 2, audio.clone()), audio);
    }

    #[test]
    fn no_sample_exceeds_the_ceiling_and_the_gain_never_jumps() {
        let mut rng = Rng::new(2);
        for attack in [0.0, 0.005, 0.03] {
            let loud = |k: usize| if k / 300 % 2 == 1 { 30.0 } else { 0.4 };
            let audio: Vec<f32> = (0..3000).map(|k| (rng.between(-1.0, 1.0) * loud(k)) as f32).collect();
            let out = limit(params(attack), 1, audio.clone());
            assert!(out.iter().all(|x| x.abs() <= 0.5 + 1e-6), "{attack}");
            assert!(out.iter().any(|x| x.abs() > 0.4));
            let gains: Vec<f32> = audio.iter().zip(&out).map(|(x, y)| y / x).collect();
            let fall = gains.windows(2).map(|w| w[0] - w[1]).fold(0.0, f32::max);
            // The mean over `attack` of gains between 0 and 1.
            let steepest = 1.0 / (attack * 1000.0 + 1.0) + 1e-4;
            assert!(f64::from(fall) <= steepest, "{attack}: {fall}");
        }
    }

    /// The definition: for each frame the minimum ahead, the recovery, and the mean, each by itself.
    #[test]
    fn the_gain_is_the_mean_of_the_minima_ahead() {
        let (ahead, release) = (7, 20.0_f64);
        let mut rng = Rng::new(3);
        let audio: Vec<f32> = (0..400).map(|_| rng.between(-2.0, 2.0).powi(3) as f32).collect();
        let allowed: Vec<f64> = audio.iter().map(|x| (0.5 / f64::from(x.abs())).min(1.0)).collect();
        let mut gain = 1.0_f64;
        let mut gains = vec![1.0; ahead];
        for k in 0..audio.len() {
            let end = (k + ahead + 1).min(audio.len());
            let smallest = allowed[k..end].iter().copied().fold(1.0, f64::min);
            gain = smallest.min(gain + (1.0 - gain) * (1.0 - (-1.0 / release).exp()));
            gains.push(gain);
        }
        let out = limit(params(0.007), 1, audio.clone());
        for (k, y) in out.iter().enumerate() {
            let mean = gains[k..=k + ahead].iter().sum::<f64>() / (ahead + 1) as f64;
            let expected = (f64::from(audio[k]) * mean).clamp(-0.5, 0.5);
            assert!((f64::from(*y) - expected).abs() < 1e-5, "{k}: {y} for {expected}");
        }
    }

    #[test]
    fn channels_share_a_gain() {
        let mut audio = vec![0.1; 200];
        audio[100] = 5.0;
        let out = limit(params(0.01), 2, audio);
        assert!((out[100] - 0.5).abs() < 1e-6 && (out[101] - 0.01).abs() < 1e-6, "{:?}", &out[100..102]);
    }
}
