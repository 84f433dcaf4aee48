//! The output of audio sources: duration, level and channels.

use crate::core::item::Channels;
use crate::core::ports::{Out, Stream};
use crate::core::shape::Build;
use crate::core::time::{Rate, Tick, ticks};
use crate::dsp::Gain;
use crate::dsp::ramp_frames;
use crate::ports;

/// Returns the end of a source that lasts `seconds`; `None` for an endless one.
pub(super) fn ends_after(seconds: Option<f64>) -> Option<Tick> {
    seconds.map(ticks)
}

/// Samples of one channel generated at a time.
const BLOCK: usize = 256;

ports! {
    /// Ports of all sources of audio.
    pub struct SourcePorts / SourceIo {
        in {}
        out {
            /// The generated audio.
            audio: Stream<f32>,
        }
    }
}

/// Interleaves generated channels and applies the level.
#[derive(Debug)]
pub(crate) struct SourceOutput {
    level: Gain,
    block: Vec<f32>,
}

impl SourceOutput {
    pub fn new(level: f64, cx: &Build<'_>) -> Self {
        let out = cx.output(SourcePorts::audio);
        Self::at(level, out.rate, out.format)
    }

    fn at(level: f64, rate: Rate, Channels(channels): Channels) -> Self {
        Self { level: Gain::new(level, ramp_frames(rate), channels.into()), block: vec![0.0; BLOCK] }
    }

    /// Starts a ramp to another level.
    pub fn set_level(&mut self, level: f64) {
        self.level.set_target(level);
    }

    /// Fills a window. `fill(channel, first, block)` generates the samples of one channel from index `first` on.
    pub fn run(&mut self, out: &mut Out<'_, f32>, mut fill: impl FnMut(usize, i64, &mut [f32])) {
        let (mut first, width) = (out.first(), out.width().max(1));
        for frames in out.items().chunks_mut(BLOCK * width) {
            let block = &mut self.block[..frames.len() / width];
            for channel in 0..width {
                fill(channel, first, block);
                for (frame, x) in frames.chunks_exact_mut(width).zip(&*block) {
                    frame[channel] = *x;
                }
            }
            self.level.process(frames);
            first += block.len() as i64;
        }
    }
}
