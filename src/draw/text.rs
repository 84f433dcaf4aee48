//! A graph as text: a line for each node, with its inputs and outputs.

use super::{Drawing, Wire};
use std::fmt::Write as _;

/// Maximum width of a column.
const WIDEST: usize = 32;

/// Lists a drawing: `id  Type  input <- node, other.output  [rate, format]`, sources first.
#[must_use]
pub fn text(drawing: &Drawing) -> String {
    let mut out = String::new();
    if !drawing.title.is_empty() {
        let _ = writeln!(out, "{}\n", drawing.title);
    }
    let widest =
        |len: &dyn Fn(usize) -> usize| (0..drawing.boxes.len()).map(len).max().unwrap_or(0).min(WIDEST);
    let id_width = widest(&|b| drawing.boxes[b].id.chars().count());
    let type_width = widest(&|b| drawing.boxes[b].type_name.chars().count());
    let mut inputs: Vec<Vec<&Wire>> = vec![Vec::new(); drawing.boxes.len()];
    drawing.wires.iter().for_each(|wire| inputs[wire.to.0].push(wire));
    let mut order: Vec<usize> = (0..drawing.boxes.len()).collect();
    order.sort_by_key(|b| drawing.boxes[*b].rank);
    for b in order {
        let node = &drawing.boxes[b];
        let source = |wire: &Wire| {
            let from = &drawing.boxes[wire.from.0];
            let port = from.outputs.get(wire.from.1).filter(|_| from.outputs.len() > 1);
            let port = port.map_or_else(String::new, |port| format!(".{}", port.name));
            let back = if wire.back { " (closes a loop)" } else { "" };
            format!("{}{port}{back}", from.id)
        };
        let of_port = |(port, (name, _)): (usize, &(String, bool))| {
            let wires = inputs[b].iter().filter(|wire| wire.to.1 == port);
            let sources: Vec<String> = wires.map(|wire| source(wire)).collect();
            (!sources.is_empty()).then(|| format!("{name} <- {}", sources.join(", ")))
        };
        let reads: Vec<String> = node.inputs.iter().enumerate().filter_map(of_port).collect();
        let mut labels: Vec<&str> =
            node.outputs.iter().map(|port| port.label.as_str()).filter(|label| !label.is_empty()).collect();
        labels.dedup();
        let gives = if labels.is_empty() { String::new() } else { format!("  [{}]", labels.join("; ")) };
        let line =
            format!("{:<id_width$}  {:<type_width$}  {}{gives}", node.id, node.type_name, reads.join("; "));
        let _ = writeln!(out, "{}", line.trim_end());
    }
    out
}
