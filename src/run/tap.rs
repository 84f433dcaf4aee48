//! Taps: outputs of nodes that are written to files.
//!
//! Audio is written as WAV, numbers as NPY, as CSV or as a chart in SVG, events as CSV or JSON lines, values as JSON, as SVG or in a file format
//! of their own.

use super::memory_tap::MemoryTap;
use crate::diag::Diagnostic;
use crate::graph::{Graph, Link, nearest, suggestion};
use foley_nodes::core::ports::PortKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One output of a node that a run writes to a file, or collects in memory.
#[derive(Clone, Debug)]
pub struct Tap {
    /// Node of the graph.
    pub node: usize,
    /// Its output port.
    pub port: usize,
    /// Destination of its output.
    pub target: TapTarget,
}

/// Destination of a tapped output.
#[derive(Clone, Debug)]
pub enum TapTarget {
    /// To a file, in a format by its extension.
    File(PathBuf),
    /// Into memory, as it is.
    Memory(Arc<dyn MemoryTap>),
    /// Into memory, if its node runs for others: see [`PlanOptions::observed`](crate::plan::PlanOptions::observed).
    Observer(Arc<dyn MemoryTap>),
}

impl Tap {
    /// The file; `None` for a tap into memory.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match &self.target {
            TapTarget::File(path) => Some(path),
            TapTarget::Memory(_) | TapTarget::Observer(_) => None,
        }
    }

    /// Returns true for a tap that makes no node run.
    #[must_use]
    pub fn is_observer(&self) -> bool {
        matches!(self.target, TapTarget::Observer(_))
    }
}

/// Finds the output that `NODE.PORT=FILE` names, and checks that its type can be written to that kind of file.
///
/// # Errors
/// An unknown node or port, or a file name of another kind.
pub fn check(graph: &Graph, text: &str) -> Result<Tap, Diagnostic> {
    let error = |message: String| Diagnostic::general("F083", message);
    let Some((name, path)) = text.split_once('=') else {
        return Err(error(format!("--tap {text}: write NODE.PORT=FILE")));
    };
    let (node, port) =
        find(graph, name).map_err(|e| Diagnostic { message: format!("--tap: {}", e.message), ..e })?;
    let path = PathBuf::from(path);
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let fits: &[&str] = match graph.nodes[node].ty.outputs[port].kind {
        PortKind::Stream(item) if item.wave => &["wav", "npy", "csv", "svg"],
        PortKind::Stream(_) => &["npy", "csv", "svg"],
        PortKind::Events(_) => &["csv", "jsonl"],
        PortKind::Value(data) | PortKind::Fold(data) => match (data.plots, data.files) {
            (true, true) => &["json", "svg", "bin"],
            (true, false) => &["json", "svg"],
            (false, true) => &["json", "bin"],
            (false, false) => &["json"],
        },
    };
    if !fits.contains(&ending.as_str()) {
        let type_name = graph.nodes[node].ty.outputs[port].kind.name();
        return Err(error(format!(
            "--tap {text}: {type_name} is written as .{}, not .{ending}",
            fits.join(" or .")
        )));
    }
    Ok(Tap { node, port, target: TapTarget::File(path) })
}

/// Finds the output that `NODE.PORT`, or `NODE` with one output, names, for a tap into memory of its type.
///
/// # Errors
/// An unknown node or port, or an output of another type.
pub fn check_memory(graph: &Graph, name: &str, tap: &Arc<dyn MemoryTap>) -> Result<Tap, Diagnostic> {
    let (node, port) = find(graph, name)?;
    let kind = graph.nodes[node].ty.outputs[port].kind;
    if let Some(taken) = tap.kind().filter(|taken| !kind.feeds(taken)) {
        let message = format!(
            "`{name}` is a {} of {}; this tap takes a {} of {}",
            kind.word(),
            kind.name(),
            taken.word(),
            taken.name()
        );
        return Err(Diagnostic::general("F083", message));
    }
    Ok(Tap { node, port, target: TapTarget::Memory(Arc::clone(tap)) })
}

/// Finds the output that `NODE.PORT`, or `NODE` with one output, names.
///
/// # Errors
/// An unknown node or port, or a node with no output or with several.
pub fn find(graph: &Graph, name: &str) -> Result<(usize, usize), Diagnostic> {
    let port_of = |(id, port): (&str, &str)| {
        let node = graph.find(id)?;
        Some((node, graph.nodes[node].ty.outputs.iter().position(|p| p.name == port)?))
    };
    let found = match graph.find(name) {
        Some(node) => (graph.nodes[node].ty.outputs.len() == 1).then_some((node, 0)),
        None => name.rsplit_once('.').and_then(port_of),
    };
    if let Some(found) = found {
        return Ok(found);
    }
    if let Some(node) = graph.find(name).map(|n| &graph.nodes[n]) {
        let ports = |links: Vec<String>| links.join(" or ");
        let outputs = node.ty.outputs.iter().map(|port| format!("`{name}.{}`", port.name)).collect();
        let output = |l: &Link| {
            format!("`{}.{}`", graph.nodes[l.node].id, graph.nodes[l.node].ty.outputs[l.port].name)
        };
        let inputs = node.links.iter().flatten().map(output).collect();
        let error = |message: String| Diagnostic::general("F083", message);
        return Err(match node.ty.outputs.len() {
            0 => error(format!("`{name}` has no output")).help(format!("it reads {}", ports(inputs))),
            _ => error(format!("`{name}` has several outputs")).help(format!("write {}", ports(outputs))),
        });
    }
    let outputs =
        graph.nodes.iter().flat_map(|n| n.ty.outputs.iter().map(|p| format!("{}.{}", n.id, p.name)));
    let all: Vec<String> = outputs.collect();
    let error = Diagnostic::general("F083", format!("there is no output `{name}`"));
    let id = name.split_once('.').map_or(name, |(id, _)| id);
    let fitting = all.iter().find(|output| output.starts_with(&format!("{id}.")));
    let near = fitting.map(String::as_str).or_else(|| nearest(name, all.iter().map(String::as_str)));
    // A node may be named without its port.
    let ids = graph.nodes.iter().filter(|node| !node.ty.outputs.is_empty()).map(|node| node.id.as_str());
    let near = near.or_else(|| nearest(id, ids));
    Err(match near {
        Some(near) => error.help(format!("did you mean `{near}`?")),
        None => error.help(suggestion(name, "outputs", all.iter().map(String::as_str))),
    })
}
