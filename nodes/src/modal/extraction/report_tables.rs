//! Tables of the results for recordings.

use super::report::{ExtractionReport, RecordingReport};
use crate::table::{Cell, ResultTable};

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

fn row(r: &RecordingReport) -> [Cell; 12] {
    [
        r.recording.as_str().into(),
        r.take.object.as_str().into(),
        r.take.support.as_str().into(),
        r.onset_s.into(),
        r.modes.into(),
        r.certain.into(),
        r.unexplained_db.into(),
        r.surrogate_db.into(),
        r.unexplained_after_5_ms_db.into(),
        r.ringing.map_or(Cell::Empty, |ringing| ringing.to_string().into()),
        r.by_other_takes_db.into(),
        r.warnings.join("; ").into(),
    ]
}

impl ExtractionReport {
    /// A row for each impact.
    #[must_use]
    pub fn table(&self) -> ResultTable {
        let mut table = ResultTable::new(&COLUMNS);
        self.recordings.iter().for_each(|r| table.push(row(r)));
        table
    }

    /// A row for each pair of takes of one object: the energy of each that the modes of the other leave unexplained.
    #[must_use]
    pub fn pairs_table(&self) -> ResultTable {
        let mut table =
            ResultTable::new(&["first", "second", "first_by_second_db", "second_by_first_db", "mean_db"]);
        let name = |k: usize| self.recordings.get(k).map_or("", |r| r.recording.as_str());
        for pair in &self.pairs {
            let [a, b] = pair.takes.map(name);
            table.push([
                a.into(),
                b.into(),
                pair.first_db.into(),
                pair.second_db.into(),
                pair.mean_db().into(),
            ]);
        }
        table
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
        let text = report.table().csv();
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows.len(), 3);
        assert!(rows[1].starts_with("a.wav,plate,\"fingers, two\",0,0,0,-12.3450,,0,,"), "{text}");
        assert!(rows[1].ends_with("\"clipped, twice; too \"\"soft\"\"\""), "{text}");
        let pairs = report.pairs_table().csv();
        assert!(pairs.ends_with("\na.wav,b.wav,-12,-16,-14\n"), "{pairs}");
    }
}
