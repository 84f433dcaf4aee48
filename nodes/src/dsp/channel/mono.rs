//! The node `Mono`; conversions to and from mono.

use crate::core::fault::Reject;
use crate::core::item::Channels;
use crate::core::node::Each;
use crate::params;
/// Writes the mean of the channels, which cannot clip.
pub fn channel_mean(input: &[f32], channels: usize, out: &mut [f32]) {
    for (frame, x) in input.chunks_exact(channels.max(1)).zip(out) {
        *x = (frame.iter().map(|&x| f64::from(x)).sum::<f64>() / frame.len() as f64) as f32;
    }
}

/// Copies mono to every channel.
pub fn channel_copy(input: &[f32], out: &mut [f32], channels: usize) {
    for (&x, frame) in input.iter().zip(out.chunks_exact_mut(channels.max(1))) {
        frame.fill(x);
    }
}
params! {
    /// Mixes all channels to one by their mean, which cannot clip.
    pub struct MonoParams {}
}

/// The node `Mono`.
#[derive(Debug)]
pub struct MonoNode(usize);

impl Each for MonoNode {
    type Params = MonoParams;
    type In = f32;
    type Out = f32;
    const NAME: &'static str = "Mono";
    const INPUT: (&'static str, &'static str) = ("audio", "Audio with any number of channels.");
    const OUTPUT: (&'static str, &'static str) = ("out", "Mono audio.");

    fn format(_: &MonoParams, _: &Channels) -> Result<Channels, Reject> {
        Ok(Channels(1))
    }

    fn new(_: &MonoParams, &Channels(inputs): &Channels) -> Self {
        Self(inputs.into())
    }

    fn each(&mut self, item: &[f32], out: &mut [f32]) {
        channel_mean(item, self.0, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::node::PerItem;
    use crate::core::ports::{Port, Stream};
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    #[test]
    fn channels_are_averaged_and_copied() {
        let mut mono = [0.0; 2];
        channel_mean(&[1.0, -1.0, 0.5, 1.5], 2, &mut mono);
        assert_eq!(mono, [0.0, 1.0]);
        let mut quad = [0.0; 8];
        channel_copy(&mono, &mut quad, 4);
        assert_eq!(quad, [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn the_node_mixes_channels() {
        let port = Port::<Stream<f32>>::new(0);
        let mono = Standalone::new::<PerItem<MonoNode>>(MonoParams {});
        let run = mono.input(port, Rate::hz(10), Channels(2), vec![1.0, 2.0, 3.0, 4.0]).run().unwrap();
        assert_eq!(run.stream(Port::<Stream<f32>>::new(0)), [1.5, 3.5]);
    }
}
