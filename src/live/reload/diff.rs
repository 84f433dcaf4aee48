//! Reload actions, found by comparing two graphs node by node.

use crate::graph::{Graph, GraphNode, Stamp};
use crate::plan::Draft;
use crate::run::Values;
use foley_nodes::core::item::StreamShape;
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use std::collections::{BTreeMap, HashMap};
use std::fmt;

/// Stamps of the files that nodes have opened.
pub type Stamps = BTreeMap<String, Option<Stamp>>;

/// The state of a graph that is compared.
pub struct GraphState<'a> {
    /// The graph.
    pub graph: &'a Graph,
    /// Shapes of its nodes.
    pub shapes: &'a [NodeShape],
    /// Its values.
    pub values: &'a Values,
    /// Seed.
    pub seed: u64,
    /// Stamps of its files.
    pub stamps: &'a Stamps,
    /// True for nodes that run on workers.
    pub on_worker: Vec<bool>,
}

/// The action of a reload for a node of the new graph. Indices are those of the old graph.
pub enum ReloadAction {
    /// The old node continues.
    Keep(usize),
    /// The old node continues with new parameters.
    Retune(usize, Box<dyn AnyParams>),
    /// The node is built: rebuilt or added.
    Build,
}

/// The result of a reload, by the ids of nodes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Edit {
    /// Number of nodes that continue, with or without new parameters.
    pub kept: usize,
    /// Nodes that continue with new parameters.
    pub retuned: Vec<String>,
    /// Nodes that were built again.
    pub rebuilt: Vec<String>,
    /// Nodes that were added.
    pub added: Vec<String>,
    /// Nodes that were removed.
    pub removed: Vec<String>,
    /// Nodes that continue with other inputs.
    pub relinked: Vec<String>,
    /// Value nodes that were computed, rather than taken from the cache.
    pub computed: Vec<String>,
}

impl fmt::Display for Edit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        for (action, ids) in [
            ("retuned", &self.retuned),
            ("rebuilt", &self.rebuilt),
            ("added", &self.added),
            ("removed", &self.removed),
            ("relinked", &self.relinked),
            ("recomputed", &self.computed),
        ] {
            if !ids.is_empty() {
                parts.push(format!("{} {action} ({})", ids.len(), crate::watch::list(ids)));
            }
        }
        let plural = if self.kept == 1 { "" } else { "s" };
        parts.push(format!("{} node{plural} kept", self.kept));
        f.write_str(&parts.join(", "))
    }
}

fn same_stream(a: Option<&StreamShape>, b: Option<&StreamShape>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => {
            (a.item.id)() == (b.item.id)()
                && (a.rate, a.width, &a.text, a.end) == (b.rate, b.width, &b.text, b.end)
        }
        (None, None) => true,
        _ => false,
    }
}

fn same_shape(a: &NodeShape, b: &NodeShape) -> bool {
    let outputs = a.outputs.iter().zip(&b.outputs);
    (&a.lookaround, a.lag, a.end, a.outputs.len()) == (&b.lookaround, b.lag, b.end, b.outputs.len())
        && outputs.clone().all(|(a, b)| same_stream(a.as_ref(), b.as_ref()))
}

/// Returns true if the inputs of two nodes have the same formats and values, from whatever outputs.
fn same_inputs(old: &GraphState<'_>, a: &GraphNode, new: &GraphState<'_>, b: &GraphNode) -> bool {
    a.links.iter().zip(&b.links).zip(a.ty.inputs).all(|((a, b), spec)| {
        a.len() == b.len()
            && a.iter().zip(b).all(|(a, b)| match spec.kind {
                PortKind::Stream(_) => {
                    let (a, b) = (&old.shapes[a.node].outputs[a.port], &new.shapes[b.node].outputs[b.port]);
                    same_stream(a.as_ref(), b.as_ref())
                }
                PortKind::Events(_) => old.shapes[a.node].end == new.shapes[b.node].end,
                PortKind::Value(_) | PortKind::Fold(_) => {
                    let hash = |side: &GraphState<'_>, key| side.values.get(&key).map(|v| v.hash());
                    let (a, b) = (hash(old, (a.node, a.port)), hash(new, (b.node, b.port)));
                    a.is_some() && a == b
                }
            })
    })
}

fn same_files(old: &GraphState<'_>, a: &NodeShape, new: &GraphState<'_>, b: &NodeShape) -> bool {
    let stamp = |side: &GraphState<'_>, path: &String| side.stamps.get(path).cloned().flatten();
    a.opened == b.opened && b.opened.iter().all(|p| stamp(old, p) == stamp(new, p))
}

/// Determines the reload action of each playing node of `new`.
#[must_use]
pub fn reload_actions(
    old: &GraphState<'_>,
    old_nodes: &[usize],
    new: &GraphState<'_>,
    draft: &Draft,
) -> HashMap<usize, ReloadAction> {
    let by_id: HashMap<&str, usize> =
        old_nodes.iter().map(|&n| (old.graph.nodes[n].id.as_str(), n)).collect();
    let action = |n: usize| {
        let node = &new.graph.nodes[n];
        let Some(&m) = by_id.get(node.id.as_str()) else { return ReloadAction::Build };
        let old_node = &old.graph.nodes[m];
        let same = old_node.ty.name == node.ty.name
            && old.seed == new.seed
            && old.on_worker[m] == new.on_worker[n]
            && same_shape(&old.shapes[m], &new.shapes[n])
            && same_inputs(old, old_node, new, node)
            && same_files(old, &old.shapes[m], new, &new.shapes[n]);
        if !same {
            return ReloadAction::Build;
        }
        if old_node.params.write() == node.params.write() {
            return ReloadAction::Keep(m);
        }
        ReloadAction::Retune(m, node.params.boxed())
    };
    draft.nodes.iter().map(|&n| (n, action(n))).collect()
}
