//! The node `LevelMeter`.

use super::meter::LevelMeter;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::{params, ports};

/// Largest number of channels: each takes two channels of the output.
const MAX_CHANNELS: u16 = 1 << 14;
/// Longest frame, in s: the node looks ahead by a whole frame.
const MAX_FRAME: f64 = 60.0;

params! {
    /// Measures peak and root mean square of each frame of a sound or of a force.
    ///
    /// Frame `k` covers the samples from `k / rate` seconds to the next frame. At the rate of a physics engine, the output is the strength
    /// of each of its steps. Each input channel has two output channels: peak and root mean square. A `.csv` tap lists
    /// them with their times.
    ///
    /// # Source
    /// The intensity that Picard, Tsingos and Faure plot with their contacts, "Audio texture synthesis for complex contact
    /// interactions" (VRIPHYS 2008).
    pub struct LevelMeterParams {
        /// Frames per second.
        rate: Rate = Rate::hz(60);
    }
}
ports! {
    /// Ports of `LevelMeter`.
    pub struct LevelMeterPorts / LevelMeterIo {
        in {
            /// The signal to measure.
            audio: Stream<f32>,
        }
        out {
            /// Peak and root mean square of each channel, one item per frame.
            levels: Stream<f32>,
        }
    }
}

/// The node `LevelMeter`.
#[derive(Debug)]
pub struct LevelMeterNode {
    rate: Rate,
}

/// Returns the range of samples at `rate` in frame `frame`: the first, and the one after the last.
fn samples(rate: Rate, frames: Rate, frame: i64) -> [i64; 2] {
    [frame, frame + 1].map(|k| rate.first_at(frames.tick(k)))
}

impl Node for LevelMeterNode {
    type Params = LevelMeterParams;
    type Ports = LevelMeterPorts;
    const NAME: &'static str = "LevelMeter";
    const CLASS: Class = Class::Audio;

    fn shape(p: &LevelMeterParams, s: &mut Shape<'_, '_, LevelMeterPorts>) -> Result<(), Reject> {
        let audio = s.input(LevelMeterPorts::audio);
        let Channels(channels) = audio.format;
        if p.rate.as_f64() > audio.rate.as_f64() {
            let message = format!("`rate` is {}, above that of the audio, {}", p.rate, audio.rate);
            s.wrong(Reject::new("F051", message).at("rate").help("a frame needs at least one sample"));
        }
        if channels > MAX_CHANNELS {
            let message = format!("`audio` has {channels} channels; at most {MAX_CHANNELS} are measured");
            s.wrong(Reject::new("F046", message).at("audio"));
        }
        if p.rate.as_f64() * MAX_FRAME < 1.0 {
            let message = format!("a frame at {} lasts longer than {MAX_FRAME} s", p.rate);
            return Err(Reject::new("F051", message).at("rate"));
        }
        // A frame may begin between two samples.
        let longest = audio.rate.as_f64() / p.rate.as_f64();
        let integer = longest.fract() == 0.0;
        s.lookaround(LevelMeterPorts::audio, 0, longest.ceil() as usize - usize::from(integer));
        s.output(LevelMeterPorts::levels, p.rate, Channels(2 * channels));
        Ok(())
    }

    fn build(_: &LevelMeterParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { rate: cx.input(LevelMeterPorts::audio).rate })
    }

    fn run(&mut self, mut io: LevelMeterIo<'_>) -> Result<(), Fault> {
        let (frames, mut frame) = (io.levels.rate(), io.levels.first());
        let (first, channels) = (io.audio.first(), io.audio.width().max(1));
        for out in io.levels.items().chunks_exact_mut(2 * channels) {
            let span =
                samples(self.rate, frames, frame).map(|n| usize::try_from(n - first).unwrap_or(0) * channels);
            let covered = io.audio.around().get(span[0]..span[1]).unwrap_or_default();
            for (channel, out) in out.chunks_exact_mut(2).enumerate() {
                let mut meter = LevelMeter::default();
                meter.process_each(covered.iter().skip(channel).step_by(channels));
                let level = meter.level();
                (out[0], out[1]) = (level.peak, level.rms as f32);
            }
            frame += 1;
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (LevelMeterParams, MemoryFiles) {
        let rate = Rate::new(1 + rng.below(600) as u64, 1 + rng.below(7) as u64);
        (LevelMeterParams { rate: rate.unwrap_or(LevelMeterParams::trial(rng).rate) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;

    fn levels(frames: Rate, rate: Rate, channels: u16, audio: Vec<f32>) -> Vec<f32> {
        let standalone = Standalone::new::<LevelMeterNode>(LevelMeterParams { rate: frames });
        let standalone = standalone.input(LevelMeterPorts::audio, rate, Channels(channels), audio);
        standalone.run().unwrap().stream(LevelMeterPorts::levels)
    }

    #[test]
    fn each_frame_has_the_peak_and_the_root_mean_square_of_its_samples() {
        // Two channels, four samples to a frame.
        let audio = vec![0.5, 1.0, -0.5, 0.0, 0.5, 0.0, -0.5, 0.0, 0.0, 2.0, 0.0, -2.0, -3.0, 2.0, 0.0, 2.0];
        let found = levels(Rate::hz(250), Rate::hz(1000), 2, audio);
        assert_eq!(found, [0.5, 0.5, 1.0, 0.5, 3.0, 1.5, 2.0, 2.0]);
    }

    #[test]
    fn every_sample_counts_in_exactly_one_frame() {
        // 44,100 Hz and 24000/1001 frames: 1839.3 samples each.
        let (rate, frames) = (Rate::hz(44_100), Rate::new(24_000, 1001).unwrap());
        let audio: Vec<f32> = (0..44_100).map(|n| ((n * 37) % 101) as f32 * 0.01).collect();
        let found = levels(frames, rate, 1, audio.clone());
        assert_eq!(found.len(), 2 * 24);
        let mut power = 0.0;
        for (k, level) in found.chunks_exact(2).enumerate() {
            let [from, to] = samples(rate, frames, k as i64);
            assert!((1839..=1840).contains(&(to - from)));
            power += f64::from(level[1]).powi(2) * (to - from) as f64;
        }
        let expected: f64 = audio.iter().map(|x| f64::from(*x).powi(2)).sum();
        assert!((power / expected - 1.0).abs() < 1e-6, "{power} {expected}");
    }

    #[test]
    fn frames_shorter_than_a_sample_are_refused() {
        let standalone = Standalone::new::<LevelMeterNode>(LevelMeterParams { rate: Rate::hz(2000) });
        let standalone = standalone.input(LevelMeterPorts::audio, Rate::hz(1000), Channels(1), vec![0.0; 10]);
        let reject = standalone.shape().unwrap_err();
        assert!(reject.code == "F051" && reject.message.contains("1000"), "{reject}");
    }
}
