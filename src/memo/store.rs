//! Entries on disk: one file each, written atomically, verified when read, and within a total size.
//!
//! An entry is magic, format version, length of the header, the hash of all that follows, the header as JSON, and the
//! values as postcard. Its name is its key, so two processes that write an entry write the same bytes.

use super::atomic_file::write_atomically;
use super::checkpoint_store;
use super::entry::{Entry, Unusable};
use super::plain_file;
use super::stream;
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

const MAGIC: &[u8; 8] = b"foleymem";
const FORMAT: u32 = 1;
/// Bytes of magic, format, length and hash.
const PREFIX: usize = 8 + 4 + 4 + 32;
/// Maximum bytes of a header: a few hundred, and the summary of the node.
const MAX_HEADER_BYTES: usize = 16 << 20;
/// Age at which a temporary file is removed: the process that wrote it was killed.
const STALE: Duration = Duration::from_secs(3600);

/// One file of a store.
#[derive(Clone, Debug)]
pub struct StoredFile {
    /// Its path.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Time of the last use.
    pub used: SystemTime,
    /// Its header; `None` if it cannot be read.
    pub entry: Option<Entry>,
}

impl StoredFile {
    /// Returns the computing time that it saves per byte, s.
    #[must_use]
    pub fn seconds_per_byte(&self) -> f64 {
        self.entry.as_ref().map_or(0.0, |e| e.seconds.max(0.0) / self.bytes.max(1) as f64)
    }

    fn key(&self) -> &str {
        self.path.file_stem().and_then(|s| s.to_str()).unwrap_or_default()
    }
}

/// A folder of entries.
#[derive(Debug)]
pub struct Store {
    dir: PathBuf,
    cap: u64,
}

impl Store {
    /// The entries in a folder, which take at most `cap` bytes.
    #[must_use]
    pub fn new(dir: impl Into<PathBuf>, cap: u64) -> Self {
        Self { dir: dir.into(), cap }
    }

    /// Returns the folder.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Returns the maximum bytes of all entries.
    #[must_use]
    pub fn cap(&self) -> u64 {
        self.cap
    }

    fn path(&self, key: &str) -> PathBuf {
        self.dir.join(format!("{key}.memo"))
    }

    /// Returns the path of the stream of a key.
    #[must_use]
    pub fn stream_path(&self, key: &str) -> PathBuf {
        self.dir.join(format!("{key}.stream"))
    }

    /// Removes entries other than `used` until `bytes` more fit; returns true if they fit.
    pub fn make_room(&self, bytes: u64, used: &HashSet<String>) -> bool {
        bytes <= self.cap && self.evict(self.cap - bytes, used) <= self.cap - bytes
    }

    /// Removes the entry of a key, if there is one.
    pub fn remove(&self, key: &str) {
        let _ = fs::remove_file(self.path(key));
    }

    /// Reads the header of an entry without its values; `None` if there is none that can be read.
    #[must_use]
    pub fn peek(&self, key: &str) -> Option<Entry> {
        read_header(&self.path(key)).filter(|e| e.key == key)
    }

