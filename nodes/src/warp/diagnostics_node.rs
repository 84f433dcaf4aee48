//! Which correspondence hurts, as a node.

use serde::{Deserialize, Serialize};

use super::Tps;
use super::diagnostics::{LeaveOut, Suspicion};
use super::effect::{Baseline, Effect};
use super::fit::Pair;
use super::fit_node::{Heard, checked, stiffness};
use super::pairing::Pairing;
use super::set::CorrespondenceSet;
use crate::artefact::text::Location as Place;
use crate::core::fault::{Fault, Reject};
use crate::core::files::{MemoryFiles, WriteSeek};
use crate::core::item::Data;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{OutPath, Params, Text};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::feature::Features;
use crate::io::{AudioWriter, Dither, WriteFormat, WriteSpec};
use crate::unit::selector_node::{comparable, units};
use crate::unit::{Blend, Concatenator, SelectorParams, UnitDatabase};
use crate::{archive_state, params, ports};
use std::fmt;
use std::ops::Range;

/// Units that are played before and after the worst range, and the most of all.
const AROUND: usize = 24;
const MOST_PLAYED: f64 = 10.0;

params! {
    /// Leaves every correspondence out in turn, and tells which one the others would do better without.
    ///
    /// The score of a correspondence is how much better the remaining ones predict each other when it is gone: a bad one spoils its
    /// neighbours, so what it is itself predicted wrong tells less. The largest score is the suspect; listen to its ranges, move or
    /// disable it, and look again. A tap of `diagnosis` as JSON holds, for each channel, the degrees of freedom of the warp and a
    /// record of each correspondence (a note of the run names the first): label, place in the file, score and rank, those that contradict it, the times of the target
    /// for which another unit is chosen without it, and by how much the shares of fallbacks and of folds change.
    ///
    /// With `with` and `without`, the longest range of the suspect is written as two recordings to compare: as it sounds with all
    /// correspondences, and as it would sound without the suspect.
    ///
    /// # Source
    /// Wahba, "Spline Models for Observational Data" (1990), section 4.2, for predictions of what is left out.
    pub struct CorrespondenceDiagnosticsParams {
        /// Stiffness as in `TpsFit`; None finds one.
        lambda: Option<f64> = None, unit "", range 0.0..=1e12;
        /// Whether `lambda` is in units of the squared mean distance of nodes.
        scale_free: bool = false;
        /// How units of both sides become pairs.
        pairing: Pairing = Pairing::InOrder;
        /// Distance of features that counts as alike, as in the selection of units: pairs that start nearer and lead three times
        /// farther apart contradict each other.
        d_max: f64 = 2.0, unit "", range 0.0..=1e6;
        /// Units that the selection compares, as in `UnitSelector`.
        look: usize = 5, unit "units", range 0..=1000_usize;
        /// Targets for which a chosen unit is not chosen again, as in `UnitSelector`.
        cool_off: usize = 20, unit "units", range 0..=1_000_000_usize;
        /// Tags of recordings that are chosen from, as in `UnitSelector`; empty for all.
        tags: Vec<Text> = Vec::new();
        /// Where the suspect's longest range is written as it sounds.
        with: Option<OutPath> = None;
        /// Where the same range is written as it would sound without the suspect.
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
            /// What should sound alike.
            pairs: Value<CorrespondenceSet>,
        }
        out {
            /// What was found, once the target has ended.
            diagnosis: Fold<Diagnosis>,
        }
    }
}

/// What was found of one correspondence.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// What people call it.
    pub label: String,
    /// Where it stands in its file.
    pub place: Place,
    /// Index in the file.
    pub correspondence: usize,
    /// By how much the squared errors of predicting the others from each other fall without it.
    pub score: f64,
    /// Place by score, from 1.
    pub rank: usize,
    /// How far its own mean is predicted wrong by all others.
    pub surprise: f64,
    /// Correspondences, by their index, that start near it and lead elsewhere.
    pub conflicts: Vec<usize>,
    /// Times of the target, from and to in s, for which another unit is chosen without it.
    pub ranges: Vec<[f64; 2]>,
    /// Change of the share of units for which nothing is near enough.
    pub delta_fallback: f64,
    /// Change of the share of the target where the warp folds over.
    pub delta_folds: f64,
}

/// What was found of all correspondences of one channel, the suspect first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelDiagnosis {
    /// lambda of the fits.
    pub lambda: f64,
    /// Degrees of freedom of the warp through all.
    pub degrees_of_freedom: f64,
    /// Share of units for which nothing is near enough, with all.
    pub fallback_share: f64,
    /// Share of the target where the warp through all folds over.
    pub fold_share: f64,
    /// One per correspondence that counts.
    pub verdicts: Vec<Verdict>,
}

