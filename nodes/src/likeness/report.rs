//! The result of a comparison.

use super::envelope_lines::HarmonicLine;
use super::joins::JoinReport;
use super::repeats::RepeatStretch;
use crate::core::node::Summary;
use crate::plot::{Chart, Image};
use crate::table::{Cell, ResultTable};
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

/// Places that the text lists of each kind.
const LISTED: usize = 5;
/// Statistics outside of their range that the text lists.
const FARTHEST: usize = 10;

/// Length and level of a sound or a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TakeFigures {
    /// Its name.
    pub name: String,
    /// Length, s.
    pub seconds: f64,
    /// Length of its active frames, s.
    pub active_seconds: f64,
    /// Level of its active frames, dB of full scale; nothing for silence.
    pub level_db: Option<f64>,
}

/// Shares of active frames that repeat an earlier part of the sound.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RepeatReport {
    /// Time before each frame that is searched, s.
    pub window_s: f64,
    /// Normalised correlation above which a frame is repeated.
    pub threshold: f64,
    /// Share of repeated frames.
    pub share: Option<f64>,
    /// Share of frames of a tone, which are not counted as repeated.
    pub periodic_share: Option<f64>,
    /// Share of repeated frames of all recordings.
    pub recordings_share: Option<f64>,
    /// Share of frames of a tone of all recordings.
    pub recordings_periodic_share: Option<f64>,
    /// The longest repeated intervals, longest first.
    pub longest: Vec<RepeatStretch>,
}

/// Lines of the envelope at the rate of the units and its multiples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LineReport {
    /// Duration of a unit, s.
    pub unit_s: f64,
    /// Duration of the frames of the sound, s. A line is higher in longer frames.
    pub frame_s: f64,
    /// Duration of the frames of the recordings, s.
    pub recordings_frame_s: f64,
    /// Mean level of all lines above their neighbourhoods, dB.
    pub mean_db: Option<f64>,
    /// The same of all recordings.
    pub recordings_db: Option<f64>,
    /// Each line.
    pub lines: Vec<HarmonicLine>,
}

/// One value of the sound beside its range over the takes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistic {
    /// Name of the quantity.
    pub quantity: String,
    /// Its unit.
    pub unit: String,
    /// Centre of the band of the sound, Hz; nothing for the whole sound.
    pub band_hz: Option<f64>,
    /// Edges of the band of modulation, Hz.
    pub modulation_hz: Option<[f64; 2]>,
    /// Value of the sound.
    pub sound: Option<f64>,
    /// Value of all recordings together.
    pub recordings: Option<f64>,
    /// Least value of a take, or of all recordings together.
    pub low: Option<f64>,
    /// Greatest value of a take, or of all recordings together.
    pub high: Option<f64>,
    /// Distance from the range: negative below, positive above, 0 within.
    pub outside: Option<f64>,
    /// Distance from the range that still counts as within: 0.5 dB, or relatively 0.1 for kurtosis, and twice the standard error of the
    /// values of both as if they were noise.
    pub tolerance: f64,
    /// True within the range and its tolerance.
    pub within: Option<bool>,
}

impl Statistic {
    /// Quantity and bands in one line.
    #[must_use]
    pub fn name(&self) -> String {
        let mut text = self.quantity.clone();
        if let Some([low, high]) = self.modulation_hz {
            let _ = write!(text, " {low} to {high} Hz");
        }
        if let Some(hz) = self.band_hz {
            let _ = match self.modulation_hz {
                Some(_) => write!(text, " of {hz:.0} Hz"),
                None => write!(text, " {hz:.0} Hz"),
            };
        }
        text
    }
}

/// Likeness of a sound and the recordings that it was made of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Likeness {
    /// Length and level of the sound.
    pub sound: TakeFigures,
    /// Likeness of each recording.
    pub recordings: Vec<TakeFigures>,
    /// True if the ranges are of parts of the only recording.
    pub parts: bool,
    /// Nothing above is compared, Hz.
    pub highest_hz: f64,
    /// Repeats.
    pub repeats: RepeatReport,
    /// Lines of the envelope, if the length of units is known.
    pub lines: Option<LineReport>,
    /// Joins, if they are known and the rate is high enough.
    pub joins: Option<JoinReport>,
    /// Spread of level, thirds of an octave, kurtosis and modulation.
    pub statistics: Vec<Statistic>,
    /// Share of the statistics that are within their range.
    pub within_share: Option<f64>,
    /// Measurements that are missing, and why.
    pub notes: Vec<String>,
    /// Curves of the figure.
    pub charts: Vec<Chart>,
    /// Spectrogram of the figure, a PNG in base64.
    pub picture: Image,
}

/// A value or a dash.
fn number(x: Option<f64>, decimals: usize, unit: &str) -> String {
    let gap = if unit.is_empty() { "" } else { " " };
    x.map_or_else(|| "-".into(), |x| format!("{x:.decimals$}{gap}{unit}"))
}

/// A share in percent, or a dash.
fn percent(x: Option<f64>) -> String {
    number(x.map(|x| 100.0 * x), 1, "%")
}

impl Likeness {
    /// Level of the joins above the limit of the recordings, dB.
    #[must_use]
    pub fn join_excess(&self) -> Option<f64> {
        let joins = self.joins.as_ref()?;
        Some(joins.joins_db? - joins.recordings_db?)
    }

