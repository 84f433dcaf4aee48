//! Taps: outputs of nodes that are written to files.
//!
//! Audio is written as WAV, numbers as NPY or CSV, events as CSV or JSON lines, values as JSON, as SVG or in a file format of their
//! own.

use crate::diag::Diagnostic;
use crate::graph::{Graph, nearest};
use foley_nodes::core::ports::PortKind;
use std::path::PathBuf;

/// One output to write to a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Tap {
    /// Node of the graph.
    pub node: usize,
    /// Its output port.
    pub port: usize,
    /// The file.
    pub path: PathBuf,
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
    let find = |name: &str| {
        if let Some(node) = graph.find(name) {
            return (graph.nodes[node].ty.outputs.len() == 1).then_some((node, 0));
        }
        let (id, port) = name.rsplit_once('.')?;
        let node = graph.find(id)?;
        Some((node, graph.nodes[node].ty.outputs.iter().position(|p| p.name == port)?))
    };
    let Some((node, port)) = find(name) else {
        let all: Vec<String> = graph
            .nodes
            .iter()
            .flat_map(|n| n.ty.outputs.iter().map(|p| format!("{}.{}", n.id, p.name)))
            .collect();
        let found = error(format!("--tap: there is no output `{name}`"));
        let fitting =
            name.split_once('.').and_then(|(id, _)| all.iter().find(|o| o.starts_with(&format!("{id}."))));
        if let Some(fitting) = fitting {
            return Err(found.help(format!("did you mean `{fitting}`?")));
        }
        return Err(match nearest(name, all.iter().map(String::as_str)) {
            Some(near) => found.help(format!("did you mean `{near}`?")),
            None => found.help(format!("outputs: {}", all.join(", "))),
        });
    };
    let path = PathBuf::from(path);
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let fits: &[&str] = match graph.nodes[node].ty.outputs[port].kind {
        PortKind::Stream(item) if item.wave => &["wav", "npy", "csv"],
        PortKind::Stream(_) => &["npy", "csv"],
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
    Ok(Tap { node, port, path })
}