/// What was found of all correspondences.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// File of the correspondences.
    pub file: String,
    /// One per channel.
    pub channels: Vec<ChannelDiagnosis>,
}

impl Data for Diagnosis {
    const NAME: &'static str = "diagnosis";

    fn trial(_: &mut Rng) -> Self {
        Self::default()
    }
}

impl Verdict {
    fn new(suspicion: Suspicion, effect: Effect, heard: &Heard) -> Self {
        let c = heard.pairs.pairs.get(suspicion.correspondence);
        let seconds = |[from, to]: [usize; 2]| [from as f64 / heard.rate, to as f64 / heard.rate];
        Self {
            label: c.map(|c| c.label.clone()).unwrap_or_default(),
            place: c.map(|c| c.place).unwrap_or_default(),
            correspondence: suspicion.correspondence,
            score: suspicion.score,
            rank: suspicion.rank,
            surprise: suspicion.surprise,
            conflicts: suspicion.conflicts,
            ranges: effect.ranges.into_iter().map(seconds).collect(),
            delta_fallback: effect.delta_fallback,
            delta_folds: effect.delta_folds,
        }
    }

    /// What to try.
    fn advice(&self) -> String {
        if self.score <= 0.0 {
            "the others do no better without it".to_owned()
        } else if !self.conflicts.is_empty() {
            format!("it contradicts {:?}: keep one of them", self.conflicts)
        } else if self.ranges.is_empty() {
            "nothing sounds different without it: disable it".to_owned()
        } else if self.delta_fallback < 0.0 || self.delta_folds < 0.0 {
            "move it to another moment of the recordings, or disable it".to_owned()
        } else {
            "disable it and listen".to_owned()
        }
    }

    fn text(&self, channel: usize, file: &str) -> String {
        let longest = self.ranges.iter().max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
        let heard = longest.map_or(String::new(), |[from, to]| {
            format!(", heard most from {from:.2} to {to:.2} s of {} ranges", self.ranges.len())
        });
        format!(
            "channel {channel}, {}. {:?} at {file}:{}: score {:.3}; without it fallbacks {:+.1} %, folds {:+.1} %{heard}; {}",
            self.rank,
            self.label,
            self.place,
            self.score,
            100.0 * self.delta_fallback,
            100.0 * self.delta_folds,
            self.advice()
        )
    }
}

impl Diagnosis {
    /// The top three of each channel in words, with what to try.
    #[must_use]
    pub fn text(&self) -> Vec<String> {
        let lines = self.channels.iter().enumerate().flat_map(|(channel, found)| {
            found.verdicts.iter().take(3).map(move |verdict| verdict.text(channel, &self.file))
        });
        lines.collect()
    }

    /// The one that hurts most in a line, if the others do better without any.
    #[must_use]
    pub fn suspect(&self) -> Option<String> {
        let firsts = self.channels.iter().enumerate();
        let firsts = firsts.filter_map(|(channel, found)| Some((channel, found.verdicts.first()?)));
        let (channel, most) = firsts.max_by(|a, b| a.1.score.total_cmp(&b.1.score))?;
        (most.score > 0.0).then(|| most.text(channel, &self.file))
    }
}

/// A stretch of one channel as two choices of units play it.
struct Audition {
    score: f64,
    with: Vec<u32>,
    without: Vec<u32>,
}

/// The node over [`suspicions`](super::suspicions) and [`Baseline`].
pub struct CorrespondenceDiagnostics {
    heard: Heard,
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
    /// The target as it is heard with all correspondences.
    fn baseline(&self, vector: usize, all: &Tps) -> Result<Baseline, Fault> {
        let (heard, p) = (&self.heard, &self.params);
        let params = SelectorParams {
            look: p.look,
            d_max: p.d_max,
            cool_off: p.cool_off,
            loop_guard: 0,
            causal: heard.database.conventions.causal,
            effort: None,
        };
        let units = units(&heard.format, &heard.database, &p.tags)?;
        let found = Baseline::new(heard.vector(vector), all, &units, params).map_err(strayed)?;
        found.ok_or_else(|| Fault::new("F101", "there is no unit to choose from").at("database"))
    }

