//! Writes a table of results and its charts, as a node.

use super::result_table::ResultTable;
use crate::core::fault::{Fault, Reject};
use crate::core::files::WriteSeek;
use crate::core::item::Data;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::OutPath;
use crate::core::ports::Value;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};
use std::fmt;
use std::io::Write as _;

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
pub struct TableOut {
    files: Vec<(&'static str, String, Box<dyn WriteSeek>, String)>,
    rows: Vec<String>,
}

impl fmt::Debug for TableOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let paths: Vec<&str> = self.files.iter().map(|(_, path, ..)| path.as_str()).collect();
        write!(f, "TableOut({paths:?})")
    }
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
        let mut files = vec![("path", p.path.0.clone(), cx.create("path", &p.path.0)?, csv)];
        if let Some(path) = &p.figure {
            let Some(svg) = table.plot() else {
                return Err(Reject::new("F083", "this table has no charts").at("figure").into());
            };
            files.push(("figure", path.0.clone(), cx.create("figure", &path.0)?, svg));
        }
        Ok(Self { files, rows })
    }

    fn run(&mut self, _: TableOutIo<'_>) -> Result<(), Fault> {
        Ok(())
    }

    fn finish(&mut self, _: TableOutIo<'_>) -> Result<Summary, Fault> {
        let mut summary = Summary::new();
        for (field, path, file, text) in &mut self.files {
            let written = file.write_all(text.as_bytes()).and_then(|()| file.flush());
            written.map_err(|e| Fault::new("F080", format!("cannot write {path:?}: {e}")).at(*field))?;
            summary.push((*field, path.as_str().into()));
        }
        summary.push(("rows", serde_json::json!(self.rows)));
        Ok(summary)
    }
}
