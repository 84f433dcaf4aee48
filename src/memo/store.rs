//! Entries on disk: one file each, whole or not at all, verified when read, and within a size.
//!
//! An entry is magic, format version, length of the header, the hash of all that follows, the header as JSON, and the
//! values as postcard. Its name is its key, so two processes that write one entry write the same.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

const MAGIC: &[u8; 8] = b"foleymem";
const FORMAT: u32 = 1;
/// Bytes before the header.
const FRONT: usize = 8 + 4 + 4 + 32;
/// A header is a few hundred bytes, and whatever the node told of itself.
const LONGEST_HEADER: usize = 16 << 20;
/// A temporary file of this age was left behind by a process that was killed.
const STALE: Duration = Duration::from_secs(3600);

/// What a node has told that an entry makes unnecessary to run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Told {
    /// Its id.
    pub node: String,
    /// What it told of itself.
    pub summary: Map<String, Value>,
    /// What it warned of.
    pub warnings: Vec<String>,
}

/// One value of an entry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Output {
    /// Output port of the node.
    pub port: usize,
    /// Type of the value.
    pub kind: String,
    /// Content hash of the value.
    pub hash: String,
    /// Bytes that it takes.
    pub bytes: usize,
}

/// What an entry says of itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Its key.
    pub key: String,
    /// Type of the node.
    pub kind: String,
    /// Version of the node.
    pub version: u32,
    /// Id of the node.
    pub node: String,
    /// Seconds that it took to compute.
    pub seconds: f64,
    /// What the node told of itself.
    pub summary: Map<String, Value>,
    /// What the node warned of.
    pub warnings: Vec<String>,
    /// The values that follow.
    pub outputs: Vec<Output>,
    /// For a stream, the nodes above it.
    #[serde(default)]
    pub above: Vec<Told>,
}

/// One file of a store.
#[derive(Clone, Debug)]
pub struct Listed {
    /// Where it is.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// When it was last used.
    pub used: SystemTime,
    /// What it says of itself, where that can be read.
    pub entry: Option<Entry>,
}

impl Listed {
    /// Seconds that a byte of it saves.
    #[must_use]
    pub fn worth(&self) -> f64 {
        self.entry.as_ref().map_or(0.0, |e| e.seconds.max(0.0) / self.bytes.max(1) as f64)
    }

    fn key(&self) -> &str {
        self.path.file_stem().and_then(|s| s.to_str()).unwrap_or_default()
    }
}

/// Why an entry that is there cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct Unusable(pub String);

/// A folder of entries.
#[derive(Debug)]
pub struct Store {
    dir: PathBuf,
    cap: u64,
}

impl Store {
    /// The entries in a folder, to be kept below `cap` bytes.
    #[must_use]
    pub fn new(dir: impl Into<PathBuf>, cap: u64) -> Self {
        Self { dir: dir.into(), cap }
    }

    /// The folder.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Most bytes of all entries.
    #[must_use]
    pub fn cap(&self) -> u64 {
        self.cap
    }

    fn path(&self, key: &str) -> PathBuf {
        self.dir.join(format!("{key}.memo"))
    }

    /// Where the stream of a key is, or would be.
    #[must_use]
    pub fn stream_path(&self, key: &str) -> PathBuf {
        self.dir.join(format!("{key}.stream"))
    }

    /// Makes room for so many bytes, but keeps all of `used`; says whether there is room.
    pub fn room(&self, bytes: u64, used: &HashSet<String>) -> bool {
        bytes <= self.cap && self.evict(self.cap - bytes, used) <= self.cap - bytes
    }

    /// What an entry says of itself, without looking at its values; `None` where there is none that can be read.
    #[must_use]
    pub fn peek(&self, key: &str) -> Option<Entry> {
        header(&self.path(key)).filter(|e| e.key == key)
    }

