//! A checked graph: node types, parameters and links, each with its location in the text.
//!
//! [`load`] reads a graph file and its sub-graphs; every error of all of them comes back in one pass.

mod asked;
mod check;
mod checked_node;
mod dir_files;
mod fixes;
mod limits;
mod links;
mod listing;
mod load;
mod load_options;
mod loader;
mod node_list;
mod order;
mod outputs;
mod parameters;
mod part;
mod raw_node;
mod root;
mod sound;
mod sub_graphs;
mod suggest;
mod texts;
mod upgrade;
mod values;

pub use asked::{Asked, Stamp};
pub use dir_files::DirFiles;
pub use fixes::{free_id, placeholder, resample};
pub use limits::Limits;
pub use listing::{files_in, matching};
pub use load::{load, load_text};
pub use load_options::LoadOptions;
pub use loader::{Loaded, SCHEMA};
pub use outputs::{output_path, written};
pub use parameters::message_source;
pub use raw_node::valid_id;
pub use root::{Root, join};
pub use suggest::{help as suggestion, nearest, omitted};
pub use texts::{Texts, read_text};
pub use upgrade::{Upgraded, upgrade};
pub use values::Override;

use crate::diag::{SourceLocation, Sources};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::AnyParams;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A graph in which every node has a type, parameters and links.
#[derive(Debug, Default)]
pub struct Graph {
    /// Its title.
    pub title: String,
    /// Seed of all randomness in it.
    pub seed: u64,
    /// Nodes in the order of the text.
    pub nodes: Vec<GraphNode>,
    /// Indices of `nodes` in topological order; delayed links do not count.
    pub order: Vec<usize>,
    /// Place of each node in `order`.
    pub rank: Vec<usize>,
    /// The files that it was read from.
    pub sources: Sources,
}

/// One node of a graph.
#[derive(Debug)]
pub struct GraphNode {
    /// Its name: the identity for seeds, state, cache entries and errors.
    pub id: String,
    /// Its type.
    pub ty: Arc<NodeType>,
    /// Its parameters.
    pub params: Box<dyn AnyParams>,
    /// Links per input port.
    pub links: Vec<Vec<Link>>,
    /// Its location.
    pub location: SourceLocation,
    /// Locations of its fields: values of parameters and inputs, and each link or path of a list, as `inputs[2]`.
    pub fields: BTreeMap<String, SourceLocation>,
    /// True if all of its links are those of the text, as in every graph that can run.
    pub whole: bool,
}

/// One link, seen from its input.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Place in [`Graph::nodes`] of the node it comes from.
    pub node: usize,
    /// Output port that it comes from.
    pub port: usize,
    /// Its location in the text.
    pub location: SourceLocation,
}

impl Graph {
    /// Finds the topological order again after links have changed; nodes in a loop without a delayed input come last.
    pub(crate) fn sort(&mut self) {
        let count = self.nodes.len();
        let mut waits = vec![0_usize; count];
        let mut readers = vec![Vec::new(); count];
        for (n, node) in self.nodes.iter().enumerate() {
            let now = node.ty.inputs.iter().zip(&node.links).filter(|(spec, _)| !spec.delayed);
            for link in now.flat_map(|(_, links)| links) {
                waits[n] += 1;
                readers[link.node].push(n);
            }
        }
        let mut order: Vec<usize> = (0..count).filter(|&n| waits[n] == 0).collect();
        let mut next = 0;
        while let Some(&n) = order.get(next) {
            next += 1;
            for &reader in &readers[n] {
                waits[reader] -= 1;
                if waits[reader] == 0 {
                    order.push(reader);
                }
            }
        }
        order.extend((0..count).filter(|&n| waits[n] > 0));
        self.rank = vec![0; count];
        order.iter().enumerate().for_each(|(at, &n)| self.rank[n] = at);
        self.order = order;
    }

    /// The index of a node by its id.
    #[must_use]
    pub fn find(&self, id: &str) -> Option<usize> {
        self.nodes.iter().position(|n| n.id == id)
    }

    /// A copy in which some nodes have no inputs: their outputs come from elsewhere.
    #[must_use]
    pub fn without_inputs(&self, which: &dyn Fn(usize) -> bool) -> Self {
        let copy = |(n, node): (usize, &GraphNode)| GraphNode {
            id: node.id.clone(),
            ty: Arc::clone(&node.ty),
            params: node.params.boxed(),
            links: match which(n) {
                true => vec![Vec::new(); node.links.len()],
                false => node.links.clone(),
            },
            location: node.location.clone(),
            fields: node.fields.clone(),
            whole: node.whole,
        };
        Self {
            title: self.title.clone(),
            seed: self.seed,
            nodes: self.nodes.iter().enumerate().map(copy).collect(),
            order: self.order.clone(),
            rank: self.rank.clone(),
            sources: self.sources.clone(),
        }
    }

    /// The location of a field of a node, or of the node if the field is not in the text.
    #[must_use]
    pub fn location(&self, node: usize, field: Option<&str>) -> SourceLocation {
        let node = &self.nodes[node];
        // A field that is not set item by item has one location.
        let whole = |field: &str| node.fields.get(field.split('[').next().unwrap_or(field));
        let of = |field: &str| node.fields.get(field).or_else(|| whole(field));
        field.and_then(of).unwrap_or(&node.location).clone()
    }
}
