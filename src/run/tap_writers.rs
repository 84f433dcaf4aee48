//! Writes taps to files: streams and events by nodes that run along, values when the run has ended.

use super::chart_writer::ChartWriter;
use super::columns::Columns;
use super::stream_chart::StreamChart;
use super::{Job, TapTarget, Values};
use crate::diag::Diagnostic;
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

/// Makes the writer of a tapped stream or of tapped events.
///
/// # Errors
/// When the file cannot be written.
pub fn writer(job: &Job<'_>, k: usize) -> Result<Box<dyn DynNode>, Diagnostic> {
    let tap = &job.taps[k];
    let kind = job.graph.nodes[tap.node].ty.outputs[tap.port].kind;
    let general = |code, message: String| Diagnostic::general(code, message);
    let shape = job.plan.shapes[tap.node].outputs[tap.port].as_ref();
    let path = match &tap.target {
        TapTarget::File(path) => path,
        TapTarget::Memory(tap) | TapTarget::Observer(tap) => return Ok(tap.start(kind, shape)),
    };
    let file = job.outputs.create_at(path).map_err(|e| general(e.code, e.message))?;
    let csv = path.extension().is_some_and(|e| e == "csv");
    match (kind, shape) {
        (PortKind::Stream(item), Some(stream))
            if item.wave && path.extension().is_some_and(|e| e == "wav") =>
        {
            let rate = u32::try_from(stream.rate.num() / stream.rate.den()).unwrap_or(u32::MAX);
            let spec = WriteSpec::new(rate, stream.width, WriteFormat::Float32);
            let writer = AudioWriter::new(file, spec).map_err(|e| general("F080", e.to_string()))?;
            Ok(Box::new(WavWriter { item, writer: Some(writer), numbers: Vec::new() }))
        }
        (PortKind::Stream(item), Some(stream)) if path.extension().is_some_and(|e| e == "svg") => {
            let node = &job.graph.nodes[tap.node];
            let title = format!("{}.{}", node.id, node.ty.outputs[tap.port].name);
            let chart = StreamChart::new(title, stream.rate, Columns::each(item, stream.width));
            Ok(Box::new(ChartWriter::new(file, item, chart)))
        }
        (PortKind::Stream(item), Some(stream)) if csv => {
            let writer = CsvWriter::start(file, item, stream.width, stream.rate);
            Ok(Box::new(writer.map_err(|e| general("F080", e.to_string()))?))
        }
        (PortKind::Stream(item), Some(stream)) => {
            let file =
                NpyWriter::start(file, item, stream.width).map_err(|e| general("F080", e.to_string()))?;
            Ok(Box::new(file))
        }
        (PortKind::Events(event), _) => Ok(Box::new(EventWriter { event, file, csv, columns: None })),
        _ => Err(general("F099", "a value was planned as a stream: a defect in foley".into())),
    }
}

