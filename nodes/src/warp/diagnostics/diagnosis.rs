//! Verdicts on correspondences, in figures and in words.

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use super::leave_one_out::Suspicion;
use crate::artefact::text::Location;
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::warp::correspondence::target_features::TargetFeatures;

/// Diagnosis of one correspondence.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Label in its file.
    pub label: String,
    /// Location in its file.
    #[serde(rename = "place")]
    pub location: Location,
    /// Index in the file.
    pub correspondence: usize,
    /// Decrease without it of the squared errors of predicting the others from each other.
    pub score: f64,
    /// Place by score, from 1.
    pub rank: usize,
    /// Error of its own mean when predicted from all others.
    pub surprise: f64,
    /// Correspondences, by their index, that start near it and lead elsewhere.
    pub conflicts: Vec<usize>,
    /// Times of the target, from and to in s, for which another unit is chosen without it.
    pub ranges: Vec<[f64; 2]>,
    /// Change of the share of units without a near enough match.
    pub delta_fallback: f64,
    /// Change of the share of the target where the warp folds over.
    pub delta_folds: f64,
}

/// Diagnosis of all correspondences of one channel, the suspect first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelDiagnosis {
    /// lambda of the fits.
    pub lambda: f64,
    /// Degrees of freedom of the warp through all.
    pub degrees_of_freedom: f64,
    /// Share of units without a near enough match, with all correspondences.
    pub fallback_share: f64,
    /// Share of the target where the warp through all folds over.
    pub fold_share: f64,
    /// One per correspondence that counts.
    pub verdicts: Vec<Verdict>,
}

/// Diagnosis of all correspondences.
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
    pub(super) fn new(suspicion: Suspicion, effect: Effect, target: &TargetFeatures) -> Self {
        let c = target.pairs.pairs.get(suspicion.correspondence);
        let seconds = |[from, to]: [usize; 2]| [from as f64 / target.rate, to as f64 / target.rate];
        Self {
            label: c.map(|c| c.label.clone()).unwrap_or_default(),
            location: c.map(|c| c.location).unwrap_or_default(),
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

    /// A recommendation.
    fn advice(&self) -> String {
        if self.score <= 0.0 {
            "without it the others fit no better".to_owned()
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
        let target = longest.map_or(String::new(), |[from, to]| {
            format!(", most audible from {from:.2} to {to:.2} s of {} ranges", self.ranges.len())
        });
        format!(
            "channel {channel}, {}. {:?} at {file}:{}: score {:.3}; without it fallbacks {:+.1} %, folds {:+.1} %{target}; {}",
            self.rank,
            self.label,
            self.location,
            self.score,
            100.0 * self.delta_fallback,
            100.0 * self.delta_folds,
            self.advice()
        )
    }
}

impl Diagnosis {
    /// The top three of each channel in words, with possible corrections.
    #[must_use]
    pub fn text(&self) -> Vec<String> {
        let lines = self.channels.iter().enumerate().flat_map(|(channel, found)| {
            found.verdicts.iter().take(3).map(move |verdict| verdict.text(channel, &self.file))
        });
        lines.collect()
    }

    /// The most harmful one in one line, if the others are better without one of them.
    #[must_use]
    pub fn suspect(&self) -> Option<String> {
        let firsts = self.channels.iter().enumerate();
        let firsts = firsts.filter_map(|(channel, found)| Some((channel, found.verdicts.first()?)));
        let (channel, most) = firsts.max_by(|a, b| a.1.score.total_cmp(&b.1.score))?;
        (most.score > 0.0).then(|| most.text(channel, &self.file))
    }
}
