//! The node `Delay`; delay lines by integer and by fractional numbers of samples.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::dsp::DspError;
use crate::dsp::nearest_items;
use crate::{params, ports};

/// Delays interleaved channels by an integer number of frames; the output begins with silence.
#[derive(Clone, Debug)]
pub struct Delay {
    line: Vec<f32>,
    index: usize,
}

impl Delay {
    /// Creates a silent line. A delay of 0 leaves the samples unchanged.
    #[must_use]
    pub fn new(frames: usize, channels: usize) -> Self {
        Self { line: vec![0.0; frames * channels], index: 0 }
    }

    /// Clears the line.
    pub fn reset(&mut self) {
        self.line.fill(0.0);
        self.index = 0;
    }

    /// Delays samples in place.
    pub fn process(&mut self, samples: &mut [f32]) {
        if self.line.is_empty() {
            return;
        }
        for x in samples {
            std::mem::swap(x, &mut self.line[self.index]);
            self.index += 1;
            if self.index == self.line.len() {
                self.index = 0;
            }
        }
    }
}

/// Delays interleaved channels by a fractional number of frames, by 4-point Lagrange interpolation.
///
/// The delay may change between calls, for Doppler shifts. The magnitude error at a delay of half a sample is -0.46 dB at 0.2 of the
/// rate and -0.031 dB at 0.1; integer delays are exact.
///
/// # Source
/// Laakso, Valimaki, Karjalainen and Laine, "Splitting the Unit Delay" (IEEE SPM 13(1), 1996), section 3.
#[derive(Clone, Debug)]
pub struct FractionalDelay {
    line: Vec<f32>,
    frames: usize,
    channels: usize,
    index: usize,
    delay: f64,
}

impl FractionalDelay {
    /// Creates a silent line for delays of 1 to `max_delay` frames, set to `delay`.
    ///
    /// # Errors
    /// Delays outside that range, no channels.
    pub fn new(delay: f64, max_delay: usize, channels: usize) -> Result<Self, DspError> {
        DspError::check(channels > 0, "channels", channels as f64, "at least 1")?;
        let frames = max_delay + 3;
        let mut line = Self { line: vec![0.0; frames * channels], frames, channels, index: 0, delay: 1.0 };
        line.set_delay(delay)?;
        Ok(line)
    }

    /// Changes the delay from the next frame on.
    ///
    /// # Errors
    /// Delays below 1 frame (the interpolation needs a later sample) or above the maximum.
    pub fn set_delay(&mut self, delay: f64) -> Result<(), DspError> {
        let max_delay = (self.frames - 3) as f64;
        DspError::check(
            (1.0..=max_delay).contains(&delay),
            "delay",
            delay,
            "1 to the maximum delay, in frames",
        )?;
        self.delay = delay;
        Ok(())
    }

    /// Clears the line.
    pub fn reset(&mut self) {
        self.line.fill(0.0);
        self.index = 0;
    }

    /// Delays samples in place.
    pub fn process(&mut self, samples: &mut [f32]) {
        let whole = self.delay.floor();
        let weights = lagrange(self.delay - whole);
        for frame in samples.chunks_exact_mut(self.channels) {
            self.line[self.index * self.channels..][..self.channels].copy_from_slice(frame);
            for (channel, x) in frame.iter_mut().enumerate() {
                let tap = |k: usize| {
                    let offset = whole as usize - 1 + k;
                    let i = (self.index + self.frames - offset) % self.frames;
                    f64::from(self.line[i * self.channels + channel])
                };
                *x = (0..4).map(|k| weights[k] * tap(k)).sum::<f64>() as f32;
            }
            self.index = (self.index + 1) % self.frames;
        }
    }
}

/// Returns the weights of the samples at delays -1, 0, 1 and 2 for a fraction in [0, 1).
fn lagrange(f: f64) -> [f64; 4] {
    [
        -f * (f - 1.0) * (f - 2.0) / 6.0,
        (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0,
        -(f + 1.0) * f * (f - 2.0) / 2.0,
        (f + 1.0) * f * (f - 1.0) / 6.0,
    ]
}

params! {
    /// Delays audio by the number of samples nearest to a time. The samples stay the same bit for bit.
    ///
    /// The output ends later than the input by the delay.
    pub struct DelayParams {
        /// Delay.
        seconds: f64 = 0.1, unit "s", range 0.0..=60.0;
    }
}
ports! {
    /// Ports of `Delay`.
    pub struct DelayPorts / DelayIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
        }
        out {
            /// The delayed audio.
            out: Stream<f32>,
        }
    }
}

