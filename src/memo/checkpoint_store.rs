//! Checkpoints on disk, from which interrupted runs resume.
//!
//! A file is magic, format version, the hash of all that follows, length of the header, the header as JSON (see
//! [`CheckpointHeader`]) and the state of each region. There is one file for each phase of a run. A run holds a lock on the
//! files of its graph and output folder; a second run at the same time saves no checkpoints.

use super::atomic_file::write_atomically;
use super::plain_file;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

const MAGIC: &[u8; 8] = b"foleyrun";
const FORMAT: u32 = 1;
/// Bytes of magic, format and hash.
const PREFIX: usize = 8 + 4 + 32;

/// An output file that a run is writing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartialFile {
    /// Temporary path.
    pub part: PathBuf,
    /// Final path.
    pub to: PathBuf,
    /// Bytes at the checkpoint; later bytes are discarded.
    pub length: u64,
}

/// The nodes of a phase that run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhaseSubset {
    /// Ids of the nodes, and true for those whose streams are read from the cache.
    pub nodes: Vec<(String, bool)>,
    /// Streams that are written to the cache: id and output port.
    pub writers: Vec<(String, usize)>,
}

/// The header of a checkpoint: a phase between two windows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CheckpointHeader {
    /// Hash of all that the rest of the run depends on.
    pub key: String,
    /// Nodes that run.
    #[serde(rename = "cut")]
    pub subset: PhaseSubset,
    /// Windows done.
    pub windows: u64,
    /// Output files that are being written.
    pub outputs: Vec<PartialFile>,
    /// Bytes of the state of each region.
    pub sizes: Vec<usize>,
}

/// A checkpoint: header and states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checkpoint {
    /// Header.
    pub header: CheckpointHeader,
    /// State of each region.
    pub states: Vec<Vec<u8>>,
}

/// The checkpoints of one graph and one output folder.
#[derive(Debug)]
pub struct CheckpointStore {
    dir: PathBuf,
    name: String,
    interval: Duration,
    /// Taken at the first use and held until the run is over; `None` inside if another run holds it.
    lock: OnceLock<Option<File>>,
}

impl CheckpointStore {
    /// Checkpoints, in the folder `dir`, of a graph that writes into the folder `out`; a run saves one per `interval`.
    #[must_use]
    pub fn new(dir: &Path, graph: &str, out: &Path, interval: Duration) -> Self {
        let out = std::path::absolute(out).unwrap_or_else(|_| out.to_owned());
        let mut hasher = blake3::Hasher::new();
        hasher.update(graph.as_bytes()).update(&[0]).update(out.to_string_lossy().as_bytes());
        let name = hasher.finalize().to_hex()[..16].to_owned();
        Self { dir: dir.to_owned(), name, interval, lock: OnceLock::new() }
    }

    /// Returns true if this run holds the lock.
    fn is_locked(&self) -> bool {
        let lock = || {
            fs::create_dir_all(&self.dir).ok()?;
            let file = File::create(self.dir.join(format!("{}.lock", self.name))).ok()?;
            file.try_lock().is_ok().then_some(file)
        };
        self.lock.get_or_init(lock).is_some()
    }

    /// Returns the time between two checkpoints.
    #[must_use]
    pub fn interval(&self) -> Duration {
        self.interval
    }

    fn path(&self, phase: usize) -> PathBuf {
        self.dir.join(format!("{}-{phase}.run", self.name))
    }

    /// Reads the header of the last checkpoint of a phase.
    #[must_use]
    pub fn last_header(&self, phase: usize) -> Option<CheckpointHeader> {
        self.read(phase).map(|found| found.header)
    }

    fn read(&self, phase: usize) -> Option<Checkpoint> {
        let path = self.path(phase);
        if path.exists() && self.is_locked() { read(&path) } else { None }
    }

    /// Finds the checkpoint of a phase with a key whose output files are still complete.
    #[must_use]
    pub fn find(&self, phase: usize, key: &str) -> Option<Checkpoint> {
        let found = self.read(phase)?;
        let complete = |file: &PartialFile| {
            fs::metadata(&file.part).is_ok_and(|m| m.is_file() && m.len() >= file.length)
        };
        (found.header.key == key && found.header.outputs.iter().all(complete)).then_some(found)
    }

    /// Saves a checkpoint in place of the last one, and removes output files that only the last one used.
    ///
    /// Returns false if another run holds the lock.
    ///
    /// # Errors
    /// When it cannot be written; the last one stays.
    pub fn save(&self, phase: usize, checkpoint: &Checkpoint) -> io::Result<bool> {
        if !self.is_locked() {
            return Ok(false);
        }
        let path = self.path(phase);
        let older = read(&path);
        let mut header = checkpoint.header.clone();
        header.sizes = checkpoint.states.iter().map(Vec::len).collect();
        let header_bytes = serde_json::to_vec(&header)?;
        let length = (header_bytes.len() as u64).to_le_bytes();
        let rest: Vec<&[u8]> = [&length[..], &header_bytes]
            .into_iter()
            .chain(checkpoint.states.iter().map(Vec::as_slice))
            .collect();
        let mut hasher = blake3::Hasher::new();
        rest.iter().for_each(|piece| {
            hasher.update(piece);
        });
        let (format, hash) = (FORMAT.to_le_bytes(), hasher.finalize());
        let pieces: Vec<&[u8]> = [&MAGIC[..], &format, hash.as_bytes()].into_iter().chain(rest).collect();
        write_atomically(&path, &pieces)?;
        for file in older.into_iter().flat_map(|older| older.header.outputs) {
            if !header.outputs.iter().any(|other| other.part == file.part) {
                let _ = fs::remove_file(file.part);
            }
        }
        Ok(true)
    }

