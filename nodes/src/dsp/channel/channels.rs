//! The node `Channels` and its channel map.

use crate::core::fault::Reject;
use crate::core::item::Channels;
use crate::core::node::Each;
use crate::core::random::Rng;
use crate::dsp::DspError;
use crate::params;
/// A choice of channels: output channel `i` is input channel `pick[i]`. A channel may be picked several times.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelMap {
    inputs: usize,
    pick: Vec<usize>,
}

impl ChannelMap {
    /// Creates a map from `inputs` channels.
    ///
    /// # Errors
    /// Channels that do not exist, and an empty list.
    pub fn new(inputs: usize, pick: &[usize]) -> Result<Self, DspError> {
        DspError::check(!pick.is_empty(), "channels", 0.0, "at least 1")?;
        for &channel in pick {
            DspError::check(
                channel < inputs,
                "channel",
                channel as f64,
                "below the input's number of channels",
            )?;
        }
        Ok(Self { inputs, pick: pick.to_vec() })
    }

    /// Returns the number of output channels.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.pick.len()
    }

    /// Maps interleaved frames, as many as both slices hold.
    pub fn process(&self, input: &[f32], out: &mut [f32]) {
        for (from, to) in input.chunks_exact(self.inputs).zip(out.chunks_exact_mut(self.pick.len())) {
            for (x, &channel) in to.iter_mut().zip(&self.pick) {
                *x = from[channel];
            }
        }
    }
}
params! {
    /// Picks, reorders and duplicates channels.
    ///
    /// `Channels(audio: "x", map: [1, 0])` swaps left and right; `map: [0, 0]` copies mono to stereo.
    pub struct ChannelsParams {
        /// Input channel of each output channel, counted from 0.
        map: Vec<usize>, unit "channel", range 0..=255_usize;
    }
}

/// The node `Channels`.
#[derive(Debug)]
pub struct ChannelsNode(ChannelMap);

impl Each for ChannelsNode {
    type Params = ChannelsParams;
    type In = f32;
    type Out = f32;
    const NAME: &'static str = "Channels";
    const INPUT: (&'static str, &'static str) = ("audio", "Audio with any number of channels.");
    const OUTPUT: (&'static str, &'static str) = ("out", "One channel for each number of the map.");

    fn format(p: &ChannelsParams, &Channels(inputs): &Channels) -> Result<Channels, Reject> {
        let map = ChannelMap::new(inputs.into(), &p.map).map_err(|e| Reject::from(e).at("map"))?;
        let outputs = u16::try_from(map.outputs()).ok().filter(|n| *n <= 256);
        outputs.map(Channels).ok_or_else(|| Reject::new("F051", "`map` has more than 256 channels").at("map"))
    }

    fn new(p: &ChannelsParams, &Channels(inputs): &Channels) -> Self {
        Self(ChannelMap::new(inputs.into(), &p.map).expect("`format` has accepted the map"))
    }

    fn each(&mut self, item: &[f32], out: &mut [f32]) {
        self.0.process(item, out);
    }

    fn trial(rng: &mut Rng) -> ChannelsParams {
        ChannelsParams { map: (0..=rng.below(4)).map(|_| rng.below(2)).collect() }
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
    fn channels_are_picked_and_copied() {
        let map = ChannelMap::new(3, &[2, 0, 2, 1]).unwrap();
        let mut out = [0.0; 8];
        map.process(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &mut out);
        assert_eq!(out, [3.0, 1.0, 3.0, 2.0, 6.0, 4.0, 6.0, 5.0]);
        assert_eq!(ChannelMap::new(2, &[2]).unwrap_err().what, "channel");
        assert!(ChannelMap::new(2, &[]).is_err());
    }

    #[test]
    fn the_node_picks_channels() {
        let port = Port::<Stream<f32>>::new(0);
        let picked = Standalone::new::<PerItem<ChannelsNode>>(ChannelsParams { map: vec![1, 0, 1] });
        let run = picked.input(port, Rate::hz(10), Channels(2), vec![1.0, 2.0, 3.0, 4.0]).run().unwrap();
        assert_eq!(run.stream(Port::<Stream<f32>>::new(0)), [2.0, 1.0, 2.0, 4.0, 3.0, 4.0]);
    }

    #[test]
    fn a_map_to_a_missing_channel_is_refused() {
        let reject = ChannelsNode::format(&ChannelsParams { map: vec![0, 2] }, &Channels(2)).unwrap_err();
        assert_eq!(reject.field.as_deref(), Some("map"));
    }
}
