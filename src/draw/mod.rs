//! A graph as a layered drawing: sources on the left, files on the right, links by kind.
//!
//! [`Drawing::of`] takes the boxes and links of a graph, [`assign_coordinates`] lays them out, `svg` formats them; `text` lists them.

mod coordinates;
mod layers;
mod svg;
mod text;

pub use coordinates::{Coordinates, assign_coordinates};
pub use svg::svg;
pub use text::text;

use crate::graph::Graph;
use crate::plan::Plan;
use foley_nodes::core::ports::PortKind;

/// The boxes and links of a graph.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// Title.
    pub title: String,
    /// Nodes.
    pub boxes: Vec<NodeBox>,
    /// Links.
    pub wires: Vec<Wire>,
}

/// One node.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeBox {
    /// Its id.
    pub id: String,
    /// Name of its type.
    pub type_name: String,
    /// Names of its inputs, and true for those that are linked.
    pub inputs: Vec<(String, bool)>,
    /// Its outputs.
    pub outputs: Vec<OutPort>,
    /// Its position in the order in which nodes follow those that they read, apart from links that close a loop.
    pub rank: usize,
}

/// One output.
#[derive(Clone, Debug, PartialEq)]
pub struct OutPort {
    /// Its name.
    pub name: String,
    /// Rate and format, if there is a plan.
    pub label: String,
    /// Kind of its data.
    pub kind: WireKind,
}

/// One link, from an output to an input, each as box and port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wire {
    /// Its output.
    pub from: (usize, usize),
    /// Its input.
    pub to: (usize, usize),
    /// True if it closes a loop.
    pub back: bool,
}

/// Kind of the data of a link, which determines its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum WireKind {
    /// A stream of audio.
    Audio,
    /// A stream of something else.
    Stream,
    /// Events.
    Events,
    /// A value.
    Value,
    /// A value made of a whole stream.
    Fold,
}

impl WireKind {
    /// Returns the kind of a port.
    #[must_use]
    pub fn of(kind: &PortKind) -> Self {
        match kind {
            PortKind::Stream(item) if item.wave => Self::Audio,
            PortKind::Stream(_) => Self::Stream,
            PortKind::Events(_) => Self::Events,
            PortKind::Value(_) => Self::Value,
            PortKind::Fold(_) => Self::Fold,
        }
    }
}

impl Drawing {
    /// Makes the drawing of a graph, with rates and formats if there is a plan.
    #[must_use]
    pub fn of(graph: &Graph, plan: Option<&Plan>) -> Self {
        let label = |node: usize, port: usize| {
            let stream = plan.and_then(|p| p.shapes[node].outputs.get(port)?.as_ref());
            stream.map_or_else(String::new, |s| format!("{}, {}", s.rate, s.text))
        };
        let boxes = graph.nodes.iter().enumerate().map(|(n, node)| NodeBox {
            id: node.id.clone(),
            rank: graph.rank[n],
            type_name: node.ty.name.to_owned(),
            inputs: (node.ty.inputs.iter().zip(&node.links))
                .map(|(spec, links)| (spec.name.to_owned(), !links.is_empty()))
                .collect(),
            outputs: (node.ty.outputs.iter().enumerate())
                .map(|(k, spec)| OutPort {
                    name: spec.name.to_owned(),
                    label: label(n, k),
                    kind: WireKind::of(&spec.kind),
                })
                .collect(),
        });
        let wires = graph.nodes.iter().enumerate().flat_map(|(n, node)| {
            node.links.iter().enumerate().flat_map(move |(port, links)| {
                links.iter().map(move |link| Wire {
                    from: (link.node, link.port),
                    to: (n, port),
                    back: graph.rank[link.node] >= graph.rank[n],
                })
            })
        });
        Self { title: graph.title.clone(), boxes: boxes.collect(), wires: wires.collect() }
    }
}

#[cfg(test)]
mod tests;
