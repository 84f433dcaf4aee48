//! Choosing, mixing and copying channels.

use super::DspError;

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
