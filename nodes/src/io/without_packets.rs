//! Packet formats in a build without the feature `flac`: an error.

use super::info::{AudioInfo, FileFormat, ReadLimits};
use super::{AudioError, AudioWarning, ReadSeek};
use std::convert::Infallible;
use std::marker::PhantomData;

/// A packet stream, which this build never opens.
pub(super) struct Packets<'s>(Infallible, PhantomData<&'s ()>);

impl<'s> Packets<'s> {
    /// Refuses the file.
    pub fn open(
        _: Box<dyn ReadSeek + 's>,
        _: u64,
        _: u64,
        format: FileFormat,
        _: &ReadLimits,
    ) -> Result<(AudioInfo, Self), AudioError> {
        let wanted =
            "this build reads WAV only; the feature `flac` adds FLAC, and `compressed-audio` the others";
        Err(AudioError::Unsupported { found: format.name().into(), wanted })
    }

    pub fn report_corrupt(&self, _: &mut Vec<AudioWarning>) {
        match self.0 {}
    }

    pub fn read(&mut self, _: &mut [f32]) {
        match self.0 {}
    }

    pub fn seek(&mut self, _: u64) -> Result<(), AudioError> {
        match self.0 {}
    }
}
