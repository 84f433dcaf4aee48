//! Format, length and limits of audio files.

use super::{AudioError, AudioWarning};

/// Container and codec of an audio file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FileFormat {
    /// RIFF, RF64 or BW64 with linear samples.
    Wav,
    /// Native FLAC.
    Flac,
    /// Vorbis (or FLAC) in Ogg.
    Ogg,
    /// MPEG layer III.
    Mp3,
}

impl FileFormat {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Wav => "WAV",
            Self::Flac => "FLAC",
            Self::Ogg => "Ogg",
            Self::Mp3 => "MP3",
        }
    }
}

/// Format of the samples in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SampleFormat {
    /// Integers of `bits` valid bits; the sample is value / 2^(bits - 1).
    Int {
        /// Valid bits.
        bits: u16,
    },
    /// IEEE floats of `bits` bits.
    Float {
        /// 32 or 64.
        bits: u16,
    },
    /// A lossy codec, whose decoder returns 32-bit floats.
    Lossy,
}

/// Format and length of an audio file.
#[derive(Clone, Debug, PartialEq)]
pub struct AudioInfo {
    /// Container and codec.
    pub format: FileFormat,
    /// Samples per second and channel.
    pub rate: u32,
    /// Number of interleaved channels.
    pub channels: usize,
    /// Exact number of frames that [`AudioReader::read`](super::AudioReader::read) returns.
    pub frames: u64,
    /// Format of the stored samples.
    pub sample_format: SampleFormat,
    /// Speakers of the channels as a WAVE channel mask, if the file states them.
    pub channel_mask: Option<u32>,
    /// Irregularities of the file. [`AudioReader`](super::AudioReader) adds corrupt packets while it reads.
    pub warnings: Vec<AudioWarning>,
}

impl AudioInfo {
    /// The warnings as texts that start with the path of the file.
    pub fn warning_texts<'a>(&'a self, path: &'a str) -> impl Iterator<Item = String> + 'a {
        self.warnings.iter().map(move |warning| format!("{path:?}: {warning}"))
    }

    /// The warning of corrupt packets, which appears while the file is read.
    #[must_use]
    pub fn corrupt_packets(&self) -> Option<&AudioWarning> {
        self.warnings.iter().find(|warning| matches!(warning, AudioWarning::CorruptPackets { .. }))
    }

    /// Memory of all samples as `f32`, bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.frames.saturating_mul(self.channels as u64 * size_of::<f32>() as u64)
    }

    /// Peak memory of an analysis of the complete recording, bytes: measured as at most five times [`AudioInfo::bytes`] for
    /// the samples as read, by channel, filtered, and in the result.
    #[must_use]
    pub fn analysis_bytes(&self) -> u64 {
        self.bytes().saturating_mul(5)
    }

    /// Length in seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.frames as f64 / f64::from(self.rate.max(1))
    }
}

/// Limits on an untrusted file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadLimits {
    /// Maximum decoded length in seconds.
    pub max_seconds: f64,
    /// Maximum number of channels.
    pub max_channels: usize,
    /// Maximum rate in samples per second.
    pub max_rate: u32,
}

impl Default for ReadLimits {
    /// 24 hours, 64 channels, 768 kHz.
    fn default() -> Self {
        Self { max_seconds: 86_400.0, max_channels: 64, max_rate: 768_000 }
    }
}

impl ReadLimits {
    /// Checks rate, channels and length.
    ///
    /// # Errors
    /// [`AudioError::Limit`].
    pub(super) fn check(&self, rate: u32, channels: usize, frames: u64) -> Result<(), AudioError> {
        let over = |what, found: f64, limit: f64| Err(AudioError::Limit { what, found, limit });
        if channels > self.max_channels {
            return over("channels", channels as f64, self.max_channels as f64);
        }
        if rate > self.max_rate {
            return over("samples per second", f64::from(rate), f64::from(self.max_rate));
        }
        let seconds = frames as f64 / f64::from(rate.max(1));
        if seconds > self.max_seconds {
            return over("seconds", seconds, self.max_seconds);
        }
        Ok(())
    }
}

/// Checks that all samples of a block are finite; `first` is the frame of the first sample.
///
/// # Errors
/// [`AudioError::NotFinite`] names the first wrong sample.
pub(super) fn check_finite(samples: &[f32], channels: usize, first: u64) -> Result<(), AudioError> {
    match samples.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(index) => Err(AudioError::NotFinite {
            frame: first + (index / channels) as u64,
            channel: index % channels,
            value: f64::from(samples[index]),
        }),
    }
}
