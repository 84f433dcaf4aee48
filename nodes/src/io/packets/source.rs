//! Part of a file as a media source of `symphonia`.

use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Mutex;

use symphonia::core::io::MediaSource;

use crate::core::files::ReadSeek;

/// The part of a source from `start`.
///
/// `symphonia` requires a `Sync` source but never shares it: the mutex makes the type `Sync` and is never locked.
pub(super) struct Source<'s> {
    inner: Mutex<Box<dyn ReadSeek + 's>>,
    start: u64,
    len: u64,
}

impl<'s> Source<'s> {
    /// The bytes of `inner` from `start` to `len`.
    pub(super) fn new(inner: Box<dyn ReadSeek + 's>, start: u64, len: u64) -> Self {
        Self { inner: Mutex::new(inner), start, len: len - start }
    }

    fn inner(&mut self) -> &mut (dyn ReadSeek + 's) {
        self.inner.get_mut().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Read for Source<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.inner().read(out)
    }
}

impl Seek for Source<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let start = self.start;
        let to = match to {
            SeekFrom::Start(offset) => SeekFrom::Start(start.saturating_add(offset)),
            relative => relative,
        };
        Ok(self.inner().seek(to)?.saturating_sub(start))
    }
}

impl MediaSource for Source<'_> {
    fn is_seekable(&self) -> bool {
        true
    }

    fn byte_len(&self) -> Option<u64> {
        Some(self.len)
    }
}
