//! Snapshots: the contents of all files of a graph at one time.

use crate::graph::{Asked, Stamp, files_in, matching};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf, absolute};
use std::time::{Duration, SystemTime};

/// A watched file, sequence, or folder whose files are listed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// A file or folder, by the path by which it was opened.
    Path(PathBuf),
    /// The files of a numbered sequence.
    Sequence(String),
    /// The files in a folder.
    Folder(PathBuf),
}

impl Key {
    /// Returns the name for messages.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Path(path) | Self::Folder(path) => path.display().to_string(),
            Self::Sequence(pattern) => pattern.clone(),
        }
    }

    fn path(&self) -> &Path {
        match self {
            Self::Path(path) | Self::Folder(path) => path,
            Self::Sequence(pattern) => Path::new(pattern),
        }
    }
}

/// The content of a watched file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// There is no file.
    Missing,
    /// The file cannot be read.
    Unreadable,
    /// A folder, or another entry that is no plain file.
    Other,
    /// Hash of the bytes, or of the names of a sequence or of the files in a folder.
    Hash([u8; 32]),
}

/// Contents by key.
pub type Contents = BTreeMap<Key, Content>;

/// Age from which the time of a file proves that it was not written again: coarse file systems have a resolution of 2 s.
const TIME_RESOLUTION: Duration = Duration::from_secs(2);

#[derive(Clone, Debug)]
struct Entry {
    stamp: Option<Stamp>,
    at: SystemTime,
    content: Content,
}

impl Entry {
    fn read(key: &Key) -> Self {
        let at = SystemTime::now();
        match key {
            Key::Path(path) => {
                // The stamp is taken first, so that a write during the read is found by the next comparison.
                let stamp = Stamp::of(path);
                Self { stamp, at, content: read_content(path) }
            }
            Key::Sequence(pattern) => {
                let names = matching(pattern).map_err(|(_, e)| e).map(|mut files| {
                    files.sort();
                    files.into_iter().map(|(_, file)| file).collect()
                });
                Self { stamp: None, at, content: names_content(names) }
            }
            Key::Folder(path) => Self { stamp: None, at, content: names_content(files_in(path)) },
        }
    }

    /// Returns true if the times of the file prove that it is unchanged.
    fn is_current(&self, key: &Key) -> bool {
        let Key::Path(path) = key else { return false };
        let old = |s: &Stamp| {
            s.modified.is_some_and(|m| self.at.duration_since(m).is_ok_and(|age| age > TIME_RESOLUTION))
        };
        self.stamp == Stamp::of(path) && self.stamp.as_ref().is_none_or(old)
    }
}

fn names_content(names: io::Result<Vec<String>>) -> Content {
    match names {
        Ok(names) => {
            let mut hasher = blake3::Hasher::new();
            for name in names {
                hasher.update(name.as_bytes()).update(b"\0");
            }
            Content::Hash(*hasher.finalize().as_bytes())
        }
        Err(e) if e.kind() == io::ErrorKind::NotFound => Content::Missing,
        Err(_) => Content::Unreadable,
    }
}

fn read_content(path: &Path) -> Content {
    match fs::metadata(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Content::Missing,
        Err(_) => Content::Unreadable,
        // A pipe or a device would block.
        Ok(meta) if !meta.is_file() => Content::Other,
        Ok(_) => {
            let hash = |mut file: File| {
                let mut hasher = blake3::Hasher::new();
                io::copy(&mut file, &mut hasher).map(|_| *hasher.finalize().as_bytes())
            };
            match File::open(path).and_then(hash) {
                Ok(hash) => Content::Hash(hash),
                Err(e) if e.kind() == io::ErrorKind::NotFound => Content::Missing,
                Err(_) => Content::Unreadable,
            }
        }
    }
}

/// The watched files and their contents.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    entries: BTreeMap<Key, Entry>,
}

impl Snapshot {
    /// Adds files that were opened; returns true if one of them has changed since it was opened.
    pub fn add(&mut self, asked: &Asked) -> bool {
        let mut changed = false;
        for (path, stamp) in &asked.files {
            self.entries.entry(Key::Path(path.clone())).or_insert_with_key(|key| {
                let entry = Entry::read(key);
                changed |= entry.stamp != *stamp && entry.content != Content::Other;
                entry
            });
        }
        for pattern in &asked.sequences {
            self.entries.entry(Key::Sequence(pattern.clone())).or_insert_with_key(Entry::read);
        }
        for folder in &asked.folders {
            self.entries.entry(Key::Folder(folder.clone())).or_insert_with_key(Entry::read);
        }
        changed
    }

    /// Retains only the files in `asked`.
    pub fn retain(&mut self, asked: &Asked) {
        self.entries.retain(|key, _| match key {
            Key::Path(path) => asked.files.contains_key(path),
            Key::Sequence(pattern) => asked.sequences.contains(pattern),
            Key::Folder(path) => asked.folders.contains(path),
        });
    }

