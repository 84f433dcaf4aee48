//! Figures of a selection: share of fallbacks, lengths of runs, and repeats.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::picks::{Pick, Picks};
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::plot::{Axis, Line, chart};
use crate::unit::UnitDatabase;

/// Window over which fallbacks are counted, seconds.
const WINDOW: f64 = 0.5;
/// Minimum share of fallbacks of a window that is listed.
const POOR_SHARE: f64 = 0.2;

/// One channel of a selection.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelReport {
    /// All picks in order.
    pub picks: Vec<Pick>,
    /// Share of all units for which nothing was chosen, because the target is silent; the figures below exclude them.
    pub asleep_share: f64,
    /// Share of picks without a near enough match.
    pub fallback_share: f64,
    /// Mean distance between target and pick.
    pub mean_d1: f64,
    /// Number of runs of each length; units of a run follow each other in their recording.
    pub runs: BTreeMap<u32, u32>,
    /// Picks of a unit that was chosen before.
    pub repeats: u64,
    /// Different units chosen.
    pub distinct: u64,
    /// Share of the database's units that were chosen.
    pub coverage: f64,
    /// Stretches of time, in seconds, in which more than a fifth of the picks of half a second are fallbacks.
    pub poor: Vec<[f64; 2]>,
}

/// Format of [`SelectionReport`] that this code writes.
pub const REPORT_VERSION: u32 = 2;

/// Report of a selection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SelectionReport {
    /// [`REPORT_VERSION`].
    pub version: u32,
    /// Digest of the conventions of the features and of the units of the database.
    pub content: String,
    /// Units per second.
    pub rate: f64,
    /// Units of the database.
    pub units: u64,
    /// Each channel.
    pub channels: Vec<ChannelReport>,
    /// Numbers in a feature vector, if the features of the target are linked.
    pub dims: usize,
    /// Features of the target's first vector, `[picks, dims]`; may be empty.
    pub target: Vec<f32>,
    /// Features of the first channel's picks, `[picks, dims]`; may be empty.
    pub chosen: Vec<f32>,
}

impl ChannelReport {
    /// Counts the picks of one channel.
    #[must_use]
    pub fn new(picks: Vec<Pick>, db: &UnitDatabase, rate: f64) -> Self {
        let mut chosen = vec![0_u32; db.len()];
        let mut runs = BTreeMap::new();
        let (mut length, mut last) = (0_u32, None);
        for pick in &picks {
            if pick.asleep {
                if length > 0 {
                    *runs.entry(length).or_insert(0) += 1;
                }
                (length, last) = (0, None);
                continue;
            }
            let unit = pick.unit.max(0) as usize;
            if let Some(count) = chosen.get_mut(unit) {
                *count += 1;
            }
            let follows =
                last.is_some_and(|last| last + 1 == unit && db.segment_of(last) == db.segment_of(unit));
            if !follows && length > 0 {
                *runs.entry(length).or_insert(0) += 1;
                length = 0;
            }
            (length, last) = (length + 1, Some(unit));
        }
        if length > 0 {
            *runs.entry(length).or_insert(0) += 1;
        }
        let awake = || picks.iter().filter(|pick| !pick.asleep);
        let count = awake().count().max(1) as f64;
        let distinct = chosen.iter().filter(|&&count| count > 0).count() as u64;
        Self {
            asleep_share: 1.0 - awake().count() as f64 / picks.len().max(1) as f64,
            fallback_share: awake().filter(|pick| pick.fallback).count() as f64 / count,
            mean_d1: awake().map(|pick| f64::from(pick.d1)).sum::<f64>() / count,
            runs,
            repeats: chosen.iter().map(|&count| u64::from(count.saturating_sub(1))).sum(),
            distinct,
            coverage: distinct as f64 / db.len().max(1) as f64,
            poor: poor(&picks, rate),
            picks,
        }
    }
}

