//! The likeness of several sounds in one table, as a value node.

use super::report::Likeness;
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Text;
use crate::core::ports::{Many, Value};
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::plot::{Chart, Line};
use crate::table::{Cell, ResultTable};
use crate::unit::SelectionReport;
use crate::{params, ports};

params! {
    /// Tabulates the likeness of sounds and their recordings, one row each.
    ///
    /// A row has the share of units without a near enough match (fallbacks), the mean length of runs in units, the share of repeats,
    /// the mean line of the envelope, the level at joins above the recordings' 95th percentile, and the shares of statistics
    /// (level spread and kurtosis; all) within the range of the recordings. Thirds of an octave and modulation have the root mean square difference
    /// from all recordings together. `missed` names the quantities that miss their aims: repeats at most
    /// 1 %, lines at most 1.5 dB, joins at most 1 dB, level spread and kurtosis within the range.
    pub struct LikenessTableParams {
        /// Name of each sound, in the order of `reports`; those without one are numbered.
        names: Vec<Text> = Vec::new();
    }
}
ports! {
    pub struct LikenessTablePorts / LikenessTableIo {
        in {
            /// Likeness of each sound.
            reports: Many<Value<Likeness>>,
            /// Selection of the units of each sound, in the order of `reports`.
            selections: Many<Value<SelectionReport>>,
        }
        out {
            /// One row per sound.
            table: Value<ResultTable>,
        }
    }
}

/// Greatest share of repeats, mean line in dB and excess of joins in dB that are not missed aims.
const AIMS: [f64; 3] = [0.01, 1.5, 1.0];

/// The node over [`likeness_table`].
#[derive(Debug)]
pub struct LikenessTable;

/// Share of statistics of some quantities within the range of the recordings.
fn within(likeness: &Likeness, quantities: &[&str]) -> Option<f64> {
    let of = |s: &&super::Statistic| quantities.contains(&s.quantity.as_str());
    let known: Vec<bool> = likeness.statistics.iter().filter(of).filter_map(|s| s.within).collect();
    (!known.is_empty()).then(|| known.iter().filter(|w| **w).count() as f64 / known.len() as f64)
}