    /// Removes all checkpoints with their partial output files.
    pub fn remove(&self) {
        let entries = fs::read_dir(&self.dir).into_iter().flatten().flatten().map(|entry| entry.path());
        let own = |path: &PathBuf| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            name.starts_with(&format!("{}-", self.name)) && name.ends_with(".run")
        };
        let checkpoints: Vec<PathBuf> = entries.filter(own).collect();
        if checkpoints.is_empty() || !self.is_locked() {
            return;
        }
        for path in checkpoints {
            for file in read(&path).into_iter().flat_map(|found| found.header.outputs) {
                let _ = fs::remove_file(file.part);
            }
            let _ = fs::remove_file(path);
        }
    }
}

impl Drop for CheckpointStore {
    /// Unlocks rather than only closes the file: a child process has a duplicate of its descriptor between `fork` and `exec`, and
    /// would hold the lock for that time.
    fn drop(&mut self) {
        if let Some(Some(file)) = self.lock.get() {
            let _ = file.unlock();
        }
    }
}

/// Removes the checkpoints in a folder with their partial output files, except those of running processes.
pub fn remove_all(dir: &Path) {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten().map(|entry| entry.path());
    for lock in entries.filter(|path| path.extension().is_some_and(|e| e == "lock")) {
        let name = lock.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let store =
            CheckpointStore { dir: dir.to_owned(), name, interval: Duration::ZERO, lock: OnceLock::new() };
        if store.is_locked() {
            store.remove();
            let _ = fs::remove_file(lock);
        }
    }
}

/// Returns true if a file can be the partial file of an output: `NAME.NUMBER.part` beside `NAME`, and no link. A checkpoint that
/// somebody else has written must not have other files resumed or removed.
fn is_partial(file: &PartialFile) -> bool {
    let text = |path: &Path| path.file_name().and_then(|name| name.to_str()).map(str::to_owned);
    let (Some(part), Some(to)) = (text(&file.part), text(&file.to)) else { return false };
    let number = part.strip_prefix(&to).and_then(|rest| rest.strip_prefix('.')?.strip_suffix(".part"));
    let named = number.is_some_and(|number| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()));
    let plain = fs::symlink_metadata(&file.part).map_or(true, |meta| meta.is_file());
    named && plain && file.part.parent() == file.to.parent()
}

