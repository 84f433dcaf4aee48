//! Explains why an output, or a part of a mix, is silent.

use super::node_report::NodeReport;
use crate::graph::{Graph, Link};
use foley_nodes::core::ports::{Arity, PortKind, PortSpec};
use serde_json::Value;
use std::collections::BTreeSet;

/// Parameters that multiply the output of a node.
const FACTORS: [&str; 8] =
    ["gain", "gains", "kappa", "level", "amplitude", "impacts", "impulse", "full_scale"];

/// An output port: its node and its number.
pub type Output = (usize, usize);

/// Returns true for an output that is active in the explained time; `None` if it is not known.
pub type Activity<'a> = &'a dyn Fn(Output) -> Option<bool>;

/// The output that a link comes from.
pub(super) fn output(link: &Link) -> Output {
    (link.node, link.port)
}

/// The time that is explained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Period {
    /// A whole run.
    Run,
    /// A second of a graph that plays: a source that has a pause, or a node without messages, needs no explanation.
    Second,
    /// A stretch of a run: the reason that a node reports holds for a whole run, and does not explain a stretch.
    Stretch,
}

/// Returns true if a message that is sent while a graph plays can reach a node.
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

/// A graph with the activity of its nodes.
struct Search<'a> {
    graph: &'a Graph,
    reports: &'a [NodeReport],
    period: Period,
    activity: Activity<'a>,
    visited: BTreeSet<usize>,
    notes: Vec<(usize, Lost, String)>,
}

/// Returns notes, each of a node and a text: why files, taps (`tapped`, by node and port) and, in a whole run, parts of mixes are silent.
///
/// From a silent output the search goes upstream to the first nodes that gave nothing although they received something.
pub fn explain(
    graph: &Graph,
    reports: &[NodeReport],
    tapped: &[Output],
    period: Period,
) -> Vec<(String, String)> {
    // Not known of a node that was replaced by a cached stream.
    let activity = |(node, port): Output| {
        Some(reports[node].activity? != 0).map(|any| {
            any && (port >= 64 || reports[node].activity.is_some_and(|active| active & (1 << port) != 0))
        })
    };
    let mut search = Search::new(graph, reports, period, &activity);
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
    let what = if period == Period::Run { "silent throughout: " } else { "silent: " };
    let text = |(_, lost, text)| if lost == Lost::Node { format!("{what}{text}") } else { text };
    search.notes.into_iter().map(|note| (id(note.0), text(note))).collect()
}

/// Finds the nodes at which a silent output is lost, each with a reason: the first ones upstream of it that give nothing although they
/// receive something, or that nothing feeds; `whole` if all that is written depends on the output.
pub fn losses(
    (graph, reports): (&Graph, &[NodeReport]),
    output: Output,
    whole: bool,
    period: Period,
    activity: Activity<'_>,
) -> Vec<(usize, String)> {
    let mut search = Search::new(graph, reports, period, activity);
    search.follow(output, whole);
    search.notes.into_iter().map(|(n, _, text)| (n, text)).collect()
}

/// Part of a node that is silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lost {
    /// A node with all its outputs.
    Node,
    /// One of several outputs.
    Port,
}

/// True for streams and events.
pub fn flows(spec: &PortSpec) -> bool {
    matches!(spec.kind, PortKind::Stream(_) | PortKind::Events(_))
}

/// True for an input of any number of streams.
pub fn is_mix(spec: &PortSpec) -> bool {
    matches!(spec.kind, PortKind::Stream(_)) && matches!(spec.arity, Arity::Many)
}

impl<'a> Search<'a> {
    fn new(graph: &'a Graph, reports: &'a [NodeReport], period: Period, activity: Activity<'a>) -> Self {
        Self { graph, reports, period, activity, visited: BTreeSet::new(), notes: Vec::new() }
    }

    /// Reason that a node reports for its silence.
    fn reason(&self, n: usize) -> Option<&str> {
        if self.period == Period::Stretch {
            return None;
        }
        self.reports[n].summary.get("silent")?.as_str()
    }

