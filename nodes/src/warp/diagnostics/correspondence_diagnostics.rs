//! Diagnosis of bad correspondences, as a node.

use super::diagnosis::{ChannelDiagnosis, Diagnosis, Verdict};
use super::effect::Baseline;
use super::leave_one_out::LeaveOut;
use crate::core::fault::{Fault, Reject};
use crate::core::files::{MemoryFiles, WriteSeek};
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{OutPath, Params, Text};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::feature::Features;
use crate::io::{AudioWriter, Dither, WriteFormat, WriteSpec};
use crate::unit::selection::{comparable, no_unit, units};
use crate::unit::{Blend, Concatenator, SelectorParams, UnitDatabase};
use crate::warp::correspondence::target_features::{TargetFeatures, checked};
use crate::warp::correspondence::{CorrespondenceSet, Pairing};
use crate::warp::fit::{FitError, Stiffness};
use crate::warp::spline::{Pair, Tps};
use crate::{archive_state, params, ports};
use std::fmt;
use std::ops::Range;

/// Units that are played before and after the worst range, and the most of all.
const MARGIN: usize = 24;
const MAX_SECONDS: f64 = 10.0;

params! {
    /// Leaves every correspondence out in turn and ranks them by the improvement of the others without it.
    ///
    /// The score of a correspondence is how much better the remaining ones predict each other when it is gone: a bad one spoils its
    /// neighbours, so its own prediction error shows less. The largest score is the suspect; listen to its ranges, move
    /// or disable it, and look again. A tap of `diagnosis` as JSON holds, for each channel, the degrees of freedom of
    /// the warp and a record of each correspondence (a note of the run names the first): label, place in the file,
    /// score and rank, those that contradict it, the times of the target for which another unit is chosen without it,
    /// and the changes of the shares of fallbacks and of folds.
    ///
    /// With `with` and `without`, the longest range of the suspect is written as two recordings to compare: as it sounds with all
    /// correspondences, and as it would sound without the suspect.
    ///
    /// # Source
    /// Wahba, "Spline Models for Observational Data" (1990), section 4.2, for predictions of points that are left out.
    pub struct CorrespondenceDiagnosticsParams {
        /// Stiffness as in `TpsFit`; None finds one.
        lambda: Option<f64> = None, unit "", range 0.0..=1e12;
        /// Measure `lambda` in units of the squared mean distance of nodes.
        scale_free: bool = false;
        /// Pairing of the units of both sides.
        pairing: Pairing = Pairing::InOrder;
        /// One warp for each channel, as in `TpsFit`.
        per_channel: bool = false;
        /// Distance of features that counts as alike, as in the selection of units: pairs that start nearer and lead three times
        /// farther apart contradict each other.
        d_max: f64 = 2.0, unit "", range 0.0..=1e6;
        /// Units that the selection compares, as in `UnitSelector`.
        look: usize = 5, unit "units", range 0..=1000_usize;
        /// Targets for which a chosen unit is not chosen again, as in `UnitSelector`.
        cool_off: usize = 20, unit "units", range 0..=1_000_000_usize;
        /// Tags of recordings that are chosen from, as in `UnitSelector`; empty for all.
        tags: Vec<Text> = Vec::new();
        /// File for the longest range of the suspect, with all correspondences.
        with: Option<OutPath> = None;
        /// File for the same range without the suspect.
        without: Option<OutPath> = None;
    }
}
ports! {
    pub struct CorrespondenceDiagnosticsPorts / CorrespondenceDiagnosticsIo {
        in {
            /// Features of the target, filtered as those of the database.
            features: Stream<Features>,
            /// The database.
            database: Value<UnitDatabase>,
            /// The correspondences.
            pairs: Value<CorrespondenceSet>,
        }
        out {
            /// The diagnosis, once the target has ended.
            diagnosis: Fold<Diagnosis>,
        }
    }
}

/// A stretch of one channel as two choices of units play it.
struct Comparison {
    score: f64,
    with: Vec<u32>,
    without: Vec<u32>,
}

