//! How far a long run is, written down now and then, so that one that was interrupted goes on there.
//!
//! A file is magic, format version, the hash of all that follows, length of the header, the header as JSON (see [`Mark`])
//! and the state of each region. There is one file for each phase of a run, and a run holds a lock on the files of its
//! graph and output folder: a second one at the same time does without.

use super::store::write_whole;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

const MAGIC: &[u8; 8] = b"foleyrun";
const FORMAT: u32 = 1;
/// Magic, format and hash.
const FRONT: usize = 8 + 4 + 32;

/// A file that a run has begun to write.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Begun {
    /// Where it lies until the run is over.
    pub part: PathBuf,
    /// Where it is to go.
    pub to: PathBuf,
    /// Bytes that belong to it; what was written later is not looked at.
    pub length: u64,
}

/// What of a phase runs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cut {
    /// Ids of the nodes, and whether their streams are read from the cache.
    pub nodes: Vec<(String, bool)>,
    /// Streams that are written to the cache: id and output port.
    pub writers: Vec<(String, usize)>,
}

/// What is known of a run between two windows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// All that the rest of the run depends on, as a hash.
    pub key: String,
    /// What runs.
    pub cut: Cut,
    /// Windows that are done.
    pub windows: u64,
    /// Files that are being written.
    pub outputs: Vec<Begun>,
    /// Bytes of the state of each region.
    pub sizes: Vec<usize>,
}

/// A mark with the states that belong to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checkpoint {
    /// The mark.
    pub mark: Mark,
    /// State of each region.
    pub states: Vec<Vec<u8>>,
}

/// The marks of the runs of one graph into one folder.
#[derive(Debug)]
pub struct Checkpoints {
    dir: PathBuf,
    name: String,
    every: Duration,
    /// Held until the run is over, from the first need on; `None` where another run holds it.
    lock: OnceLock<Option<File>>,
}

impl Checkpoints {
    /// Marks of a graph that writes into the folder `out`, kept in the folder `dir`: one for each `every` that a run takes.
    #[must_use]
    pub fn new(dir: &Path, graph: &str, out: &Path, every: Duration) -> Self {
        let out = std::path::absolute(out).unwrap_or_else(|_| out.to_owned());
        let mut hasher = blake3::Hasher::new();
        hasher.update(graph.as_bytes()).update(&[0]).update(out.to_string_lossy().as_bytes());
        let name = hasher.finalize().to_hex()[..16].to_owned();
        Self { dir: dir.to_owned(), name, every, lock: OnceLock::new() }
    }

    /// Whether these marks are those of this run.
    fn own(&self) -> bool {
        let lock = || {
            fs::create_dir_all(&self.dir).ok()?;
            let file = File::create(self.dir.join(format!("{}.lock", self.name))).ok()?;
            file.try_lock().is_ok().then_some(file)
        };
        self.lock.get_or_init(lock).is_some()
    }

    /// Time from one mark to the next.
    #[must_use]
    pub fn every(&self) -> Duration {
        self.every
    }

    fn path(&self, phase: usize) -> PathBuf {
        self.dir.join(format!("{}-{phase}.run", self.name))
    }

    /// The last mark of a phase.
    #[must_use]
    pub fn last(&self, phase: usize) -> Option<Mark> {
        self.read(phase).map(|found| found.mark)
    }

    fn read(&self, phase: usize) -> Option<Checkpoint> {
        let path = self.path(phase);
        if path.exists() && self.own() { read(&path) } else { None }
    }

    /// The mark of a phase, where it has the key and all that was written is still there.
    #[must_use]
    pub fn find(&self, phase: usize, key: &str) -> Option<Checkpoint> {
        let found = self.read(phase)?;
        let whole = |b: &Begun| fs::metadata(&b.part).is_ok_and(|m| m.is_file() && m.len() >= b.length);
        (found.mark.key == key && found.mark.outputs.iter().all(whole)).then_some(found)
    }