    /// Returns true if an output has been active; None if it is not known, since a cached stream replaced its node.
    fn is_active(&self, output: Output) -> Option<bool> {
        (self.activity)(output).or_else(|| self.reason(output.0).map(|_| false))
    }

    /// Returns true if no output of a node has been active.
    fn gave_nothing(&self, node: usize) -> bool {
        let ports = 0..self.graph.nodes[node].ty.outputs.len();
        !ports.into_iter().any(|port| self.is_active((node, port)) == Some(true))
    }

    /// Explains an output without content; `whole` if all of an output depends on it.
    fn follow(&mut self, (node, port): Output, whole: bool) {
        let spec = &self.graph.nodes[node].ty.outputs[port];
        if !flows(spec) || self.is_active((node, port)) != Some(false) {
            return;
        }
        if self.gave_nothing(node) {
            self.explain(node, whole);
        } else if whole && self.visited.insert(node) {
            let text = format!("nothing comes from `{}`, while other outputs are in use", spec.name);
            self.notes.push((node, Lost::Port, text));
        }
    }

    /// Explains a node that gave nothing; `whole` as in [`follow`](Self::follow).
    fn explain(&mut self, n: usize, whole: bool) {
        let is_off = self.reports[n].summary.get("off").and_then(Value::as_bool).unwrap_or(false)
            && self.period != Period::Stretch;
        if is_off && !whole || !self.visited.insert(n) {
            return;
        }
        let node = &self.graph.nodes[n];
        let inputs = node.ty.inputs.iter().zip(&node.links).filter(|(spec, _)| flows(spec));
        let links: Vec<(&str, Output)> =
            inputs.flat_map(|(spec, links)| links.iter().map(|link| (spec.name, output(link)))).collect();
        // A node may pass on what is silent for a known reason, such as contacts of an amplitude of 0.
        let quiet = |link: Output| self.is_active(link) == Some(false) || self.reason(link.0).is_some();
        let (silent, heard): (Vec<_>, Vec<_>) = links.into_iter().partition(|(_, link)| quiet(*link));
        let zeros = node.ty.zeros(&*node.params);
        let zero = zeros.into_iter().find(|name| FACTORS.contains(name));
        let zero =
            zero.filter(|_| self.period != Period::Stretch && (!heard.is_empty() || silent.is_empty()));
        let reason = match self.reason(n) {
            Some(reason) => Some(reason.to_owned()),
            None if is_off => Some("a linked strength is 0".to_owned()),
            None => zero.map(|name| format!("`{name}` is 0")),
        };
        let unexplained = silent.is_empty() && (self.period != Period::Second || !heard.is_empty());
        if reason.is_some() || unexplained {
            let text = reason.unwrap_or_else(|| self.generic(n, &heard));
            self.notes.push((n, Lost::Node, text));
        }
        for (_, link) in silent {
            if self.reason(link.0).is_some() {
                self.explain(link.0, whole);
            } else {
                self.follow(link, whole);
            }
        }
    }

    /// Reason that applies to any node: its inputs, and its figures.
    fn generic(&self, n: usize, heard: &[(&str, Output)]) -> String {
        let node = &self.graph.nodes[n];
        if node.ty.family == "live" {
            return "it takes messages while the graph plays, and none came: play it with `foley live`"
                .to_owned();
        }
        let mut names: Vec<&str> = heard.iter().map(|(name, _)| *name).collect();
        names.dedup();
        let read = match &names[..] {
            [] => "it outputs nothing".to_owned(),
            names => format!("it outputs nothing from its input at `{}`", names.join("`, `")),
        };
        if self.period == Period::Stretch {
            return if names.is_empty() { "it outputs nothing in this time".to_owned() } else { read };
        }
        let figures = self.reports[n].summary.iter().filter(|(_, value)| value.is_number());
        let figures: Vec<String> = figures.map(|(key, value)| format!("{key} {value}")).collect();
        if figures.is_empty() { read } else { format!("{read} ({})", figures.join(", ")) }
    }
}
