//! The output of a graph to the device.

use foley_nodes::core::buffer::StreamBuffer;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::stage::Cx;
use foley_nodes::dsp::Dropout;
use std::any::Any;

/// Holds the samples of one window until the callback mixes them.
pub struct DeviceOutput {
    channels: usize,
    block: Vec<f32>,
    /// First frame and number of frames in the block.
    filled: Option<(usize, usize)>,
    dropout: Dropout,
}

impl DeviceOutput {
    /// An output for windows of `quantum` frames; it fades out in `ramp` frames when a window is missing.
    #[must_use]
    pub fn new(channels: usize, quantum: usize, ramp: usize) -> Self {
        let dropout = Dropout::new(channels, ramp);
        Self { channels, block: vec![0.0; channels * quantum], filled: None, dropout }
    }

    /// Marks a discontinuity before the next window, which is smoothed.
    pub fn mark_discontinuity(&mut self) {
        self.dropout.cut();
    }

    /// Adds the window to `out`: mono to all channels, others channel by channel, and excess channels to the last.
    ///
    /// # Shapes
    /// `out`: one window of `channels` interleaved samples per frame.
    pub fn add_to(&mut self, out: &mut [f32], channels: usize) {
        let width = self.channels;
        let (first, frames) = self.filled.take().unwrap_or((0, 0));
        let (before, rest) = self.block.split_at_mut(first * width);
        let (sound, after) = rest.split_at_mut(frames * width);
        self.dropout.gap(before);
        if frames > 0 {
            self.dropout.sound(sound);
        }
        if before.is_empty() {
            self.dropout.gap(after);
        } else {
            after.fill(0.0);
        }
        for (out, frame) in out.chunks_exact_mut(channels.max(1)).zip(self.block.chunks_exact(width.max(1))) {
            if let [x] = frame {
                out.iter_mut().for_each(|out| *out += x);
            } else {
                let last = out.len() - 1;
                (0..).zip(frame).for_each(|(k, x): (usize, &f32)| out[k.min(last)] += x);
            }
        }
    }
}

impl DynNode for DeviceOutput {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        let Self { channels, block, filled, .. } = self;
        *filled = cx
            .raw_input(0, |buffer, span| {
                let frames = ((span.to - span.from).max(0) as usize).min(block.len() / *channels);
                let buffer = buffer.typed::<StreamBuffer<f32>>()?;
                // A stream that begins within the window fills its end, one that ends its beginning.
                let first = if span.first { block.len() / *channels - frames } else { 0 };
                let range = first * *channels..(first + frames) * *channels;
                block[range].copy_from_slice(buffer.view(span.to - frames as i64, span.to));
                Some((first, frames))
            })
            .flatten();
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}
