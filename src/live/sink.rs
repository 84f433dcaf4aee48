//! Where the sound of a graph is picked up for the device.

use foley_nodes::core::buffer::StreamBuffer;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::stage::Cx;
use foley_nodes::dsp::Dropout;
use std::any::Any;

/// Keeps the samples of one window until the device takes them.
pub struct Sink {
    channels: usize,
    block: Vec<f32>,
    /// First frame and frames in the block.
    filled: Option<(usize, usize)>,
    bridge: Dropout,
}

impl Sink {
    /// For windows of `quantum` frames; `ramp` frames from sound to silence where none comes.
    #[must_use]
    pub fn new(channels: usize, quantum: usize, ramp: usize) -> Self {
        let bridge = Dropout::new(channels, ramp);
        Self { channels, block: vec![0.0; channels * quantum], filled: None, bridge }
    }

    /// What comes next is another piece.
    pub fn cut(&mut self) {
        self.bridge.cut();
    }

    /// Adds the window to `out`: mono to all channels, more channels as they come, and those too many to the last.
    ///
    /// # Shapes
    /// `out`: frames of `channels` samples, as many as the quantum has.
    pub fn add_to(&mut self, out: &mut [f32], channels: usize) {
        let width = self.channels;
        let (at, frames) = self.filled.take().unwrap_or((0, 0));
        let (before, rest) = self.block.split_at_mut(at * width);
        let (sound, after) = rest.split_at_mut(frames * width);
        self.bridge.gap(before);
        if frames > 0 {
            self.bridge.sound(sound);
        }
        if before.is_empty() {
            self.bridge.gap(after);
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

impl DynNode for Sink {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        let Self { channels, block, filled, .. } = self;
        *filled = cx
            .raw_input(0, |buffer, span| {
                let frames = ((span.to - span.from).max(0) as usize).min(block.len() / *channels);
                let buffer = buffer.typed::<StreamBuffer<f32>>()?;
                // What begins within the window stands at its end, what ends at its beginning.
                let at = if span.first { block.len() / *channels - frames } else { 0 };
                let place = at * *channels..(at + frames) * *channels;
                block[place].copy_from_slice(buffer.view(span.to - frames as i64, span.to));
                Some((at, frames))
            })
            .flatten();
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}
