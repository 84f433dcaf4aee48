//! The headers of cached results.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The summary of a node that an entry makes unnecessary to run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NodeSummary {
    /// Its id.
    pub node: String,
    /// Its summary.
    pub summary: Map<String, Value>,
    /// Its warnings.
    pub warnings: Vec<String>,
}

/// One value or stream of an entry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Output {
    /// Output port of the node.
    pub port: usize,
    /// Type of the value, or of the items or events.
    pub kind: String,
    /// Hash of the content.
    pub hash: String,
    /// Bytes on disk.
    pub bytes: usize,
}

/// The header of an entry.
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
    /// Time to compute it, s.
    pub seconds: f64,
    /// Summary of the node.
    pub summary: Map<String, Value>,
    /// Warnings of the node.
    pub warnings: Vec<String>,
    /// The values that follow the header.
    pub outputs: Vec<Output>,
    /// For a stream, the nodes upstream of it.
    #[serde(default, rename = "above")]
    pub upstream: Vec<NodeSummary>,
}

/// The reason why an entry cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct Unusable(pub String);
