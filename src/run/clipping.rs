//! Advice on the level of a sound that exceeds full scale or is too soft.

use super::node_report::NodeReport;
use crate::graph::Graph;
use foley_nodes::core::params::Datum;
use foley_nodes::core::ports::PortKind;
use foley_nodes::dsp::{db_to_linear, linear_to_db};
use serde_json::Value;

/// Peak to aim at, dB of full scale.
const PEAK_DB: f64 = -1.0;
/// Share of the samples beyond full scale up to which a limiter is nearly inaudible.
const FEW: f64 = 0.001;

/// Peak below which a sound is hardly audible, dB of full scale.
const SOFT_DB: f64 = -60.0;

/// Samples of a sound.
#[derive(Clone, Copy, Debug)]
pub struct Loudness {
    /// Largest magnitude.
    pub peak: f64,
    /// Share of the samples that exceed full scale.
    pub over: f64,
}

/// Returns notes on the files of a run that clip or are hardly audible: each of a node and a text.
///
/// A file of floats stores its input unchanged, such as a force in N.
pub fn notes(graph: &Graph, reports: &[NodeReport]) -> Vec<(String, String)> {
    let is_float = |(name, datum): &(&str, Datum)| {
        *name == "format" && matches!(datum, Datum::Name(format) if format == "Float32")
    };
    let note = |(n, node): (usize, &NodeReport)| {
        let fact = |key: &str| node.summary.get(key).and_then(Value::as_f64);
        let (peak, over, samples) = (fact("peak")?, fact("clipped")?, fact("frames")? * fact("channels")?);
        let text = if over > 0.0 {
            Some(advice(graph, n, Loudness { peak, over: over / samples }))
        } else {
            too_soft(graph, n, peak)
        };
        Some((node.id.clone(), text.filter(|_| !graph.nodes[n].params.write().iter().any(is_float))?))
    };
    reports.iter().enumerate().filter(|(_, node)| node.sink).filter_map(note).collect()
}

/// Advice on how to lower the sound that a node without outputs, such as `WavOut`, receives, so that its peak is -1 dB of full scale.
pub fn advice(graph: &Graph, sink: usize, sound: Loudness) -> String {
    let above = linear_to_db(sound.peak);
    let change = PEAK_DB - above;
    let lower = level_parameter(graph, sink, change)
        .unwrap_or_else(|| format!("put Gain(db: {change:.1}) before `{}`", graph.nodes[sink].id));
    let limiter = if sound.over < FEW {
        format!(
            "; or put Limiter before it, since no more than {:.2} % of the samples exceed it",
            sound.over * 100.0
        )
    } else {
        String::new()
    };
    format!("its peak is {above:.1} dB above full scale: {lower}{limiter}")
}

/// Advice on how to raise a sound that is hardly audible; `None` for louder sounds, and for silence, which has other reasons.
fn too_soft(graph: &Graph, sink: usize, peak: f64) -> Option<String> {
    let level = linear_to_db(peak);
    if peak <= 0.0 || level >= SOFT_DB {
        return None;
    }
    let raise = level_parameter(graph, sink, PEAK_DB - level);
    let raise =
        raise.map(|raise| format!(": {raise}, or find the node that attenuates it")).unwrap_or_default();
    Some(format!("its peak is {level:.1} dB of full scale, which is barely audible{raise}"))
}

/// The nearest parameter before a node that sets the level, with its new value.
fn level_parameter(graph: &Graph, sink: usize, change: f64) -> Option<String> {
    let mut at = sink;
    loop {
        // The level of one of several inputs is not that of the sum.
        let inputs = &graph.nodes[at].links;
        let mut links = inputs.iter().flatten().filter(|link| {
            let port = &graph.nodes[link.node].ty.outputs[link.port];
            matches!(port.kind, PortKind::Stream(_))
        });
        let link = links.next().filter(|_| links.next().is_none())?;
        at = link.node;
        let node = &graph.nodes[at];
        let params = node.params.write();
        let number = |wanted: &str| {
            let linked = node
                .ty
                .inputs
                .iter()
                .zip(&node.links)
                .any(|(spec, links)| spec.name == wanted && !links.is_empty());
            let (_, datum) = params.iter().find(|(name, _)| *name == wanted && !linked)?;
            match datum {
                Datum::Float(x) => Some(*x),
                Datum::Int(x) => Some(*x as f64),
                _ => None,
            }
        };
        // A node of a sub-graph is not written in the file of the user.
        if node.id.contains('.') {
            return None;
        }
        if let Some(db) = number("db") {
            return Some(format!("set `db: {:.1}` on `{}` (now {db})", db + change, node.id));
        }
        if let Some(gain) = number("gain") {
            let new = gain * db_to_linear(change);
            let digits = (2 - new.abs().max(1e-12).log10().floor() as i32).clamp(0, 12) as usize;
            return Some(format!("set `gain: {new:.digits$}` on `{}` (now {gain})", node.id));
        }
    }
}
