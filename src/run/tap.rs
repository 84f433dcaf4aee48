//! Writes any output of any node to a file: audio as WAV, numbers as NPY or CSV, events as CSV or JSON lines, values as JSON,
//! as SVG or as files of their own kind.

use super::{Job, Values};
use crate::diag::Diagnostic;
use crate::graph::{Graph, nearest};
use foley_nodes::archive_state;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::files::WriteSeek;
use foley_nodes::core::item::{EventType, ItemType};
use foley_nodes::core::node::{DynNode, Summary};
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::stage::Cx;
use foley_nodes::core::state::{StateArchive, Stateful, archive_position};
use foley_nodes::core::time::{Rate, seconds};
use foley_nodes::io::{AudioWriter, WriteFormat, WriteSpec};
use std::any::Any;
use std::io::{self, BufWriter, SeekFrom, Write};
use std::path::PathBuf;

/// One output to write to a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Tap {
    /// Node of the graph.
    pub node: usize,
    /// Its output port.
    pub port: usize,
    /// Where to.
    pub path: PathBuf,
}

/// Finds the output that `NODE.PORT=FILE` names, and says where the file's kind does not fit it.
///
/// # Errors
/// An unknown node or port, or a file name of another kind.
pub fn check(graph: &Graph, text: &str) -> Result<Tap, Diagnostic> {
    let error = |message: String| Diagnostic::general("F083", message);
    let Some((name, path)) = text.split_once('=') else {
        return Err(error(format!("--tap {text}: write NODE.PORT=FILE")));
    };
    let find = |name: &str| {
        if let Some(node) = graph.find(name) {
            return (graph.nodes[node].ty.outputs.len() == 1).then_some((node, 0));
        }
        let (id, port) = name.rsplit_once('.')?;
        let node = graph.find(id)?;
        Some((node, graph.nodes[node].ty.outputs.iter().position(|p| p.name == port)?))
    };
    let Some((node, port)) = find(name) else {
        let all: Vec<String> = graph
            .nodes
            .iter()
            .flat_map(|n| n.ty.outputs.iter().map(|p| format!("{}.{}", n.id, p.name)))
            .collect();
        let found = error(format!("--tap: there is no output `{name}`"));
        let own =
            name.split_once('.').and_then(|(id, _)| all.iter().find(|o| o.starts_with(&format!("{id}."))));
        if let Some(own) = own {
            return Err(found.help(format!("did you mean `{own}`?")));
        }
        return Err(match nearest(name, all.iter().map(String::as_str)) {
            Some(near) => found.help(format!("did you mean `{near}`?")),
            None => found.help(format!("outputs: {}", all.join(", "))),
        });
    };
    let path = PathBuf::from(path);
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let fits: &[&str] = match graph.nodes[node].ty.outputs[port].kind {
        PortKind::Stream(item) if item.wave => &["wav", "npy", "csv"],
        PortKind::Stream(_) => &["npy", "csv"],
        PortKind::Events(_) => &["csv", "jsonl"],
        PortKind::Value(data) | PortKind::Fold(data) => match (data.plots, data.files) {
            (true, true) => &["json", "svg", "bin"],
            (true, false) => &["json", "svg"],
            (false, true) => &["json", "bin"],
            (false, false) => &["json"],
        },
    };
    if !fits.contains(&ending.as_str()) {
        let what = graph.nodes[node].ty.outputs[port].kind.name();
        return Err(error(format!(
            "--tap {text}: {what} is written as .{}, not .{ending}",
            fits.join(" or .")
        )));
    }
    Ok(Tap { node, port, path })
}

/// The writer of a stream or of events.
///
/// # Errors
/// When the file cannot be written.
pub fn writer(job: &Job<'_>, k: usize) -> Result<Box<dyn DynNode>, Diagnostic> {
    let tap = &job.taps[k];
    let general = |code, message: String| Diagnostic::general(code, message);
    let file = job.outputs.create_at(&tap.path).map_err(|e| general(e.code, e.message))?;
    let csv = tap.path.extension().is_some_and(|e| e == "csv");
    let shape = job.plan.shapes[tap.node].outputs[tap.port].as_ref();
    match (job.graph.nodes[tap.node].ty.outputs[tap.port].kind, shape) {
        (PortKind::Stream(item), Some(stream))
            if item.wave && tap.path.extension().is_some_and(|e| e == "wav") =>
        {
            let rate = u32::try_from(stream.rate.num() / stream.rate.den()).unwrap_or(u32::MAX);
            let spec = WriteSpec::new(rate, stream.width, WriteFormat::Float32);
            let writer = AudioWriter::new(file, spec).map_err(|e| general("F080", e.to_string()))?;
            Ok(Box::new(Wave { item, writer: Some(writer), numbers: Vec::new() }))
        }
        (PortKind::Stream(item), Some(stream)) if csv => {
            let rows = Rows::start(file, item, stream.width, stream.rate);
            Ok(Box::new(rows.map_err(|e| general("F080", e.to_string()))?))
        }
        (PortKind::Stream(item), Some(stream)) => {
            let file =
                Numbers::start(file, item, stream.width).map_err(|e| general("F080", e.to_string()))?;
            Ok(Box::new(file))
        }
        (PortKind::Events(event), _) => Ok(Box::new(Lines { event, file, csv, columns: None })),
        _ => Err(general("F099", "a value was planned as a stream: a defect in foley".into())),
    }
}

