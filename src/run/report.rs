//! The report of a run.

use super::Job;
use super::node_report::NodeReport;
use super::trace::SilenceTrace;
use crate::graph::Graph;
use crate::plan::Plan;
use foley_nodes::core::node::Summary;
use foley_nodes::core::time::seconds;
use serde_json::{Map, Value, json};
use std::collections::HashSet;
use std::time::Duration;

/// One file that was written.
#[derive(Clone, Debug)]
pub struct OutputReport {
    /// Its path.
    pub path: String,
    /// The summary of its writer: rate, channels, frames, peak, rms.
    pub facts: Map<String, Value>,
}

/// The report of a run.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Title of the graph.
    pub title: String,
    /// Wall time of the run.
    pub wall: Duration,
    /// Processor time of the whole process, if the system reports it.
    pub cpu: Option<Duration>,
    /// Length of the piece, seconds.
    pub length: f64,
    /// Planned bytes of all buffers.
    pub planned_bytes: usize,
    /// Maximum bytes of all buffers.
    pub buffer_bytes: usize,
    /// Time in the piece at which the run resumed an earlier one, s.
    pub resumed_at: Option<f64>,
    /// Peak memory of the whole process, if the system reports it.
    pub peak_process_bytes: Option<usize>,
    /// Per node of the graph.
    pub nodes: Vec<NodeReport>,
    /// Files written.
    pub outputs: Vec<OutputReport>,
    /// Warnings, with the ids of their nodes.
    pub notes: Vec<(String, String)>,
    /// Nodes at which the sound is lost, if the run traced them.
    pub trace: Option<SilenceTrace>,
}

impl Report {
    pub(super) fn new(graph: &Graph, plan: &Plan) -> Self {
        let nodes = graph.nodes.iter().map(|n| NodeReport {
            id: n.id.clone(),
            kind: n.ty.name,
            sink: n.ty.outputs.is_empty(),
            ..NodeReport::default()
        });
        Self {
            title: graph.title.clone(),
            planned_bytes: plan.bytes,
            length: seconds(plan.length(graph)),
            nodes: nodes.collect(),
            notes: plan.notes(graph),
            ..Self::default()
        }
    }

    /// Adds the activity of the outputs of a node.
    pub(super) fn add_activity(&mut self, n: usize, active: u64) {
        *self.nodes[n].activity.get_or_insert_default() |= active;
    }

    pub(super) fn add(&mut self, n: usize, time: Duration, calls: u64, summary: Summary) {
        let node = &mut self.nodes[n];
        node.time += time;
        node.calls += calls;
        for (key, value) in summary {
            if key == "warning" {
                self.notes.push((node.id.clone(), value.as_str().unwrap_or_default().to_owned()));
            } else {
                node.summary.insert(key.to_owned(), value);
            }
        }
    }

    pub(super) fn add_cached(&mut self, n: usize, summary: Map<String, Value>, warnings: Vec<String>) {
        let node = &mut self.nodes[n];
        node.cached = true;
        node.summary = summary;
        self.notes.extend(warnings.into_iter().map(|warning| (node.id.clone(), warning)));
    }

    /// Iterates over the warnings, once each: a node that runs in several phases warns in each of them.
    pub fn warnings(&self) -> impl Iterator<Item = &(String, String)> {
        let mut shown = HashSet::new();
        self.notes.iter().filter(move |note| shown.insert(*note))
    }

    /// The warnings of a node after the first `since` notes.
    pub(super) fn warnings_since(&self, n: usize, since: usize) -> Vec<String> {
        let own = self.notes.iter().skip(since).filter(|(id, _)| *id == self.nodes[n].id);
        own.map(|(_, note)| note.clone()).collect()
    }

    /// Returns the ids of the nodes that were computed, without those that only write.
    #[must_use]
    pub fn computed(&self) -> Vec<String> {
        self.nodes.iter().filter(|n| !n.cached && n.calls > 0 && !n.sink).map(|n| n.id.clone()).collect()
    }

    pub(super) fn note_buffer_bytes(&mut self, bytes: usize) {
        self.buffer_bytes = self.buffer_bytes.max(bytes);
    }

    /// Records that a checkpoint could not be saved.
    pub(super) fn note_checkpoint_error(&mut self, e: &std::io::Error) {
        let text = format!("cannot save a checkpoint, so the run could not be resumed: {e}");
        self.notes.push(("checkpoint".to_owned(), text));
    }

    pub(super) fn close(&mut self, job: &Job<'_>, wall: Duration) {
        self.wall = wall;
        self.cpu = cpu_time();
        self.peak_process_bytes = peak_memory();
        for (n, node) in self.nodes.iter_mut().enumerate() {
            let shape = &job.plan.shapes[n];
            let inputs = job.graph.nodes[n].links.iter().flatten();
            let mut inputs = inputs.filter_map(|l| job.plan.shapes[l.node].outputs.get(l.port)?.as_ref());
            let first = shape.outputs.iter().flatten().next().or_else(|| inputs.next());
            let items = first.and_then(|s| Some(s.rate.first_at(s.end?)));
            node.items = items.unwrap_or(0).max(0) as u64;
            if let Some(Value::String(path)) = node.summary.get("path").cloned() {
                let path = job.outputs.resolve(&path).map_or(path, |p| p.display().to_string());
                self.outputs.push(OutputReport { path, facts: node.summary.clone() });
            }
        }
    }

    /// Formats the report as JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        let nodes: Map<String, Value> = self
            .nodes
            .iter()
            .map(|n| {
                let facts = json!({
                    "kind": n.kind,
                    "seconds": n.time.as_secs_f64(),
                    "windows": n.calls,
                    "items": n.items,
                    "cached": n.cached,
                    "summary": n.summary,
                });
                (n.id.clone(), facts)
            })
            .collect();
        let outputs: Vec<Value> = self
            .outputs
            .iter()
            .map(|o| {
                let mut facts = o.facts.clone();
                facts.insert("path".into(), o.path.clone().into());
                if let (Some(frames), Some(rate)) = (
                    o.facts.get("frames").and_then(Value::as_f64),
                    o.facts.get("rate").and_then(Value::as_f64),
                ) {
                    facts.insert("seconds".into(), json!(frames / rate));
                }
                Value::Object(facts)
            })
            .collect();
        let mut all = json!({
            "title": self.title,
            "wall_seconds": self.wall.as_secs_f64(),
            "cpu_seconds": self.cpu.map(|c| c.as_secs_f64()),
            "length_seconds": self.length,
            "planned_bytes": self.planned_bytes,
            "buffer_bytes": self.buffer_bytes,
            "peak_process_bytes": self.peak_process_bytes,
            "went_on_at": self.resumed_at,
            "nodes": nodes,
            "outputs": outputs,
            "warnings": self.warnings().map(|(id, note)| json!({"node": id, "message": note})).collect::<Vec<_>>(),
        });
        if let (Some(fields), Some(trace)) = (all.as_object_mut(), &self.trace) {
            fields.insert("silence".to_owned(), json!(trace.outputs));
        }
        all
    }
}

/// Processor time of all threads of this process so far.
fn cpu_time() -> Option<Duration> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks: u64 = fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?;
    // Linux reports hundredths of a second, independent of the clock of the kernel.
    Some(Duration::from_millis(ticks * 10))
}

/// Peak memory of this process so far.
fn peak_memory() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<usize>().ok().map(|kib| kib * 1024)
}