/// The node over [`suspicions`](super::leave_one_out::suspicions) and [`Baseline`].
pub struct CorrespondenceDiagnostics {
    target: TargetFeatures,
    params: CorrespondenceDiagnosticsParams,
    with: Option<Box<dyn WriteSeek>>,
    without: Option<Box<dyn WriteSeek>>,
}

impl fmt::Debug for CorrespondenceDiagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CorrespondenceDiagnostics({:?})", self.params)
    }
}

impl CorrespondenceDiagnostics {
    /// The target as it sounds with all correspondences.
    fn baseline(&self, vector: usize, all: &Tps) -> Result<Baseline, Fault> {
        let (target, p) = (&self.target, &self.params);
        let params = SelectorParams {
            look: p.look,
            d_max: p.d_max,
            cool_off: p.cool_off,
            loop_guard: 0,
            causal: target.database.conventions.causal,
            effort: None,
        };
        let units = units(&target.format, &target.database, &p.tags)?;
        let found = Baseline::new(target.vector(vector), all, &units, params).map_err(not_finite)?;
        found.ok_or_else(no_unit)
    }

    fn channel(
        &self,
        vector: usize,
        pairs: &[(usize, Pair)],
    ) -> Result<(ChannelDiagnosis, Option<Comparison>), Fault> {
        let d = self.target.format.dims();
        let wrong = |e: FitError| Fault::new("F111", e.to_string()).at("pairs");
        let stiffness = Stiffness::of(self.params.lambda, self.params.scale_free);
        let out = LeaveOut::as_stiff(pairs, d, stiffness).map_err(wrong)?;
        let (all, freedom) = out.all().map_err(wrong)?;
        let mut found = out.suspicions(self.params.d_max);
        found.sort_by_key(|suspicion| suspicion.rank);
        let rest = found.iter().map(|s| out.without(s.correspondence));
        let rest: Vec<Tps> = rest.collect::<Result<_, _>>().map_err(wrong)?;
        let baseline = self.baseline(vector, &all)?;
        let effects = baseline.effects(&rest).map_err(not_finite)?;
        let interval = effects.first().and_then(|effect| self.interval(&effect.ranges, baseline.len()));
        let comparison = match (interval, rest.first(), found.first()) {
            (Some(interval), Some(rest), Some(suspect)) => Some(Comparison {
                score: suspect.score,
                with: baseline.picks().get(interval.clone()).unwrap_or_default().to_vec(),
                without: baseline.picks_with(rest, interval).map_err(not_finite)?,
            }),
            _ => None,
        };
        let verdicts = found.into_iter().zip(effects).map(|(s, e)| Verdict::new(s, e, &self.target));
        let diagnosis = ChannelDiagnosis {
            lambda: out.lambda(),
            degrees_of_freedom: freedom,
            fallback_share: baseline.fallback_share(),
            fold_share: baseline.fold_share(),
            verdicts: verdicts.collect(),
        };
        Ok((diagnosis, comparison))
    }

    /// Returns the interval of the longest of some ranges that is played.
    fn interval(&self, ranges: &[[usize; 2]], units: usize) -> Option<Range<usize>> {
        let [from, to] = ranges.iter().rev().max_by_key(|[from, to]| to - from)?;
        let from = from.saturating_sub(MARGIN);
        let most = from + (MAX_SECONDS * self.target.rate) as usize;
        Some(from..(to + MARGIN).min(units).min(most))
    }

    /// Writes the sounds of two choices of units.
    fn write(&mut self, comparison: Option<Comparison>) -> Result<(), Fault> {
        let Comparison { with, without, .. } =
            comparison.unwrap_or(Comparison { score: 0.0, with: Vec::new(), without: Vec::new() });
        let db = &self.target.database;
        let sinks = [("with", self.with.take(), with), ("without", self.without.take(), without)];
        for (field, sink, picks) in sinks {
            let Some(sink) = sink else { continue };
            let player = Concatenator::new(db, Blend::EqualPower);
            let channels: Vec<Vec<f32>> = (0..db.channels()).map(|c| player.whole(c, &picks)).collect();
            let frames = channels.first().map_or(0, Vec::len);
            let sample = |k: usize| channels.iter().filter_map(move |c| c.get(k).copied());
            let samples: Vec<f32> = (0..frames).flat_map(sample).collect();
            let rate = db.conventions.rate.as_f64().round() as u32;
            let spec = WriteSpec {
                dither: Dither::None,
                ..WriteSpec::new(rate, db.channels(), WriteFormat::Float32)
            };
            let written = AudioWriter::new(sink, spec).and_then(|mut writer| {
                writer.write(&samples)?;
                writer.finish()
            });
            written.map_err(|e| Fault::new("F080", e.to_string()).at(field))?;
        }
        Ok(())
    }
}

