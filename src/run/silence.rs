//! Explains why an output, or a part of a mix, is silent.

use super::report::NodeReport;
use crate::graph::{Graph, Link};
use foley_nodes::core::ports::{Arity, PortKind, PortSpec};
use serde_json::Value;
use std::collections::BTreeSet;

/// Parameters that multiply what a node gives.
const FACTORS: [&str; 8] =
    ["gain", "gains", "kappa", "level", "amplitude", "impacts", "impulse", "full_scale"];

/// An output port: its node and its number.
type Output = (usize, usize);

/// The output that a link comes from.
fn output(link: &Link) -> Output {
    (link.node, link.port)
}

/// The time that is explained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Period {
    /// A whole run.
    Run,
    /// A second of a graph that plays: a source that has a pause, or a node without messages, needs no explanation.
    Second,
}

/// Returns true if something that is sent while a graph plays can reach a node.
pub fn reads_messages(graph: &Graph, id: &str) -> bool {
    let (mut open, mut seen) = (Vec::from_iter(graph.find(id)), BTreeSet::new());
    while let Some(n) = open.pop() {
        if graph.nodes[n].ty.family == "live" {
            return true;
        }
        if seen.insert(n) {
            open.extend(graph.nodes[n].links.iter().flatten().map(|link| link.node));
        }
    }
    false
}

/// A graph with what its nodes have given.
struct Search<'a> {
    graph: &'a Graph,
    reports: &'a [NodeReport],
    period: Period,
    visited: BTreeSet<usize>,
    notes: Vec<(usize, String)>,
}

/// Returns notes, each of a node and a text: why files, taps (`tapped`, by node and port) and, in a whole run, parts of mixes are silent.
///
/// From what is silent the search goes upstream to the first nodes that gave nothing although they got something.
pub fn explain(
    graph: &Graph,
    reports: &[NodeReport],
    tapped: &[Output],
    period: Period,
) -> Vec<(String, String)> {
    let mut search = Search { graph, reports, period, visited: BTreeSet::new(), notes: Vec::new() };
    for (n, node) in graph.nodes.iter().enumerate() {
        let sink = node.ty.outputs.is_empty();
        for (spec, links) in node.ty.inputs.iter().zip(&node.links) {
            if sink && flows(spec) {
                links.iter().for_each(|link| search.follow(output(link), true));
            } else if period == Period::Run
                && is_mix(spec)
                && reports[n].activity.is_some_and(|active| active != 0)
            {
                links.iter().for_each(|link| search.follow(output(link), false));
            }
        }
    }
    tapped.iter().for_each(|tap| search.follow(*tap, true));
    let id = |n: usize| graph.nodes[n].id.clone();
    search.notes.into_iter().map(|(n, text)| (id(n), text)).collect()
}

/// True for streams and events.
fn flows(spec: &PortSpec) -> bool {
    matches!(spec.kind, PortKind::Stream(_) | PortKind::Events(_))
}

/// True for an input of any number of streams.
fn is_mix(spec: &PortSpec) -> bool {
    matches!(spec.kind, PortKind::Stream(_)) && matches!(spec.arity, Arity::Many)
}

impl Search<'_> {
    /// What a node says about its silence.
    fn reason(&self, n: usize) -> Option<&str> {
        self.reports[n].summary.get("silent")?.as_str()
    }

    /// Returns true if an output has carried something; None if it is not known, since a cached stream replaced its node.
    fn is_active(&self, (node, port): Output) -> Option<bool> {
        match self.reports[node].activity {
            Some(active) => Some(port >= 64 || active & (1 << port) != 0),
            None => self.reason(node).map(|_| false),
        }
    }

    /// Explains an output if nothing came from it; `whole` if all of an output depends on it.
    fn follow(&mut self, (node, port): Output, whole: bool) {
        let spec = &self.graph.nodes[node].ty.outputs[port];
        if !flows(spec) || self.is_active((node, port)) != Some(false) {
            return;
        }
        if self.reports[node].activity.unwrap_or(0) == 0 {
            self.explain(node, whole);
        } else if whole && self.visited.insert(node) {
            let text = format!("nothing comes from `{}`, while other outputs are in use", spec.name);
            self.notes.push((node, text));
        }
    }

    /// Explains a node that gave nothing; `whole` as in [`follow`](Self::follow).
    fn explain(&mut self, n: usize, whole: bool) {
        let is_off = self.reports[n].summary.get("off").and_then(Value::as_bool).unwrap_or(false);
        if is_off && !whole || !self.visited.insert(n) {
            return;
        }
        let node = &self.graph.nodes[n];
        let inputs = node.ty.inputs.iter().zip(&node.links).filter(|(spec, _)| flows(spec));
        let links: Vec<(&str, Output)> =
            inputs.flat_map(|(spec, links)| links.iter().map(|link| (spec.name, output(link)))).collect();
        // A node may pass on what is silent for a reason that it knows, such as contacts of an amplitude of 0.
        let quiet = |link: Output| self.is_active(link) == Some(false) || self.reason(link.0).is_some();
        let (silent, heard): (Vec<_>, Vec<_>) = links.into_iter().partition(|(_, link)| quiet(*link));
        let zeros = node.ty.zeros(&*node.params);
        let zero = zeros.into_iter().find(|name| FACTORS.contains(name));
        let zero = zero.filter(|_| !heard.is_empty() || silent.is_empty());
        let reason = match self.reason(n) {
            Some(reason) => Some(reason.to_owned()),
            None if is_off => Some("a linked strength is 0".to_owned()),
            None => zero.map(|name| format!("`{name}` is 0")),
        };
        let unexplained = silent.is_empty() && (self.period == Period::Run || !heard.is_empty());
        if reason.is_some() || unexplained {
            let text = reason.unwrap_or_else(|| self.generic(n, &heard));
            let what = if self.period == Period::Run { "silent throughout" } else { "silent" };
            self.notes.push((n, format!("{what}: {text}")));
        }
        for (_, link) in silent {
            if self.reason(link.0).is_some() {
                self.explain(link.0, whole);
            } else {
                self.follow(link, whole);
            }
        }
    }

    /// What can be said of any node: what it read, and its figures.
    fn generic(&self, n: usize, heard: &[(&str, Output)]) -> String {
        let node = &self.graph.nodes[n];
        if node.ty.family == "live" {
            return "it takes messages while the graph plays, and none came: play it with `foley live`"
                .to_owned();
        }
        let mut names: Vec<&str> = heard.iter().map(|(name, _)| *name).collect();
        names.dedup();
        let read = match &names[..] {
            [] => "it gives nothing".to_owned(),
            names => format!("nothing comes of what arrives at `{}`", names.join("`, `")),
        };
        let figures = self.reports[n].summary.iter().filter(|(_, value)| value.is_number());
        let figures: Vec<String> = figures.map(|(key, value)| format!("{key} {value}")).collect();
        if figures.is_empty() { read } else { format!("{read} ({})", figures.join(", ")) }
    }
}
