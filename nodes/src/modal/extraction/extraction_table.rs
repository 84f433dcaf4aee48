//! Writes what was found in recordings as tables, as a node.

use super::report::{ExtractionReport, RecordingReport};
use crate::core::fault::{Fault, Reject};
use crate::core::files::{MemoryFiles, WriteSeek};
use crate::core::node::{Class, Node, Summary};
use crate::core::params::OutPath;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};
use std::fmt;
use std::io::Write as _;

params! {
    /// Writes what `ModalFeatures` found as CSV: one row for each recording.
    ///
    /// Columns are the recording, object, support, time of the onset, number of modes and of those with a certain decay, energy that no
    /// mode explains (of the recording, of its surrogate, and from 5 ms after the onset on), `ringing`, what the modes of other takes of the
    /// object leave unexplained, and the warnings.
    pub struct ExtractionTableParams {
        /// The table, such as `knocks.csv`.
        path: OutPath;
        /// CSV of pairs of takes of one object: what each leaves unexplained of the other.
        pairs: Option<OutPath> = None;
    }
}
ports! {
    pub struct ExtractionTablePorts / ExtractionTableIo {
        in {
            /// What was found.
            report: Value<ExtractionReport>,
        }
        out {}
    }
}

/// The node that writes the tables.
pub struct ExtractionTable {
    files: Vec<(&'static str, String, Box<dyn WriteSeek>, Vec<u8>)>,
}

impl fmt::Debug for ExtractionTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let paths: Vec<&str> = self.files.iter().map(|(_, path, ..)| path.as_str()).collect();
        write!(f, "ExtractionTable({paths:?})")
    }
}

const COLUMNS: [&str; 12] = [
    "recording",
    "object",
    "support",
    "onset_s",
    "modes",
    "certain",
    "unexplained_db",
    "surrogate_db",
    "unexplained_after_5_ms_db",
    "ringing",
    "by_other_takes_db",
    "warnings",
];

fn row(r: &RecordingReport) -> [String; 12] {
    let db = |x: f64| format!("{x:.2}");
    let optional = |x: Option<f64>| x.map_or(String::new(), db);
    [
        r.recording.clone(),
        r.take.object.clone(),
        r.take.support.clone(),
        format!("{:.4}", r.onset_s),
        r.modes.to_string(),
        r.certain.to_string(),
        db(r.unexplained_db),
        optional(r.surrogate_db),
        db(r.unexplained_after_5_ms_db),
        r.ringing.map_or(String::new(), |ringing| ringing.to_string()),
        optional(r.by_other_takes_db),
        r.warnings.join("; "),
    ]
}

fn table(report: &ExtractionReport) -> Result<Vec<u8>, csv::Error> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(COLUMNS)?;
    report.recordings.iter().try_for_each(|r| csv.write_record(row(r)))?;
    csv.into_inner().map_err(|e| e.into_error().into())
}

fn pairs_table(report: &ExtractionReport) -> Result<Vec<u8>, csv::Error> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(["first", "second", "first_by_second_db", "second_by_first_db", "mean_db"])?;
    let name = |k: usize| report.recordings.get(k).map_or("", |r| r.recording.as_str());
    for pair in &report.pairs {
        let [a, b] = pair.takes.map(name);
        let [x, y, mean] = [pair.first_db, pair.second_db, pair.mean_db()].map(|x| format!("{x:.2}"));
        csv.write_record([a, b, &x, &y, &mean])?;
    }
    csv.into_inner().map_err(|e| e.into_error().into())
}

impl Node for ExtractionTable {
    type Params = ExtractionTableParams;
    type Ports = ExtractionTablePorts;
    const NAME: &'static str = "ExtractionTable";
    const CLASS: Class = Class::Offline;

    fn shape(_: &ExtractionTableParams, s: &mut Shape<'_, '_, ExtractionTablePorts>) -> Result<(), Reject> {
        s.ends(Some(0));
        Ok(())
    }

    fn build(p: &ExtractionTableParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let report = cx.value(ExtractionTablePorts::report);
        let failed = |e: csv::Error| Fault::new("F080", format!("cannot write the table: {e}")).at("path");
        let mut files =
            vec![("path", p.path.0.clone(), cx.create("path", &p.path.0)?, table(&report).map_err(failed)?)];
        if let Some(path) = &p.pairs {
            let text = pairs_table(&report).map_err(failed)?;
            files.push(("pairs", path.0.clone(), cx.create("pairs", &path.0)?, text));
        }
        Ok(Self { files })
    }

    fn run(&mut self, _: ExtractionTableIo<'_>) -> Result<(), Fault> {
        Ok(())
    }

    fn finish(&mut self, _: ExtractionTableIo<'_>) -> Result<Summary, Fault> {
        let mut summary = Summary::new();
        for (field, path, file, text) in &mut self.files {
            let written = file.write_all(text).and_then(|()| file.flush());
            written.map_err(|e| Fault::new("F080", format!("cannot write {path:?}: {e}")).at(*field))?;
            summary.push((*field, path.as_str().into()));
        }
        Ok(summary)
    }

    fn trial(_: &mut Rng) -> (ExtractionTableParams, MemoryFiles) {
        // Both files of a trial would have one name.
        let params = ExtractionTableParams { path: OutPath("trial.out".into()), pairs: None };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::{Take, TakePair};

    #[test]
    fn tables_have_a_row_for_each_recording_and_each_pair() {
        let of = |name: &str, support: &str| RecordingReport {
            recording: name.into(),
            take: Take { object: "plate".into(), support: support.into(), ..Take::default() },
            unexplained_db: -12.345,
            warnings: vec!["clipped, twice".into(), "too \"soft\"".into()],
            ..RecordingReport::default()
        };
        let report = ExtractionReport {
            recordings: vec![of("a.wav", "fingers, two"), of("b.wav", "foam")],
            pairs: vec![TakePair { takes: [0, 1], first_db: -12.0, second_db: -16.0 }],
            ..ExtractionReport::default()
        };
        let text = String::from_utf8(table(&report).unwrap()).unwrap();
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows.len(), 3);
        assert!(rows[1].starts_with("a.wav,plate,\"fingers, two\",0.0000,0,0,-12.35,,0.00,,"), "{text}");
        assert!(rows[1].ends_with("\"clipped, twice; too \"\"soft\"\"\""), "{text}");
        let pairs = String::from_utf8(pairs_table(&report).unwrap()).unwrap();
        assert!(pairs.ends_with("\na.wav,b.wav,-12.00,-16.00,-14.00\n"), "{pairs}");
    }
}