/// Writes the tapped values, once all are known.
///
/// # Errors
/// When a file cannot be written, or a type has no drawing.
pub fn write_values(job: &Job<'_>, values: &Values) -> Result<(), Vec<Diagnostic>> {
    let mut errors = Vec::new();
    for tap in job.taps {
        let Some(value) = values.get(&(tap.node, tap.port)) else { continue };
        let kind = value.kind();
        let ending = tap.path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let bytes = match ending {
            "svg" => (kind.plot)(value).map(String::into_bytes).ok_or("drawing").map(Some),
            "bin" => (kind.file)(value).ok_or("file of its own kind").map(Some),
            _ => Ok(None),
        };
        let bytes = bytes.map_err(|what| format!("a {} has no {what}; write it as .json", kind.name));
        let written = bytes.and_then(|bytes| {
            let mut file = BufWriter::new(job.outputs.create_at(&tap.path).map_err(|e| e.message)?);
            let done = match bytes {
                Some(bytes) => file.write_all(&bytes),
                None => (kind.json)(value, &mut file),
            };
            done.and_then(|()| file.flush()).map_err(|e| e.to_string())
        });
        if let Err(message) = written {
            errors.push(Diagnostic::general("F080", format!("--tap {}: {message}", tap.path.display())));
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

fn failed(e: &dyn std::fmt::Display) -> Fault {
    Fault::new("F080", format!("cannot write a tap: {e}"))
}

/// What the writers of taps have in common: they keep no state that an edit could take over.
macro_rules! plain_node {
    () => {
        fn as_any_mut(&mut self) -> &mut dyn Any {
            self
        }
    };
}

struct Wave {
    item: &'static ItemType,
    writer: Option<AudioWriter<Box<dyn WriteSeek>>>,
    numbers: Vec<f32>,
}

impl DynNode for Wave {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        self.numbers.clear();
        cx.raw_input(0, |buffer, span| (self.item.numbers)(buffer, span.from, span.to, &mut self.numbers));
        match &mut self.writer {
            Some(writer) => writer.write(&self.numbers).map_err(|e| failed(&e)),
            None => Ok(()),
        }
    }

    fn finish(&mut self, _: &Cx<'_>) -> Result<Summary, Fault> {
        if let Some(writer) = self.writer.take() {
            writer.finish().map_err(|e| failed(&e))?;
        }
        Ok(Summary::new())
    }

    archive_state!(each writer);

    plain_node!();
}

/// An NPY file of `[items, width]` or `[items, width, columns]` 32-bit floats.
struct Numbers {
    file: Box<dyn WriteSeek>,
    item: &'static ItemType,
    width: usize,
    items: u64,
    numbers: Vec<f32>,
}

impl Numbers {
    fn start(file: Box<dyn WriteSeek>, item: &'static ItemType, width: usize) -> io::Result<Self> {
        let mut numbers = Self { file, item, width, items: 0, numbers: Vec::new() };
        numbers.header()?;
        Ok(numbers)
    }

    /// Always 128 bytes long, so that it can be written again once the count is known.
    fn header(&mut self) -> io::Result<()> {
        let columns = self.item.columns.len();
        let shape = match (self.width, columns) {
            (width, 1) => format!("({}, {width})", self.items),
            (width, columns) => format!("({}, {width}, {columns})", self.items),
        };
        let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
        while text.len() < 128 - 11 {
            text.push(' ');
        }
        text.push('\n');
        self.file.write_all(b"\x93NUMPY\x01\x00")?;
        self.file.write_all(&u16::try_from(text.len()).unwrap_or(118).to_le_bytes())?;
        self.file.write_all(text.as_bytes())
    }
}

impl DynNode for Numbers {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        self.numbers.clear();
        let count = cx.raw_input(0, |buffer, span| {
            (self.item.numbers)(buffer, span.from, span.to, &mut self.numbers);
            (span.to - span.from) as u64
        });
        self.items += count.unwrap_or(0);
        let bytes: Vec<u8> = self.numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.file.write_all(&bytes).map_err(|e| failed(&e))
    }

    fn finish(&mut self, _: &Cx<'_>) -> Result<Summary, Fault> {
        let rewind = self.file.seek(SeekFrom::Start(0)).map(|_| ());
        rewind.and_then(|()| self.header()).and_then(|()| self.file.flush()).map_err(|e| failed(&e))?;
        Ok(Summary::new())
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        self.items.archive_state(archive)?;
        archive_position(&mut *self.file, archive)
    }

    plain_node!();
}

/// Items, one a line: its time in seconds, then its numbers.
struct Rows {
    file: Box<dyn WriteSeek>,
    item: &'static ItemType,
    /// Numbers in a line.
    width: usize,
    rate: Rate,
    numbers: Vec<f32>,
}

impl Rows {
    fn start(
        mut file: Box<dyn WriteSeek>,
        item: &'static ItemType,
        width: usize,
        rate: Rate,
    ) -> io::Result<Self> {
        let name = |k: usize, column: &str| match (column, width) {
            ("", _) => format!("{k}"),
            (_, 1) => column.to_owned(),
            _ => format!("{k}.{column}"),
        };
        let names = (0..width).flat_map(|k| item.columns.iter().map(move |column| name(k, column)));
        writeln!(file, "time,{}", names.collect::<Vec<_>>().join(","))?;
        Ok(Self { file, item, width: width * item.columns.len(), rate, numbers: Vec::new() })
    }

    fn lines(&mut self, first: i64) -> io::Result<()> {
        for (k, numbers) in (first..).zip(self.numbers.chunks_exact(self.width.max(1))) {
            write!(self.file, "{}", seconds(self.rate.tick(k)))?;
            numbers.iter().try_for_each(|x| write!(self.file, ",{x}"))?;
            writeln!(self.file)?;
        }
        Ok(())
    }
}

impl DynNode for Rows {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        self.numbers.clear();
        let first = cx.raw_input(0, |buffer, span| {
            (self.item.numbers)(buffer, span.from, span.to, &mut self.numbers);
            span.from
        });
        self.lines(first.unwrap_or(0)).map_err(|e| failed(&e))
    }

    fn finish(&mut self, _: &Cx<'_>) -> Result<Summary, Fault> {
        self.file.flush().map_err(|e| failed(&e))?;
        Ok(Summary::new())
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        archive_position(&mut *self.file, archive)
    }

    plain_node!();
}

