//! Recordings with their takes.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ops::Range;

use crate::core::time::Rate;
use crate::dsp::{DspError, Quality, Resampler};
use crate::unit::UnitSource;

/// A recording with its takes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CutRecording {
    /// Provenance, licence and tag.
    pub source: UnitSource,
    /// High-passed and scaled samples of each channel, equally many.
    pub channels: Vec<Vec<f32>>,
    /// Samples of each take, in order, without overlaps.
    pub takes: Vec<Range<usize>>,
    /// Noise floor, dB of full scale.
    pub floor: f64,
    /// Factor by which the recording was scaled.
    pub gain: f64,
}

impl CutRecording {
    /// Number of samples of each channel.
    #[must_use]
    pub fn len(&self) -> usize {
        self.channels.iter().map(Vec::len).min().unwrap_or(0)
    }

    /// Returns true if there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of samples in takes.
    #[must_use]
    pub fn samples_in_takes(&self) -> usize {
        self.takes.iter().map(ExactSizeIterator::len).sum()
    }

    /// The mean of the channels, with zeros outside of the takes.
    #[must_use]
    pub fn gated_mono(&self) -> Vec<f32> {
        let mut mono = vec![0.0; self.len()];
        let scale = 1.0 / self.channels.len().max(1) as f32;
        for take in &self.takes {
            for k in take.clone() {
                mono[k] = scale * self.channels.iter().map(|x| x[k]).sum::<f32>();
            }
        }
        mono
    }
}

/// Recordings at one rate, with their takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Takes {
    /// Sample rate.
    pub rate: Rate,
    /// The recordings.
    pub recordings: Vec<CutRecording>,
}

impl Takes {
    /// The takes at another rate.
    ///
    /// # Errors
    /// A rate that cannot be reached.
    pub fn at_rate(&self, rate: Rate) -> Result<Cow<'_, Self>, DspError> {
        if self.rate == rate {
            return Ok(Cow::Borrowed(self));
        }
        let resampler = Resampler::new(self.rate, rate, Quality::High)?;
        let factor = rate.as_f64() / self.rate.as_f64();
        let mut recordings = self.recordings.clone();
        for recording in &mut recordings {
            for channel in &mut recording.channels {
                *channel = resampler.whole(channel)?;
            }
            let length = recording.len();
            let at = |sample: usize| ((sample as f64 * factor).round() as usize).min(length);
            recording.takes.iter_mut().for_each(|take| *take = at(take.start)..at(take.end));
        }
        Ok(Cow::Owned(Self { rate, recordings }))
    }

    /// Number of takes of all recordings.
    #[must_use]
    pub fn count(&self) -> usize {
        self.recordings.iter().map(|r| r.takes.len()).sum()
    }
}