    /// Writes a mark in the place of an older one, and takes away what only that one needed; says whether it may.
    ///
    /// # Errors
    /// When that cannot be done; the older one stays.
    pub fn keep(&self, phase: usize, checkpoint: &Checkpoint) -> io::Result<bool> {
        if !self.own() {
            return Ok(false);
        }
        let path = self.path(phase);
        let older = read(&path);
        let mut mark = checkpoint.mark.clone();
        mark.sizes = checkpoint.states.iter().map(Vec::len).collect();
        let header = serde_json::to_vec(&mark)?;
        let length = (header.len() as u64).to_le_bytes();
        let rest: Vec<&[u8]> =
            [&length[..], &header].into_iter().chain(checkpoint.states.iter().map(Vec::as_slice)).collect();
        let mut hasher = blake3::Hasher::new();
        rest.iter().for_each(|piece| {
            hasher.update(piece);
        });
        let (format, hash) = (FORMAT.to_le_bytes(), hasher.finalize());
        let pieces: Vec<&[u8]> = [&MAGIC[..], &format, hash.as_bytes()].into_iter().chain(rest).collect();
        write_whole(&path, &pieces)?;
        for gone in older.into_iter().flat_map(|older| older.mark.outputs) {
            if !mark.outputs.iter().any(|own| own.part == gone.part) {
                let _ = fs::remove_file(gone.part);
            }
        }
        Ok(true)
    }

    /// Takes away every mark, with the files that were begun.
    pub fn forget(&self) {
        let entries = fs::read_dir(&self.dir).into_iter().flatten().flatten().map(|entry| entry.path());
        let own = |path: &PathBuf| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            name.starts_with(&format!("{}-", self.name)) && name.ends_with(".run")
        };
        let marks: Vec<PathBuf> = entries.filter(own).collect();
        if marks.is_empty() || !self.own() {
            return;
        }
        for path in marks {
            for begun in read(&path).into_iter().flat_map(|found| found.mark.outputs) {
                let _ = fs::remove_file(begun.part);
            }
            let _ = fs::remove_file(path);
        }
    }
}

/// Takes away the marks of all runs in a folder but of those that run now, with the files that were begun.
pub(super) fn forget_all(dir: &Path) {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten().map(|entry| entry.path());
    for lock in entries.filter(|path| path.extension().is_some_and(|e| e == "lock")) {
        let name = lock.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let marks = Checkpoints { dir: dir.to_owned(), name, every: Duration::ZERO, lock: OnceLock::new() };
        if marks.own() {
            marks.forget();
            let _ = fs::remove_file(lock);
        }
    }
}

