//! Checked reads of bytes and numbers from a file that may be truncated.

use std::io::SeekFrom;

use super::{MeshError, ReadSeek};

/// A file whose length is known.
pub(super) struct Source {
    inner: Box<dyn ReadSeek>,
    length: u64,
    format: &'static str,
}

impl Source {
    pub(super) fn new(mut inner: Box<dyn ReadSeek>, format: &'static str) -> Result<Self, MeshError> {
        let length = inner.seek(SeekFrom::End(0)).map_err(|source| MeshError::Io { format, source })?;
        Ok(Self { inner, length, format })
    }

    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// Fills `out` from `offset`.
    ///
    /// # Errors
    /// [`MeshError::Truncated`] before anything is read, if the file is too short; [`MeshError::Io`].
    pub(super) fn read_at(
        &mut self,
        offset: u64,
        out: &mut [u8],
        what: impl FnOnce() -> String,
    ) -> Result<(), MeshError> {
        let needed = offset.saturating_add(out.len() as u64);
        if needed > self.length {
            return Err(MeshError::Truncated {
                format: self.format,
                what: what(),
                needed,
                available: self.length,
            });
        }
        let format = self.format;
        self.inner
            .seek(SeekFrom::Start(offset))
            .and_then(|_| self.inner.read_exact(out))
            .map_err(|source| MeshError::Io { format, source })
    }
}

#[inline]
pub(super) fn u32_le(bytes: &[u8]) -> u32 {
    u32::from_le_bytes(array(bytes))
}

#[inline]
pub(super) fn u64_le(bytes: &[u8]) -> u64 {
    u64::from_le_bytes(array(bytes))
}

#[inline]
pub(super) fn f32_le(bytes: &[u8]) -> f32 {
    f32::from_le_bytes(array(bytes))
}

#[inline]
pub(super) fn f64_le(bytes: &[u8]) -> f64 {
    f64::from_le_bytes(array(bytes))
}

/// The first bytes as an array, padded with zeros, so that a wrong length cannot panic.
pub(super) fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut out = [0; N];
    let n = N.min(bytes.len());
    out[..n].copy_from_slice(&bytes[..n]);
    out
}
