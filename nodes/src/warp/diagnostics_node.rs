//! Which correspondence hurts, as a node.

use serde::{Deserialize, Serialize};

use super::diagnostics::{Suspicion, moved_ranges, suspicions, without};
use super::fit::Pair;
use super::fit_node::{Heard, checked, stiffness};
use super::pairing::Pairing;
use super::set::CorrespondenceSet;
use super::text::Place;
use super::{Tps, fit};
use crate::core::fault::{Fault, Reject};
use crate::core::item::Data;
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::random::Draw;
use crate::core::shape::{Build, Ends, Shape};
use crate::feature::Features;
use crate::unit::UnitDatabase;
use crate::{params, ports};

/// Units that move less than this in feature space are as good as unmoved.
const MOVED: f64 = 0.25;
/// Unmoved units within a range that do not split it.
const GAP: usize = 24;

params! {
    /// Leaves every correspondence out in turn, and tells which one the others would do better without.
    ///
    /// The score of a correspondence is how much better the remaining ones predict each other when it is gone: a bad one spoils its
    /// neighbours, so what it is itself predicted wrong tells less. The largest score is the suspect; listen to its ranges, move or
    /// disable it, and look again. A tap of `diagnosis` as JSON holds, for each channel and correspondence, label, place in the file,
    /// score and rank, those that contradict it, and the times of the target whose features the warp moves elsewhere without it.
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
    /// Score, rank and conflicts.
    pub suspicion: Suspicion,
    /// Times of the target, from and to in s, whose features the warp moves elsewhere without it.
    pub ranges: Vec<[f64; 2]>,
}

/// What was found of all correspondences of one channel, the suspect first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelDiagnosis {
    /// lambda of the fits.
    pub lambda: f64,
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

    fn trial(_: &mut Draw) -> Self {
        Self::default()
    }
}

impl Diagnosis {
    /// The top three of each channel in words, with what to try.
    #[must_use]
    pub fn text(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for (channel, found) in self.channels.iter().enumerate() {
            for v in found.verdicts.iter().take(3) {
                let s = &v.suspicion;
                let what = if s.score <= 0.0 {
                    "the others do no better without it".to_owned()
                } else if s.conflicts.is_empty() {
                    "move it, or disable it and listen".to_owned()
                } else {
                    format!("it contradicts {:?}: keep one of them", s.conflicts)
                };
                lines.push(format!(
                    "channel {channel}, {}. {:?} at {}:{}: score {:.3}; {what}",
                    s.rank, v.label, self.file, v.place, s.score
                ));
            }
        }
        lines
    }
}

/// The node over [`suspicions`].
#[derive(Debug)]
pub struct CorrespondenceDiagnostics {
    heard: Heard,
    params: CorrespondenceDiagnosticsParams,
}

impl CorrespondenceDiagnostics {
    fn channel(&self, vector: usize, pairs: &[(usize, Pair)]) -> Result<ChannelDiagnosis, Fault> {
        let (heard, d) = (&self.heard, self.heard.format.dims());
        let wrong = |e: super::FitError| Fault::new("F111", e.to_string()).at("pairs");
        let plain: Vec<Pair> = pairs.iter().map(|(_, pair)| pair.clone()).collect();
        let (all, report) =
            fit(&plain, d, stiffness(self.params.lambda, self.params.scale_free)).map_err(wrong)?;
        let lambda = report.lambda;
        let own = heard.vector(vector);
        let seconds = |[from, to]: [usize; 2]| [from as f64 / heard.rate, to as f64 / heard.rate];
        let verdict = |suspicion: Suspicion| {
            let rest: Tps = without(pairs, suspicion.correspondence, d, lambda).map_err(wrong)?;
            let ranges = moved_ranges(&own, &all, &rest, MOVED, GAP);
            let c = heard.pairs.pairs.get(suspicion.correspondence);
            Ok(Verdict {
                label: c.map(|c| c.label.clone()).unwrap_or_default(),
                place: c.map(|c| c.place).unwrap_or_default(),
                ranges: ranges.into_iter().map(seconds).collect(),
                suspicion,
            })
        };
        let found = suspicions(pairs, d, lambda, self.params.d_max).map_err(wrong)?;
        let mut verdicts = found.into_iter().map(verdict).collect::<Result<Vec<_>, Fault>>()?;
        verdicts.sort_by_key(|v| v.suspicion.rank);
        Ok(ChannelDiagnosis { lambda, verdicts })
    }
}

impl Node for CorrespondenceDiagnostics {
    type Params = CorrespondenceDiagnosticsParams;
    type Ports = CorrespondenceDiagnosticsPorts;
    const NAME: &'static str = "CorrespondenceDiagnostics";
    const CLASS: Class = Class::Offline;

    fn shape(
        _: &CorrespondenceDiagnosticsParams,
        s: &mut Shape<'_, '_, CorrespondenceDiagnosticsPorts>,
    ) -> Result<(), Reject> {
        type Port = CorrespondenceDiagnosticsPorts;
        checked(&s.input(Port::features), s.value(Port::database), s.value(Port::pairs))?;
        s.when_ended(Port::features, Ends::Stop);
        Ok(())
    }

    fn build(p: &CorrespondenceDiagnosticsParams, cx: &Build<'_>) -> Result<Self, Fault> {
        type Port = CorrespondenceDiagnosticsPorts;
        let heard = Heard::new(cx.input(Port::features), cx.value(Port::database), cx.value(Port::pairs))?;
        Ok(Self { heard, params: p.clone() })
    }

    fn run(&mut self, io: CorrespondenceDiagnosticsIo<'_>) -> Result<(), Fault> {
        self.heard.add(io.features.items());
        Ok(())
    }

    fn finish(&mut self, mut io: CorrespondenceDiagnosticsIo<'_>) -> Result<Summary, Fault> {
        let all = self.heard.pairs(self.params.pairing)?;
        let channels = all.iter().enumerate().map(|(vector, pairs)| self.channel(vector, pairs));
        let diagnosis =
            Diagnosis { file: self.heard.pairs.file.clone(), channels: channels.collect::<Result<_, _>>()? };
        let summary = vec![("suspects", serde_json::json!(diagnosis.text()))];
        io.diagnosis.set(diagnosis);
        Ok(summary)
    }
}
