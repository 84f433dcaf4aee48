//! Facts about a graph that are known without running it.

use super::Errors;
use crate::graph::{Asked, Graph};
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::time::Tick;

/// The valid part of a graph, and all its errors.
#[derive(Debug)]
pub struct Inspection {
    /// Errors, warnings, and notes of the nodes.
    pub errors: Errors,
    /// The graph, or its valid nodes that read only valid nodes.
    pub graph: Graph,
    /// Shape of each node of the graph: rates, formats and ends. Empty for nodes that failed, and for all nodes where planning failed.
    pub shapes: Vec<NodeShape>,
    /// Latency of the outputs of each node when the graph plays, ticks; empty if the graph cannot run.
    pub latencies: Vec<Tick>,
    /// The files that were requested.
    pub asked: Asked,
}
