//! The node `CurveFile`.

use super::curve_table::{CurveTable, read_curve_table};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::params::{AssetPath, Text};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, seconds, ticks};
use crate::{params, ports};

params! {
    /// Reads numbers over time from CSV or JSON lines, such as a channel of an animation.
    ///
    /// CSV has a header with `time_s` or `time`, and a column for each number. JSON lines are objects such as `{"time": 0.5, "height": 1.2}`.
    /// Between rows the numbers are on straight lines. Empty fields, `nan` and `null` are gaps; those longer than 0.1 s are NaN in the stream.
    pub struct CurveFileParams {
        /// The file.
        path: AssetPath;
        /// The column to read; empty for all, each as a channel.
        column: Text = "".into();
        /// Items per second.
        rate: Rate = Rate::hz(60);
    }
}
ports! {
    pub struct CurveFilePorts / CurveFileIo {
        in {}
        out {
            /// The numbers.
            curve: Stream<f32>,
        }
    }
}

/// Maximum number of columns.
const MAX_COLUMNS: usize = 64;

/// The node over [`read_curve_table`].
#[derive(Debug)]
pub struct CurveFile {
    table: CurveTable,
}

fn read(p: &CurveFileParams, bytes: &[u8]) -> Result<CurveTable, Reject> {
    let wrong = |message: String| Reject::new("F157", format!("{:?}, {message}", p.path.0)).at("path");
    let table = read_curve_table(bytes, &p.column.0).map_err(|e| wrong(e.to_string()))?;
    let columns = table.names.len();
    if columns > MAX_COLUMNS {
        return Err(wrong(format!("it has {columns} columns of numbers; at most {MAX_COLUMNS} are read"))
            .help("name one in `column`"));
    }
    Ok(table)
}

impl Node for CurveFile {
    type Params = CurveFileParams;
    type Ports = CurveFilePorts;
    const NAME: &'static str = "CurveFile";
    const CLASS: Class = Class::Audio;

    fn shape(p: &CurveFileParams, s: &mut Shape<'_, '_, CurveFilePorts>) -> Result<(), Reject> {
        let table = read(p, &s.bytes("path", &p.path.0)?)?;
        let frames = p.rate.first_at(ticks(table.end()) + 1);
        s.ends(Some(p.rate.tick(frames)));
        s.output(CurveFilePorts::curve, p.rate, Channels(table.names.len() as u16));
        Ok(())
    }

    fn build(p: &CurveFileParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { table: read(p, &cx.bytes("path", &p.path.0)?)? })
    }

    fn run(&mut self, mut io: CurveFileIo<'_>) -> Result<(), Fault> {
        let (first, rate, width) = (io.curve.first(), io.curve.rate(), io.curve.width());
        for (k, item) in (first..).zip(io.curve.items().chunks_exact_mut(width)) {
            let time = seconds(rate.tick(k));
            item.iter_mut().enumerate().for_each(|(c, x)| *x = self.table.at(c, time) as f32);
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (CurveFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let mut text = String::from("time_s,a,b\n");
        let mut time = 0.0;
        for _ in 0..2 + rng.below(20) {
            text += &format!("{time},{},{}\n", rng.between(-1.0, 1.0), rng.between(-1.0, 1.0));
            time += rng.between(0.01, 0.2);
        }
        files.insert("motion.csv", text);
        let column = if rng.below(2) == 0 { "".into() } else { "b".into() };
        (CurveFileParams { path: "motion.csv".into(), column, rate: Rate::hz([25, 60][rng.below(2)]) }, files)
    }
}