    /// Reads all files that may have changed; returns true if a content is different.
    pub fn update(&mut self) -> bool {
        let mut changed = false;
        for (key, entry) in &mut self.entries {
            if entry.is_current(key) {
                continue;
            }
            let now = Entry::read(key);
            changed |= now.content != entry.content;
            *entry = now;
        }
        changed
    }

    /// Returns the contents at the last update.
    #[must_use]
    pub fn contents(&self) -> Contents {
        self.entries.iter().map(|(key, entry)| (key.clone(), entry.content)).collect()
    }

    /// Returns the number of files and sequences.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns true if there are no files.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Returns the folders to watch: those of all files, their parents (a folder may be replaced), the targets of symbolic
    /// links, and the nearest existing ancestors of missing folders.
    ///
    /// Files themselves are not watched: such a watch ends when an editor replaces the file.
    #[must_use]
    pub fn folders(&self) -> BTreeSet<PathBuf> {
        let mut asked = BTreeSet::new();
        let mut found = BTreeSet::new();
        for key in self.entries.keys() {
            let path = absolute(key.path()).unwrap_or_else(|_| key.path().to_owned());
            asked.extend(path.ancestors().skip(1).take(2).map(Path::to_owned));
            let real = fs::canonicalize(&path).ok();
            found.extend(real.as_deref().and_then(Path::parent).map(Path::to_owned));
            found.extend(real.filter(|_| matches!(key, Key::Folder(_))));
        }
        found.extend(asked.iter().filter_map(|f| f.ancestors().find_map(|f| fs::canonicalize(f).ok())));
        found
    }

    /// Returns the names of the files and of their ancestors, and the folders of sequences and listed ones, in which any file is relevant.
    #[must_use]
    pub fn names(&self) -> (BTreeSet<OsString>, BTreeSet<PathBuf>) {
        let mut names = BTreeSet::new();
        let mut folders = BTreeSet::new();
        for key in self.entries.keys() {
            let path = absolute(key.path()).unwrap_or_else(|_| key.path().to_owned());
            let listed = match key {
                Key::Path(_) => None,
                Key::Sequence(_) => path.parent(),
                Key::Folder(_) => Some(path.as_path()),
            };
            folders.extend(listed.and_then(|p| fs::canonicalize(p).ok()));
            for path in [fs::canonicalize(&path).ok(), Some(path)].into_iter().flatten() {
                names.extend(path.iter().map(OsString::from));
            }
        }
        (names, folders)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot(paths: &[&Path]) -> Snapshot {
        let files = paths.iter().map(|p| (p.to_path_buf(), Stamp::of(p))).collect();
        let mut snapshot = Snapshot::default();
        assert!(!snapshot.add(&Asked { files, ..Asked::default() }));
        snapshot
    }

    #[test]
    fn the_same_bytes_written_again_are_no_change() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        fs::write(&path, "one").unwrap();
        let mut snapshot = snapshot(&[&path]);
        fs::write(&path, "one").unwrap();
        assert!(!snapshot.update());
        // The same length, and possibly the same time of the file system.
        fs::write(&path, "two").unwrap();
        assert!(snapshot.update());
        assert!(!snapshot.update());
    }

    #[test]
    fn a_file_that_comes_and_goes_is_a_change_each_time() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("deep/er/a");
        let mut snapshot = snapshot(&[&path]);
        assert!(snapshot.folders().contains(&fs::canonicalize(dir.path()).unwrap()));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        assert!(!snapshot.update());
        fs::write(&path, "one").unwrap();
        assert!(snapshot.update());
        fs::remove_file(&path).unwrap();
        assert!(snapshot.update());
    }

    #[test]
    fn a_new_file_of_a_sequence_is_a_change_and_another_file_is_none() {
        let dir = tempfile::tempdir().unwrap();
        let pattern = dir.path().join("frame_####.obj").to_str().unwrap().to_owned();
        let mut snapshot = Snapshot::default();
        snapshot.add(&Asked { sequences: [pattern].into(), ..Asked::default() });
        fs::write(dir.path().join("notes.txt"), "").unwrap();
        assert!(!snapshot.update());
        fs::write(dir.path().join("frame_0001.obj"), "").unwrap();
        assert!(snapshot.update());
    }

    #[test]
    fn a_new_file_in_a_listed_folder_is_a_change() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("knocks");
        let mut snapshot = Snapshot::default();
        snapshot.add(&Asked { folders: [folder.clone()].into(), ..Asked::default() });
        fs::create_dir(&folder).unwrap();
        assert!(snapshot.update());
        fs::write(folder.join("a.wav"), "").unwrap();
        assert!(snapshot.update() && !snapshot.update());
        let real = fs::canonicalize(&folder).unwrap();
        assert!(snapshot.folders().contains(&real) && snapshot.names().1.contains(&real));
        fs::remove_file(folder.join("a.wav")).unwrap();
        assert!(snapshot.update());
    }

    #[test]
    fn a_file_that_changed_after_it_was_opened_is_reported() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        let files = [(path.clone(), Stamp::of(&path))].into();
        fs::write(&path, "now there").unwrap();
        assert!(Snapshot::default().add(&Asked { files, ..Asked::default() }));
    }
}
