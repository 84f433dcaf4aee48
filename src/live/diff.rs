//! What an edit leaves as it is.

use crate::graph::{Graph, GraphNode, Stamp};
use crate::plan::Draft;
use crate::run::Values;
use foley_nodes::core::item::StreamShape;
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use std::collections::{BTreeMap, HashMap};
use std::fmt;

/// Files that nodes have opened, with what tells one content from another.
pub type Stamps = BTreeMap<String, Option<Stamp>>;

/// What there is to compare of a graph.
pub struct Side<'a> {
    /// The graph.
    pub graph: &'a Graph,
    /// Shapes of its nodes.
    pub shapes: &'a [NodeShape],
    /// Its values.
    pub values: &'a Values,
    /// Seed of its randomness.
    pub seed: u64,
    /// The files behind it.
    pub stamps: &'a Stamps,
    /// Which nodes run ahead of the callback.
    pub ahead: Vec<bool>,
}

/// What becomes of a node that plays.
pub enum Fate {
    /// It goes on as it is, as this node of the graph before.
    Same(usize),
    /// It may go on with new parameters, if it can take them.
    Retuned(usize, Box<dyn AnyParams>),
    /// It is built.
    New,
}

/// What an edit came to, in numbers and names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Edit {
    /// Nodes that go on, with or without new parameters.
    pub kept: usize,
    /// Nodes that took new parameters while they play.
    pub retuned: Vec<String>,
    /// Nodes that were built anew.
    pub rebuilt: Vec<String>,
    /// Nodes that were not there.
    pub added: Vec<String>,
    /// Nodes that are not there any more.
    pub removed: Vec<String>,
    /// Nodes that go on and hear something else.
    pub fed: Vec<String>,
    /// Values that were computed, rather than known from before.
    pub computed: Vec<String>,
}

impl fmt::Display for Edit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        for (what, ids) in [
            ("retuned", &self.retuned),
            ("rebuilt", &self.rebuilt),
            ("added", &self.added),
            ("removed", &self.removed),
            ("fed anew", &self.fed),
            ("recomputed", &self.computed),
        ] {
            if !ids.is_empty() {
                parts.push(format!("{} {what} ({})", ids.len(), crate::watch::list(ids)));
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

/// Whether a node finds the same formats and values at its inputs, wherever they come from.
fn same_inputs(old: &Side<'_>, a: &GraphNode, new: &Side<'_>, b: &GraphNode) -> bool {
    a.links.iter().zip(&b.links).zip(a.ty.inputs).all(|((a, b), spec)| {
        a.len() == b.len()
            && a.iter().zip(b).all(|(a, b)| match spec.kind {
                PortKind::Stream(_) => {
                    let (a, b) = (&old.shapes[a.node].outputs[a.port], &new.shapes[b.node].outputs[b.port]);
                    same_stream(a.as_ref(), b.as_ref())
                }
                PortKind::Events(_) => old.shapes[a.node].end == new.shapes[b.node].end,
                PortKind::Value(_) | PortKind::Fold(_) => {
                    let hash = |side: &Side<'_>, key| side.values.get(&key).map(|v| v.hash());
                    let (a, b) = (hash(old, (a.node, a.port)), hash(new, (b.node, b.port)));
                    a.is_some() && a == b
                }
            })
    })
}

fn same_files(old: &Side<'_>, a: &NodeShape, new: &Side<'_>, b: &NodeShape) -> bool {
    let stamp = |side: &Side<'_>, path: &String| side.stamps.get(path).cloned().flatten();
    a.opened == b.opened && b.opened.iter().all(|p| stamp(old, p) == stamp(new, p))
}

/// The fate of each node of `new` that plays.
#[must_use]
pub fn fates(old: &Side<'_>, old_plays: &[usize], new: &Side<'_>, draft: &Draft) -> HashMap<usize, Fate> {
    let by_id: HashMap<&str, usize> =
        old_plays.iter().map(|&n| (old.graph.nodes[n].id.as_str(), n)).collect();
    let fate = |n: usize| {
        let node = &new.graph.nodes[n];
        let Some(&m) = by_id.get(node.id.as_str()) else { return Fate::New };
        let was = &old.graph.nodes[m];
        let same = was.ty.name == node.ty.name
            && old.seed == new.seed
            && old.ahead[m] == new.ahead[n]
            && same_shape(&old.shapes[m], &new.shapes[n])
            && same_inputs(old, was, new, node)
            && same_files(old, &old.shapes[m], new, &new.shapes[n]);
        if !same {
            return Fate::New;
        }
        if was.params.write() == node.params.write() {
            return Fate::Same(m);
        }
        Fate::Retuned(m, node.params.boxed())
    };
    draft.nodes.iter().map(|&n| (n, fate(n))).collect()
}
