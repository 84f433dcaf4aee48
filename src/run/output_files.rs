//! Output files: written under temporary names, and renamed together when the run has succeeded.

use crate::graph::output_path;
use crate::memo::PartialFile;
use foley_nodes::core::files::{FileError, MemoryOutputs, Outputs, WriteSeek};
use std::collections::HashSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf, absolute};
use std::sync::{Mutex, PoisonError};

/// Output files below one folder; a drop before [`DirOutputs::commit`] removes them.
#[derive(Debug)]
pub struct DirOutputs {
    root: PathBuf,
    /// Memory for the outputs of the graph, in place of the folder.
    memory: Option<MemoryOutputs>,
    /// Temporary path and final path of the files that are being written.
    pending: Mutex<Vec<(PathBuf, PathBuf)>>,
    /// Files under their final paths.
    written: Mutex<Vec<PathBuf>>,
    /// Partial files of an earlier run, which this one resumes.
    resumed: Mutex<Vec<PartialFile>>,
    /// Partial files that stay for a later run.
    retained: Mutex<HashSet<PathBuf>>,
}

impl DirOutputs {
    /// Outputs in memory, and where they are then.
    #[must_use]
    pub fn in_memory() -> (Self, MemoryOutputs) {
        let memory = MemoryOutputs::default();
        (Self::with(PathBuf::new(), Some(memory.clone())), memory)
    }

    /// Outputs below `root`; the folder is created with the first file.
    #[must_use]
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self::with(root.into(), None)
    }

    fn with(root: PathBuf, memory: Option<MemoryOutputs>) -> Self {
        let (pending, written, resumed, retained) = Default::default();
        Self { root, memory, pending, written, resumed, retained }
    }

    /// Returns true if the outputs are in memory, where no later run finds them.
    #[must_use]
    pub fn is_memory(&self) -> bool {
        self.memory.is_some()
    }

    /// Resumes partial files of an earlier run when they are created again.
    pub fn resume(&self, files: Vec<PartialFile>) {
        *self.resumed.lock().unwrap_or_else(PoisonError::into_inner) = files;
    }

    /// Syncs the files that are being written to the disk, and returns them without those `except`.
    ///
    /// # Errors
    /// When a file cannot be synced.
    pub fn sync(&self, except: &HashSet<PathBuf>) -> io::Result<Vec<PartialFile>> {
        let pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let synced = pending.into_iter().filter(|(part, _)| !except.contains(part));
        synced
            .map(|(part, to)| {
                let file = File::open(&part)?;
                file.sync_data()?;
                Ok(PartialFile { part: absolute(&part)?, to: absolute(&to)?, length: file.metadata()?.len() })
            })
            .collect()
    }

    /// Returns the temporary paths of the files that are being written.
    #[must_use]
    pub fn partial_paths(&self) -> HashSet<PathBuf> {
        let pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
        pending.iter().map(|(part, _)| part.clone()).collect()
    }

    /// Retains partial files for a later run, in place of those of an earlier call.
    pub fn retain(&self, files: &[PartialFile]) {
        let paths = files.iter().map(|file| file.part.clone()).collect();
        *self.retained.lock().unwrap_or_else(PoisonError::into_inner) = paths;
    }

    /// Creates a file at a path from the command line, which need not be below the folder.
    ///
    /// # Errors
    /// If it cannot be written, or if another output has the same path.
    pub fn create_at(&self, path: &Path) -> Result<Box<dyn WriteSeek>, FileError> {
        Ok(Box::new(OutputFile(BufWriter::with_capacity(1 << 16, self.create_file_at(path)?))))
    }

    /// Creates a file as [`DirOutputs::create_at`] does, without a buffer.
    ///
    /// # Errors
    /// As [`DirOutputs::create_at`].
    pub fn create_file_at(&self, path: &Path) -> Result<File, FileError> {
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
        let (part, file) = match self.take_resumed(path) {
            Some(partial) => {
                let file = OpenOptions::new().write(true).open(&partial.part);
                let file = file.and_then(|file| file.set_len(partial.length).map(|()| file));
                (partial.part, file)
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
        Ok(file)
    }

    fn take_resumed(&self, to: &Path) -> Option<PartialFile> {
        let to = absolute(to).ok()?;
        let mut resumed = self.resumed.lock().unwrap_or_else(PoisonError::into_inner);
        let at = resumed.iter().position(|file| file.to == to)?;
        Some(resumed.swap_remove(at))
    }

    /// Renames every file to its final path.
    ///
    /// # Errors
    /// If a file cannot be renamed; those before it remain, the others are removed.
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

    /// Returns the files that are complete.
    #[must_use]
    pub fn written(&self) -> Vec<PathBuf> {
        self.written.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Resolves the path of an output of the graph.
    ///
    /// # Errors
    /// When it is not below the folder.
    pub fn resolve(&self, path: &str) -> Result<PathBuf, FileError> {
        let full = self.root.join(output_path(path)?);
        // A symbolic link that leads out of the folder is refused, also in the middle of the path.
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
        match &self.memory {
            Some(memory) => memory.create(&output_path(path)?.to_string_lossy()),
            None => self.create_at(&self.resolve(path)?),
        }
    }
}

/// The nearest existing ancestor of a path, resolved.
fn existing(path: &Path) -> Option<PathBuf> {
    path.ancestors().find_map(|p| fs::canonicalize(p).ok())
}

impl Drop for DirOutputs {
    fn drop(&mut self) {
        let retained = self.retained.get_mut().unwrap_or_else(PoisonError::into_inner);
        for (part, _) in self.pending.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            if !absolute(&part).is_ok_and(|part| retained.contains(&part)) {
                let _ = fs::remove_file(part);
            }
        }
    }
}

struct OutputFile(BufWriter<File>);

impl Write for OutputFile {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        self.0.write(buf)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl Seek for OutputFile {
    fn seek(&mut self, pos: SeekFrom) -> io::Result<u64> {
        self.0.seek(pos)
    }
}
