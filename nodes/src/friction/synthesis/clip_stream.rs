//! Overlap-add of clips to a signal that can be read in windows of any length.

use std::ops::RangeInclusive;

use super::noise::{ClipInput, IftNoise, NoiseError};
use super::receiver::{Mono, Receiver};
use crate::archive_state;
use crate::core::state::Stateful;

/// Overlap-add of clips that overlap by half.
///
/// Output segment `[k hop, (k + 1) hop)` is the second half of clip `k` plus the first half of clip `k + 1`, so the
/// bits do not depend on the lengths of windows. Reading in order renders every clip once. Reading from another
/// position renders the clips there.
///
/// # Complexity
/// One clip per hop and O(1) per sample; nothing is allocated after `new`.
pub struct ClipStream<R = Mono> {
    noise: IftNoise<R>,
    /// The last two rendered clips, each with its index if it is valid.
    clips: [(Option<u64>, Vec<f32>); 2],
}

impl<R: Receiver> Stateful for ClipStream<R> {
    archive_state!(noise, clips);
}

impl<R: Receiver> ClipStream<R> {
    /// Creates a stream of the clips of `noise`.
    #[must_use]
    pub fn new(noise: IftNoise<R>) -> Self {
        let len = noise.clip_len() * noise.channels();
        Self { noise, clips: [(None, vec![0.0; len]), (None, vec![0.0; len])] }
    }

    /// Returns the noise.
    #[must_use]
    pub fn noise(&self) -> &IftNoise<R> {
        &self.noise
    }

    /// Returns the noise, so that its receiver can be moved between windows.
    pub fn noise_mut(&mut self) -> &mut IftNoise<R> {
        &mut self.noise
    }

    /// Returns the number of samples from one clip to the next.
    #[must_use]
    pub fn hop(&self) -> usize {
        self.noise.hop()
    }

    /// Returns the clips that overlap samples `[from, from + len)`, `len` at least 1.
    #[must_use]
    pub fn clips_touching(&self, from: u64, len: usize) -> RangeInclusive<u64> {
        let hop = self.hop() as u64;
        from / hop..=(from + (len as u64).max(1) - 1) / hop + 1
    }

    /// Discards rendered clips, after a change of the input.
    pub fn reset(&mut self) {
        self.clips.iter_mut().for_each(|c| c.0 = None);
    }

    /// Writes samples from sample `from`. `input` returns the motion at the centre of a clip.
    ///
    /// # Shapes
    /// `out: [channels * T]`, planar.
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
        let mut written = 0;
        while written < len {
            let position = from + written as u64;
            let count = ((hop - position % hop) as usize).min(len - written);
            for clip in [position / hop, position / hop + 1] {
                if !self.is_prepared(clip) {
                    self.prepare(clip, input(clip))?;
                }
            }
            for channel in 0..channels {
                let start = channel * len + written;
                self.overlap_add(channel, position, &mut out[start..start + count]);
            }
            written += count;
        }
        Ok(())
    }

    /// Returns true if clip `clip` is one of the two rendered clips.
    #[must_use]
    pub fn is_prepared(&self, clip: u64) -> bool {
        self.clips[slot(clip)].0 == Some(clip)
    }

    /// Renders clip `clip`, in place of the clip before the previous one. For callers that move the receiver between
    /// clips.
    ///
    /// # Errors
    /// As [`IftNoise::clip`].
    pub fn prepare(&mut self, clip: u64, input: ClipInput<'_>) -> Result<(), NoiseError> {
        let (index, samples) = &mut self.clips[slot(clip)];
        *index = None;
        self.noise.clip(clip, input, samples)?;
        *index = Some(clip);
        Ok(())
    }

    /// Writes one channel from sample `from`, at most to the end of its segment, from prepared clips. Other clips are
    /// silent.
    pub fn overlap_add(&self, channel: usize, from: u64, out: &mut [f32]) {
        let hop = self.hop();
        let (clip, offset) = (from / hop as u64, (from % hop as u64) as usize);
        let start = channel * 2 * hop + offset;
        out.fill(0.0);
        for (clip, start) in [(clip, start + hop), (clip + 1, start)] {
            if self.is_prepared(clip) {
                let samples = self.clips[slot(clip)].1[start..].iter().take(hop - offset);
                out.iter_mut().zip(samples).for_each(|(out, x)| *out += x);
            }
        }
    }
}

/// Returns the slot of a clip. Neighbouring clips have different slots.
fn slot(clip: u64) -> usize {
    (clip % 2) as usize
}
