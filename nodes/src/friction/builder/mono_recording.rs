//! A whole recording, collected from a stream and averaged to one channel.

use crate::core::fault::Reject;
use crate::core::ports::In;
use crate::core::shape::Incoming;
use crate::impl_state;

/// The mean of the channels of a whole recording.
pub(super) struct MonoRecording {
    pub samples: Vec<f32>,
    length: usize,
    /// Decimation factor: every `step`-th sample is stored.
    pub step: usize,
}
impl_state!(MonoRecording { samples });

/// Maximum length of a recording in samples: half an hour at 192 kHz.
const MAX_SAMPLES: i64 = 1800 * 192_000;

impl MonoRecording {
    pub fn new(audio: &Incoming<f32>, step: usize) -> Self {
        let length = audio.items().unwrap_or(0).clamp(0, MAX_SAMPLES) as usize;
        Self { samples: Vec::with_capacity(length.div_ceil(step)), length, step }
    }

    /// Adds a window, without samples after the end of the recording.
    pub fn add(&mut self, audio: &In<'_, f32>) {
        let (width, first) = (audio.width().max(1), audio.first().max(0) as usize);
        let remaining = self.length.saturating_sub(first);
        let mean = |frame: &[f32]| frame.iter().sum::<f32>() / width as f32;
        let frames = audio.items().chunks_exact(width).take(remaining);
        let offset = first.next_multiple_of(self.step) - first;
        self.samples.extend(frames.skip(offset).step_by(self.step).map(mean));
    }
}

/// Refuses an endless or too long recording.
pub(super) fn check_length(port: &str, audio: &Incoming<f32>) -> Result<(), Reject> {
    match audio.items() {
        Some(samples) if samples <= MAX_SAMPLES => Ok(()),
        found => {
            let length = found.map_or("does not end".into(), |n| format!("has {n} samples"));
            let message =
                format!("`{port}` {length}; a recording of at most {MAX_SAMPLES} samples is needed");
            Err(Reject::new("F075", message).at(port).help("give a recorded file, or cut the stream"))
        }
    }
}

/// Refuses a recording of fewer than `min` samples.
pub(super) fn check_min_length(
    port: &str,
    audio: &Incoming<f32>,
    min: usize,
    purpose: &str,
) -> Result<(), Reject> {
    let found = audio.items().unwrap_or(i64::MAX);
    if found >= min as i64 {
        return Ok(());
    }
    let message = format!("`{port}` has {found} samples; {purpose} needs {min}");
    Err(Reject::new("F077", message).at(port).help("give a longer recording, or a shorter `clip`"))
}
