//! The node `VariationReport`.

use super::variation::{FrameCloud, RenderedImpact, rendered_impacts, successive_correlations};
use super::{reduced, retained_grains};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::correlation::CorrelationPatterns;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::{GrainRecordings, SourceKind, matching_tags};
use crate::grain::synthesis::{RepertoireRules, check_patterns};
use crate::plot::{Chart, Line};
use crate::table::ResultTable;
use crate::{params, ports};

params! {
    /// Compares the impacts that a `GrainRetarget` plays for one energy with each other and with the recordings.
    ///
    /// `table` has a row for all grains and for each share of their bytes, as chosen by `GrainSubset`: the bytes of grains and patterns, those
    /// that the different impacts would have as 16-bit samples, the magnitude of the greatest normalised cross-correlation of successive impacts
    /// at any shift of up to 10 ms, and the range of their K-weighted loudness. A distance is the mean Mahalanobis distance of the mel cepstra of the frames of an
    /// impact, 12 coefficients without loudness, from those of all recordings of the tags. Its limit is the greatest distance of a recording
    /// from the others.
    ///
    /// `impacts` has a row for each impact of all grains. Tapped as SVG, `table` draws correlations and distances.
    ///
    /// # Randomness
    /// The impacts, as those of `GrainRetarget`.
    ///
    /// # Complexity
    /// Two transforms for each impact, and one for each 10 ms of it.
    pub struct VariationReportParams {
        /// Tags of the recordings.
        impact: Text = "".into();
        /// Number of impacts.
        events: usize = 100, unit "", range 2..=10_000;
        /// Variations of each recorded impact.
        variations: usize = 64, unit "", range 1..=1024;
        /// Share of the recorded differences of level between impacts that remains.
        spread: f64 = 0.0, unit "", range 0.0..=1.0;
        /// Shares of the bytes of the grains.
        shares: Vec<f64> = vec![0.5, 0.25], unit "", range 0.0..=1.0;
        /// Sound stored beyond the ends of grains without neighbours, for joins.
        margin: f64 = 0.005, unit "s", range 0.0..=0.1;
    }
}
ports! {
    pub struct VariationReportPorts / VariationReportIo {
        in {
            /// The recordings.
            recordings: Value<GrainRecordings>,
            /// Their grains.
            dictionary: Value<GrainDictionary>,
            /// Their patterns.
            patterns: Value<CorrelationPatterns>,
        }
        out {
            /// Figures for all grains and for shares of them.
            table: Value<ResultTable>,
            /// Figures of each impact of all grains.
            impacts: Value<ResultTable>,
        }
    }
}

/// The node `VariationReport`.
#[derive(Debug)]
pub struct VariationReport;

/// Figures of the impacts of one dictionary.
struct Figures {
    /// Correlation of each with the one before, without the first one.
    correlations: Vec<f64>,
    /// Distance of each from the recordings.
    distances: Vec<f64>,
}

impl Figures {
    fn of(all: &[RenderedImpact], rate: f64, cloud: &FrameCloud) -> Self {
        Self {
            correlations: successive_correlations(all.iter().map(|impact| impact.samples.as_slice()), rate),
            distances: all.iter().map(|impact| cloud.distance(&impact.samples, rate)).collect(),
        }
    }
}

