//! A whole recording, averaged to one channel while it streams in.

use crate::core::fault::Reject;
use crate::core::ports::In;
use crate::core::shape::Incoming;
use crate::impl_state;

/// A whole recording, mono.
pub(super) struct Take {
    pub samples: Vec<f32>,
    length: usize,
    /// One of so many samples is kept.
    pub step: usize,
}
impl_state!(Take { samples });

/// Longest recording, in samples: half an hour at 192 kHz.
const LONGEST: i64 = 1800 * 192_000;

impl Take {
    pub fn new(audio: &Incoming<f32>, step: usize) -> Self {
        let length = audio.items().unwrap_or(0).clamp(0, LONGEST) as usize;
        Self { samples: Vec::with_capacity(length.div_ceil(step)), length, step }
    }

    /// Adds a window, without what stands after the end of the recording.
    pub fn add(&mut self, audio: &In<'_, f32>) {
        let (width, first) = (audio.width().max(1), audio.first().max(0) as usize);
        let left = self.length.saturating_sub(first);
        let mean = |frame: &[f32]| frame.iter().sum::<f32>() / width as f32;
        let frames = audio.items().chunks_exact(width).take(left);
        let next = first.next_multiple_of(self.step) - first;
        self.samples.extend(frames.skip(next).step_by(self.step).map(mean));
    }
}

pub(super) fn check_length(port: &str, audio: &Incoming<f32>) -> Result<(), Reject> {
    match audio.items() {
        Some(samples) if samples <= LONGEST => Ok(()),
        found => {
            let length = found.map_or("does not end".into(), |n| format!("has {n} samples"));
            let message = format!("`{port}` {length}; a recording of at most {LONGEST} samples is needed");
            Err(Reject::new("F075", message).at(port).help("give a recorded file, or cut the stream"))
        }
    }
}

/// Refuses a recording of fewer samples than the least that can be measured.
pub(super) fn check_enough(port: &str, audio: &Incoming<f32>, least: usize, why: &str) -> Result<(), Reject> {
    let found = audio.items().unwrap_or(i64::MAX);
    if found >= least as i64 {
        return Ok(());
    }
    let message = format!("`{port}` has {found} samples; {why} take {least}");
    Err(Reject::new("F077", message).at(port).help("give a longer recording, or a shorter `clip`"))
}