    /// Statistics outside of their ranges, farthest first: kurtosis by its ratio, all others by dB.
    #[must_use]
    pub fn farthest(&self) -> Vec<&Statistic> {
        let mut all: Vec<&Statistic> = self.statistics.iter().filter(|s| s.within == Some(false)).collect();
        let distance = |s: &Statistic| match (s.outside, s.sound, s.unit.is_empty()) {
            (Some(by), Some(x), true) => 10.0 * (x / (x - by)).abs().max(1e-9).log10().abs(),
            (by, _, _) => by.unwrap_or(0.0).abs(),
        };
        all.sort_by(|a, b| distance(b).total_cmp(&distance(a)));
        all
    }

    /// All figures in lines of text.
    #[must_use]
    pub fn text(&self) -> String {
        let mut out = String::new();
        // Writing to a string cannot fail.
        let mut line = |name: &str, text: String| {
            let _ = writeln!(out, "{name:<14}{text}");
        };
        let figures = |t: &TakeFigures| {
            let level = t.level_db.map_or("silent".into(), |db| format!("{db:.1} dB"));
            format!("{:.2} s, {:.2} s of it active at {level}", t.seconds, t.active_seconds)
        };
        line("sound", figures(&self.sound));
        for take in &self.recordings {
            line("recording", format!("{}: {}", take.name, figures(take)));
        }
        let r = &self.repeats;
        line(
            "repeats",
            format!(
                "{} of its active frames repeat part of the {} s before (recordings {}); tones {} ({})",
                percent(r.share),
                r.window_s,
                percent(r.recordings_share),
                percent(r.periodic_share),
                percent(r.recordings_periodic_share)
            ),
        );
        for s in r.longest.iter().take(LISTED) {
            let found = format!("{:.3} to {:.3} s, {:.3} s before", s.from, s.to, s.lag);
            line("", format!("{found}, correlation {:.2}", s.correlation));
        }
        if let Some(l) = &self.lines {
            let (mean, recordings) = (number(l.mean_db, 1, "dB"), number(l.recordings_db, 1, "dB"));
            let hz = 1.0 / l.unit_s;
            line("lines", format!("{mean} at {hz:.1} Hz and its multiples (recordings {recordings})"));
            let highest = l.lines.iter().max_by(|a, b| a.db.total_cmp(&b.db));
            if let Some(highest) = highest {
                line("", format!("highest {:.1} dB at {:.1} Hz", highest.db, highest.hz));
            }
        }
        if let Some(j) = &self.joins {
            let excess = number(self.join_excess(), 1, "dB");
            let between = number(j.between_db.zip(j.recordings_db).map(|(a, b)| a - b), 1, "dB");
            let share = percent(j.share_above);
            line(
                "joins",
                format!(
                    "{} joins; their 95th percentile above 8 kHz is {excess} over that of the recordings (between joins {between}); {share} \
                     of them are above it",
                    j.count
                ),
            );
            for place in j.loudest.iter().take(LISTED) {
                line("", format!("{:.3} s, {:.1} dB", place.at, place.excess_db));
            }
        }
        line("statistics", format!("{} are within the range of the recordings", percent(self.within_share)));
        for s in self.farthest().into_iter().take(FARTHEST) {
            let [x, low, high] = [s.sound, s.low, s.high].map(|x| number(x, 1, ""));
            let by = s.outside.unwrap_or(0.0);
            line("", format!("{}: {x} {}, range {low} to {high}, {by:+.1} outside", s.name(), s.unit));
        }
        for note in &self.notes {
            line("note", note.clone());
        }
        out
    }

    /// All values as a table with its charts.
    #[must_use]
    pub fn table(&self) -> ResultTable {
        let columns = [
            "quantity",
            "band_hz",
            "modulation_hz",
            "unit",
            "sound",
            "recordings",
            "low",
            "high",
            "outside",
            "tolerance",
        ];
        let mut table = ResultTable::new(&columns);
        let mut own = |name: &str, unit: &str, sound: Option<f64>, recordings: Option<f64>| {
            let mut row = vec![Cell::Empty; columns.len()];
            (row[0], row[3], row[4], row[5]) = (name.into(), unit.into(), sound.into(), recordings.into());
            table.push(row);
        };
        let r = &self.repeats;
        own("repeated share", "", r.share, r.recordings_share);
        own("periodic share", "", r.periodic_share, r.recordings_periodic_share);
        if let Some(l) = &self.lines {
            own("lines of the envelope", "dB", l.mean_db, l.recordings_db);
        }
        if let Some(j) = &self.joins {
            own("joins above 8 kHz, 95th percentile", "dB", j.joins_db, j.recordings_db);
            own("intervals between joins above 8 kHz, 95th percentile", "dB", j.between_db, j.recordings_db);
        }
        for s in &self.statistics {
            let modulation = s.modulation_hz.map(|[low, high]| format!("{low} to {high}"));
            table.push([
                s.quantity.as_str().into(),
                s.band_hz.into(),
                modulation.map_or(Cell::Empty, Cell::from),
                s.unit.as_str().into(),
                s.sound.into(),
                s.recordings.into(),
                s.low.into(),
                s.high.into(),
                s.outside.into(),
                s.tolerance.into(),
            ]);
        }
        table.charts.clone_from(&self.charts);
        table
    }

    /// The main figures, for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let lines = self.lines.as_ref();
        let mut summary: Summary = vec![
            ("repeated_share", self.repeats.share.into()),
            ("recordings_repeated_share", self.repeats.recordings_share.into()),
            ("lines_db", lines.and_then(|l| l.mean_db).into()),
            ("recordings_lines_db", lines.and_then(|l| l.recordings_db).into()),
            ("joins_excess_db", self.join_excess().into()),
            ("within_share", self.within_share.into()),
        ];
        summary.extend(self.notes.iter().map(|note| ("notice", note.as_str().into())));
        summary
    }
}
