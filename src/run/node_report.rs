//! The report of one node.

use serde_json::{Map, Value};
use std::time::Duration;

/// The report of one node.
#[derive(Clone, Debug, Default)]
pub struct NodeReport {
    /// Its id.
    pub id: String,
    /// Its type.
    pub kind: &'static str,
    /// True for a node that only writes files.
    pub sink: bool,
    /// Wall time in it.
    pub time: Duration,
    /// Windows that it ran.
    pub calls: u64,
    /// Items of its first output, or of its first input where it has none.
    pub items: u64,
    /// True if its outputs came from the cache.
    pub cached: bool,
    /// Its own summary.
    pub summary: Map<String, Value>,
    /// A bit for each of its first 64 outputs that has been active; None if it did not run.
    pub activity: Option<u64>,
}
