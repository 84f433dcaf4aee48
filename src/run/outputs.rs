//! Output files: written under temporary names, and moved to their places all at once when the run has succeeded.

use crate::graph::output_path;
use crate::memo::Begun;
use foley_nodes::core::files::{FileError, Outputs, WriteSeek};
use std::collections::HashSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf, absolute};
use std::sync::{Mutex, PoisonError};

/// Outputs below one folder.
///
/// Dropped before [`DirOutputs::commit`], nothing is left behind.
#[derive(Debug)]
pub struct DirOutputs {
    root: PathBuf,
    pending: Mutex<Vec<(PathBuf, PathBuf)>>,
    written: Mutex<Vec<PathBuf>>,
    /// What an earlier run has begun and this one goes on with.
    begun: Mutex<Vec<Begun>>,
    /// What is left for a later one.
    left: Mutex<HashSet<PathBuf>>,
}

impl DirOutputs {
    /// Outputs below `root`; the folder is made when the first output starts.
    #[must_use]
    pub fn new(root: impl Into<PathBuf>) -> Self {
        let (pending, written, begun, left) = Default::default();
        Self { root: root.into(), pending, written, begun, left }
    }

    /// Goes on with files that an earlier run has begun, as soon as they are created again.
    pub fn go_on(&self, begun: Vec<Begun>) {
        *self.begun.lock().unwrap_or_else(PoisonError::into_inner) = begun;
    }

    /// The files that are being written, but for some, with all their bytes on the disk.
    ///
    /// # Errors
    /// When one cannot be brought there.
    pub fn synced(&self, but: &HashSet<PathBuf>) -> io::Result<Vec<Begun>> {
        let pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let own = pending.into_iter().filter(|(part, _)| !but.contains(part));
        own.map(|(part, to)| {
            let file = File::open(&part)?;
            file.sync_data()?;
            Ok(Begun { part: absolute(&part)?, to: absolute(&to)?, length: file.metadata()?.len() })
        })
        .collect()
    }

    /// Where the files are that are being written.
    #[must_use]
    pub fn parts(&self) -> HashSet<PathBuf> {
        let pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
        pending.iter().map(|(part, _)| part.clone()).collect()
    }

    /// Leaves files where they are, for a later run to go on with; those of an earlier call no more.
    pub fn leave(&self, begun: &[Begun]) {
        let left = begun.iter().map(|b| b.part.clone()).collect();
        *self.left.lock().unwrap_or_else(PoisonError::into_inner) = left;
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
        let (part, file) = match self.take_begun(path) {
            Some(begun) => {
                let file = OpenOptions::new().write(true).open(&begun.part);
                let file = file.and_then(|file| file.set_len(begun.length).map(|()| file));
                (begun.part, file)
            }
            None => {
                let mut name = path.file_name().unwrap_or_default().to_os_string();
                name.push(format!(".{}.part", std::process::id()));
                let part = path.with_file_name(name);
                let file = File::create(&part);
                (part, file)
            }
        };
        let file = file.map_err(|e| error(&e))?;
        pending.push((part, path.to_owned()));
        Ok(Box::new(Part(BufWriter::with_capacity(1 << 16, file))))
    }

    fn take_begun(&self, to: &Path) -> Option<Begun> {
        let to = absolute(to).ok()?;
        let mut begun = self.begun.lock().unwrap_or_else(PoisonError::into_inner);
        let at = begun.iter().position(|b| b.to == to)?;
        Some(begun.swap_remove(at))
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
        let left = self.left.get_mut().unwrap_or_else(PoisonError::into_inner);
        for (part, _) in self.pending.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            if !absolute(&part).is_ok_and(|part| left.contains(&part)) {
                let _ = fs::remove_file(part);
            }
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
