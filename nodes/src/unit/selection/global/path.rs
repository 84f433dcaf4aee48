//! Paths through the units of a database, and their costs.

use crate::core::params::Text;
use crate::core::random::Rng;
use crate::params;

params! {
    /// Costs of a path, and the units that it may take.
    pub struct PathCostParams {
        /// Cost of a jump, in distances of features.
        switch_cost: f64 = 1.0, unit "", range 0.0..=1000.0;
        /// Maximum distance of features that sound alike.
        d_max: f64 = 2.0, unit "", range 0.0..=1_000_000.0;
        /// A unit beyond `d_max` costs no more than `d_max` and this; 0 sets no limit.
        penalty: f64 = 0.0, unit "", range 0.0..=1_000_000.0;
        /// Number of targets for which a chosen unit is not chosen again; 0 allows it.
        cool_off: usize = 20, unit "units", range 0..=1_000_000_usize;
        /// Time within which the last four picks are not repeated in order; 0 allows it.
        loop_guard: f64 = 2.0, unit "s", range 0.0..=60.0;
        /// Choose only from recordings with one of these tags; empty for all.
        tags: Vec<Text> = Vec::new();
    }
}

/// Costs of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlobalParams {
    /// Price of a unit that does not follow the one before it in its recording.
    pub switch_cost: f64,
    /// Maximum cost of the distance of one unit; infinite for no limit.
    pub cap: f64,
    /// Targets for which a chosen unit is not chosen again.
    pub cool_off: usize,
    /// Targets within which the last four picks are not repeated in order; 0 allows it.
    pub loop_guard: usize,
}

impl PathCostParams {
    /// Costs that suit small trials, over all recordings.
    pub(in crate::unit::selection) fn small(self, rng: &mut Rng) -> Self {
        Self {
            switch_cost: rng.between(0.0, 2.0),
            d_max: rng.between(0.0, 9.0),
            cool_off: self.cool_off % 40,
            loop_guard: rng.between(0.0, 0.1),
            tags: Vec::new(),
            ..self
        }
    }

    /// The costs for targets at a rate in units per second.
    #[must_use]
    pub(in crate::unit) fn global(&self, rate: f64) -> GlobalParams {
        GlobalParams {
            switch_cost: self.switch_cost.min(MAX_SWITCH_COST),
            cap: distance_cap(self.d_max, self.penalty),
            cool_off: self.cool_off,
            loop_guard: (self.loop_guard * rate).round() as usize,
        }
    }
}

/// Maximum cost of a jump: a larger one would exceed the precision of distances.
pub const MAX_SWITCH_COST: f64 = 1000.0;

/// A path through the units of a database.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// A unit for each target.
    pub units: Vec<u32>,
    /// Cost of the path.
    pub cost: f64,
    /// Cost of the best path without `cool_off` and `loop_guard`.
    pub free_cost: f64,
    /// Units of that path that recurred before the end of their cool-off, or that completed a repeat.
    pub repeats: usize,
    /// Number of repeated searches of parts of it for that reason.
    pub rounds: usize,
    /// Units that were replaced in the end, regardless of the cost.
    pub replaced: usize,
}

/// Share of places at which two paths differ.
#[must_use]
pub fn difference(a: &[u32], b: &[u32]) -> f64 {
    let differ = a.iter().zip(b).filter(|(a, b)| a != b).count() + a.len().abs_diff(b.len());
    differ as f64 / a.len().max(b.len()).max(1) as f64
}

/// Maximum distance that counts as cost: `d_max` and `penalty`; no limit if `penalty` is 0.
#[must_use]
pub fn distance_cap(d_max: f64, penalty: f64) -> f64 {
    if penalty > 0.0 { d_max + penalty } else { f64::INFINITY }
}
