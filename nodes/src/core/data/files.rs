//! Access of nodes to files, without paths of the file system.

use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek, Write};
use std::sync::{Arc, Mutex};

/// A source of bytes with random access, which can be moved to another thread.
pub trait ReadSeek: Read + Seek + Send {}
impl<T: Read + Seek + Send + ?Sized> ReadSeek for T {}

/// A sink of bytes with random access.
pub trait WriteSeek: Write + Seek + Send {}
impl<T: Write + Seek + Send> WriteSeek for T {}

/// Reason why a file is not available.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct FileError {
    /// Stable code of the message.
    pub code: &'static str,
    /// Description of the mistake, and of the correct form.
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

    /// The paths of the files in a folder, without its sub-folders and hidden files, in order of their names.
    ///
    /// # Errors
    /// When it is missing, outside the allowed folders, or no folder.
    fn folder(&self, path: &str) -> Result<Vec<String>, FileError>;

    /// The same files for a node that opens some of them during the run; `None` if that is not possible.
    fn shared(&self) -> Option<Arc<dyn Files>> {
        None
    }

    /// Maximum number of bytes of files that one node may hold.
    fn room(&self) -> u64 {
        u64::MAX
    }

    /// The whole content of a file.
    ///
    /// # Errors
    /// As [`Files::open`], when reading fails, and when there are more than [`Files::room`] bytes.
    fn bytes(&self, path: &str) -> Result<Vec<u8>, FileError> {
        let mut all = Vec::new();
        let room = self.room();
        self.open(path)?
            .take(room.saturating_add(1))
            .read_to_end(&mut all)
            .map_err(|e| FileError { code: "F061", message: format!("cannot read {path:?}: {e}") })?;
        if all.len() as u64 > room {
            return Err(too_large(path, all.len() as u64, room));
        }
        Ok(all)
    }
}

/// Error for files that exceed the memory limit.
pub(in crate::core) fn too_large(path: &str, bytes: u64, room: u64) -> FileError {
    let message =
        format!("{path:?} is held as a whole and takes {bytes} bytes or more; the memory limit is {room}");
    FileError { code: "F063", message }
}

/// Destination of outputs; they appear under their names when the run has succeeded.
pub trait Outputs: Send + Sync {
    /// Starts an output file, or opens the one to resume, at its beginning and with its content.
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

    /// The paths of all files, in order.
    pub fn paths(&self) -> impl Iterator<Item = &str> {
        self.files.keys().map(String::as_str)
    }

    /// The bytes of a file.
    #[must_use]
    pub fn get(&self, path: &str) -> Option<&[u8]> {
        self.files.get(path).map(|bytes| &**bytes)
    }
}

impl Files for MemoryFiles {
    fn open(&self, path: &str) -> Result<Box<dyn ReadSeek>, FileError> {
        match self.files.get(path) {
            Some(bytes) => Ok(Box::new(Cursor::new(Arc::clone(bytes)))),
            None => Err(FileError { code: "F060", message: format!("there is no file {path:?}") }),
        }
    }

    fn shared(&self) -> Option<Arc<dyn Files>> {
        Some(Arc::new(self.clone()))
    }

    fn sequence(&self, pattern: &str) -> Result<Vec<(u64, String)>, FileError> {
        let found: Vec<_> =
            self.files.keys().filter_map(|k| Some((number_in(pattern, k)?, k.clone()))).collect();
        sorted_sequence(pattern, found)
    }

    fn folder(&self, path: &str) -> Result<Vec<String>, FileError> {
        let inside = |key: &&String| {
            let name = key.strip_prefix(path).and_then(|rest| rest.strip_prefix('/'));
            name.is_some_and(|name| !name.contains('/'))
        };
        let found: Vec<String> = self.files.keys().filter(inside).cloned().collect();
        if found.is_empty() {
            return Err(FileError { code: "F060", message: format!("there is no folder {path:?}") });
        }
        Ok(found)
    }
}

type Bytes = Arc<Mutex<Vec<u8>>>;

/// Outputs in memory.
#[derive(Clone, Debug, Default)]
pub struct MemoryOutputs {
    files: Arc<Mutex<BTreeMap<String, Bytes>>>,
    /// True if an existing file is resumed.
    goes_on: bool,
}

impl MemoryOutputs {
    /// Copies of the output so far, for a run that continues it.
    #[must_use]
    pub fn to_resume(&self) -> Self {
        let copy = |(path, bytes): (&String, &Bytes)| {
            Some((path.clone(), Arc::new(Mutex::new(bytes.lock().ok()?.clone()))))
        };
        let files = self.files.lock().map(|files| files.iter().filter_map(copy).collect());
        Self { files: Arc::new(Mutex::new(files.unwrap_or_default())), goes_on: true }
    }

