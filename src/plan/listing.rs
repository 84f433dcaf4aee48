//! A plan as text and JSON.

use super::delays::Cause;
use super::memory::{bytes_by_output, format_bytes};
use super::offline_plan::Plan;
use super::region::Runnable;
use super::shapes::shape_notes;
use crate::graph::Graph;
use foley_nodes::core::time::{Tick, seconds};
use serde_json::{Value, json};
use std::fmt::Write as _;

/// Nodes up to which a plan lists them all.
const SMALL: usize = 20;

impl Plan {
    /// Notes of nodes about their files: the id of each node, and a text.
    #[must_use]
    pub fn notes(&self, graph: &Graph) -> Vec<(String, String)> {
        shape_notes(graph, &self.shapes)
    }

    /// Returns the bytes of the buffers of each output, largest first: node, port, bytes.
    #[must_use]
    pub fn bytes_by_output(&self) -> Vec<(usize, usize, usize)> {
        bytes_by_output(&self.shapes, self.phases.iter().flat_map(|p| &p.regions))
    }

    /// Returns the latency of the outputs of a node when it plays, ticks.
    #[must_use]
    pub fn latency(&self, node: usize) -> Tick {
        let delay = self.phases.iter().map(|p| p.delays.of[node]).max().unwrap_or(0);
        delay + self.shapes[node].lag
    }

    /// Returns the inputs that determine the delay of a node, from the node upstream.
    #[must_use]
    pub fn latency_chain(&self, node: usize) -> Vec<Cause> {
        let Some(phase) = self.phases.iter().find(|p| p.nodes.contains(&node)) else { return Vec::new() };
        let mut chain: Vec<Cause> = Vec::new();
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

    /// Formats the plan as text, on one page or with a line for each node (`long`). A small graph has all its lines in any case.
    #[must_use]
    pub fn text(&self, graph: &Graph, long: bool) -> String {
        let long = long || graph.nodes.len() <= SMALL;
        let mut out = String::new();
        for (node, note) in self.notes(graph) {
            let _ = writeln!(out, "note: {node}: {note}");
        }
        let _ = writeln!(
            out,
            "{} node(s), {} phase(s), windows of {:.1} ms, {} of buffers",
            graph.nodes.len(),
            self.phases.len(),
            seconds(self.window) * 1e3,
            format_bytes(self.bytes)
        );
        if !long && !self.values.is_empty() {
            let _ = writeln!(out, "{} values before the streams", self.values.len());
        }
        for (n, phase) in self.values.iter().filter(|_| long) {
            let _ = writeln!(
                out,
                "value  {} ({}), before phase {}",
                graph.nodes[*n].id,
                graph.nodes[*n].ty.name,
                phase + 1
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
                format_bytes(phase.bytes)
            );
            for (r, region) in phase.regions.iter().enumerate() {
                for node in region.nodes.iter().filter(|_| long) {
                    let Runnable::Node(n) = node.runnable else { continue };
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
        let sinks: Vec<usize> =
            (0..graph.nodes.len()).filter(|&n| graph.nodes[n].ty.outputs.is_empty()).collect();
        let shown = if long { sinks.len() } else { SMALL };
        for &n in sinks.iter().take(shown) {
            let _ =
                write!(out, "\nlatency of {}: {:.3} ms", graph.nodes[n].id, seconds(self.latency(n)) * 1e3);
            for cause in self.latency_chain(n).iter().filter(|c| c.ahead > 0) {
                let _ = write!(
                    out,
                    ", {:.3} ms look-ahead on {}",
                    seconds(cause.ahead) * 1e3,
                    graph.nodes[cause.from].id
                );
            }
        }
        if sinks.len() > shown {
            let _ = write!(out, "\nlatency of {} more nodes", sinks.len() - shown);
        }
        out.push_str("\n\nlargest buffers:\n");
        for (n, port, bytes) in self.bytes_by_output().into_iter().take(8) {
            let node = &graph.nodes[n];
            let _ =
                writeln!(out, "  {:>10}  {}.{}", format_bytes(bytes), node.id, node.ty.outputs[port].name);
        }
        if !long {
            let _ = writeln!(out, "\n--long lists all {} nodes", graph.nodes.len());
        }
        out
    }

    /// Formats the plan as JSON.
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
                    "notes": self.shapes[n].notes,
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
