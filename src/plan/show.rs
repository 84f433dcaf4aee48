//! A plan as text and JSON.

use super::{Plan, Region};
use crate::diag::Diagnostic;
use crate::graph::Graph;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::time::{Tick, seconds};
use serde_json::{Value, json};
use std::fmt::Write as _;

/// Bytes for people.
#[must_use]
pub fn size(bytes: usize) -> String {
    match bytes {
        0..1024 => format!("{bytes} B"),
        1024..1_048_576 => format!("{:.1} KiB", bytes as f64 / 1024.0),
        1_048_576..1_073_741_824 => format!("{:.1} MiB", bytes as f64 / 1_048_576.0),
        _ => format!("{:.2} GiB", bytes as f64 / 1_073_741_824.0),
    }
}

impl Plan {
    /// Bytes that the buffers behind each output take, largest first: node, port, bytes.
    #[must_use]
    pub fn bytes_by_output(&self) -> Vec<(usize, usize, usize)> {
        bytes_by_output(&self.shapes, self.phases.iter().flat_map(|p| &p.regions))
    }

    /// How late the outputs of a node are in a live run, ticks.
    #[must_use]
    pub fn latency(&self, node: usize) -> Tick {
        let delay = self.phases.iter().map(|p| p.delays.of[node]).max().unwrap_or(0);
        delay + self.shapes[node].lag
    }

    /// The chain of nodes that makes a node late, from it upwards.
    #[must_use]
    pub fn why_late(&self, node: usize) -> Vec<super::Cause> {
        let Some(phase) = self.phases.iter().find(|p| p.nodes.contains(&node)) else { return Vec::new() };
        let mut chain: Vec<super::Cause> = Vec::new();
        let mut at = node;
        while let Some(cause) = &phase.delays.cause[at] {
            if chain.len() > self.shapes.len() {
                break;
            }
            at = cause.from;
            chain.push(cause.clone());
        }
        chain
    }

    /// The plan for people.
    #[must_use]
    pub fn text(&self, graph: &Graph) -> String {
        let mut out = String::new();
        let _ = writeln!(
            out,
            "{} nodes, {} phases, windows of {:.1} ms, {} of buffers",
            graph.nodes.len(),
            self.phases.len(),
            seconds(self.window) * 1e3,
            size(self.bytes)
        );
        for (n, before) in &self.values {
            let _ = writeln!(
                out,
                "value  {} ({}), before phase {}",
                graph.nodes[*n].id,
                graph.nodes[*n].ty.name,
                before + 1
            );
        }
        for (k, phase) in self.phases.iter().enumerate() {
            let _ = writeln!(
                out,
                "\nphase {}: {:.3} s in {} windows, {} regions, {}",
                k + 1,
                seconds(phase.duration),
                phase.windows,
                phase.regions.len(),
                size(phase.bytes)
            );
            for (r, region) in phase.regions.iter().enumerate() {
                for node in &region.nodes {
                    let super::What::Node(n) = node.job else { continue };
                    let streams = self.shapes[n].outputs.iter().flatten();
                    let shape: Vec<String> = streams.map(|s| format!("{s:?}")).collect();
                    let _ = writeln!(
                        out,
                        "  region {r}  {:<16} {:<18} {:>9.3} ms behind  {}",
                        graph.nodes[n].id,
                        graph.nodes[n].ty.name,
                        seconds(phase.delays.of[n]) * 1e3,
                        shape.join("; ")
                    );
                }
            }
        }
        let sinks = (0..graph.nodes.len()).filter(|&n| graph.nodes[n].ty.outputs.is_empty());
        for n in sinks {
            let _ =
                write!(out, "\nlatency of {}: {:.3} ms", graph.nodes[n].id, seconds(self.latency(n)) * 1e3);
            for cause in self.why_late(n).iter().filter(|c| c.ahead > 0) {
                let _ = write!(
                    out,
                    ", {:.3} ms look-ahead on {}",
                    seconds(cause.ahead) * 1e3,
                    graph.nodes[cause.from].id
                );
            }
        }
        out.push_str("\n\nlargest buffers:\n");
        for (n, port, bytes) in self.bytes_by_output().into_iter().take(8) {
            let node = &graph.nodes[n];
            let _ = writeln!(out, "  {:>10}  {}.{}", size(bytes), node.id, node.ty.outputs[port].name);
        }
        out
    }