/// Writes the tapped values when the run has ended.
///
/// # Errors
/// If a file cannot be written, or a type has no such file format.
pub fn write_values(job: &Job<'_>, values: &Values) -> Result<(), Vec<Diagnostic>> {
    let mut errors = Vec::new();
    for tap in job.taps {
        let Some(value) = values.get(&(tap.node, tap.port)) else { continue };
        let path = match &tap.target {
            TapTarget::File(path) => path,
            TapTarget::Memory(tap) | TapTarget::Observer(tap) => {
                tap.set(value);
                continue;
            }
        };
        let kind = value.kind();
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let bytes = match ending {
            "svg" => (kind.plot)(value).map(String::into_bytes).ok_or("drawing").map(Some),
            "bin" => (kind.file)(value).ok_or("file format of its own").map(Some),
            _ => Ok(None),
        };
        let bytes = bytes.map_err(|what| format!("a {} has no {what}; write it as .json", kind.name));
        let written = bytes.and_then(|bytes| {
            let mut file = BufWriter::new(job.outputs.create_at(path).map_err(|e| e.message)?);
            let done = match bytes {
                Some(bytes) => file.write_all(&bytes),
                None => (kind.json)(value, &mut file),
            };
            done.and_then(|()| file.flush()).map_err(|e| e.to_string())
        });
        if let Err(message) = written {
            errors.push(Diagnostic::general("F080", format!("--tap {}: {message}", path.display())));
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

fn failed(e: &dyn std::fmt::Display) -> Fault {
    Fault::new("F080", format!("cannot write a tap: {e}"))
}

/// The method that all writers of taps share.
macro_rules! as_any {
    () => {
        fn as_any_mut(&mut self) -> &mut dyn Any {
            self
        }
    };
}

/// Writes audio as 32-bit float WAV.
struct WavWriter {
    item: &'static ItemType,
    writer: Option<AudioWriter<Box<dyn WriteSeek>>>,
    numbers: Vec<f32>,
}

impl DynNode for WavWriter {
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

    as_any!();
}

/// Writes an NPY file of `[items, width]` or `[items, width, columns]` 32-bit floats.
struct NpyWriter {
    file: Box<dyn WriteSeek>,
    item: &'static ItemType,
    width: usize,
    items: u64,
    numbers: Vec<f32>,
}

impl NpyWriter {
    fn start(file: Box<dyn WriteSeek>, item: &'static ItemType, width: usize) -> io::Result<Self> {
        let mut numbers = Self { file, item, width, items: 0, numbers: Vec::new() };
        numbers.header()?;
        Ok(numbers)
    }

    /// Writes the header, always 128 bytes: it is written again when the count is known.
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

impl DynNode for NpyWriter {
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

    as_any!();
}

/// Writes items as CSV, one per line: its time in seconds, then its numbers.
struct CsvWriter {
    file: Box<dyn WriteSeek>,
    item: &'static ItemType,
    /// NpyWriter in a line.
    width: usize,
    rate: Rate,
    numbers: Vec<f32>,
}

impl CsvWriter {
    fn start(
        mut file: Box<dyn WriteSeek>,
        item: &'static ItemType,
        width: usize,
        rate: Rate,
    ) -> io::Result<Self> {
        writeln!(file, "time,{}", Columns::each(item, width).names().join(","))?;
        Ok(Self { file, item, width: width * item.columns.len(), rate, numbers: Vec::new() })
    }

    fn write_items(&mut self, first: i64) -> io::Result<()> {
        for (k, numbers) in (first..).zip(self.numbers.chunks_exact(self.width.max(1))) {
            write!(self.file, "{}", seconds(self.rate.tick(k)))?;
            numbers.iter().try_for_each(|x| write!(self.file, ",{x}"))?;
            writeln!(self.file)?;
        }
        Ok(())
    }
}

impl DynNode for CsvWriter {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        self.numbers.clear();
        let first = cx.raw_input(0, |buffer, span| {
            (self.item.numbers)(buffer, span.from, span.to, &mut self.numbers);
            span.from
        });
        self.write_items(first.unwrap_or(0)).map_err(|e| failed(&e))
    }

    fn finish(&mut self, _: &Cx<'_>) -> Result<Summary, Fault> {
        self.file.flush().map_err(|e| failed(&e))?;
        Ok(Summary::new())
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        archive_position(&mut *self.file, archive)
    }

    as_any!();
}

/// Writes events as CSV or JSON lines, one per line.
struct EventWriter {
    event: &'static EventType,
    file: Box<dyn WriteSeek>,
    csv: bool,
    columns: Option<Vec<String>>,
}

impl EventWriter {
    fn write_event(&mut self, time: f64, event: &serde_json::Value) -> io::Result<()> {
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

impl DynNode for EventWriter {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        let events =
            cx.raw_input(0, |buffer, span| (self.event.json)(buffer, span.from, span.to)).unwrap_or_default();
        for (tick, event) in events {
            self.write_event(seconds(tick), &event).map_err(|e| failed(&e))?;
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

    as_any!();
}