/// Times of windows with many fallbacks; overlapping windows are joined.
fn poor(picks: &[Pick], rate: f64) -> Vec<[f64; 2]> {
    let window = ((WINDOW * rate).round() as usize).clamp(1, picks.len().max(1));
    let (mut intervals, mut fallbacks): (Vec<[usize; 2]>, usize) = (Vec::new(), 0);
    for (i, pick) in picks.iter().enumerate() {
        fallbacks += usize::from(pick.fallback);
        if let Some(left) = i.checked_sub(window) {
            fallbacks -= usize::from(picks[left].fallback);
        }
        let from = (i + 1).saturating_sub(window);
        if i + 1 >= window && fallbacks as f64 > POOR_SHARE * window as f64 {
            match intervals.last_mut() {
                Some(last) if last[1] >= from => last[1] = i + 1,
                _ => intervals.push([from, i + 1]),
            }
        }
    }
    intervals.into_iter().map(|ends| ends.map(|k| k as f64 / rate)).collect()
}

/// Digest of the conventions, segments and features of a database.
pub(super) fn database_digest(db: &UnitDatabase) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&db.conventions.hash()).update(format!("{:?}", db.segments).as_bytes());
    db.features.iter().for_each(|x| {
        hasher.update(&x.to_le_bytes());
    });
    hasher.finalize().to_hex()[..16].to_owned()
}

impl Data for SelectionReport {
    const NAME: &'static str = "selection report";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let db = UnitDatabase::trial(rng);
        let format = <Picks as crate::core::item::Item>::trial_format(rng);
        let picks = (0..9).map(|k| <Picks as crate::core::item::Item>::trial(&format, k, rng)).collect();
        let channels = vec![ChannelReport::new(picks, &db, 240.0)];
        Self {
            version: REPORT_VERSION,
            content: database_digest(&db),
            rate: 240.0,
            units: db.len() as u64,
            channels,
            dims: 0,
            target: Vec::new(),
            chosen: Vec::new(),
        }
    }

    /// The features of target and picks against time, as in figure 10 of An, James and Marschner (2012); without the target's
    /// features, the distance between both.
    fn plot(&self) -> Option<String> {
        let count = self.channels.first().map_or(0, |channel| channel.picks.len());
        let seconds = |i: usize| i as f64 / self.rate;
        let line = |label: String, values: &mut dyn Iterator<Item = f64>| {
            Line::new(label, values.enumerate().map(|(i, y)| [seconds(i), y]).collect())
        };
        let dims = self.dims;
        let row = |x: &[f32], dim: usize| -> Vec<f64> {
            x.iter().skip(dim).step_by(dims.max(1)).map(|&x| f64::from(x)).collect()
        };
        let lines: Vec<Line> = if self.target.is_empty() {
            let d1 =
                |channel: &ChannelReport| -> Vec<f64> { channel.picks.iter().map(|p| p.d1.into()).collect() };
            let named = self.channels.iter().enumerate();
            named.map(|(c, channel)| line(format!("D1, channel {c}"), &mut d1(channel).into_iter())).collect()
        } else {
            let pair = |dim| {
                let target = line(format!("target {dim}"), &mut row(&self.target, dim).into_iter());
                [target, line(format!("chosen {dim}"), &mut row(&self.chosen, dim).into_iter())]
            };
            (0..dims.min(6)).flat_map(pair).collect()
        };
        let ys = || lines.iter().flat_map(|line| &line.points).map(|p| p[1]);
        let (low, high) = (ys().fold(f64::INFINITY, f64::min), ys().fold(f64::NEG_INFINITY, f64::max));
        if count < 2 || !(low.is_finite() && high.is_finite()) {
            return None;
        }
        let margin = 0.05 * (high - low).max(1e-3);
        let x = Axis { label: "time, s".into(), range: [0.0, seconds(count - 1)], log: false };
        let label = if self.target.is_empty() { "distance of features" } else { "features" };
        let y = Axis { label: label.into(), range: [low - margin, high + margin], log: false };
        Some(chart("Target and chosen units", &x, &y, &lines))
    }
}