/// Root mean square difference between sound and recordings over the bands of a quantity.
fn difference(likeness: &Likeness, quantity: &str) -> Option<f64> {
    let of = |s: &&super::Statistic| s.quantity == quantity;
    let squares =
        likeness.statistics.iter().filter(of).filter_map(|s| Some((s.sound? - s.recordings?).powi(2)));
    let squares: Vec<f64> = squares.collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Share of fallbacks and mean length of runs in units, over all channels.
fn selected(report: &SelectionReport) -> [Option<f64>; 2] {
    let picks = |c: &crate::unit::ChannelReport| c.picks.iter().filter(|pick| !pick.asleep).count() as f64;
    let total: f64 = report.channels.iter().map(picks).sum();
    let fallbacks: f64 = report.channels.iter().map(|c| c.fallback_share * picks(c)).sum();
    let runs: f64 = report.channels.iter().flat_map(|c| c.runs.values()).map(|n| f64::from(*n)).sum();
    [(total > 0.0).then(|| fallbacks / total), (runs > 0.0).then(|| total / runs)]
}

/// One row per sound: its name, its likeness, and the selection of its units.
#[must_use]
pub fn likeness_table<'a>(
    rows: impl Iterator<Item = (&'a str, &'a Likeness, Option<&'a SelectionReport>)>,
) -> ResultTable {
    let mut table = ResultTable::new(&[
        "sound",
        "seconds",
        "fallback_share",
        "run_units",
        "repeats",
        "lines_db",
        "joins_excess_db",
        "level_and_kurtosis_within",
        "all_within",
        "third_octaves_rms_db",
        "modulation_rms_db",
        "missed",
    ]);
    for (name, likeness, selection) in rows {
        let [fallbacks, run] = selection.map_or([None; 2], selected);
        let lines = likeness.lines.as_ref().and_then(|lines| lines.mean_db);
        let figures = [likeness.repeats.share, lines, likeness.join_excess()];
        let shape = within(likeness, &["level spread", "kurtosis"]);
        let over = |k: usize| figures[k].is_some_and(|x| x > AIMS[k]);
        let mut missed: Vec<&str> =
            (0..3).filter(|k| over(*k)).map(|k| ["repeats", "lines", "joins"][k]).collect();
        if shape.is_some_and(|share| share < 1.0) {
            missed.push("level spread or kurtosis");
        }
        let mut row: Vec<Cell> =
            vec![name.into(), likeness.sound.seconds.into(), fallbacks.into(), run.into()];
        row.extend(figures.map(Cell::from));
        row.extend([shape.into(), likeness.within_share.into()]);
        row.extend(["third octave", "modulation"].map(|quantity| difference(likeness, quantity).into()));
        row.push(missed.join(", ").into());
        table.push(row);
    }
    table.charts = [
        ("Difference from the recordings", ["third_octaves_rms_db", "modulation_rms_db"]),
        ("Lines and joins", ["lines_db", "joins_excess_db"]),
    ]
    .map(|(title, names)| {
        Chart::of(title, ("row", false), ("dB", false), names.map(|n| dots(&table, n)).into())
    })
    .into();
    table
}

/// A column of a table against the number of the row.
fn dots(table: &ResultTable, name: &str) -> Line {
    let column = table.columns.iter().position(|column| column == name);
    let at = |(k, row): (usize, &Vec<Cell>)| match row.get(column?)? {
        Cell::Number(x) => Some([(k + 1) as f64, *x]),
        _ => None,
    };
    Line::dots(name, table.rows.iter().enumerate().filter_map(at).collect())
}

impl Func for LikenessTable {
    type Params = LikenessTableParams;
    type Ports = LikenessTablePorts;
    const NAME: &'static str = "LikenessTable";

    fn eval(p: &LikenessTableParams, _: &Build<'_>, mut io: LikenessTableIo<'_>) -> Result<Summary, Fault> {
        let reports: Vec<&Likeness> = io.reports.iter().collect();
        let selections: Vec<&SelectionReport> = io.selections.iter().collect();
        if p.names.len() > reports.len() {
            let message = format!("{} names for {} reports", p.names.len(), reports.len());
            return Err(Fault::new("F051", message).at("names").help("link a report for each"));
        }
        let numbered: Vec<String> = (1..=reports.len()).map(|k| format!("sound {k}")).collect();
        let rows = reports.iter().zip(&numbered).enumerate();
        let table = likeness_table(rows.map(|(k, (likeness, number))| {
            let name = p.names.get(k).map_or(number.as_str(), |name| name.0.as_str());
            (name, *likeness, selections.get(k).copied())
        }));
        let summary = vec![("sounds", reports.len().into())];
        io.table.set(table);
        Ok(summary)
    }

    fn trial(_: &mut Rng) -> (LikenessTableParams, MemoryFiles) {
        (LikenessTableParams { names: Vec::new() }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;

    #[test]
    fn a_row_has_the_figures_and_names_the_missed_aims() {
        let mut likeness = Likeness::trial(&mut Rng::new(1));
        likeness.repeats.share = Some(0.02);
        likeness.lines = None;
        let good = Likeness { repeats: super::super::RepeatReport::default(), ..likeness.clone() };
        let table = likeness_table([("bad", &likeness, None), ("good", &good, None)].into_iter());
        let csv = table.csv();
        let rows: Vec<&str> = csv.lines().collect();
        assert_eq!(rows.len(), 3);
        assert!(rows[1].starts_with("bad,") && rows[1].contains("repeats"), "{csv}");
        assert!(rows[2].starts_with("good,") && !rows[2].contains("repeats"), "{csv}");
        assert!(table.plot().unwrap().contains("third_octaves_rms_db"));
    }

    #[test]
    fn a_difference_is_the_root_mean_square_over_the_bands_that_both_have() {
        let of = |sound, recordings| super::super::Statistic {
            quantity: "third octave".into(),
            sound,
            recordings,
            ..Default::default()
        };
        let statistics = vec![of(Some(1.0), Some(4.0)), of(Some(2.0), Some(-2.0)), of(Some(9.0), None)];
        let likeness = Likeness { statistics, ..Likeness::default() };
        assert_eq!(difference(&likeness, "third octave"), Some(12.5_f64.sqrt()));
        assert_eq!(difference(&likeness, "modulation"), None);
    }
}
