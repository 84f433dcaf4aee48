//! The memo during one run.

use super::key::{Key, Keys};
use super::store::{Entry, Output};
use super::{Memo, keeps};
use crate::graph::Graph;
use crate::plan::Plan;
use foley_nodes::core::files::Files;
use foley_nodes::core::item::AnyValue;
use foley_nodes::core::ports::PortKind;
use serde_json::{Map, Value};
use std::collections::{HashMap, HashSet};
use std::time::Duration;

/// Code of the warning about an entry that cannot be used.
const UNUSABLE: &str = "F084";

/// What the memo had of a node.
#[derive(Debug)]
pub struct Hit {
    /// Its values by output port.
    pub values: Vec<(usize, AnyValue)>,
    /// What the node told of itself.
    pub summary: Map<String, Value>,
    /// What the node warned of.
    pub warnings: Vec<String>,
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
        if !keeps(self.graph.nodes[n].ty) {
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
        let found = self.memo.store.read(&key).map_err(|e| e.0).and_then(|found| match found {
            Some((entry, payload)) => self.decode(n, entry, &payload).map(Some),
            None => Ok(None),
        });
        found.unwrap_or_else(|what| {
            let dir = self.memo.store.dir().display();
            self.warnings.push((n, format!("{UNUSABLE}: computed again: {key}.memo in {dir}: {what}")));
            None
        })
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
        if !self.keys.still(n) {
            return;
        }
        let entry = Entry {
            key,
            kind: node.ty.name.to_owned(),
            version: node.ty.version,
            node: node.id.clone(),
            seconds: took.as_secs_f64(),
            summary,
            warnings,
            outputs,
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
            for n in values.chain(folds).filter(|&n| keeps(self.graph.nodes[n].ty)) {
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
        None
    }
}