/// Reads a complete checkpoint; the hash is compared before any length in it is used.
fn read(path: &Path) -> Option<Checkpoint> {
    let bytes = plain_file::read(path, plain_file::MAX_BYTES).ok()?;
    let (prefix, rest) = bytes.split_at_checked(PREFIX)?;
    let known = prefix[..8] == MAGIC[..] && prefix[8..12] == FORMAT.to_le_bytes();
    if !known || blake3::hash(rest).as_bytes()[..] != prefix[12..] {
        return None;
    }
    let (length, rest) = rest.split_first_chunk()?;
    let (header, mut rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    let header: CheckpointHeader = serde_json::from_slice(header).ok()?;
    if !header.outputs.iter().all(is_partial) {
        return None;
    }
    let mut states = Vec::new();
    for size in &header.sizes {
        let (state, after) = rest.split_at_checked(*size)?;
        states.push(state.to_vec());
        rest = after;
    }
    Some(Checkpoint { header, states })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn partial_file(dir: &Path, name: &str, bytes: &[u8]) -> PartialFile {
        let part = dir.join(format!("out.wav.{name}"));
        fs::write(&part, bytes).unwrap();
        PartialFile { part, to: dir.join("out.wav"), length: bytes.len() as u64 }
    }

    fn checkpoint(key: &str, outputs: Vec<PartialFile>) -> Checkpoint {
        let states = vec![vec![1, 2, 3], Vec::new(), vec![4; 1000]];
        let header = CheckpointHeader {
            key: key.to_owned(),
            windows: 7,
            outputs,
            sizes: vec![3, 0, 1000],
            ..CheckpointHeader::default()
        };
        Checkpoint { header, states }
    }

    fn store_in(dir: &Path) -> CheckpointStore {
        CheckpointStore::new(dir, "graph.ron", Path::new("out"), Duration::from_secs(1))
    }

    #[test]
    fn a_checkpoint_is_found_by_its_key_while_its_output_files_are_complete() {
        let dir = tempfile::tempdir().unwrap();
        let store = store_in(dir.path());
        let made = checkpoint("a", vec![partial_file(dir.path(), "1.part", b"12345")]);
        assert!(store.save(0, &made).unwrap());
        assert_eq!(store.find(0, "a").as_ref(), Some(&made));
        assert_eq!((store.find(0, "b"), store.find(1, "a")), (None, None));
        fs::write(dir.path().join("out.wav.1.part"), b"1234567").unwrap();
        assert!(store.find(0, "a").is_some(), "later bytes are ignored");
        fs::write(dir.path().join("out.wav.1.part"), b"1234").unwrap();
        assert_eq!(store.find(0, "a"), None, "bytes are missing");
    }

    #[test]
    fn a_checkpoint_replaces_the_last_one_and_its_files() {
        let dir = tempfile::tempdir().unwrap();
        let store = store_in(dir.path());
        let [one, two] = ["1.part", "2.part"].map(|name| partial_file(dir.path(), name, b"x"));
        store.save(0, &checkpoint("a", vec![one.clone(), two.clone()])).unwrap();
        store.save(0, &checkpoint("b", vec![two.clone()])).unwrap();
        assert_eq!((one.part.exists(), two.part.exists()), (false, true));
        assert!(store.find(0, "b").is_some());
        store.remove();
        assert!(!two.part.exists() && store.last_header(0).is_none());
    }

    #[test]
    fn all_checkpoints_are_removed_except_those_of_a_running_process() {
        let dir = tempfile::tempdir().unwrap();
        let [old, other] = ["3.part", "4.part"].map(|name| partial_file(dir.path(), name, b"x"));
        let running = store_in(dir.path());
        running.save(0, &checkpoint("a", vec![other.clone()])).unwrap();
        let ended = CheckpointStore::new(dir.path(), "other.ron", Path::new("out"), Duration::ZERO);
        ended.save(1, &checkpoint("b", vec![old.clone()])).unwrap();
        drop(ended);
        remove_all(dir.path());
        assert_eq!((old.part.exists(), other.part.exists()), (false, true));
        assert!(running.find(0, "a").is_some());
        drop(running);
        remove_all(dir.path());
        assert!(!other.part.exists() && fs::read_dir(dir.path()).unwrap().next().is_none());
    }

    #[test]
    fn a_damaged_checkpoint_is_not_found() {
        let dir = tempfile::tempdir().unwrap();
        let store = store_in(dir.path());
        store.save(0, &checkpoint("a", Vec::new())).unwrap();
        let path = store.path(0);
        let whole = fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x10;
            fs::write(&path, &bytes).unwrap();
            assert_eq!(store.find(0, "a"), None, "byte {at}");
            fs::write(&path, &whole[..at]).unwrap();
            assert_eq!(store.find(0, "a"), None, "truncated at {at}");
        }
    }

    #[test]
    fn a_second_run_at_the_same_time_saves_no_checkpoints() {
        let dir = tempfile::tempdir().unwrap();
        let (first, second) = (store_in(dir.path()), store_in(dir.path()));
        first.save(0, &checkpoint("a", Vec::new())).unwrap();
        assert!(!second.save(0, &checkpoint("a", Vec::new())).unwrap());
        first.save(0, &checkpoint("b", Vec::new())).unwrap();
        assert!(second.last_header(0).is_none() && second.find(0, "b").is_none());
        second.remove();
        drop(second);
        assert!(first.find(0, "b").is_some(), "the second run does not remove it");
        drop(first);
        assert!(store_in(dir.path()).find(0, "b").is_some(), "the next run finds it");
    }

    #[test]
    fn the_lock_is_released_while_a_child_process_has_a_duplicate_of_its_file() {
        let dir = tempfile::tempdir().unwrap();
        let store = store_in(dir.path());
        assert!(store.is_locked());
        let duplicate = store.lock.get().and_then(Option::as_ref).unwrap().try_clone().unwrap();
        assert!(!store_in(dir.path()).is_locked());
        drop(store);
        assert!(store_in(dir.path()).is_locked());
        drop(duplicate);
    }

    #[test]
    fn a_checkpoint_that_names_another_file_is_none_and_the_file_stays() {
        let dir = tempfile::tempdir().unwrap();
        let store = store_in(dir.path());
        let other = dir.path().join("other");
        fs::write(&other, b"mine").unwrap();
        let to = || dir.path().join("other");
        let named = |part: &str| PartialFile { part: dir.path().join(part), to: to(), length: 0 };
        for wrong in ["other", "other.part", "other..part", "other.x1.part", "sub/other.1.part"] {
            store.save(0, &checkpoint("a", vec![named(wrong)])).unwrap();
            assert_eq!(store.find(0, "a"), None, "{wrong}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&other, dir.path().join("other.1.part")).unwrap();
            store.save(0, &checkpoint("a", vec![named("other.1.part")])).unwrap();
            assert_eq!(store.find(0, "a"), None);
        }
        store.remove();
        remove_all(dir.path());
        assert_eq!(fs::read(&other).unwrap(), b"mine");
    }
}