    /// An entry and the bytes of its values; `None` where there is none.
    ///
    /// # Errors
    /// When a file of that name is there, and is no whole entry of that key.
    pub fn read(&self, key: &str) -> Result<Option<(Entry, Vec<u8>)>, Unusable> {
        let path = self.path(key);
        let unusable = |what: &str| Err(Unusable(what.to_owned()));
        let bytes = match File::open(&path).and_then(|file| within(file, self.cap)) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Unusable(format!("it cannot be read: {e}"))),
        };
        if bytes.len() < FRONT {
            return unusable("it is cut short");
        }
        let (front, rest) = bytes.split_at(FRONT);
        if &front[..8] != MAGIC {
            return unusable("it is another kind of file");
        }
        let (format, length) = (number(front, 8), number(front, 12) as usize);
        if format != FORMAT {
            return Err(Unusable(format!("it has format {format}, this version reads {FORMAT}")));
        }
        if blake3::hash(rest).as_bytes() != &front[16..FRONT] || length > rest.len() {
            return unusable("it is damaged or cut short");
        }
        let Ok(entry) = serde_json::from_slice::<Entry>(&rest[..length]) else {
            return unusable("its header cannot be read");
        };
        if entry.key != key {
            return unusable("it belongs to another key");
        }
        self.touch(&path);
        let payload = bytes[FRONT + length..].to_vec();
        Ok(Some((entry, payload)))
    }

    /// Notes that a file is in use: it is kept longer. Where that cannot be noted, only the order of eviction suffers.
    pub(super) fn touch(&self, path: &Path) {
        let _ = File::options().append(true).open(path).and_then(|f| f.set_modified(SystemTime::now()));
    }

    /// Adds an entry, in place of one of the same key; others are removed where the size asks for it, but none of `used`.
    /// Says whether there was room.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, entry: &Entry, payload: &[u8], used: &HashSet<String>) -> io::Result<bool> {
        let header = serde_json::to_vec(entry)?;
        let bytes = (FRONT + header.len() + payload.len()) as u64;
        if header.len() > LONGEST_HEADER {
            return Ok(false);
        }
        let _ = fs::remove_file(self.path(&entry.key));
        if !self.room(bytes, used) {
            return Ok(false);
        }
        let mut front = Vec::with_capacity(FRONT);
        front.extend_from_slice(MAGIC);
        front.extend_from_slice(&FORMAT.to_le_bytes());
        front.extend_from_slice(&(header.len() as u32).to_le_bytes());
        let hash = blake3::Hasher::new().update(&header).update(payload).finalize();
        front.extend_from_slice(hash.as_bytes());
        write_whole(&self.path(&entry.key), &[&front, &header, payload])?;
        Ok(true)
    }

    /// All entries, the least worth first: by seconds saved per byte, then by when it was last used.
    #[must_use]
    pub fn list(&self) -> Vec<Listed> {
        let mut all: Vec<Listed> = files(&self.dir)
            .filter(|(path, _)| is_entry(path))
            .map(|(path, meta)| Listed {
                bytes: meta.len(),
                used: meta.modified().unwrap_or(SystemTime::UNIX_EPOCH),
                entry: match path.extension().is_some_and(|e| e == "stream") {
                    true => super::stream::header(&path),
                    false => header(&path),
                },
                path,
            })
            .collect();
        all.sort_by(|a, b| a.worth().total_cmp(&b.worth()).then(a.used.cmp(&b.used)));
        all
    }

    /// Removes entries until the rest takes at most `bytes`, but none of `used`; gives the bytes that the rest takes.
    ///
    /// Another process may use an entry that goes: it then computes it again.
    pub fn evict(&self, bytes: u64, used: &HashSet<String>) -> u64 {
        self.sweep();
        let mut total: u64 =
            files(&self.dir).filter(|(path, _)| is_entry(path)).map(|(_, meta)| meta.len()).sum();
        if total <= bytes {
            return total;
        }
        for listed in self.list() {
            if total <= bytes {
                break;
            }
            if !used.contains(listed.key()) && fs::remove_file(&listed.path).is_ok() {
                total = total.saturating_sub(listed.bytes);
            }
        }
        total
    }

    /// Removes all entries, all traces, and how far runs are that do not run now.
    pub fn clear(&self) {
        self.evict(0, &HashSet::new());
        super::checkpoints::forget_all(&self.dir);
        for (path, _) in files(&self.dir.join("index")) {
            if path.extension().is_some_and(|e| e == "json") {
                let _ = fs::remove_file(path);
            }
        }
    }

    /// Removes what processes that were killed have left half written.
    fn sweep(&self) {
        let stale = |time: SystemTime| time.elapsed().is_ok_and(|age| age > STALE);
        for (path, meta) in files(&self.dir).chain(files(&self.dir.join("index"))) {
            if path.extension().is_some_and(|e| e == "part") && meta.modified().is_ok_and(stale) {
                let _ = fs::remove_file(path);
            }
        }
    }
}

/// A whole file, where it takes no more than all entries may.
fn within(file: File, cap: u64) -> io::Result<Vec<u8>> {
    if file.metadata()?.len() > cap {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, "it is larger than the whole cache may be"));
    }
    let mut bytes = Vec::new();
    file.take(cap).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn number(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes)
}

fn files(dir: &Path) -> impl Iterator<Item = (PathBuf, fs::Metadata)> + use<> {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten();
    entries.filter_map(|e| Some((e.path(), e.metadata().ok()?))).filter(|(_, meta)| meta.is_file())
}

/// Whether a file has the name of an entry; nothing else in the folder is touched.
fn is_entry(path: &Path) -> bool {
    let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    let hex = stem.len() == 64 && stem.bytes().all(|b| b.is_ascii_hexdigit());
    hex && path.extension().is_some_and(|e| e == "memo" || e == "stream")
}

fn header(path: &Path) -> Option<Entry> {
    let mut file = File::open(path).ok()?;
    let mut front = [0; FRONT];
    file.read_exact(&mut front).ok()?;
    let length = number(&front, 12) as usize;
    if &front[..8] != MAGIC || number(&front, 8) != FORMAT || length > LONGEST_HEADER {
        return None;
    }
    let mut header = Vec::new();
    file.take(length as u64).read_to_end(&mut header).ok()?;
    serde_json::from_slice(&header).ok()
}

/// A name beside a file that no other thread or process uses; the folder is made.
pub(super) fn temporary(path: &Path) -> io::Result<PathBuf> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    name.push(format!(".{}-{count}.part", std::process::id()));
    Ok(path.with_file_name(name))
}

/// Writes a file under a temporary name, syncs it, and moves it to its place.
pub(super) fn write_whole(path: &Path, pieces: &[&[u8]]) -> io::Result<()> {
    let part = temporary(path)?;
    let write = || {
        let mut file = File::create(&part)?;
        pieces.iter().try_for_each(|piece| file.write_all(piece))?;
        file.sync_all()?;
        fs::rename(&part, path)
    };
    write().inspect_err(|_| {
        let _ = fs::remove_file(&part);
    })
}
