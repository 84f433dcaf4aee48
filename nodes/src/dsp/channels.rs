//! Choosing, mixing and copying channels.

use super::DspError;
use crate::core::fault::Reject;
use crate::core::item::Channels;
use crate::core::node::Each;
use crate::core::random::Rng;
use crate::params;

/// Picks and reorders channels: output channel `i` is input channel `pick[i]`; one may be picked several times.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelMap {
    inputs: usize,
    pick: Vec<usize>,
}

impl ChannelMap {
    /// A map from `inputs` channels.
    ///
    /// # Errors
    /// Picks that do not exist, and an empty pick.
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

    /// Number of output channels.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.pick.len()
    }

    /// Maps whole frames; the shorter of the two slices decides.
    pub fn process(&self, input: &[f32], out: &mut [f32]) {
        for (from, to) in input.chunks_exact(self.inputs).zip(out.chunks_exact_mut(self.pick.len())) {
            for (x, &channel) in to.iter_mut().zip(&self.pick) {
                *x = from[channel];
            }
        }
    }
}

/// Mixes to mono by the average of the channels, which cannot clip.
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
    /// Picks, reorders and copies channels.
    ///
    /// `Channels(audio: "x", map: [1, 0])` swaps left and right; `map: [0, 0]` makes mono stereo.
    pub struct ChannelsParams {
        /// For each output channel the input channel it takes, counted from 0.
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

params! {
    /// Mixes all channels to one, by their average, which cannot clip.
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
    fn channels_are_picked_averaged_and_copied() {
        let map = ChannelMap::new(3, &[2, 0, 2, 1]).unwrap();
        let mut out = [0.0; 8];
        map.process(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &mut out);
        assert_eq!(out, [3.0, 1.0, 3.0, 2.0, 6.0, 4.0, 6.0, 5.0]);
        assert_eq!(ChannelMap::new(2, &[2]).unwrap_err().what, "channel");
        assert!(ChannelMap::new(2, &[]).is_err());
        let mut mono = [0.0; 2];
        channel_mean(&[1.0, -1.0, 0.5, 1.5], 2, &mut mono);
        assert_eq!(mono, [0.0, 1.0]);
        let mut quad = [0.0; 8];
        channel_copy(&mono, &mut quad, 4);
        assert_eq!(quad, [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn nodes_pick_and_mix_channels() {
        let (audio, rate) = (vec![1.0, 2.0, 3.0, 4.0], Rate::hz(10));
        let port = Port::<Stream<f32>>::new(0);
        let picked = Standalone::new::<PerItem<ChannelsNode>>(ChannelsParams { map: vec![1, 0, 1] });
        let run = picked.input(Port::<Stream<f32>>::new(0), rate, Channels(2), audio.clone()).run().unwrap();
        assert_eq!(run.stream(port), [2.0, 1.0, 2.0, 4.0, 3.0, 4.0]);
        let mono = Standalone::new::<PerItem<MonoNode>>(MonoParams {});
        let run = mono.input(Port::<Stream<f32>>::new(0), rate, Channels(2), audio).run().unwrap();
        assert_eq!(run.stream(Port::<Stream<f32>>::new(0)), [1.5, 3.5]);
    }

    #[test]
    fn a_map_to_a_channel_that_is_not_there_is_refused() {
        let reject = ChannelsNode::format(&ChannelsParams { map: vec![0, 2] }, &Channels(2)).unwrap_err();
        assert_eq!(reject.field.as_deref(), Some("map"));
    }
}