    /// The paths of all files, in order.
    #[must_use]
    pub fn paths(&self) -> Vec<String> {
        self.files.lock().map(|files| files.keys().cloned().collect()).unwrap_or_default()
    }

    /// Returns the bytes written to `path`.
    #[must_use]
    pub fn get(&self, path: &str) -> Option<Vec<u8>> {
        let files = self.files.lock().ok()?;
        files.get(path).and_then(|bytes| Some(bytes.lock().ok()?.clone()))
    }
}

impl Outputs for MemoryOutputs {
    fn create(&self, path: &str) -> Result<Box<dyn WriteSeek>, FileError> {
        let mut bytes = Bytes::default();
        if let Ok(mut files) = self.files.lock() {
            match files.get(path).filter(|_| self.goes_on) {
                Some(there) => bytes = Arc::clone(there),
                None => drop(files.insert(path.to_owned(), Arc::clone(&bytes))),
            }
        }
        Ok(Box::new(SharedBytes { bytes, at: 0 }))
    }
}

struct SharedBytes {
    bytes: Bytes,
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

/// Returns the number of `name` at the `#` of `pattern`.
#[must_use]
pub fn number_in(pattern: &str, name: &str) -> Option<u64> {
    let at = pattern.find('#')?;
    let rest = pattern[at..].trim_start_matches('#');
    let digits = name.strip_prefix(&pattern[..at])?.strip_suffix(rest)?;
    let plain = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    plain.then(|| digits.parse().ok()).flatten()
}

/// Orders the files of a sequence, or reports that there are none or that one is missing.
///
/// Numbers go up in equal steps: by 1, or by 2 where every other frame was written.
///
/// # Errors
/// If `found` is empty, or a number is missing or occurs twice: a motion would continue too early after the gap.
pub fn sorted_sequence(
    pattern: &str,
    mut found: Vec<(u64, String)>,
) -> Result<Vec<(u64, String)>, FileError> {
    let error = |message| Err(FileError { code: "F060", message });
    if found.is_empty() {
        return error(format!("no file matches {pattern:?}; each # run stands for the frame number"));
    }
    found.sort();
    let pairs = || found.iter().zip(found.iter().skip(1));
    let step = pairs().map(|(a, b)| b.0 - a.0).min().unwrap_or(1);
    let Some(((before, first), (after, second))) = pairs().find(|(a, b)| {
        let gap = b.0 - a.0;
        gap == 0 || (gap != step && step > 0)
    }) else {
        return Ok(found);
    };
    error(if before == after {
        format!(
            "{first:?} and {second:?} of the sequence {pattern:?} are both number {before}; keep one of them"
        )
    } else {
        let missing = before + step;
        format!(
            "number {missing} of the sequence {pattern:?} is missing: {before} is followed by {after}; write it again"
        )
    })
}

/// The first 40 characters of a text, for a message.
#[must_use]
pub fn excerpt(text: &str) -> String {
    text.chars().take(40).collect()
}

/// A text file without the byte order mark that some editors put in front of UTF-8.
#[must_use]
pub fn strip_bom(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sorted(numbers: &[u64]) -> Result<Vec<u64>, String> {
        let found = numbers.iter().enumerate().map(|(k, n)| (*n, format!("f_{n}_{k}.obj"))).collect();
        let sorted = sorted_sequence("f_#.obj", found).map_err(|e| e.message)?;
        Ok(sorted.into_iter().map(|(n, _)| n).collect())
    }

    #[test]
    fn sequences_go_up_in_equal_steps() {
        assert_eq!(sorted(&[10, 9, 11]).unwrap(), [9, 10, 11]);
        assert_eq!(sorted(&[1, 5, 3]).unwrap(), [1, 3, 5]);
        assert_eq!(sorted(&[7]).unwrap(), [7]);
        let missing = sorted(&[1, 2, 3, 5, 6]).unwrap_err();
        assert!(missing.contains("number 4") && missing.contains("3 is followed by 5"), "{missing}");
        let missing = sorted(&[2, 4, 8]).unwrap_err();
        assert!(missing.contains("number 6"), "{missing}");
        let twice = sorted(&[1, 2, 2]).unwrap_err();
        assert!(twice.contains("both number 2"), "{twice}");
        assert!(sorted(&[]).unwrap_err().contains("no file matches"));
    }
}
