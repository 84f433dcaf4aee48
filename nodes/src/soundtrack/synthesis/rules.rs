//! Rules of a synthesis, and counts of its choices.

use super::morph::OverlapMode;
use crate::core::node::Summary;
use crate::{choices, impl_state};

choices! {
    /// Method of counting similar ancestors and predecessors.
    pub enum MatchCount {
        /// Consecutive ones, from the nearest on.
        Consecutive,
        /// All of them.
        Total,
    }
}

choices! {
    /// Criterion by which the ancestors of a candidate are similar to those of the output.
    pub enum MatchCriterion {
        /// Each differs by the threshold at most.
        PerCoefficient,
        /// The mean of the differences, from the node itself up to the ancestor, is half of the threshold at most.
        RunningMean,
    }
}

choices! {
    /// The candidates that are compared.
    pub enum CandidateSearch {
        /// All nodes of the level.
        Exact,
        /// The children of the candidates of the parent; all nodes where none of them matches.
        Narrow,
    }
}

choices! {
    /// Effect of a weight between -1 and 1.
    pub enum WeightBias {
        /// As a probability: if wanted sounds have the share `p` of the time of the recordings, `p + (1 - p) |w|`.
        Probability,
        /// A wanted node is chosen `1 + 9 w` times as often as another one, an unwanted node `1 - |w|` times.
        Monotone,
        /// As in the paper: the weight of a wanted node is `w`, that of others 0.1.
        Paper,
    }
}

/// Rules of a synthesis.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthesisRules {
    /// Number of predecessors that are compared.
    pub predecessors: usize,
    /// The same for roots.
    pub root_predecessors: usize,
    /// Roots are chosen by the continuity of their levels by octave with those before, instead of predecessors that match: the greatest difference,
    /// relative to that of consecutive blocks of the recordings.
    pub continuity: Option<f64>,
    /// Greatest gain by which the levels of a block continue those before it, dB; 0 for blocks as they were recorded.
    pub join_gain: f64,
    /// Method of counting similar ancestors and predecessors.
    pub count: MatchCount,
    /// Criterion by which ancestors are similar.
    pub criterion: MatchCriterion,
    /// The candidates that are compared.
    pub search: CandidateSearch,
    /// Time by which a wanted sound is prepared, s.
    pub look_ahead: f64,
    /// Minimum match of a wanted node, as a share of that of other nodes, and of other nodes as a share of that of a wanted node.
    pub quality: f64,
    /// Effect of weights between -1 and 1.
    pub bias: WeightBias,
    /// Sound where two sounds overlap.
    pub overlap: OverlapMode,
    /// Probability that a node remains a candidate, for each recent choice of it; 1 for no preference.
    pub repetition: f64,
    /// Duration for which a choice counts for `repetition`, s.
    pub memory: f64,
    /// Longest stretch of a recording that is repeated unchanged, s, if there is another choice.
    pub max_run: Option<f64>,
    /// Greatest number of candidates of one kind that are compared; of more, this many are taken at equal distances.
    pub candidates: usize,
}

impl Default for SynthesisRules {
    fn default() -> Self {
        Self {
            predecessors: 5,
            root_predecessors: 16,
            continuity: None,
            join_gain: 15.0,
            count: MatchCount::Consecutive,
            criterion: MatchCriterion::PerCoefficient,
            search: CandidateSearch::Exact,
            look_ahead: 1.0,
            quality: 0.7,
            bias: WeightBias::Probability,
            overlap: OverlapMode::Winner,
            repetition: 1.0,
            memory: 2.0,
            max_run: Some(1.0),
            candidates: 4096,
        }
    }
}

impl SynthesisRules {
    /// [`Self::quality`] in percent.
    #[must_use]
    pub fn percent(&self) -> usize {
        (100.0 * self.quality).round() as usize
    }
}

/// Counts of a synthesis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SynthesisCounts {
    /// Nodes that were matched.
    pub steps: u64,
    /// Candidates that were left at the end, over all nodes.
    pub candidates: u64,
    /// Nodes whose choice matches only some of their ancestors.
    pub partial: u64,
    /// Nodes without a similar candidate: the most similar node was taken.
    pub approximate: u64,
    /// Nodes whose wanted candidates matched too badly.
    pub discarded: u64,
    /// Nodes whose successors could not be prepared.
    pub unprepared: u64,
    /// Lists of candidates that were too long.
    pub capped: u64,
}

impl_state!(SynthesisCounts { steps, candidates, partial, approximate, discarded, unprepared, capped });

impl SynthesisCounts {
    /// Figures for the summary of a run.
    #[must_use]
    pub fn figures(&self) -> Summary {
        let share = |n: u64| n as f64 / self.steps.max(1) as f64;
        vec![
            ("steps", self.steps.into()),
            ("candidates_mean", share(self.candidates).into()),
            ("partial", self.partial.into()),
            ("approximate", self.approximate.into()),
            ("discarded", self.discarded.into()),
            ("unprepared", self.unprepared.into()),
            ("capped", self.capped.into()),
        ]
    }
}
