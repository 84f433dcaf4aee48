//! Writes a table of results and its charts, as a node.

use super::result_table::ResultTable;
use crate::core::fault::{Fault, Reject};
use crate::core::item::Data;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::OutPath;
use crate::core::ports::Value;
use crate::core::shape::{Build, Shape};
use crate::io::text_output::TextOutput;
use crate::{params, ports};

/// Maximum number of rows in the summary of a run.
const MAX_ROWS: usize = 100;

params! {
    /// Writes a table of results as CSV, and its charts as SVG. The summary of the run has the rows.
    pub struct TableOutParams {
        /// The CSV: names of columns with units, then rows.
        path: OutPath;
        /// SVG of the charts, for tables that have some.
        figure: Option<OutPath> = None;
    }
}
ports! {
    pub struct TableOutPorts / TableOutIo {
        in {
            /// The table.
            table: Value<ResultTable>,
        }
        out {}
    }
}

/// The node over [`ResultTable::csv`].
#[derive(Debug)]
pub struct TableOut {
    files: Vec<(TextOutput, String)>,
    rows: Vec<String>,
}

impl Node for TableOut {
    type Params = TableOutParams;
    type Ports = TableOutPorts;
    const NAME: &'static str = "TableOut";
    const CLASS: Class = Class::Offline;

    fn shape(_: &TableOutParams, s: &mut Shape<'_, '_, TableOutPorts>) -> Result<(), Reject> {
        s.ends(Some(0));
        Ok(())
    }

    fn build(p: &TableOutParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let table = cx.value(TableOutPorts::table);
        let csv = table.csv();
        let rows = csv.lines().take(MAX_ROWS + 1).map(str::to_owned).collect();
        let mut files = vec![(TextOutput::create(cx, "path", &p.path)?, csv)];
        if let Some(path) = &p.figure {
            let Some(svg) = table.plot() else {
                return Err(Reject::new("F083", "this table has no charts").at("figure").into());
            };
            files.push((TextOutput::create(cx, "figure", path)?, svg));
        }
        Ok(Self { files, rows })
    }

    fn run(&mut self, _: TableOutIo<'_>) -> Result<(), Fault> {
        Ok(())
    }

    fn finish(&mut self, _: TableOutIo<'_>) -> Result<Summary, Fault> {
        let mut summary = Summary::new();
        self.files.iter_mut().try_for_each(|(file, text)| file.write(text, &mut summary))?;
        summary.push(("rows", serde_json::json!(self.rows)));
        Ok(summary)
    }
}