    /// The plan for programs.
    #[must_use]
    pub fn json(&self, graph: &Graph) -> Value {
        let nodes: Vec<Value> = (0..graph.nodes.len())
            .map(|n| {
                let node = &graph.nodes[n];
                let phases: Vec<usize> = (0..self.phases.len())
                    .filter(|&k| self.phases[k].nodes.contains(&n))
                    .map(|k| k + 1)
                    .collect();
                let outputs: Vec<Value> = node
                    .ty
                    .outputs
                    .iter()
                    .zip(&self.shapes[n].outputs)
                    .map(|(spec, stream)| {
                        json!({
                            "name": spec.name,
                            "kind": spec.kind.word(),
                            "type": spec.kind.name(),
                            "rate": stream.as_ref().map(|s| s.rate.to_string()),
                            "width": stream.as_ref().map(|s| s.width),
                            "format": stream.as_ref().map(|s| s.text.clone()),
                        })
                    })
                    .collect();
                json!({
                    "id": node.id,
                    "type": node.ty.name,
                    "class": node.ty.class.word(),
                    "phases": phases,
                    "delay_seconds": seconds(self.latency(n) - self.shapes[n].lag),
                    "latency_seconds": seconds(self.latency(n)),
                    "end_seconds": self.shapes[n].end.map(seconds),
                    "outputs": outputs,
                })
            })
            .collect();
        let buffers: Vec<Value> = self
            .bytes_by_output()
            .into_iter()
            .map(|(n, port, bytes)| {
                json!({"output": format!("{}.{}", graph.nodes[n].id, graph.nodes[n].ty.outputs[port].name), "bytes": bytes})
            })
            .collect();
        let phases: Vec<Value> = self
            .phases
            .iter()
            .map(|p| {
                json!({
                    "seconds": seconds(p.duration),
                    "windows": p.windows,
                    "regions": p.regions.len(),
                    "bytes": p.bytes,
                })
            })
            .collect();
        json!({
            "window_seconds": seconds(self.window),
            "bytes": self.bytes,
            "phases": phases,
            "nodes": nodes,
            "buffers": buffers,
        })
    }
}

/// Bytes per output with a stream, most first: node, port, bytes.
fn bytes_by_output<'r>(
    shapes: &[NodeShape],
    regions: impl Iterator<Item = &'r Region> + Clone,
) -> Vec<(usize, usize, usize)> {
    let mut all = Vec::new();
    for (n, shape) in shapes.iter().enumerate() {
        for (port, stream) in shape.outputs.iter().enumerate() {
            let bytes: usize = regions.clone().map(|region| region.bytes_of(n, port)).sum();
            if stream.is_some() && bytes > 0 {
                all.push((n, port, bytes));
            }
        }
    }
    all.sort_by_key(|(n, port, bytes)| (usize::MAX - bytes, *n, *port));
    all
}

/// Refuses buffers of `bytes` bytes beyond the limit, and names those that need most.
///
/// # Errors
/// F050.
pub fn within<'r>(
    limit: usize,
    bytes: usize,
    graph: &Graph,
    shapes: &[NodeShape],
    regions: impl Iterator<Item = &'r Region> + Clone,
) -> Result<(), Vec<Diagnostic>> {
    if bytes <= limit {
        return Ok(());
    }
    let most = bytes_by_output(shapes, regions);
    let name = |&(n, port, bytes): &(usize, usize, usize)| {
        let node = &graph.nodes[n];
        format!("`{}.{}` {}", node.id, node.ty.outputs[port].name, size(bytes))
    };
    let largest: Vec<String> = most.iter().take(3).map(name).collect();
    let message = format!("buffers need {}, the limit is {}", size(bytes), size(limit));
    let mut diagnostic = Diagnostic::general("F050", message).help(format!(
        "most is for {}; allow more with --memory, or use a shorter --window or less look-ahead",
        largest.join(", ")
    ));
    diagnostic.place = most.first().map(|(n, _, _)| graph.nodes[*n].place.clone());
    Err(vec![diagnostic])
}
