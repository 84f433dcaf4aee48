//! The cache during one run.

use super::cacheable::{has_cacheable_streams, has_cacheable_values};
use super::entry::{Entry, NodeSummary, Output};
use super::graph_memo::Memo;
use super::key::{Key, Keys};
use super::memory::{CachedEntry, Hit};
use super::store::Store;
use super::stream::{Codec, PartialStream, Source};
use crate::graph::Graph;
use crate::plan::Plan;
use foley_nodes::core::computation::Partial;
use foley_nodes::core::files::Files;
use foley_nodes::core::item::AnyValue;
use foley_nodes::core::ports::PortKind;
use serde_json::{Map, Value};
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Code of the warning about an entry that cannot be used.
const UNUSABLE: &str = "F084";

/// A cached output stream of a node.
#[derive(Clone, Debug)]
pub struct CachedStream {
    /// Its header.
    pub entry: Arc<Entry>,
    /// The stream.
    pub source: Arc<Source>,
}

/// Values by node and output port.
pub type Values = HashMap<(usize, usize), AnyValue>;

/// The key of one output of a node.
fn port_key(node: blake3::Hash, port: &str) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"stream").update(node.as_bytes()).update(port.as_bytes());
    hasher.finalize().to_string()
}

/// Time between two times that partial results are stored.
const STORED_EVERY: Duration = Duration::from_secs(10);

/// Partial results of a node, as an entry of the cache.
pub struct StoredPartial<'a> {
    store: &'a Store,
    entry: Entry,
    used: HashSet<String>,
    /// True when the run is to stop: a partial result is then stored at once.
    stop: &'a AtomicBool,
    stored: Mutex<Instant>,
}

impl StoredPartial<'_> {
    /// Removes them: the computation has come to its end.
    pub fn remove(&self) {
        self.store.remove(&self.entry.key);
    }
}

impl Partial for StoredPartial<'_> {
    fn load(&self) -> Option<Vec<u8>> {
        // What is damaged is computed again.
        self.store.read(&self.entry.key).ok().flatten().map(|(_, payload)| payload)
    }

    fn offer(&self, encode: &dyn Fn() -> Option<Vec<u8>>) {
        let mut stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.stop.load(Ordering::SeqCst) && stored.elapsed() < STORED_EVERY {
            return;
        }
        if let Some(bytes) = encode() {
            let _ = self.store.write(&self.entry, &bytes, &self.used);
        }
        *stored = Instant::now();
    }
}

/// The cache during one run: looks up nodes, and stores the results of those that were computed.
pub struct RunCache<'a> {
    memo: &'a Memo,
    graph: &'a Graph,
    plan: &'a Plan,
    keys: Keys<'a>,
    hashes: HashMap<usize, String>,
    used: HashSet<String>,
    warnings: Vec<(usize, String)>,
    write_failed: bool,
}

impl<'a> RunCache<'a> {
    /// The cache for a run of a planned graph.
    #[must_use]
    pub fn new(memo: &'a Memo, graph: &'a Graph, plan: &'a Plan, files: &'a dyn Files, seed: u64) -> Self {
        Self {
            memo,
            graph,
            plan,
            keys: Keys::new(graph, plan, files, seed),
            hashes: HashMap::new(),
            used: HashSet::new(),
            warnings: Vec::new(),
            write_failed: false,
        }
    }

    /// Takes the warnings about the cache, by node; none of them affects a result.
    pub fn take_warnings(&mut self) -> Vec<(usize, String)> {
        std::mem::take(&mut self.warnings)
    }

    /// Makes the key of a node and adds it to the index; `None` for a node that is not cached.
    fn key(&mut self, n: usize, values: &Values) -> Option<String> {
        if !has_cacheable_values(&self.graph.nodes[n].ty) {
            return None;
        }
        let key = self.keys.key(n, &|node, port| values.get(&(node, port)).map(AnyValue::hash))?;
        let hash = key.hash?.to_string();
        if let Err(e) = self.memo.index().note(&self.graph.nodes[n].id, &key.parts) {
            self.warn_cannot_write(n, &e);
        }
        self.hashes.insert(n, hash.clone());
        self.used.insert(hash.clone());
        Some(hash)
    }

