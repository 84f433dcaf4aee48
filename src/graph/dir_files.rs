//! Files on the disk, as nodes open them.

use super::asked::{Asked, Stamp};
use super::limits::Limits;
use super::listing::files_in;
use super::root::{Root, join};
use foley_nodes::core::files::{FileError, Files, ReadSeek, number_in, sorted_sequence};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of files in a folder that is read as a whole.
const MAX_FILES: usize = 100_000;

/// The files of a [`Root`], for nodes.
///
/// A clone reads the same files, and both count the files that it opens.
#[derive(Clone, Debug, Default)]
pub struct DirFiles {
    root: Root,
    limits: Limits,
    opened: Arc<Mutex<BTreeSet<PathBuf>>>,
}

impl DirFiles {
    /// The files of a root.
    #[must_use]
    pub fn new(root: Root, limits: Limits) -> Self {
        Self { root, limits, opened: Arc::default() }
    }

    /// Returns the limits of files.
    #[must_use]
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// All files that were requested so far, by the graph's texts and by its nodes.
    #[must_use]
    pub fn asked(&self) -> Asked {
        self.root.asked()
    }

    /// Returns the stamp of the present content of a file.
    #[must_use]
    pub fn stamp(&self, path: &str) -> Option<Stamp> {
        Stamp::of(&self.root.resolve(path).ok()?)
    }

    /// Every file that was opened so far.
    #[must_use]
    pub fn opened(&self) -> Vec<PathBuf> {
        self.opened.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }
}

impl Files for DirFiles {
    fn room(&self) -> u64 {
        self.limits.memory as u64
    }

    fn open(&self, path: &str) -> Result<Box<dyn ReadSeek>, FileError> {
        let real = self.root.resolve(path)?;
        let file = File::open(&real)
            .map_err(|e| FileError { code: "F061", message: format!("cannot read {path:?}: {e}") })?;
        let bytes = file.metadata().map_or(0, |m| m.len());
        if bytes > self.limits.file_bytes {
            let message = format!("{path:?} has {bytes} bytes, the limit is {}", self.limits.file_bytes);
            return Err(FileError { code: "F063", message });
        }
        self.opened.lock().unwrap_or_else(PoisonError::into_inner).insert(real);
        Ok(Box::new(BufReader::with_capacity(1 << 16, file)))
    }

    fn sequence(&self, pattern: &str) -> Result<Vec<(u64, String)>, FileError> {
        let mut asked = self.root.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.sequences.insert(pattern.to_owned());
        drop(asked);
        let path = Path::new(pattern);
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        let failed = |code, what: &dyn std::fmt::Display| FileError {
            code,
            message: format!("cannot list the files of {pattern:?}: {what}"),
        };
        let text = folder.to_str().ok_or_else(|| failed("F061", &"the folder's name is no text"))?;
        let real = if self.root.patterns.iter().any(|named| named == path) {
            fs::canonicalize(text).map_err(|e| failed("F061", &e))?
        } else {
            self.root.real(text).map_err(|e| failed(e.code, &e.message))?
        };
        let entries = fs::read_dir(real).map_err(|e| failed("F061", &e))?;
        let found = entries.flatten().filter_map(|entry| {
            let file = entry.file_name().into_string().ok()?;
            Some((number_in(name, &file)?, folder.join(&file).to_str()?.to_owned()))
        });
        sorted_sequence(pattern, found.collect())
    }

    fn folder(&self, path: &str) -> Result<Vec<String>, FileError> {
        self.root.asked.lock().unwrap_or_else(PoisonError::into_inner).folders.insert(path.into());
        let error = |code, message| Err(FileError { code, message });
        let real = self.root.real(path)?;
        if !real.is_dir() {
            return error("F064", format!("{path:?} is a file, not a folder"));
        }
        match files_in(&real) {
            Ok(names) if names.len() > MAX_FILES => {
                error("F063", format!("{path:?} has {} files, the limit is {MAX_FILES}", names.len()))
            }
            Ok(names) => Ok(names.iter().map(|name| join(Path::new(path), name)).collect()),
            Err(e) => error("F061", format!("cannot list the files in {path:?}: {e}")),
        }
    }

    fn shared(&self) -> Option<Arc<dyn Files>> {
        Some(Arc::new(self.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequences_are_listed_inside_the_root_only_and_kept_files_count_with_the_others() {
        let dir = tempfile::tempdir().unwrap();
        let base = dir.path();
        for folder in ["cloth", "other"] {
            fs::create_dir(base.join(folder)).unwrap();
            for frame in [10, 9] {
                fs::write(base.join(folder).join(format!("f_{frame}.obj")), b"x").unwrap();
            }
        }
        let files = DirFiles::new(Root::of(&base.join("cloth/graph.ron")), Limits::default());
        let list = |p: &str| files.sequence(base.join(p).to_str().unwrap()).map_err(|e| e.code);
        let found = list("cloth/f_#.obj").unwrap();
        assert_eq!(found.iter().map(|(n, _)| *n).collect::<Vec<_>>(), [9, 10]);
        assert_eq!(list("other/f_#.obj"), Err("F062"));
        assert_eq!(list("cloth/../other/f_#.obj"), Err("F062"));
        assert_eq!(list("cloth/none/f_#.obj"), Err("F060"));
        assert_eq!(list("cloth/g_#.obj"), Err("F060"));
        assert!(files.opened().is_empty());
        // A path on the command line may be anywhere.
        let mut root = Root::of(&base.join("cloth/graph.ron"));
        root.allow_named(&base.join("other/f_#.obj"));
        let named = DirFiles::new(root, Limits::default());
        let found_there = named.sequence(base.join("other/f_#.obj").to_str().unwrap()).unwrap();
        assert_eq!(found_there.len(), 2);
        assert_eq!(named.bytes(&found_there[1].1).unwrap(), b"x");
        assert!(named.sequence(base.join("other/#.obj").to_str().unwrap()).is_err());
        assert_eq!(files.shared().unwrap().bytes(&found[0].1).unwrap(), b"x");
        assert_eq!(files.opened().len(), 1);
    }

    #[test]
    fn folders_are_listed_inside_the_root_in_order_and_without_hidden_files() {
        let dir = tempfile::tempdir().unwrap();
        let base = dir.path();
        fs::create_dir_all(base.join("knocks/deeper")).unwrap();
        fs::create_dir_all(base.join("other")).unwrap();
        for name in ["knocks/b.wav", "knocks/a.wav", "knocks/.c.wav", "other/d.wav"] {
            fs::write(base.join(name), b"x").unwrap();
        }
        let list = |files: &DirFiles, p: &str| {
            let found = files.folder(base.join(p).to_str().unwrap()).map_err(|e| e.code)?;
            Ok(found.iter().map(|f| f.rsplit('/').next().unwrap_or_default().to_owned()).collect::<Vec<_>>())
        };
        let files = DirFiles::new(Root::of(&base.join("knocks/graph.ron")), Limits::default());
        assert_eq!(list(&files, "knocks").unwrap(), ["a.wav", "b.wav"]);
        assert_eq!(list(&files, "knocks/a.wav"), Err("F064"));
        assert_eq!((list(&files, "none"), list(&files, "other")), (Err("F060"), Err("F062")));
        assert!(files.asked().folders.contains(&base.join("knocks")));
        // A folder that is named on the command line may be anywhere.
        let mut root = Root::of(&base.join("knocks/graph.ron"));
        root.allow_named(&base.join("other"));
        assert_eq!(list(&DirFiles::new(root, Limits::default()), "other").unwrap(), ["d.wav"]);
    }
}
