//! Writes a stream as a line chart.

use super::stream_chart::StreamChart;
use foley_nodes::archive_state;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::files::WriteSeek;
use foley_nodes::core::item::ItemType;
use foley_nodes::core::node::{DynNode, Summary};
use foley_nodes::core::stage::Cx;
use std::any::Any;
use std::io::{self, Write};

/// Draws a stream, and writes the drawing at its end.
pub(super) struct ChartWriter {
    file: Box<dyn WriteSeek>,
    item: &'static ItemType,
    chart: StreamChart,
    numbers: Vec<f32>,
}

impl ChartWriter {
    pub(super) fn new(file: Box<dyn WriteSeek>, item: &'static ItemType, chart: StreamChart) -> Self {
        Self { file, item, chart, numbers: Vec::new() }
    }
}

impl DynNode for ChartWriter {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        self.numbers.clear();
        let first = cx.raw_input(0, |buffer, span| {
            (self.item.numbers)(buffer, span.from, span.to, &mut self.numbers);
            span.from
        });
        self.chart.push(first.unwrap_or(0), &self.numbers);
        Ok(())
    }

    fn finish(&mut self, _: &Cx<'_>) -> Result<Summary, Fault> {
        let written: io::Result<()> =
            self.file.write_all(self.chart.draw().as_bytes()).and_then(|()| self.file.flush());
        written.map_err(|e| Fault::new("F080", format!("cannot write a tap: {e}")))?;
        Ok(Summary::new())
    }

    archive_state!(chart);

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}