    fn warn_cannot_write(&mut self, n: usize, e: &std::io::Error) {
        if !std::mem::replace(&mut self.write_failed, true) {
            let dir = self.memo.store().dir().display();
            self.warnings
                .push((n, format!("results cannot be cached in {dir}: {e} (--no-cache disables the cache)")));
        }
    }

    /// Looks up the values of a node, from the values that it reads.
    pub fn look_up(&mut self, n: usize, values: &Values) -> Option<Hit> {
        let key = self.key(n, values)?;
        if let Some(CachedEntry::Values(hit)) = self.memo.memory().get(&key) {
            return Some((*hit).clone());
        }
        let found = self.memo.store().read(&key).map_err(|e| e.0).and_then(|found| match found {
            Some((entry, payload)) => {
                let hit = self.decode(n, entry, &payload)?;
                self.memo.memory().put(&key, CachedEntry::Values(Arc::new(hit.clone())), payload.len());
                Ok(Some(hit))
            }
            None => Ok(None),
        });
        found.unwrap_or_else(|reason| {
            self.warn_unusable(n, &format!("{key}.memo"), &reason);
            None
        })
    }

    /// Partial result of an interrupted computation of a node; `None` for a node that is not cached. Requires [`Self::look_up`].
    #[must_use]
    pub fn partial<'b>(&self, n: usize, stop: &'b AtomicBool) -> Option<StoredPartial<'b>>
    where
        'a: 'b,
    {
        let key = self.hashes.get(&n)?;
        let node = &self.graph.nodes[n];
        let entry = Entry {
            key: blake3::hash(format!("partial {key}").as_bytes()).to_string(),
            kind: node.ty.name.to_owned(),
            version: node.ty.version,
            node: node.id.clone(),
            ..Entry::default()
        };
        let (store, used) = (self.memo.store(), self.used.clone());
        Some(StoredPartial { store, entry, used, stop, stored: Mutex::new(Instant::now()) })
    }

    fn warn_unusable(&mut self, n: usize, file: &str, reason: &str) {
        let dir = self.memo.store().dir().display();
        self.warnings.push((n, format!("{UNUSABLE}: computed again: {file} in {dir}: {reason}")));
    }

    /// Hashes the keys of nodes and `more`; `None` if a file cannot be read.
    #[must_use]
    pub fn run_key(&self, nodes: &[usize], values: &Values, more: &str) -> Option<String> {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"run").update(more.as_bytes());
        for &n in nodes {
            let key = self.keys.key(n, &|node, port| values.get(&(node, port)).map(AnyValue::hash))?;
            hasher.update(key.hash?.as_bytes());
        }
        Some(hasher.finalize().to_string())
    }

    /// Returns the cache of the graph.
    #[must_use]
    pub fn memo(&self) -> &'a Memo {
        self.memo
    }

    /// Returns the nodes whose streams a node depends on.
    pub fn upstream(&self, n: usize) -> impl Iterator<Item = usize> + use<> {
        self.keys.upstream(n).into_iter()
    }

    /// The key of one output stream of a node; `None` if a value upstream is not known or a file cannot be read.
    fn stream_key(&self, n: usize, port: usize, values: &Values) -> Option<String> {
        let key = self.keys.stream_key(n, &|node, port| values.get(&(node, port)).map(AnyValue::hash))?;
        Some(port_key(key.hash?, self.graph.nodes[n].ty.outputs.get(port)?.name))
    }

    /// Looks up some output streams of a node; `None` unless all of them are cached.
    pub fn look_up_streams(
        &mut self,
        n: usize,
        ports: &[(usize, Codec)],
        values: &Values,
    ) -> Option<Vec<(usize, Codec, CachedStream)>> {
        let mut all = Vec::new();
        for &(port, codec) in ports {
            let key = self.stream_key(n, port, values)?;
            let stream = match self.memo.memory().get(&key) {
                Some(CachedEntry::Stream(entry, source)) => CachedStream { entry, source },
                _ => self.read_stream(n, &key, &codec)?,
            };
            self.used.insert(key);
            all.push((port, codec, stream));
        }
        Some(all)
    }

    fn read_stream(&mut self, n: usize, key: &str, codec: &Codec) -> Option<CachedStream> {
        let path = self.memo.store().stream_path(key);
        let max_bytes = self.memo.memory().max_entry();
        let (entry, source) = match Source::find(&path, key, codec, max_bytes as u64) {
            Ok(found) => found?,
            Err(e) => {
                self.warn_unusable(n, &format!("{key}.stream"), &e.0);
                return None;
            }
        };
        self.memo.store().touch(&path);
        let stream = CachedStream { entry: Arc::new(entry), source: Arc::new(source) };
        if let Source::Bytes(bytes) = &*stream.source {
            let entry = CachedEntry::Stream(Arc::clone(&stream.entry), Arc::clone(&stream.source));
            self.memo.memory().put(key, entry, bytes.len());
        }
        Some(stream)
    }

    /// Starts to write an output stream of a node.
    pub fn start_stream(
        &mut self,
        n: usize,
        port: usize,
        values: &Values,
    ) -> Option<(String, PartialStream)> {
        let key = self.stream_key(n, port, values)?;
        match PartialStream::create(self.memo.store().stream_path(&key), self.memo.store().cap() / 4) {
            Ok(file) => Some((key, file)),
            Err(e) => {
                self.warn_cannot_write(n, &e);
                None
            }
        }
    }

    /// Adds the key of a node's streams to the index.
    pub fn note_stream_key(&mut self, n: usize, values: &Values) {
        let key = self.keys.stream_key(n, &|node, port| values.get(&(node, port)).map(AnyValue::hash));
        if let Some(Err(e)) = key.map(|key| self.memo.index().note(&self.graph.nodes[n].id, &key.parts)) {
            self.warn_cannot_write(n, &e);
        }
    }

    /// Retains the nodes whose files have not changed since their keys were made.
    pub fn retain_unchanged(&self, nodes: &mut Vec<usize>) {
        self.keys.retain_unchanged(nodes);
    }

    /// Completes an output stream that was written to its end.
    pub fn store_stream(
        &mut self,
        n: usize,
        port: usize,
        codec: &Codec,
        (key, mut file): (String, PartialStream),
        seconds: f64,
        upstream: Vec<NodeSummary>,
    ) {
        if let Some(e) = file.take_failure() {
            self.warn_cannot_write(n, &e);
        }
        let Some(bytes) = file.complete_bytes(codec) else { return };
        let node = &self.graph.nodes[n];
        let spec = node.ty.outputs.get(port);
        let entry = Entry {
            key: key.clone(),
            kind: node.ty.name.to_owned(),
            version: node.ty.version,
            node: node.id.clone(),
            seconds,
            outputs: vec![Output {
                port,
                kind: spec.map(|s| s.kind.name().to_owned()).unwrap_or_default(),
                hash: file.hash().to_string(),
                bytes: bytes as usize,
            }],
            upstream,
            ..Entry::default()
        };
        if !self.memo.store().make_room(bytes, &self.used) {
            self.warnings
                .push((n, "its streams are not cached: no room in the cache (--cache-size)".to_owned()));
            return;
        }
        match file.commit(&entry) {
            Ok(()) => {
                self.used.insert(key);
            }
            Err(e) => self.warn_cannot_write(n, &e),
        }
    }

    fn decode(&self, n: usize, entry: Entry, payload: &[u8]) -> Result<Hit, String> {
        let mut values = Vec::new();
        let mut rest = payload;
        for output in &entry.outputs {
            let spec = self.graph.nodes[n].ty.outputs.get(output.port);
            let (bytes, after) = rest.split_at_checked(output.bytes).ok_or("a value is cut short")?;
            rest = after;
            let Some(PortKind::Value(kind) | PortKind::Fold(kind)) = spec.map(|s| s.kind) else {
                return Err(format!("{} has no value at output {}", entry.kind, output.port));
            };
            let value = (kind.decode)(bytes).ok_or_else(|| format!("its {} cannot be read", kind.name))?;
            if blake3::Hash::from_bytes(value.hash()).to_string() != output.hash {
                return Err(format!("its {} is not the one that was cached", kind.name));
            }
            values.push((output.port, value));
        }
        Ok(Hit { values, summary: entry.summary, warnings: entry.warnings })
    }

    /// Stores the values of a node that was not found by [`RunCache::look_up`], under the key made before it read its files.
    pub fn store_values(
        &mut self,
        n: usize,
        values: &Values,
        time: Duration,
        summary: Map<String, Value>,
        warnings: Vec<String>,
    ) {
        let Some(key) = self.hashes.get(&n).cloned() else { return };
        let node = &self.graph.nodes[n];
        let mut payload = Vec::new();
        let mut outputs = Vec::new();
        for port in 0..node.ty.outputs.len() {
            if !matches!(node.ty.outputs[port].kind, PortKind::Value(_) | PortKind::Fold(_)) {
                continue;
            }
            // A node that has not set all of its values is computed each time.
            let Some(value) = values.get(&(n, port)) else { return };
            let Some(bytes) = (value.kind().encode)(value) else { return };
            outputs.push(Output {
                port,
                kind: value.kind().name.to_owned(),
                hash: blake3::Hash::from_bytes(value.hash()).to_string(),
                bytes: bytes.len(),
            });
            payload.extend(bytes);
        }
        // If a file was written while the node read it, the key is that of the old content.
        let mut unchanged = vec![n];
        self.keys.retain_unchanged(&mut unchanged);
        if unchanged.is_empty() {
            return;
        }
        let all = (0..node.ty.outputs.len()).filter_map(|port| Some((port, values.get(&(n, port))?.clone())));
        let hit = Hit { values: all.collect(), summary: summary.clone(), warnings: warnings.clone() };
        self.memo.memory().put(&key, CachedEntry::Values(Arc::new(hit)), payload.len());
        let entry = Entry {
            key,
            kind: node.ty.name.to_owned(),
            version: node.ty.version,
            node: node.id.clone(),
            seconds: time.as_secs_f64(),
            summary,
            warnings,
            outputs,
            upstream: Vec::new(),
        };
        match self.memo.store().write(&entry, &payload, &self.used) {
            Ok(true) => {}
            Ok(false) => {
                let warning = "its values are not cached: no room in the cache (--cache-size)".to_owned();
                self.warnings.push((n, warning));
            }
            Err(e) => self.warn_cannot_write(n, &e),
        }
    }

    /// Returns the present key of a node, without running anything, and true if a result is cached under it.
    ///
    /// `None` for a node that is not cached, that does not run, or whose files cannot be read.
    #[must_use]
    pub fn status(&self, target: usize) -> Option<(Key, bool)> {
        let mut known: HashMap<(usize, usize), [u8; 32]> = HashMap::new();
        let last = self.plan.values.iter().map(|(_, p)| p + 1).max().unwrap_or(0);
        for phase in 0..self.plan.phases.len().max(last) {
            let values = self.plan.values.iter().filter(|(_, p)| *p == phase).map(|(n, _)| *n);
            let folds = self.plan.phases.get(phase).into_iter().flat_map(|p| p.nodes.iter().copied());
            for n in values.chain(folds).filter(|&n| has_cacheable_values(&self.graph.nodes[n].ty)) {
                let key = self.keys.key(n, &|node, port| known.get(&(node, port)).copied());
                let hash = key.as_ref().and_then(|k| k.hash);
                let entry = hash.and_then(|hash| self.memo.store().peek(&hash.to_string()));
                if n == target {
                    return key.map(|key| (key, entry.is_some()));
                }
                for output in entry.into_iter().flat_map(|e| e.outputs) {
                    if let Ok(hash) = blake3::Hash::from_hex(&output.hash) {
                        known.insert((n, output.port), *hash.as_bytes());
                    }
                }
            }
        }
        if !self.plan.phases.iter().any(|p| p.nodes.contains(&target))
            || !has_cacheable_streams(&self.graph.nodes[target].ty)
        {
            return None;
        }
        let key = self.keys.stream_key(target, &|node, port| known.get(&(node, port)).copied())?;
        let outputs = self.graph.nodes[target].ty.outputs.iter();
        let mut paths =
            outputs.filter_map(|o| Some(self.memo.store().stream_path(&port_key(key.hash?, o.name))));
        let cached = paths.any(|path| path.exists());
        Some((key, cached))
    }
}
