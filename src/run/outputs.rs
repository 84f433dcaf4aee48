//! Output files: written under temporary names, and moved to their places all at once when the run has succeeded.

use crate::graph::output_path;
use foley_nodes::core::files::{FileError, Outputs, WriteSeek};
use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Outputs below one folder.
///
/// Dropped before [`DirOutputs::commit`], nothing is left behind.
#[derive(Debug)]
pub struct DirOutputs {
    root: PathBuf,
    pending: Mutex<Vec<(PathBuf, PathBuf)>>,
    written: Mutex<Vec<PathBuf>>,
}

impl DirOutputs {
    /// Outputs below `root`; the folder is made when the first output starts.
    #[must_use]
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into(), pending: Mutex::default(), written: Mutex::default() }
    }

    /// Starts a file whose path the user gave on the command line, anywhere.
    ///
    /// # Errors
    /// When it cannot be written, or when another output has the same path.
    pub fn create_at(&self, path: &Path) -> Result<Box<dyn WriteSeek>, FileError> {
        let error = |e: &io::Error| FileError {
            code: "F080",
            message: format!("cannot write {}: {e}", path.display()),
        };
        let mut pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
        if pending.iter().any(|(_, to)| to == path) {
            return Err(FileError {
                code: "F081",
                message: format!("two outputs have the path {}", path.display()),
            });
        }
        if path.is_dir() {
            return Err(FileError { code: "F080", message: format!("{} is a folder", path.display()) });
        }
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| error(&e))?;
        }
        let mut name = path.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".{}.part", std::process::id()));
        let part = path.with_file_name(name);
        let file = File::create(&part).map_err(|e| error(&e))?;
        pending.push((part, path.to_owned()));
        Ok(Box::new(Part(BufWriter::with_capacity(1 << 16, file))))
    }

    /// Moves every output to its place.
    ///
    /// # Errors
    /// When one cannot be moved; those before it stay in their places, the rest is removed.
    pub fn commit(&self) -> io::Result<()> {
        let mut pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
        while let Some((part, to)) = pending.first().cloned() {
            let moved = File::open(&part).and_then(|f| f.sync_all()).and_then(|()| fs::rename(&part, &to));
            moved.map_err(|e| io::Error::new(e.kind(), format!("cannot write {}: {e}", to.display())))?;
            pending.remove(0);
            self.written.lock().unwrap_or_else(PoisonError::into_inner).push(to);
        }
        Ok(())
    }

    /// The files that are in their places.
    #[must_use]
    pub fn written(&self) -> Vec<PathBuf> {
        self.written.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Where an output of the graph goes.
    ///
    /// # Errors
    /// When that is not below the folder.
    pub fn place(&self, path: &str) -> Result<PathBuf, FileError> {
        let full = self.root.join(output_path(path)?);
        // A link that leads out of the folder must not be followed, also where it is in the middle of the path.
        if let (Ok(root), Some(folder)) = (fs::canonicalize(&self.root), full.parent().and_then(existing))
            && !folder.starts_with(&root)
        {
            let message = format!("{path:?} leads out of the output folder");
            return Err(FileError { code: "F082", message });
        }
        Ok(full)
    }
}

impl Outputs for DirOutputs {
    fn create(&self, path: &str) -> Result<Box<dyn WriteSeek>, FileError> {
        self.create_at(&self.place(path)?)
    }
}

/// The nearest folder above a path that exists, resolved.
fn existing(path: &Path) -> Option<PathBuf> {
    path.ancestors().find_map(|p| fs::canonicalize(p).ok())
}

impl Drop for DirOutputs {
    fn drop(&mut self) {
        for (part, _) in self.pending.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            let _ = fs::remove_file(part);
        }
    }
}

struct Part(BufWriter<File>);

impl Write for Part {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        self.0.write(buf)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl Seek for Part {
    fn seek(&mut self, pos: SeekFrom) -> io::Result<u64> {
        self.0.seek(pos)
    }
}
