//! A graph as text: a line for each node, with what it reads and gives.

use super::{Drawing, Wire};
use std::fmt::Write as _;

/// Maximum width of a column.
const WIDEST: usize = 32;

/// Boxes in an order in which each follows those that it reads, apart from links that close a loop.
fn order(drawing: &Drawing) -> Vec<usize> {
    let count = drawing.boxes.len();
    let mut waits = vec![0; count];
    let forward = |wire: &&Wire| !wire.back;
    drawing.wires.iter().filter(forward).for_each(|wire| waits[wire.to.0] += 1);
    let mut readers: Vec<Vec<usize>> = vec![Vec::new(); count];
    drawing.wires.iter().filter(forward).for_each(|wire| readers[wire.from.0].push(wire.to.0));
    // Of those that are ready, the one that became ready last: a chain stays together.
    let mut ready: Vec<usize> = (0..count).rev().filter(|b| waits[*b] == 0).collect();
    let mut order = Vec::with_capacity(count);
    while let Some(next) = ready.pop() {
        order.push(next);
        for &reader in readers[next].iter().rev() {
            waits[reader] -= 1;
            if waits[reader] == 0 {
                ready.push(reader);
            }
        }
    }
    order
}

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
    for b in order(drawing) {
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
