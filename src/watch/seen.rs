//! The contents of the files that matter, as they were when looked at last.

use crate::graph::{Asked, Stamp, matching};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf, absolute};
use std::time::{Duration, SystemTime};

/// What is looked at.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// A file or folder, by the path that was asked for.
    Path(PathBuf),
    /// Which files belong to a numbered sequence.
    Sequence(String),
}

impl Key {
    /// What people call it.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Path(path) => path.display().to_string(),
            Self::Sequence(pattern) => pattern.clone(),
        }
    }

    fn path(&self) -> &Path {
        match self {
            Self::Path(path) => path,
            Self::Sequence(pattern) => Path::new(pattern),
        }
    }
}

/// What was found there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Nothing.
    Missing,
    /// Something that cannot be read.
    Unreadable,
    /// A folder, or anything else that is no plain file.
    Other,
    /// Bytes, or a list of names, with this hash.
    Hash([u8; 32]),
}

/// All contents at one time.
pub type Contents = BTreeMap<Key, Content>;

/// How old a file has to be for its times to tell that it was not written again: coarse file systems count in 2 s.
const COARSE: Duration = Duration::from_secs(2);

#[derive(Clone, Debug)]
struct Entry {
    stamp: Option<Stamp>,
    at: SystemTime,
    content: Content,
}

impl Entry {
    fn look(key: &Key) -> Self {
        let at = SystemTime::now();
        match key {
            Key::Path(path) => {
                // The stamp comes first: what is written while the file is read shows at the next look.
                let stamp = Stamp::of(path);
                Self { stamp, at, content: read(path) }
            }
            Key::Sequence(pattern) => {
                let content = match matching(pattern) {
                    Ok(mut files) => {
                        files.sort();
                        let mut hasher = blake3::Hasher::new();
                        for (_, file) in files {
                            hasher.update(file.as_bytes()).update(b"\0");
                        }
                        Content::Hash(*hasher.finalize().as_bytes())
                    }
                    Err((_, e)) if e.kind() == io::ErrorKind::NotFound => Content::Missing,
                    Err(_) => Content::Unreadable,
                };
                Self { stamp: None, at, content }
            }
        }
    }

    /// Whether the file's times alone tell that it is the same; content is read again where there is doubt.
    fn holds(&self, key: &Key) -> bool {
        let Key::Path(path) = key else { return false };
        let old =
            |s: &Stamp| s.modified.is_some_and(|m| self.at.duration_since(m).is_ok_and(|age| age > COARSE));
        self.stamp == Stamp::of(path) && self.stamp.as_ref().is_none_or(old)
    }
}

fn read(path: &Path) -> Content {
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

/// The files that matter and what was in them.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    entries: BTreeMap<Key, Entry>,
}

impl Seen {
    /// Also looks at what was asked for; gives whether any of it has changed after it was asked for.
    pub fn add(&mut self, asked: &Asked) -> bool {
        let mut late = false;
        for (path, stamp) in &asked.files {
            self.entries.entry(Key::Path(path.clone())).or_insert_with_key(|key| {
                let entry = Entry::look(key);
                late |= entry.stamp != *stamp && entry.content != Content::Other;
                entry
            });
        }
        for pattern in &asked.sequences {
            self.entries.entry(Key::Sequence(pattern.clone())).or_insert_with_key(Entry::look);
        }
        late
    }

    /// Forgets everything that was not asked for this time.
    pub fn keep(&mut self, asked: &Asked) {
        self.entries.retain(|key, _| match key {
            Key::Path(path) => asked.files.contains_key(path),
            Key::Sequence(pattern) => asked.sequences.contains(pattern),
        });
    }

    /// Looks again; gives whether anything has another content than before.
    pub fn look(&mut self) -> bool {
        let mut changed = false;
        for (key, entry) in &mut self.entries {
            if entry.holds(key) {
                continue;
            }
            let now = Entry::look(key);
            changed |= now.content != entry.content;
            *entry = now;
        }
        changed
    }

    /// What was found at the last look.
    #[must_use]
    pub fn contents(&self) -> Contents {
        self.entries.iter().map(|(key, entry)| (key.clone(), entry.content)).collect()
    }

    /// How many files and sequences are looked at.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether nothing is looked at.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Where events have to be awaited: the folders of all files, the folders that those are in (they may be replaced),
    /// the folders that links lead to, and the nearest ones that exist of those that do not.
    ///
    /// Folders and never files: a watch on a file ends when an editor puts another one in its place.
    #[must_use]
    pub fn folders(&self) -> BTreeSet<PathBuf> {
        let mut asked = BTreeSet::new();
        let mut found = BTreeSet::new();
        for key in self.entries.keys() {
            let path = absolute(key.path()).unwrap_or_else(|_| key.path().to_owned());
            asked.extend(path.ancestors().skip(1).take(2).map(Path::to_owned));
            found.extend(fs::canonicalize(&path).ok().and_then(|p| p.parent().map(Path::to_owned)));
        }
        found.extend(asked.iter().filter_map(|f| f.ancestors().find_map(|f| fs::canonicalize(f).ok())));
        found
    }

    /// Names of the files, and of the folders above them, and the folders in which any file matters.
    #[must_use]
    pub fn names(&self) -> (BTreeSet<OsString>, BTreeSet<PathBuf>) {
        let mut names = BTreeSet::new();
        let mut folders = BTreeSet::new();
        for key in self.entries.keys() {
            let path = absolute(key.path()).unwrap_or_else(|_| key.path().to_owned());
            if matches!(key, Key::Sequence(_)) {
                folders.extend(path.parent().and_then(|p| fs::canonicalize(p).ok()));
            }
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

    fn seen(paths: &[&Path]) -> Seen {
        let files = paths.iter().map(|p| (p.to_path_buf(), Stamp::of(p))).collect();
        let mut seen = Seen::default();
        assert!(!seen.add(&Asked { files, ..Asked::default() }));
        seen
    }

    #[test]
    fn the_same_bytes_written_again_are_no_change() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        fs::write(&path, "one").unwrap();
        let mut seen = seen(&[&path]);
        fs::write(&path, "one").unwrap();
        assert!(!seen.look());
        // As long as before, and perhaps within one tick of the file system's clock.
        fs::write(&path, "two").unwrap();
        assert!(seen.look());
        assert!(!seen.look());
    }

    #[test]
    fn a_file_that_comes_and_goes_is_a_change_each_time() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("deep/er/a");
        let mut seen = seen(&[&path]);
        assert!(seen.folders().contains(&fs::canonicalize(dir.path()).unwrap()));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        assert!(!seen.look());
        fs::write(&path, "one").unwrap();
        assert!(seen.look());
        fs::remove_file(&path).unwrap();
        assert!(seen.look());
    }

    #[test]
    fn a_new_file_of_a_sequence_is_a_change_and_another_file_is_none() {
        let dir = tempfile::tempdir().unwrap();
        let pattern = dir.path().join("frame_####.obj").to_str().unwrap().to_owned();
        let mut seen = Seen::default();
        seen.add(&Asked { sequences: [pattern].into(), ..Asked::default() });
        fs::write(dir.path().join("notes.txt"), "").unwrap();
        assert!(!seen.look());
        fs::write(dir.path().join("frame_0001.obj"), "").unwrap();
        assert!(seen.look());
    }

    #[test]
    fn a_file_that_changed_after_it_was_asked_for_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        let files = [(path.clone(), Stamp::of(&path))].into();
        fs::write(&path, "now there").unwrap();
        assert!(Seen::default().add(&Asked { files, ..Asked::default() }));
    }
}
