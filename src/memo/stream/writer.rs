//! Writes a stream file while the stream runs.

use super::codec::Codec;
use super::format::{BLOCK, BLOCK_PREFIX, FORMAT, MAGIC, PREFIX, block_hash};
use crate::memo::atomic_file::temporary_path;
use crate::memo::entry::Entry;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::{DynNode, Summary};
use foley_nodes::core::stage::Cx;
use foley_nodes::core::state::StateArchive;
use std::any::Any;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// A stream file that is being written; a drop before [`PartialStream::commit`] removes it.
#[derive(Debug)]
pub struct PartialStream {
    path: PathBuf,
    temporary: PathBuf,
    file: Option<BufWriter<File>>,
    bytes: u64,
    max_bytes: u64,
    end: i64,
    hash: blake3::Hasher,
    /// Reason why it cannot be written.
    failed: Option<io::Error>,
}

impl PartialStream {
    /// Creates a file that is renamed to `path` when it is complete, and takes at most `max_bytes`.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn create(path: PathBuf, max_bytes: u64) -> io::Result<Self> {
        let temporary = temporary_path(&path)?;
        let mut file = BufWriter::new(File::create(&temporary)?);
        file.write_all(MAGIC)?;
        file.write_all(&FORMAT.to_le_bytes())?;
        let hash = blake3::Hasher::new();
        Ok(Self { path, temporary, file: Some(file), bytes: PREFIX, max_bytes, end: 0, hash, failed: None })
    }

    /// Returns the bytes of a complete stream; `None` if it was abandoned or has not reached its end.
    #[must_use]
    pub fn complete_bytes(&self, codec: &Codec) -> Option<u64> {
        (self.file.is_some() && self.end >= codec.end()).then_some(self.bytes)
    }

    /// Takes the error for which it was abandoned.
    pub fn take_failure(&mut self) -> Option<io::Error> {
        self.failed.take()
    }

    /// Returns the hash of all blocks.
    #[must_use]
    pub fn hash(&self) -> blake3::Hash {
        self.hash.finalize()
    }

    fn abandon(&mut self, error: Option<io::Error>) {
        self.file = None;
        self.failed = error;
        let _ = fs::remove_file(&self.temporary);
    }

    fn write_block(&mut self, from: i64, to: i64, payload: &[u8]) {
        let Some(file) = &mut self.file else { return };
        self.bytes += (BLOCK_PREFIX + payload.len()) as u64;
        if self.bytes > self.max_bytes || from != self.end {
            return self.abandon(None);
        }
        let hash = block_hash(from, to, payload);
        self.hash.update(hash.as_bytes());
        self.end = to;
        let numbers = [from.to_le_bytes(), to.to_le_bytes(), (payload.len() as u64).to_le_bytes()];
        let pieces = [&numbers.concat(), &hash.as_bytes()[..], payload];
        if let Err(e) = pieces.iter().try_for_each(|piece| file.write_all(piece)) {
            self.abandon(Some(e));
        }
    }

    /// Completes the file with its header, and renames it.
    ///
    /// It is not synced: a file that a loss of power damages is found by its hashes when it is read.
    ///
    /// # Errors
    /// When it cannot be written or renamed; it is removed then.
    pub fn commit(mut self, entry: &Entry) -> io::Result<()> {
        let Some(mut file) = self.file.take() else { return Ok(()) };
        let header = serde_json::to_vec(entry)?;
        file.write_all(&header)?;
        file.write_all(&(header.len() as u32).to_le_bytes())?;
        file.write_all(blake3::hash(&header).as_bytes())?;
        file.write_all(MAGIC)?;
        file.flush()?;
        drop(file);
        fs::rename(&self.temporary, &self.path)
    }
}

impl Drop for PartialStream {
    fn drop(&mut self) {
        // After a commit there is no file of this name.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// A stream file that is shared with the node that writes it.
pub type SharedPartialStream = Arc<Mutex<PartialStream>>;

/// A node that writes the stream at its input to a file.
pub struct StreamWriter {
    codec: Codec,
    file: SharedPartialStream,
    payload: Vec<u8>,
    from: i64,
    to: i64,
}

impl StreamWriter {
    /// Writes the stream at port 0.
    #[must_use]
    pub fn new(codec: Codec, file: SharedPartialStream) -> Self {
        Self { codec, file, payload: Vec::new(), from: 0, to: 0 }
    }

    fn flush(&mut self) {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_block(self.from, self.to, &self.payload);
        self.payload.clear();
        self.from = self.to;
    }
}

impl DynNode for StreamWriter {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        let done = cx.raw_input(0, |buffer, span| {
            self.to = self.to.max(span.to);
            if span.to > span.from { self.codec.encode(buffer, span, &mut self.payload) } else { Some(()) }
        });
        if done.flatten().is_none() {
            let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
            file.abandon(None);
        }
        if self.payload.len() >= BLOCK {
            self.flush();
        }
        Ok(())
    }

    fn finish(&mut self, _: &Cx<'_>) -> Result<Summary, Fault> {
        if self.to > self.from {
            self.flush();
        }
        Ok(Summary::new())
    }

    /// A resumed run lacks the blocks before the checkpoint, so it writes no stream.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        if archive.restores() {
            self.file.lock().unwrap_or_else(PoisonError::into_inner).abandon(None);
        }
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}