/// Events, one a line.
struct Lines {
    event: &'static EventType,
    file: Box<dyn WriteSeek>,
    csv: bool,
    columns: Option<Vec<String>>,
}

impl Lines {
    fn line(&mut self, time: f64, event: &serde_json::Value) -> io::Result<()> {
        let fields = match event {
            serde_json::Value::Object(fields) => fields.clone(),
            other => serde_json::Map::from_iter([("value".to_owned(), other.clone())]),
        };
        if !self.csv {
            let mut all = serde_json::Map::from_iter([("time".to_owned(), time.into())]);
            all.extend(fields);
            return writeln!(self.file, "{}", serde_json::Value::Object(all));
        }
        if self.columns.is_none() {
            let columns: Vec<String> = fields.keys().cloned().collect();
            writeln!(self.file, "time,{}", columns.join(","))?;
            self.columns = Some(columns);
        }
        let cell = |name: &String| match fields.get(name) {
            Some(serde_json::Value::String(text)) => format!("\"{}\"", text.replace('"', "\"\"")),
            Some(value @ (serde_json::Value::Array(_) | serde_json::Value::Object(_))) => {
                format!("\"{}\"", value.to_string().replace('"', "\"\""))
            }
            Some(value) => value.to_string(),
            None => String::new(),
        };
        let cells: Vec<String> = self.columns.iter().flatten().map(cell).collect();
        writeln!(self.file, "{time},{}", cells.join(","))
    }
}

impl DynNode for Lines {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        let events =
            cx.raw_input(0, |buffer, span| (self.event.json)(buffer, span.from, span.to)).unwrap_or_default();
        for (tick, event) in events {
            self.line(seconds(tick), &event).map_err(|e| failed(&e))?;
        }
        Ok(())
    }

    fn finish(&mut self, _: &Cx<'_>) -> Result<Summary, Fault> {
        self.file.flush().map_err(|e| failed(&e))?;
        Ok(Summary::new())
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        self.columns.archive_state(archive)?;
        archive_position(&mut *self.file, archive)
    }

    plain_node!();
}
