//! How a node reads and writes files without ever opening a path itself.

use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek, Write};
use std::sync::{Arc, Mutex};

/// Anything that bytes can be read from at any place, and that can be moved to another thread.
pub trait ReadSeek: Read + Seek + Send {}
impl<T: Read + Seek + Send + ?Sized> ReadSeek for T {}

/// Anything that bytes can be written to at any place.
pub trait WriteSeek: Write + Seek + Send {}
impl<T: Write + Seek + Send> WriteSeek for T {}

/// Why a file could not be had.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct FileError {
    /// Stable code of the message.
    pub code: &'static str,
    /// What was found and what would be right.
    pub message: String,
}

/// Resolves the asset paths of a graph: inside its root only, within its limits.
pub trait Files: Send + Sync {
    /// Opens a file for reading.
    ///
    /// # Errors
    /// When it is missing, outside the allowed folders, too large, or not a plain file.
    fn open(&self, path: &str) -> Result<Box<dyn ReadSeek>, FileError>;

    /// The files of a numbered sequence such as `frame_####.obj`, in the order of their numbers.
    ///
    /// # Errors
    /// When there is none.
    fn sequence(&self, pattern: &str) -> Result<Vec<(u64, String)>, FileError>;

    /// The whole content of a file.
    ///
    /// # Errors
    /// As [`Files::open`], and when reading fails.
    fn bytes(&self, path: &str) -> Result<Vec<u8>, FileError> {
        let mut all = Vec::new();
        self.open(path)?
            .read_to_end(&mut all)
            .map_err(|e| FileError { code: "F061", message: format!("cannot read {path:?}: {e}") })?;
        Ok(all)
    }
}

/// Where outputs go; they appear under their names only once the run has succeeded.
pub trait Outputs: Send + Sync {
    /// Starts an output file.
    ///
    /// # Errors
    /// When the path leaves the output folder or cannot be written.
    fn create(&self, path: &str) -> Result<Box<dyn WriteSeek>, FileError>;
}

/// Files in memory: for tests, and for programs that have their bytes already.
#[derive(Clone, Debug, Default)]
pub struct MemoryFiles {
    files: BTreeMap<String, Arc<[u8]>>,
}

impl MemoryFiles {
    /// Adds a file.
    pub fn insert(&mut self, path: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        self.files.insert(path.into(), bytes.into().into());
    }
}

impl Files for MemoryFiles {
    fn open(&self, path: &str) -> Result<Box<dyn ReadSeek>, FileError> {
        match self.files.get(path) {
            Some(bytes) => Ok(Box::new(Cursor::new(Arc::clone(bytes)))),
            None => Err(FileError { code: "F060", message: format!("there is no file {path:?}") }),
        }
    }

    fn sequence(&self, pattern: &str) -> Result<Vec<(u64, String)>, FileError> {
        let found: Vec<_> =
            self.files.keys().filter_map(|k| Some((number_in(pattern, k)?, k.clone()))).collect();
        sorted_sequence(pattern, found)
    }
}

/// Outputs kept in memory.
#[derive(Clone, Debug, Default)]
pub struct MemoryOutputs {
    files: Arc<Mutex<BTreeMap<String, Arc<Mutex<Vec<u8>>>>>>,
}

impl MemoryOutputs {
    /// What has been written to `path`.
    #[must_use]
    pub fn get(&self, path: &str) -> Option<Vec<u8>> {
        let files = self.files.lock().ok()?;
        files.get(path).and_then(|bytes| Some(bytes.lock().ok()?.clone()))
    }
}

impl Outputs for MemoryOutputs {
    fn create(&self, path: &str) -> Result<Box<dyn WriteSeek>, FileError> {
        let bytes = Arc::<Mutex<Vec<u8>>>::default();
        if let Ok(mut files) = self.files.lock() {
            files.insert(path.to_owned(), Arc::clone(&bytes));
        }
        Ok(Box::new(SharedBytes { bytes, at: 0 }))
    }
}

struct SharedBytes {
    bytes: Arc<Mutex<Vec<u8>>>,
    at: u64,
}

impl Write for SharedBytes {
    fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
        let mut bytes = self.bytes.lock().map_err(|_| std::io::Error::other("poisoned"))?;
        let mut cursor = Cursor::new(&mut *bytes);
        cursor.set_position(self.at);
        let n = cursor.write(buf)?;
        self.at += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Seek for SharedBytes {
    fn seek(&mut self, pos: std::io::SeekFrom) -> std::io::Result<u64> {
        let bytes = self.bytes.lock().map_err(|_| std::io::Error::other("poisoned"))?;
        let mut cursor = Cursor::new(&*bytes);
        cursor.set_position(self.at);
        self.at = cursor.seek(pos)?;
        Ok(self.at)
    }
}

/// The number that stands in `name` where `pattern` has its run of `#`.
#[must_use]
pub fn number_in(pattern: &str, name: &str) -> Option<u64> {
    let at = pattern.find('#')?;
    let rest = pattern[at..].trim_start_matches('#');
    let digits = name.strip_prefix(&pattern[..at])?.strip_suffix(rest)?;
    let plain = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    plain.then(|| digits.parse().ok()).flatten()
}

/// Orders the files of a sequence, or says that there are none.
///
/// # Errors
/// When `found` is empty.
pub fn sorted_sequence(
    pattern: &str,
    mut found: Vec<(u64, String)>,
) -> Result<Vec<(u64, String)>, FileError> {
    if found.is_empty() {
        let message = format!("no file matches {pattern:?}; each # run stands for the frame number");
        return Err(FileError { code: "F060", message });
    }
    found.sort();
    Ok(found)
}