fn not_finite(unit: crate::unit::NotFinite) -> Fault {
    Fault::new("F111", format!("the warp maps unit {} of the target to numbers that are not finite", unit.0))
        .at("pairs")
}

impl Node for CorrespondenceDiagnostics {
    type Params = CorrespondenceDiagnosticsParams;
    type Ports = CorrespondenceDiagnosticsPorts;
    const NAME: &'static str = "CorrespondenceDiagnostics";
    const VERSION: u32 = 7;
    const CLASS: Class = Class::Offline;

    fn shape(
        p: &CorrespondenceDiagnosticsParams,
        s: &mut Shape<'_, '_, CorrespondenceDiagnosticsPorts>,
    ) -> Result<(), Reject> {
        type Port = CorrespondenceDiagnosticsPorts;
        comparable(&s.input(Port::features).format, s.value(Port::database), &p.tags)?;
        checked(&s.input(Port::features), s.value(Port::database), s.value(Port::pairs))?;
        s.when_ended(Port::features, Ends::Stop);
        Ok(())
    }

    fn build(p: &CorrespondenceDiagnosticsParams, cx: &Build<'_>) -> Result<Self, Fault> {
        type Port = CorrespondenceDiagnosticsPorts;
        let target =
            TargetFeatures::new(cx.input(Port::features), cx.value(Port::database), cx.value(Port::pairs))?;
        let create = |field: &str, path: &Option<OutPath>| {
            path.as_ref().map(|path| cx.create(field, &path.0)).transpose()
        };
        let (with, without) = (create("with", &p.with)?, create("without", &p.without)?);
        Ok(Self { target, params: p.clone(), with, without })
    }

    fn run(&mut self, io: CorrespondenceDiagnosticsIo<'_>) -> Result<(), Fault> {
        self.target.add(io.features.items());
        Ok(())
    }

    fn finish(&mut self, mut io: CorrespondenceDiagnosticsIo<'_>) -> Result<Summary, Fault> {
        let all = self.target.pairs(self.params.pairing, self.params.per_channel)?;
        let of = |vector: usize| all.get(vector).or(all.first()).map_or(&[][..], Vec::as_slice);
        let found = (0..self.target.format.vectors).map(|vector| self.channel(vector, of(vector)));
        let (channels, comparisons): (Vec<_>, Vec<_>) =
            found.collect::<Result<Vec<_>, Fault>>()?.into_iter().unzip();
        let suspect = comparisons.into_iter().flatten().max_by(|a, b| a.score.total_cmp(&b.score));
        self.write(suspect)?;
        let diagnosis = Diagnosis { file: self.target.pairs.file.clone(), channels };
        let mut summary = vec![("suspects", serde_json::json!(diagnosis.text()))];
        summary.extend(diagnosis.suspect().map(|text| ("warning", text.into())));
        summary.extend(self.target.mismatch_warnings());
        io.diagnosis.set(diagnosis);
        Ok(summary)
    }

    archive_state!(target);

    fn trial(rng: &mut Rng) -> (CorrespondenceDiagnosticsParams, MemoryFiles) {
        let p = CorrespondenceDiagnosticsParams::trial(rng);
        let params = CorrespondenceDiagnosticsParams {
            look: p.look % 6,
            cool_off: p.cool_off % 40,
            tags: Vec::new(),
            with: None,
            without: None,
            ..p
        };
        (params, MemoryFiles::default())
    }
}