/// A checkpoint that is whole; no length in it is believed before the hash has been compared.
fn read(path: &Path) -> Option<Checkpoint> {
    let bytes = fs::read(path).ok()?;
    let (front, rest) = bytes.split_at_checked(FRONT)?;
    let known = front[..8] == MAGIC[..] && front[8..12] == FORMAT.to_le_bytes();
    if !known || blake3::hash(rest).as_bytes()[..] != front[12..] {
        return None;
    }
    let (length, rest) = rest.split_first_chunk()?;
    let (header, mut rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    let mark: Mark = serde_json::from_slice(header).ok()?;
    let mut states = Vec::new();
    for size in &mark.sizes {
        let (state, after) = rest.split_at_checked(*size)?;
        states.push(state.to_vec());
        rest = after;
    }
    Some(Checkpoint { mark, states })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begun(dir: &Path, name: &str, bytes: &[u8]) -> Begun {
        let part = dir.join(name);
        fs::write(&part, bytes).unwrap();
        Begun { part, to: dir.join("out.wav"), length: bytes.len() as u64 }
    }

    fn checkpoint(key: &str, outputs: Vec<Begun>) -> Checkpoint {
        let states = vec![vec![1, 2, 3], Vec::new(), vec![4; 1000]];
        let mark =
            Mark { key: key.to_owned(), windows: 7, outputs, sizes: vec![3, 0, 1000], ..Mark::default() };
        Checkpoint { mark, states }
    }

    fn of(dir: &Path) -> Checkpoints {
        Checkpoints::new(dir, "graph.ron", Path::new("out"), Duration::from_secs(1))
    }

    #[test]
    fn a_mark_is_found_by_its_key_while_all_that_was_written_is_there() {
        let dir = tempfile::tempdir().unwrap();
        let marks = of(dir.path());
        let made = checkpoint("a", vec![begun(dir.path(), "1.part", b"12345")]);
        assert!(marks.keep(0, &made).unwrap());
        assert_eq!(marks.find(0, "a").as_ref(), Some(&made));
        assert_eq!((marks.find(0, "b"), marks.find(1, "a")), (None, None));
        fs::write(dir.path().join("1.part"), b"1234567").unwrap();
        assert!(marks.find(0, "a").is_some(), "what was written later does no harm");
        fs::write(dir.path().join("1.part"), b"1234").unwrap();
        assert_eq!(marks.find(0, "a"), None, "what was written is gone");
    }

    #[test]
    fn a_newer_mark_takes_the_place_of_an_older_one_and_of_its_files() {
        let dir = tempfile::tempdir().unwrap();
        let marks = of(dir.path());
        let [one, two] = ["1.part", "2.part"].map(|name| begun(dir.path(), name, b"x"));
        marks.keep(0, &checkpoint("a", vec![one.clone(), two.clone()])).unwrap();
        marks.keep(0, &checkpoint("b", vec![two.clone()])).unwrap();
        assert_eq!((one.part.exists(), two.part.exists()), (false, true));
        assert!(marks.find(0, "b").is_some());
        marks.forget();
        assert!(!two.part.exists() && marks.last(0).is_none());
    }

    #[test]
    fn all_marks_can_be_taken_away_but_those_of_a_run_that_runs() {
        let dir = tempfile::tempdir().unwrap();
        let [old, other] = ["old.part", "own.part"].map(|name| begun(dir.path(), name, b"x"));
        let running = of(dir.path());
        running.keep(0, &checkpoint("a", vec![other.clone()])).unwrap();
        let over = Checkpoints::new(dir.path(), "other.ron", Path::new("out"), Duration::ZERO);
        over.keep(1, &checkpoint("b", vec![old.clone()])).unwrap();
        drop(over);
        forget_all(dir.path());
        assert_eq!((old.part.exists(), other.part.exists()), (false, true));
        assert!(running.find(0, "a").is_some());
        drop(running);
        forget_all(dir.path());
        assert!(!other.part.exists() && fs::read_dir(dir.path()).unwrap().next().is_none());
    }

    #[test]
    fn a_damaged_mark_counts_as_none() {
        let dir = tempfile::tempdir().unwrap();
        let marks = of(dir.path());
        marks.keep(0, &checkpoint("a", Vec::new())).unwrap();
        let path = marks.path(0);
        let whole = fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x10;
            fs::write(&path, &bytes).unwrap();
            assert_eq!(marks.find(0, "a"), None, "byte {at}");
            fs::write(&path, &whole[..at]).unwrap();
            assert_eq!(marks.find(0, "a"), None, "cut at {at}");
        }
    }

    #[test]
    fn a_second_run_at_the_same_time_does_without() {
        let dir = tempfile::tempdir().unwrap();
        let (first, second) = (of(dir.path()), of(dir.path()));
        first.keep(0, &checkpoint("a", Vec::new())).unwrap();
        assert!(!second.keep(0, &checkpoint("a", Vec::new())).unwrap());
        first.keep(0, &checkpoint("b", Vec::new())).unwrap();
        assert!(second.last(0).is_none() && second.find(0, "b").is_none());
        second.forget();
        drop(second);
        assert!(first.find(0, "b").is_some(), "the second leaves the first alone");
        drop(first);
        assert!(of(dir.path()).find(0, "b").is_some(), "and what the first left is there for the next");
    }
}
