//! Entries in memory, in front of the disk: what was used last stays, within a size.

use super::session::Hit;
use super::store::Entry;
use super::stream::Source;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Most bytes in memory for a graph that is run again and again.
pub const MEMORY: usize = 256 << 20;

/// One entry.
#[derive(Clone, Debug)]
pub enum Held {
    /// Values, decoded.
    Values(Arc<Hit>),
    /// A stream, verified.
    Stream(Arc<Entry>, Arc<Source>),
}

#[derive(Debug, Default)]
struct Inner {
    /// Entry, bytes, and when it was last used.
    entries: HashMap<String, (Held, usize, u64)>,
    bytes: usize,
    now: u64,
}

/// Entries by their keys.
#[derive(Debug)]
pub struct Memory {
    cap: usize,
    inner: Mutex<Inner>,
}

impl Memory {
    /// For at most so many bytes.
    #[must_use]
    pub fn new(cap: usize) -> Self {
        Self { cap, inner: Mutex::default() }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Most bytes of one entry: a large one must not drive out all others.
    #[must_use]
    pub fn largest(&self) -> usize {
        self.cap / 4
    }

    /// Bytes of all entries.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.inner().bytes
    }

    /// An entry, which counts as used now.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<Held> {
        let mut inner = self.inner();
        inner.now += 1;
        let now = inner.now;
        let (held, _, used) = inner.entries.get_mut(key)?;
        *used = now;
        Some(held.clone())
    }

    /// Adds an entry of so many bytes; what was not used for longest goes.
    ///
    /// # Complexity
    /// O(entries) for each that goes.
    pub fn put(&self, key: &str, held: Held, bytes: usize) {
        let mut inner = self.inner();
        if let Some((_, old, _)) = inner.entries.remove(key) {
            inner.bytes -= old;
        }
        if bytes > self.largest() {
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
        inner.entries.insert(key.to_owned(), (held, bytes, now));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_used_last_stays() {
        let memory = Memory::new(40);
        let put = |key: &str, bytes| memory.put(key, Held::Values(Arc::new(Hit::default())), bytes);
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
