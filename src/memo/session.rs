//! The memo during one run.

use super::key::{Key, Keys};
use super::memory::Held;
use super::store::{Entry, Output, Told};
use super::stream::{Codec, Part, Source};
use super::{Memo, keeps, streams};
use crate::graph::Graph;
use crate::plan::Plan;
use foley_nodes::core::files::Files;
use foley_nodes::core::item::AnyValue;
use foley_nodes::core::ports::PortKind;
use serde_json::{Map, Value};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::time::Duration;

/// Code of the warning about an entry that cannot be used.
const UNUSABLE: &str = "F084";

/// What the memo had of a node.
#[derive(Clone, Debug, Default)]
pub struct Hit {
    /// Its values by output port.
    pub values: Vec<(usize, AnyValue)>,
    /// What the node told of itself.
    pub summary: Map<String, Value>,
    /// What the node warned of.
    pub warnings: Vec<String>,
}

/// What the memo had of one output stream of a node.
#[derive(Clone, Debug)]
pub struct Kept {
    /// What it says of itself.
    pub entry: Arc<Entry>,
    /// The stream.
    pub source: Arc<Source>,
}

type Values = HashMap<(usize, usize), AnyValue>;

/// The key of one output of a node.
fn port_key(node: blake3::Hash, port: &str) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"stream").update(node.as_bytes()).update(port.as_bytes());
    hasher.finalize().to_string()
}

/// The memo during one run: looks nodes up, and keeps what had to be computed.
pub struct Session<'a> {
    memo: &'a Memo,
    graph: &'a Graph,
    plan: &'a Plan,
    keys: Keys<'a>,
    hashes: HashMap<usize, String>,
    used: HashSet<String>,
    warnings: Vec<(usize, String)>,
    told: bool,
}