    /// Reads an entry and the bytes of its values; `None` if there is none.
    ///
    /// # Errors
    /// If a file of this name exists, but is not a complete entry of the key.
    pub fn read(&self, key: &str) -> Result<Option<(Entry, Vec<u8>)>, Unusable> {
        let path = self.path(key);
        let unusable = |reason: &str| Err(Unusable(reason.to_owned()));
        let bytes = match plain_file::read(&path, self.cap) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Unusable(format!("it cannot be read: {e}"))),
        };
        if bytes.len() < PREFIX {
            return unusable("it is cut short");
        }
        let (prefix, rest) = bytes.split_at(PREFIX);
        if &prefix[..8] != MAGIC {
            return unusable("it is another kind of file");
        }
        let (format, length) = (number(prefix, 8), number(prefix, 12) as usize);
        if format != FORMAT {
            return Err(Unusable(format!("it has format {format}, this version reads {FORMAT}")));
        }
        if blake3::hash(rest).as_bytes() != &prefix[16..PREFIX] || length > rest.len() {
            return unusable("it is damaged or cut short");
        }
        let Ok(entry) = serde_json::from_slice::<Entry>(&rest[..length]) else {
            return unusable("its header cannot be read");
        };
        if entry.key != key {
            return unusable("it belongs to another key");
        }
        self.touch(&path);
        let payload = bytes[PREFIX + length..].to_vec();
        Ok(Some((entry, payload)))
    }

    /// Sets the time of the last use of a file; a failure only affects the order of eviction.
    pub(super) fn touch(&self, path: &Path) {
        let _ = File::options().append(true).open(path).and_then(|f| f.set_modified(SystemTime::now()));
    }

    /// Writes an entry, in place of one of the same key; entries other than `used` are removed to make room.
    ///
    /// Returns false if there is no room.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, entry: &Entry, payload: &[u8], used: &HashSet<String>) -> io::Result<bool> {
        let header = serde_json::to_vec(entry)?;
        let bytes = (PREFIX + header.len() + payload.len()) as u64;
        if header.len() > MAX_HEADER_BYTES {
            return Ok(false);
        }
        let _ = fs::remove_file(self.path(&entry.key));
        if !self.make_room(bytes, used) {
            return Ok(false);
        }
        let mut prefix = Vec::with_capacity(PREFIX);
        prefix.extend_from_slice(MAGIC);
        prefix.extend_from_slice(&FORMAT.to_le_bytes());
        prefix.extend_from_slice(&(header.len() as u32).to_le_bytes());
        let hash = blake3::Hasher::new().update(&header).update(payload).finalize();
        prefix.extend_from_slice(hash.as_bytes());
        write_atomically(&self.path(&entry.key), &[&prefix, &header, payload])?;
        Ok(true)
    }

    /// Lists all entries in the order of eviction: by seconds saved per byte, then by the time of the last use.
    #[must_use]
    pub fn list(&self) -> Vec<StoredFile> {
        let mut all: Vec<StoredFile> = files(&self.dir)
            .filter(|(path, _)| is_entry(path))
            .map(|(path, meta)| StoredFile {
                bytes: meta.len(),
                used: meta.modified().unwrap_or(SystemTime::UNIX_EPOCH),
                entry: match path.extension().is_some_and(|e| e == "stream") {
                    true => stream::read_header(&path),
                    false => read_header(&path),
                },
                path,
            })
            .collect();
        all.sort_by(|a, b| a.seconds_per_byte().total_cmp(&b.seconds_per_byte()).then(a.used.cmp(&b.used)));
        all
    }

    /// Removes entries other than `used` until the others take at most `bytes`, and returns the bytes that they take.
    ///
    /// A process that uses a removed entry computes it again.
    pub fn evict(&self, bytes: u64, used: &HashSet<String>) -> u64 {
        self.remove_stale();
        let mut total: u64 =
            files(&self.dir).filter(|(path, _)| is_entry(path)).map(|(_, meta)| meta.len()).sum();
        if total <= bytes {
            return total;
        }
        for file in self.list() {
            if total <= bytes {
                break;
            }
            if !used.contains(file.key()) && fs::remove_file(&file.path).is_ok() {
                total = total.saturating_sub(file.bytes);
            }
        }
        total
    }

    /// Removes all entries, key histories, and checkpoints of runs that are not running.
    pub fn clear(&self) {
        self.evict(0, &HashSet::new());
        checkpoint_store::remove_all(&self.dir);
        for (path, _) in files(&self.dir.join("index")) {
            if path.extension().is_some_and(|e| e == "json") {
                let _ = fs::remove_file(path);
            }
        }
    }

    /// Removes temporary files of processes that were killed.
    fn remove_stale(&self) {
        let stale = |time: SystemTime| time.elapsed().is_ok_and(|age| age > STALE);
        for (path, meta) in files(&self.dir).chain(files(&self.dir.join("index"))) {
            if path.extension().is_some_and(|e| e == "part") && meta.modified().is_ok_and(stale) {
                let _ = fs::remove_file(path);
            }
        }
    }
}

fn number(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes)
}

fn files(dir: &Path) -> impl Iterator<Item = (PathBuf, fs::Metadata)> + use<> {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten();
    entries.filter_map(|e| Some((e.path(), e.metadata().ok()?))).filter(|(_, meta)| meta.is_file())
}

/// Returns true if a file has the name of an entry; other files in the folder are not touched.
fn is_entry(path: &Path) -> bool {
    let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    let hex = stem.len() == 64 && stem.bytes().all(|b| b.is_ascii_hexdigit());
    hex && path.extension().is_some_and(|e| e == "memo" || e == "stream")
}

fn read_header(path: &Path) -> Option<Entry> {
    let mut file = plain_file::open(path).ok()?;
    let mut prefix = [0; PREFIX];
    file.read_exact(&mut prefix).ok()?;
    let length = number(&prefix, 12) as usize;
    if &prefix[..8] != MAGIC || number(&prefix, 8) != FORMAT || length > MAX_HEADER_BYTES {
        return None;
    }
    let mut header = Vec::new();
    file.take(length as u64).read_to_end(&mut header).ok()?;
    serde_json::from_slice(&header).ok()
}
