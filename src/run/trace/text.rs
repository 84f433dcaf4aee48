//! The trace of a run as text.

use super::{Extent, Loss, OutputLevel, PortLevel, SilenceTrace, Step, TracedOutput};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Largest number of nodes that are listed.
const MAX_STEPS: usize = 40;

impl OutputLevel {
    /// In a few words.
    #[must_use]
    pub fn text(&self) -> String {
        match (self.events, self.peak_db) {
            (Some(1), _) => "1 event".to_owned(),
            (Some(count), _) => format!("{count} events"),
            (None, Some(peak)) => format!("{peak:.1} dB"),
            (None, None) if self.active => "active".to_owned(),
            (None, None) => "silent".to_owned(),
        }
    }
}

impl PortLevel {
    /// The id of the node that an input reads.
    fn source(&self) -> Option<&str> {
        Some(self.from.as_deref()?.rsplit_once('.')?.0)
    }
}

impl Loss {
    fn text(&self) -> String {
        let what = match (self.extent, self.time) {
            (Extent::Throughout, _) => "silent throughout".to_owned(),
            (Extent::Part, _) => format!("`{}` is silent in it", self.silent),
            (Extent::Stretch, Some([from, to])) => format!("silent from {from:.2} to {to:.2} s"),
            (Extent::Stretch, None) => "silent for some time".to_owned(),
        };
        format!("{what}: lost at `{}` ({}): {}", self.node, self.kind, self.reason)
    }
}

impl TracedOutput {
    /// Readable lines: the level and the nodes at which sound is lost, then the path if it is lost.
    #[must_use]
    pub fn text(&self) -> String {
        let level = |arrives: &PortLevel| {
            let rms = arrives.level.rms_db.map_or_else(String::new, |rms| format!(", rms {rms:.1} dB"));
            let peak = if arrives.level.peak_db.is_some() { "peak " } else { "" };
            let port = if self.levels.len() > 1 { format!("{} ", arrives.port) } else { String::new() };
            let from = arrives.from.as_deref().unwrap_or_default();
            format!("{port}{peak}{}{rms} from {from}", arrives.level.text())
        };
        let levels: Vec<String> = self.levels.iter().map(level).collect();
        let mut out = format!("{}: {}", self.output, levels.join("; "));
        if self.losses.is_empty() {
            out.push_str("; nothing is lost on its path\n");
            return out;
        }
        out.push('\n');
        for loss in &self.losses {
            let _ = writeln!(out, "  {}", loss.text());
        }
        let timed = self.losses.iter().any(|loss| loss.time.is_some());
        let link = |input: &PortLevel| {
            let from = input.from.as_deref().unwrap_or_default();
            format!("{} <- {from} {}", input.port, input.level.text())
        };
        let port = |output: &PortLevel| {
            let span = output.level.span.filter(|_| timed);
            let span = span.map_or_else(String::new, |[from, to]| format!(" ({from:.2} to {to:.2} s)"));
            format!("{} {}{span}", output.port, output.level.text())
        };
        let shown = self.shown();
        let cell = |step: &Step| {
            let inputs: Vec<String> = step.inputs.iter().map(link).collect();
            let outputs: Vec<String> = step.outputs.iter().map(port).collect();
            let lost = self.losses.iter().any(|loss| loss.node == step.node);
            let mark = if lost { "  <-- lost here" } else { "" };
            [
                step.node.clone(),
                step.kind.to_owned(),
                inputs.join(", "),
                format!("{}{mark}", outputs.join(", ")),
            ]
        };
        let rows: Vec<[String; 4]> = shown.iter().map(|step| cell(step)).collect();
        let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0).min(60);
        let widths = [width(0), width(1), width(2)];
        for [node, kind, inputs, outputs] in &rows {
            let arrow = if outputs.is_empty() { "" } else { "-> " };
            let [a, b, c] = widths;
            let line = format!("    {node:<a$}  {kind:<b$}  {inputs:<c$}  {arrow}{outputs}");
            let _ = writeln!(out, "{}", line.trim_end());
        }
        if shown.len() < self.path.len() {
            let _ = writeln!(
                out,
                "    ... {} more nodes, which `--report FILE.json` lists",
                self.path.len() - shown.len()
            );
        }
        out
    }

    /// The steps that are listed: all, or in a large graph the ones that lose the sound and their neighbours.
    fn shown(&self) -> Vec<&Step> {
        if self.path.len() <= MAX_STEPS {
            return self.path.iter().collect();
        }
        let lost: BTreeSet<&str> = self.losses.iter().map(|loss| loss.node.as_str()).collect();
        let reads = |step: &Step, ids: &BTreeSet<&str>| {
            step.inputs.iter().filter_map(PortLevel::source).any(|id| ids.contains(id))
        };
        let mut near = lost.clone();
        for step in &self.path {
            if reads(step, &near) {
                near.insert(&step.node);
            }
        }
        let read: BTreeSet<&str> = (self.path.iter().filter(|step| lost.contains(step.node.as_str())))
            .flat_map(|step| step.inputs.iter().filter_map(PortLevel::source))
            .collect();
        let wanted = |step: &&Step| near.contains(step.node.as_str()) || read.contains(step.node.as_str());
        self.path.iter().filter(wanted).take(MAX_STEPS).collect()
    }
}

impl SilenceTrace {
    /// Lines for people.
    #[must_use]
    pub fn text(&self) -> String {
        if self.outputs.is_empty() {
            return "trace: no file or tap receives a stream or events\n".to_owned();
        }
        self.outputs.iter().map(|output| format!("trace: {}", output.text())).collect()
    }
}
