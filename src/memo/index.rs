//! The parts of the last keys of each node, which explain why a node is computed again, and the measured costs of nodes.

use super::atomic_file::write_atomically;
use super::key::KeyPart;
use super::plain_file;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// The last two keys of a node.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeyHistory {
    /// The graph file.
    pub graph: String,
    /// Id of the node.
    pub node: String,
    /// Parts of the key in the last run.
    pub last: Vec<KeyPart>,
    /// Parts of the last different key; empty if there was none.
    pub before: Vec<KeyPart>,
}

/// Key histories and costs of one graph.
#[derive(Debug)]
pub struct Index<'a> {
    dir: &'a Path,
    graph: &'a str,
}

impl<'a> Index<'a> {
    pub(super) fn new(dir: &'a Path, graph: &'a str) -> Self {
        Self { dir, graph }
    }

    fn path(&self, node: &str) -> PathBuf {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.graph.as_bytes()).update(&[0]).update(node.as_bytes());
        let name = hasher.finalize().to_hex();
        self.dir.join("index").join(format!("{}.json", &name[..32]))
    }

    fn costs_path(&self) -> PathBuf {
        self.path("").with_extension("costs.json")
    }

    /// Reads the types of nodes and their costs in earlier runs, ns per element, by id.
    #[must_use]
    pub fn costs(&self) -> BTreeMap<String, (String, f64)> {
        let text = plain_file::read(&self.costs_path(), plain_file::MAX_BYTES).ok();
        text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
    }

    /// Writes the costs of nodes.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn note_costs(&self, costs: &BTreeMap<String, (String, f64)>) -> io::Result<()> {
        write_atomically(&self.costs_path(), &[&serde_json::to_vec(costs)?])
    }

    /// Reads the key history of a node; `None` if there is none that can be read.
    #[must_use]
    pub fn get(&self, node: &str) -> Option<KeyHistory> {
        let text = plain_file::read(&self.path(node), plain_file::MAX_BYTES).ok()?;
        let history: KeyHistory = serde_json::from_slice(&text).ok()?;
        (history.graph == self.graph && history.node == node).then_some(history)
    }

    /// Adds the parts of a node's key in this run.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn note(&self, node: &str, parts: &[KeyPart]) -> io::Result<()> {
        let old = self.get(node).unwrap_or_default();
        if old.last == parts {
            return Ok(());
        }
        let history = KeyHistory {
            graph: self.graph.to_owned(),
            node: node.to_owned(),
            last: parts.to_vec(),
            before: old.last,
        };
        write_atomically(&self.path(node), &[&serde_json::to_vec(&history)?])
    }
}
