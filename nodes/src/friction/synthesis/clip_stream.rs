//! Overlapping clips added up to a signal that can be read in windows of any size.

use std::ops::RangeInclusive;

use super::noise::{ClipInput, IftNoise, NoiseError};
use super::receiver::{Mono, Receiver};
use crate::archive_state;
use crate::core::state::Stateful;

/// Two half-overlapping clips at a time, added to a continuous signal.
///
/// Output segment `[k hop, (k + 1) hop)` is the second half of clip `k` plus the first half of clip `k + 1`, so the bits
/// do not depend on how the signal is cut into windows. Reading in order renders every clip once; reading again from
/// elsewhere renders the clips touched there.
///
/// # Complexity
/// One clip per hop and O(1) per sample; no allocation after `new`.
pub struct ClipStream<R = Mono> {
    noise: IftNoise<R>,
    /// The last two clips rendered, each with its index once it is valid.
    clips: [(Option<u64>, Vec<f32>); 2],
}

impl<R: Receiver> Stateful for ClipStream<R> {
    archive_state!(noise, clips);
}

impl<R: Receiver> ClipStream<R> {
    /// A stream of the clips of `noise`.
    #[must_use]
    pub fn new(noise: IftNoise<R>) -> Self {
        let len = noise.clip_len() * noise.channels();
        Self { noise, clips: [(None, vec![0.0; len]), (None, vec![0.0; len])] }
    }

    /// The synthesiser.
    #[must_use]
    pub fn noise(&self) -> &IftNoise<R> {
        &self.noise
    }

    /// The synthesiser, to move its receiver between windows.
    pub fn noise_mut(&mut self) -> &mut IftNoise<R> {
        &mut self.noise
    }

    /// Samples from clip to clip.
    #[must_use]
    pub fn hop(&self) -> usize {
        self.noise.hop()
    }

    /// Clips that touch samples `[from, from + len)`, `len` at least 1.
    #[must_use]
    pub fn clips_touching(&self, from: u64, len: usize) -> RangeInclusive<u64> {
        let hop = self.hop() as u64;
        from / hop..=(from + (len as u64).max(1) - 1) / hop + 1
    }

    /// Forgets rendered clips, for input that has changed or a jump.
    pub fn reset(&mut self) {
        self.clips.iter_mut().for_each(|c| c.0 = None);
    }

    /// Writes samples from sample `from` on; `input` gives the vertices at the centre of a clip that is needed.
    ///
    /// # Shapes
    /// `out: [channels * T]`, channel after channel.
    ///
    /// # Errors
    /// As [`IftNoise::clip`].
    pub fn fill<'a>(
        &mut self,
        from: u64,
        out: &mut [f32],
        mut input: impl FnMut(u64) -> ClipInput<'a>,
    ) -> Result<(), NoiseError> {
        let (hop, channels) = (self.hop() as u64, self.noise.channels().max(1));
        let len = out.len() / channels;
        let mut done = 0;
        while done < len {
            let at = from + done as u64;
            let count = ((hop - at % hop) as usize).min(len - done);
            for clip in [at / hop, at / hop + 1] {
                if !self.holds(clip) {
                    self.prepare(clip, input(clip))?;
                }
            }
            for channel in 0..channels {
                self.overlap(channel, at, &mut out[channel * len + done..channel * len + done + count]);
            }
            done += count;
        }
        Ok(())
    }

    /// Whether clip `clip` is one of the two that are kept.
    #[must_use]
    pub fn holds(&self, clip: u64) -> bool {
        self.clips[place(clip)].0 == Some(clip)
    }

    /// Renders clip `clip` and keeps it until the next but one; for callers that move the receiver from clip to clip.
    ///
    /// # Errors
    /// As [`IftNoise::clip`].
    pub fn prepare(&mut self, clip: u64, input: ClipInput<'_>) -> Result<(), NoiseError> {
        let (held, samples) = &mut self.clips[place(clip)];
        *held = None;
        self.noise.clip(clip, input, samples)?;
        *held = Some(clip);
        Ok(())
    }

    /// Writes one channel from sample `from` on, at most up to the end of its segment, out of clips that are prepared.
    ///
    /// What is not prepared is silent.
    pub fn overlap(&self, channel: usize, from: u64, out: &mut [f32]) {
        let hop = self.hop();
        let (clip, offset) = (from / hop as u64, (from % hop as u64) as usize);
        let start = channel * 2 * hop + offset;
        out.fill(0.0);
        for (clip, start) in [(clip, start + hop), (clip + 1, start)] {
            if self.holds(clip) {
                let samples = self.clips[place(clip)].1[start..].iter().take(hop - offset);
                out.iter_mut().zip(samples).for_each(|(out, x)| *out += x);
            }
        }
    }
}

/// Place of a clip among the two kept ones: neighbours differ in parity and so never displace each other.
fn place(clip: u64) -> usize {
    (clip % 2) as usize
}