impl<'a> Session<'a> {
    /// The memo for a run of a planned graph.
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
            told: false,
        }
    }

    /// What went wrong with the memo so far, by node; none of it changes a result.
    pub fn take_warnings(&mut self) -> Vec<(usize, String)> {
        std::mem::take(&mut self.warnings)
    }

    /// Makes the key of a node, and notes what it is made of; `None` for a node that is not kept.
    fn key(&mut self, n: usize, values: &HashMap<(usize, usize), AnyValue>) -> Option<String> {
        if !keeps(&self.graph.nodes[n].ty) {
            return None;
        }
        let key = self.keys.key(n, &|node, port| values.get(&(node, port)).map(AnyValue::hash))?;
        let hash = key.hash?.to_string();
        if let Err(e) = self.memo.index().note(&self.graph.nodes[n].id, &key.parts) {
            self.cannot_write(n, &e);
        }
        self.hashes.insert(n, hash.clone());
        self.used.insert(hash.clone());
        Some(hash)
    }

    fn cannot_write(&mut self, n: usize, e: &std::io::Error) {
        if !std::mem::replace(&mut self.told, true) {
            let dir = self.memo.store.dir().display();
            self.warnings.push((n, format!("results cannot be kept in {dir}: {e} (--no-cache keeps none)")));
        }
    }

    /// What was kept of a node, given the values that it reads.
    pub fn look_up(&mut self, n: usize, values: &HashMap<(usize, usize), AnyValue>) -> Option<Hit> {
        let key = self.key(n, values)?;
        if let Some(Held::Values(hit)) = self.memo.memory.get(&key) {
            return Some((*hit).clone());
        }
        let found = self.memo.store.read(&key).map_err(|e| e.0).and_then(|found| match found {
            Some((entry, payload)) => {
                let hit = self.decode(n, entry, &payload)?;
                self.memo.memory.put(&key, Held::Values(Arc::new(hit.clone())), payload.len());
                Ok(Some(hit))
            }
            None => Ok(None),
        });
        found.unwrap_or_else(|what| {
            self.unusable(n, &format!("{key}.memo"), &what);
            None
        })
    }

    fn unusable(&mut self, n: usize, file: &str, what: &str) {
        let dir = self.memo.store.dir().display();
        self.warnings.push((n, format!("{UNUSABLE}: computed again: {file} in {dir}: {what}")));
    }

    /// All that a run of these nodes and all above them depends on, and `more`; `None` where a file cannot be read.
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

    /// The memo.
    #[must_use]
    pub fn memo(&self) -> &'a Memo {
        self.memo
    }

    /// Nodes whose streams a node depends on.
    pub fn above(&self, n: usize) -> impl Iterator<Item = usize> + use<> {
        self.keys.above(n).into_iter()
    }

    /// The key of one output stream of a node; `None` while a value above it is not known, or where a file cannot be read.
    fn stream_key(&self, n: usize, port: usize, values: &Values) -> Option<String> {
        let key = self.keys.stream_key(n, &|node, port| values.get(&(node, port)).map(AnyValue::hash))?;
        Some(port_key(key.hash?, self.graph.nodes[n].ty.outputs.get(port)?.name))
    }

    /// What was kept of some output streams of a node: all of them or nothing.
    pub fn look_up_streams(
        &mut self,
        n: usize,
        ports: &[(usize, Codec)],
        values: &Values,
    ) -> Option<Vec<(usize, Codec, Kept)>> {
        let mut all = Vec::new();
        for &(port, codec) in ports {
            let key = self.stream_key(n, port, values)?;
            let kept = match self.memo.memory.get(&key) {
                Some(Held::Stream(entry, source)) => Kept { entry, source },
                _ => self.read_stream(n, &key, &codec)?,
            };
            self.used.insert(key);
            all.push((port, codec, kept));
        }
        Some(all)
    }

    fn read_stream(&mut self, n: usize, key: &str, codec: &Codec) -> Option<Kept> {
        let path = self.memo.store.stream_path(key);
        let most = self.memo.memory.largest();
        let (entry, source) = match Source::find(&path, key, codec, most as u64) {
            Ok(found) => found?,
            Err(e) => {
                self.unusable(n, &format!("{key}.stream"), &e.0);
                return None;
            }
        };
        self.memo.store.touch(&path);
        let kept = Kept { entry: Arc::new(entry), source: Arc::new(source) };
        if let Source::Bytes(bytes) = &*kept.source {
            let held = Held::Stream(Arc::clone(&kept.entry), Arc::clone(&kept.source));
            self.memo.memory.put(key, held, bytes.len());
        }
        Some(kept)
    }

    /// Starts to keep an output stream of a node.
    pub fn start_stream(&mut self, n: usize, port: usize, values: &Values) -> Option<(String, Part)> {
        let key = self.stream_key(n, port, values)?;
        match Part::create(self.memo.store.stream_path(&key), self.memo.store.cap() / 4) {
            Ok(part) => Some((key, part)),
            Err(e) => {
                self.cannot_write(n, &e);
                None
            }
        }
    }

    /// Notes what the key of a node's streams is made of.
    pub fn note_stream(&mut self, n: usize, values: &Values) {
        let key = self.keys.stream_key(n, &|node, port| values.get(&(node, port)).map(AnyValue::hash));
        if let Some(Err(e)) = key.map(|key| self.memo.index().note(&self.graph.nodes[n].id, &key.parts)) {
            self.cannot_write(n, &e);
        }
    }

    /// Of some nodes those whose files are still what their keys were made of.
    pub fn still(&self, nodes: &mut Vec<usize>) {
        self.keys.still(nodes);
    }

    /// Keeps an output stream that was written to its end.
    pub fn keep_stream(
        &mut self,
        n: usize,
        port: usize,
        codec: &Codec,
        (key, mut part): (String, Part),
        seconds: f64,
        above: Vec<Told>,
    ) {
        if let Some(e) = part.take_failure() {
            self.cannot_write(n, &e);
        }
        let Some(bytes) = part.whole(codec) else { return };
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
                hash: part.hash().to_string(),
                bytes: bytes as usize,
            }],
            above,
            ..Entry::default()
        };
        if !self.memo.store.room(bytes, &self.used) {
            self.warnings
                .push((n, "its streams are not kept: no room in the cache (--cache-size)".to_owned()));
            return;
        }
        match part.commit(&entry) {
            Ok(()) => {
                self.used.insert(key);
            }
            Err(e) => self.cannot_write(n, &e),
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
                return Err(format!("its {} is not the one that was kept", kind.name));
            }
            values.push((output.port, value));
        }
        Ok(Hit { values, summary: entry.summary, warnings: entry.warnings })
    }

    /// Keeps what a node has given, after it was looked up in vain: the key is made before the node reads its files.
    pub fn keep(
        &mut self,
        n: usize,
        values: &HashMap<(usize, usize), AnyValue>,
        took: Duration,
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
            // A node that has not set one of its values is computed each time.
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
        // A file that was written while the node read it must not stand under the key of its older content.
        let mut same = vec![n];
        self.keys.still(&mut same);
        if same.is_empty() {
            return;
        }
        let own = (0..node.ty.outputs.len()).filter_map(|port| Some((port, values.get(&(n, port))?.clone())));
        let hit = Hit { values: own.collect(), summary: summary.clone(), warnings: warnings.clone() };
        self.memo.memory.put(&key, Held::Values(Arc::new(hit)), payload.len());
        let entry = Entry {
            key,
            kind: node.ty.name.to_owned(),
            version: node.ty.version,
            node: node.id.clone(),
            seconds: took.as_secs_f64(),
            summary,
            warnings,
            outputs,
            above: Vec::new(),
        };
        match self.memo.store.write(&entry, &payload, &self.used) {
            Ok(true) => {}
            Ok(false) => {
                let what = "its values are not kept: no room in the cache (--cache-size)".to_owned();
                self.warnings.push((n, what));
            }
            Err(e) => self.cannot_write(n, &e),
        }
    }

    /// The key that a node has now, without running anything, and whether it is kept under it.
    ///
    /// `None` for a node that is not kept, that does not run, or whose files cannot be read.
    #[must_use]
    pub fn survey(&self, target: usize) -> Option<(Key, bool)> {
        let mut known: HashMap<(usize, usize), [u8; 32]> = HashMap::new();
        let last = self.plan.values.iter().map(|(_, p)| p + 1).max().unwrap_or(0);
        for phase in 0..self.plan.phases.len().max(last) {
            let values = self.plan.values.iter().filter(|(_, p)| *p == phase).map(|(n, _)| *n);
            let folds = self.plan.phases.get(phase).into_iter().flat_map(|p| p.nodes.iter().copied());
            for n in values.chain(folds).filter(|&n| keeps(&self.graph.nodes[n].ty)) {
                let key = self.keys.key(n, &|node, port| known.get(&(node, port)).copied());
                let hash = key.as_ref().and_then(|k| k.hash);
                let entry = hash.and_then(|hash| self.memo.store.peek(&hash.to_string()));
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
            || !streams(&self.graph.nodes[target].ty)
        {
            return None;
        }
        let key = self.keys.stream_key(target, &|node, port| known.get(&(node, port)).copied())?;
        let outputs = self.graph.nodes[target].ty.outputs.iter();
        let mut paths =
            outputs.filter_map(|o| Some(self.memo.store.stream_path(&port_key(key.hash?, o.name))));
        let there = paths.any(|path| path.exists());
        Some((key, there))
    }
}