/// Least and greatest of some numbers.
fn extremes(x: impl Iterator<Item = f64>) -> [f64; 2] {
    x.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

impl Func for VariationReport {
    type Params = VariationReportParams;
    type Ports = VariationReportPorts;
    const NAME: &'static str = "VariationReport";
    const VERSION: u32 = 2;

    fn eval(
        p: &VariationReportParams,
        cx: &Build<'_>,
        mut io: VariationReportIo<'_>,
    ) -> Result<Summary, Fault> {
        let (recordings, dictionary, patterns) = (io.recordings, io.dictionary, io.patterns);
        check_patterns(patterns, dictionary)?;
        let impulsive: Vec<_> =
            recordings.recordings.iter().filter(|r| r.kind == SourceKind::Impulsive).collect();
        let (found, _) = matching_tags(&p.impact.0, impulsive.iter().map(|r| r.tags.as_slice()));
        if found.is_empty() {
            let message = format!("no recording of an impact has a tag of {:?}", p.impact.0);
            return Err(Fault::new("F151", message)
                .at("impact")
                .help("leave `impact` empty for all of them"));
        }
        let rate = dictionary.rate;
        let sounds: Vec<Vec<f32>> = found.iter().map(|k| impulsive[*k].mono()).collect();
        let cloud = FrameCloud::new(&sounds, rate);
        let limit = cloud.limit();
        let rules = RepertoireRules { variations: p.variations, spread: p.spread };
        let margin = (p.margin * rate).round() as usize;
        let mut table = ResultTable::new(&[
            "share",
            "grains",
            "bytes",
            "impacts",
            "bytes_of_impacts",
            "mean_correlation",
            "largest_correlation",
            "loudness_range_db",
            "largest_distance",
            "limit",
            "outside",
        ]);
        let mut impacts = ResultTable::new(&["impact", "seconds", "loudness_db", "correlation", "distance"]);
        let is_chosen =
            |pattern: &crate::grain::Pattern| found.iter().any(|k| impulsive[*k].name == pattern.name);
        let mut summary = Vec::new();
        let total = (1 + p.shares.len()) as f64;
        for (row, share) in std::iter::once(None).chain(p.shares.iter().map(Some)).enumerate() {
            if (cx.monitor)(row as f64 / total) {
                return Err(Fault::stopped());
            }
            let smaller = share.map(|share| {
                let budget = (share * dictionary.bytes() as f64) as usize;
                let retained = retained_grains(dictionary, patterns, &is_chosen, budget, margin);
                reduced(dictionary, patterns, &retained, margin)
            });
            let (dictionary, patterns) =
                smaller.as_ref().map_or((dictionary, patterns), |s| (&s.dictionary, &s.patterns));
            let all = rendered_impacts(dictionary, patterns, &p.impact.0, &rules, p.events, &cx.random);
            let figures = Figures::of(&all, rate, &cloud);
            let bytes = |found: Result<Vec<u8>, String>| found.map_or(0, |bytes| bytes.len());
            let samples: usize = all.iter().map(|impact| impact.samples.len()).sum();
            let outside = figures.distances.iter().filter(|d| **d > limit).count();
            let mean = figures.correlations.iter().sum::<f64>() / figures.correlations.len().max(1) as f64;
            let [_, largest] = extremes(figures.correlations.iter().copied());
            let [_, distance] = extremes(figures.distances.iter().copied());
            let [softest, loudest] = extremes(all.iter().map(|impact| impact.loudness));
            let range = loudest - softest;
            table.push([
                share.copied().unwrap_or(1.0).into(),
                dictionary.len().into(),
                (bytes(dictionary.to_bytes()) + bytes(patterns.to_bytes())).into(),
                all.len().into(),
                (2 * samples).into(),
                mean.into(),
                largest.into(),
                range.into(),
                distance.into(),
                limit.into(),
                outside.into(),
            ]);
            if share.is_none() {
                summary = vec![
                    ("impacts", all.len().into()),
                    ("largest_correlation", largest.into()),
                    ("loudness_range_db", range.into()),
                    ("largest_distance", distance.into()),
                    ("limit", limit.into()),
                    ("outside", outside.into()),
                ];
                for (k, impact) in all.iter().enumerate() {
                    let correlation = k.checked_sub(1).and_then(|k| figures.correlations.get(k));
                    impacts.push([
                        k.into(),
                        (impact.samples.len() as f64 / rate).into(),
                        impact.loudness.into(),
                        correlation.copied().unwrap_or(0.0).into(),
                        figures.distances[k].into(),
                    ]);
                }
                let dots = |x: &[f64]| x.iter().enumerate().map(|(k, y)| [k as f64, *y]).collect::<Vec<_>>();
                let ends = vec![[0.0, limit], [all.len().saturating_sub(1) as f64, limit]];
                let axis = ("impact", false);
                let correlation = vec![Line::dots("impacts", dots(&figures.correlations))];
                let distances =
                    vec![Line::dots("impacts", dots(&figures.distances)), Line::new("recordings", ends)];
                table.charts = vec![
                    Chart::of("successive impacts", axis, ("correlation", false), correlation),
                    Chart::of("distance from the recordings", axis, ("distance", false), distances),
                ];
            }
        }
        io.table.set(table);
        io.impacts.set(impacts);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (VariationReportParams, MemoryFiles) {
        let p = VariationReportParams::trial(rng);
        let params = VariationReportParams {
            impact: "".into(),
            events: 2 + rng.below(6),
            variations: 1 + rng.below(4),
            shares: vec![rng.between(0.3, 1.0)],
            ..p
        };
        (params, MemoryFiles::default())
    }
}
