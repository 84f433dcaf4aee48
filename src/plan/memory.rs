//! Memory of the buffers of a plan, and its limit.

use super::region::Region;
use crate::diag::Diagnostic;
use crate::graph::Graph;
use foley_nodes::core::shape::NodeShape;

/// Formats a number of bytes with a binary unit.
#[must_use]
pub fn format_bytes(bytes: usize) -> String {
    match bytes {
        0..1024 => format!("{bytes} B"),
        1024..1_048_576 => format!("{:.1} KiB", bytes as f64 / 1024.0),
        1_048_576..1_073_741_824 => format!("{:.1} MiB", bytes as f64 / 1_048_576.0),
        _ => format!("{:.2} GiB", bytes as f64 / 1_073_741_824.0),
    }
}

/// Bytes of the buffers of each output with a stream, largest first: node, port, bytes.
pub fn bytes_by_output<'r>(
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

/// Refuses buffers of `bytes` bytes beyond the limit, and names the largest.
///
/// # Errors
/// F050.
pub fn check_limit<'r>(
    limit: usize,
    bytes: usize,
    graph: &Graph,
    shapes: &[NodeShape],
    regions: impl Iterator<Item = &'r Region> + Clone,
) -> Result<(), Vec<Diagnostic>> {
    if bytes <= limit {
        return Ok(());
    }
    let outputs = bytes_by_output(shapes, regions);
    let name = |&(n, port, bytes): &(usize, usize, usize)| {
        let node = &graph.nodes[n];
        format!("`{}.{}` {}", node.id, node.ty.outputs[port].name, format_bytes(bytes))
    };
    let largest: Vec<String> = outputs.iter().take(3).map(name).collect();
    let message = format!("buffers need {}, the limit is {}", format_bytes(bytes), format_bytes(limit));
    let mut diagnostic = Diagnostic::general("F050", message).help(format!(
        "the largest are {}; allow more with --memory, or use a shorter --window or less look-ahead",
        largest.join(", ")
    ));
    diagnostic.location = outputs.first().map(|(n, _, _)| graph.nodes[*n].location.clone());
    Err(vec![diagnostic])
}
