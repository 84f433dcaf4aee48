//! What the last keys of each node were made of, so that a person can be told what has changed.

use super::key::Part;
use super::store::write_whole;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The last two keys of a node.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// The graph file.
    pub graph: String,
    /// Id of the node.
    pub node: String,
    /// Parts of the key in the last run.
    pub last: Vec<Part>,
    /// Parts of the last key that was another; empty where there was none.
    pub before: Vec<Part>,
}

/// The traces of one graph.
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

    /// Nanoseconds per element that nodes took in earlier runs, by id and type.
    #[must_use]
    pub fn costs(&self) -> BTreeMap<String, (String, f64)> {
        let text = fs::read(self.costs_path()).ok();
        text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
    }

    /// Notes what nodes took.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn note_costs(&self, costs: &BTreeMap<String, (String, f64)>) -> io::Result<()> {
        write_whole(&self.costs_path(), &[&serde_json::to_vec(costs)?])
    }

    /// The trace of a node, where there is one that can be read.
    #[must_use]
    pub fn get(&self, node: &str) -> Option<Trace> {
        let text = fs::read(self.path(node)).ok()?;
        let trace: Trace = serde_json::from_slice(&text).ok()?;
        (trace.graph == self.graph && trace.node == node).then_some(trace)
    }

    /// Notes the parts of a node's key in this run.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn note(&self, node: &str, parts: &[Part]) -> io::Result<()> {
        let old = self.get(node).unwrap_or_default();
        if old.last == parts {
            return Ok(());
        }
        let trace = Trace {
            graph: self.graph.to_owned(),
            node: node.to_owned(),
            last: parts.to_vec(),
            before: old.last,
        };
        write_whole(&self.path(node), &[&serde_json::to_vec(&trace)?])
    }
}