    fn channel(
        &self,
        vector: usize,
        pairs: &[(usize, Pair)],
    ) -> Result<(ChannelDiagnosis, Option<Audition>), Fault> {
        let d = self.heard.format.dims();
        let wrong = |e: super::FitError| Fault::new("F111", e.to_string()).at("pairs");
        let stiffness = stiffness(self.params.lambda, self.params.scale_free);
        let out = LeaveOut::as_stiff(pairs, d, stiffness).map_err(wrong)?;
        let (all, freedom) = out.all().map_err(wrong)?;
        let mut found = out.suspicions(self.params.d_max);
        found.sort_by_key(|suspicion| suspicion.rank);
        let rest = found.iter().map(|s| out.without(s.correspondence));
        let rest: Vec<Tps> = rest.collect::<Result<_, _>>().map_err(wrong)?;
        let baseline = self.baseline(vector, &all)?;
        let effects = baseline.effects(&rest).map_err(strayed)?;
        let stretch = effects.first().and_then(|effect| self.stretch(&effect.ranges, baseline.len()));
        let audition = match (stretch, rest.first(), found.first()) {
            (Some(stretch), Some(rest), Some(suspect)) => Some(Audition {
                score: suspect.score,
                with: baseline.picks().get(stretch.clone()).unwrap_or_default().to_vec(),
                without: baseline.audition(rest, stretch).map_err(strayed)?,
            }),
            _ => None,
        };
        let verdicts = found.into_iter().zip(effects).map(|(s, e)| Verdict::new(s, e, &self.heard));
        let diagnosis = ChannelDiagnosis {
            lambda: out.lambda(),
            degrees_of_freedom: freedom,
            fallback_share: baseline.fallback_share(),
            fold_share: baseline.fold_share(),
            verdicts: verdicts.collect(),
        };
        Ok((diagnosis, audition))
    }

    /// What is played of the longest of some ranges.
    fn stretch(&self, ranges: &[[usize; 2]], units: usize) -> Option<Range<usize>> {
        let [from, to] = ranges.iter().rev().max_by_key(|[from, to]| to - from)?;
        let from = from.saturating_sub(AROUND);
        let most = from + (MOST_PLAYED * self.heard.rate) as usize;
        Some(from..(to + AROUND).min(units).min(most))
    }

    /// Writes what two choices of units sound like.
    fn write(&mut self, audition: Option<Audition>) -> Result<(), Fault> {
        let Audition { with, without, .. } =
            audition.unwrap_or(Audition { score: 0.0, with: Vec::new(), without: Vec::new() });
        let db = &self.heard.database;
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

fn strayed(unit: crate::unit::NotFinite) -> Fault {
    Fault::new("F111", format!("the warp leads unit {} of the target to no finite place", unit.0)).at("pairs")
}

impl Node for CorrespondenceDiagnostics {
    type Params = CorrespondenceDiagnosticsParams;
    type Ports = CorrespondenceDiagnosticsPorts;
    const NAME: &'static str = "CorrespondenceDiagnostics";
    const VERSION: u32 = 5;
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
        let heard = Heard::new(cx.input(Port::features), cx.value(Port::database), cx.value(Port::pairs))?;
        let create = |field: &str, path: &Option<OutPath>| {
            path.as_ref().map(|path| cx.create(field, &path.0)).transpose()
        };
        let (with, without) = (create("with", &p.with)?, create("without", &p.without)?);
        Ok(Self { heard, params: p.clone(), with, without })
    }

    fn run(&mut self, io: CorrespondenceDiagnosticsIo<'_>) -> Result<(), Fault> {
        self.heard.add(io.features.items());
        Ok(())
    }

    fn finish(&mut self, mut io: CorrespondenceDiagnosticsIo<'_>) -> Result<Summary, Fault> {
        let all = self.heard.pairs(self.params.pairing)?;
        let found = all.iter().enumerate().map(|(vector, pairs)| self.channel(vector, pairs));
        let (channels, auditions): (Vec<_>, Vec<_>) =
            found.collect::<Result<Vec<_>, Fault>>()?.into_iter().unzip();
        let suspect = auditions.into_iter().flatten().max_by(|a, b| a.score.total_cmp(&b.score));
        self.write(suspect)?;
        let diagnosis = Diagnosis { file: self.heard.pairs.file.clone(), channels };
        let mut summary = vec![("suspects", serde_json::json!(diagnosis.text()))];
        summary.extend(diagnosis.suspect().map(|text| ("warning", text.into())));
        summary.extend(self.heard.strange());
        io.diagnosis.set(diagnosis);
        Ok(summary)
    }

    archive_state!(heard);

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