/// The report in a few words.
pub(super) fn report_summary(channels: &[ChannelReport]) -> Summary {
    let mean = |get: &dyn Fn(&ChannelReport) -> f64| {
        channels.iter().map(get).sum::<f64>() / channels.len().max(1) as f64
    };
    let longest = channels.iter().filter_map(|c| c.runs.keys().last()).max().copied().unwrap_or(0);
    let poor: f64 = channels.iter().flat_map(|c| &c.poor).map(|[from, to]| to - from).sum();
    vec![
        ("asleep_share", mean(&|c| c.asleep_share).into()),
        ("fallback_share", mean(&|c| c.fallback_share).into()),
        ("mean_d1", mean(&|c| c.mean_d1).into()),
        ("longest_run", longest.into()),
        ("coverage", mean(&|c| c.coverage).into()),
        ("repeats", channels.iter().map(|c| c.repeats).sum::<u64>().into()),
        ("poor_seconds", poor.into()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_states_its_version_and_its_database() {
        let (report, other) =
            (SelectionReport::trial(&mut Rng::new(1)), SelectionReport::trial(&mut Rng::new(2)));
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!((json["version"].as_u64(), json["content"].as_str()), (Some(2), Some(&*report.content)));
        assert!(report.content.len() == 16 && report.content != other.content);
    }

    #[test]
    fn runs_repeats_and_poor_stretches_are_counted() {
        let mut db = UnitDatabase::trial(&mut Rng::new(1));
        let units = db.len() as u32;
        db.segments = vec![crate::unit::Segment { units, ..Default::default() }];
        let pick = |unit, fallback| Pick { unit, fallback, asleep: false, d1: 0.5, d2: 1.0 };
        let mut picks: Vec<Pick> = [0, 1, 2, 0, 1, 5].map(|unit| pick(unit, false)).to_vec();
        picks.extend(vec![pick(3, true); 6]);
        let report = ChannelReport::new(picks, &db, 8.0);
        assert_eq!(report.runs, BTreeMap::from([(1, 7), (2, 1), (3, 1)]));
        assert_eq!((report.repeats, report.distinct, report.fallback_share), (7, 5, 0.5));
        // Windows of four units: the first with one fallback ends after the seventh pick.
        assert_eq!(report.poor, [[3.0 / 8.0, 12.0 / 8.0]]);
        assert_eq!(report.mean_d1, 0.5);
    }

    #[test]
    fn units_that_are_slept_through_are_no_good_picks() {
        let mut db = UnitDatabase::trial(&mut Rng::new(1));
        let units = db.len() as u32;
        db.segments = vec![crate::unit::Segment { units, ..Default::default() }];
        let pick = |unit, fallback| Pick { unit, fallback, d1: 3.0, ..Pick::default() };
        let asleep = Pick { unit: 1, asleep: true, ..Pick::default() };
        let mut picks = vec![pick(0, false), pick(1, true)];
        picks.extend([asleep; 6]);
        let report = ChannelReport::new([picks, vec![pick(2, false), pick(3, true)]].concat(), &db, 8.0);
        assert_eq!((report.asleep_share, report.fallback_share, report.mean_d1), (0.6, 0.5, 3.0));
        // Picks before and after the sleep form no run, and sleep does not count as a repeat.
        assert_eq!((report.runs, report.repeats, report.distinct), (BTreeMap::from([(2, 2)]), 0, 4));
    }

    #[test]
    fn the_drawing_shows_distances_or_features() {
        let mut report = SelectionReport::trial(&mut Rng::new(2));
        assert_eq!(report.plot().unwrap().matches("<polyline").count(), 1);
        (report.dims, report.target, report.chosen) = (2, vec![0.5; 18], vec![0.0; 18]);
        let svg = report.plot().unwrap();
        assert!(svg.matches("<polyline").count() == 4 && svg.contains("chosen 1") && svg.contains("time, s"));
    }
}