/// The node `Delay`. It reads the history in the buffer of its input, which the plan counts and a reload preserves.
#[derive(Debug)]
pub struct DelayNode;

impl Node for DelayNode {
    type Params = DelayParams;
    type Ports = DelayPorts;
    const NAME: &'static str = "Delay";
    const CLASS: Class = Class::Audio;

    fn shape(p: &DelayParams, s: &mut Shape<'_, '_, DelayPorts>) -> Result<(), Reject> {
        let audio = s.input(DelayPorts::audio);
        let frames = nearest_items(audio.rate, p.seconds);
        s.lookaround(DelayPorts::audio, frames, 0);
        s.tail(audio.rate.span(frames));
        s.output(DelayPorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(_: &DelayParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self)
    }

    fn run(&mut self, mut io: DelayIo<'_>) -> Result<(), Fault> {
        let out = io.out.items();
        out.copy_from_slice(&io.audio.around()[..out.len()]);
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (DelayParams, MemoryFiles) {
        (DelayParams { seconds: rng.between(0.0, 0.3) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    use crate::dsp::testing::{assert_block_invariant, signal};

    #[test]
    fn a_whole_delay_moves_every_bit() {
        let x = signal(50, 2);
        for frames in [0, 1, 13, 60] {
            let mut y = x.clone();
            Delay::new(frames, 2).process(&mut y);
            let silent = (2 * frames).min(y.len());
            assert!(y[..silent].iter().all(|&x| x == 0.0));
            assert_eq!(y[silent..], x[..x.len() - silent]);
        }
    }

    #[test]
    fn a_fractional_delay_is_exact_for_cubics_and_whole_delays() {
        let cubic = |t: f64| 1.0 + 0.1 * t - 0.02 * t * t + 0.001 * t * t * t;
        let x: Vec<f32> = (0..30).map(|n| cubic(f64::from(n)) as f32).collect();
        for delay in [1.0, 1.25, 2.5, 4.0, 4.999] {
            let mut y = x.clone();
            FractionalDelay::new(delay, 5, 1).unwrap().process(&mut y);
            for (n, &y) in y.iter().enumerate().skip(8) {
                assert!((f64::from(y) - cubic(n as f64 - delay)).abs() < 1e-5, "{delay} {n}");
            }
        }
        let mut y = signal(40, 2);
        let mut whole = y.clone();
        FractionalDelay::new(3.0, 9, 2).unwrap().process(&mut y);
        Delay::new(3, 2).process(&mut whole);
        assert_eq!(y, whole);
        assert_eq!(FractionalDelay::new(0.5, 5, 1).unwrap_err().what, "delay");
    }

    #[test]
    fn the_stated_magnitude_errors_hold() {
        for (f, db) in [(0.1, -0.031), (0.2, -0.46)] {
            let w = std::f64::consts::TAU * f;
            let h = lagrange(0.5);
            let re: f64 = (0..4).map(|k| h[k] * (w * k as f64).cos()).sum();
            let im: f64 = (0..4).map(|k| h[k] * (w * k as f64).sin()).sum();
            let found = 20.0 * re.hypot(im).log10();
            assert!((found / db - 1.0).abs() < 0.02, "{f}: {found}");
        }
    }

    #[test]
    fn blocks_do_not_change_a_bit() {
        assert_block_invariant(&signal(2500, 3), 3, || Delay::new(101, 3), |d, _, x| d.process(x));
        let new = || FractionalDelay::new(17.3, 20, 3).unwrap();
        assert_block_invariant(&signal(2500, 3), 3, new, |d, _, x| d.process(x));
    }

    #[test]
    fn the_node_delays_and_ends_later_by_the_delay() {
        let standalone = Standalone::new::<DelayNode>(DelayParams { seconds: 0.031 });
        let audio = vec![1.0, 2.0, 3.0, 4.0];
        let run = standalone.input(DelayPorts::audio, Rate::hz(100), Channels(2), audio).run().unwrap();
        assert_eq!(run.stream(DelayPorts::out), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0]);
    }
}
