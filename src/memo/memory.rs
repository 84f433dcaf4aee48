//! Entries in memory, in front of the disk: the least recently used are removed beyond a size.

use super::entry::Entry;
use super::stream::Source;
use foley_nodes::core::item::AnyValue;
use serde_json::{Map, Value};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Maximum bytes in memory for a graph that is run repeatedly.
pub const MEMORY: usize = 256 << 20;

/// The cached values of a node.
#[derive(Clone, Debug, Default)]
pub struct Hit {
    /// Its values by output port.
    pub values: Vec<(usize, AnyValue)>,
    /// Its summary.
    pub summary: Map<String, Value>,
    /// Its warnings.
    pub warnings: Vec<String>,
}

/// One entry.
#[derive(Clone, Debug)]
pub enum CachedEntry {
    /// Decoded values.
    Values(Arc<Hit>),
    /// A verified stream.
    Stream(Arc<Entry>, Arc<Source>),
}

#[derive(Debug, Default)]
struct Inner {
    /// Entry, bytes, and time of the last use.
    entries: HashMap<String, (CachedEntry, usize, u64)>,
    bytes: usize,
    /// Number of uses so far.
    now: u64,
}

/// Entries by their keys.
#[derive(Debug)]
pub struct Memory {
    cap: usize,
    inner: Mutex<Inner>,
}

impl Memory {
    /// An empty cache of at most `cap` bytes.
    #[must_use]
    pub fn new(cap: usize) -> Self {
        Self { cap, inner: Mutex::default() }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the maximum bytes of one entry: a large one must not evict all others.
    #[must_use]
    pub fn max_entry(&self) -> usize {
        self.cap / 4
    }

    /// Returns the bytes of all entries.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.inner().bytes
    }

    /// Finds an entry, and records its use.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<CachedEntry> {
        let mut inner = self.inner();
        inner.now += 1;
        let now = inner.now;
        let (entry, _, used) = inner.entries.get_mut(key)?;
        *used = now;
        Some(entry.clone())
    }

    /// Adds an entry; the least recently used are removed to make room.
    ///
    /// # Complexity
    /// O(entries) for each that is removed.
    pub fn put(&self, key: &str, entry: CachedEntry, bytes: usize) {
        let mut inner = self.inner();
        if let Some((_, old, _)) = inner.entries.remove(key) {
            inner.bytes -= old;
        }
        if bytes > self.max_entry() {
            return;
        }
        while inner.bytes + bytes > self.cap {
            let oldest =
                inner.entries.iter().min_by_key(|(_, (_, _, used))| *used).map(|(key, _)| key.clone());
            let Some((_, old, _)) = oldest.and_then(|key| inner.entries.remove(&key)) else { break };
            inner.bytes -= old;
        }
        inner.now += 1;
        let now = inner.now;
        inner.bytes += bytes;
        inner.entries.insert(key.to_owned(), (entry, bytes, now));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_recently_used_entry_is_removed() {
        let memory = Memory::new(40);
        let put = |key: &str, bytes| memory.put(key, CachedEntry::Values(Arc::new(Hit::default())), bytes);
        ["a", "b", "c", "d"].into_iter().for_each(|key| put(key, 10));
        assert!(memory.get("a").is_some());
        put("e", 10);
        assert!(memory.get("b").is_none() && memory.get("a").is_some() && memory.bytes() == 40);
        put("e", 5);
        assert_eq!(memory.bytes(), 35);
        put("large", 11);
        assert!(memory.get("large").is_none() && memory.bytes() == 35);
    }
}
