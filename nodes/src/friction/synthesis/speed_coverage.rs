//! The share of the rendered clips that lay outside the speeds of a friction model.

use serde::{Deserialize, Serialize};

use crate::core::node::Summary;

/// Emitter clips rendered, and how many of them lay outside the model's speeds.
///
/// All clips are equally long, so shares of counts are shares of emitter time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SpeedCoverage {
    /// Clips of sliding emitters.
    pub sliding: u64,
    /// Of these, faster than the fastest measured speed: their spectrum was held.
    pub above: u64,
    /// Of these, slower than the slowest measured speed: their level was extrapolated.
    pub below: u64,
}

impl SpeedCoverage {
    /// Share of emitter time above the model's top speed.
    #[must_use]
    pub fn share_above(&self) -> f64 {
        self.above as f64 / self.sliding.max(1) as f64
    }

    /// Share of emitter time below the model's bottom speed.
    #[must_use]
    pub fn share_below(&self) -> f64 {
        self.below as f64 / self.sliding.max(1) as f64
    }
}

/// What is told of friction noise in the end.
pub(super) fn coverage_summary(coverage: SpeedCoverage, peak: f32) -> Summary {
    vec![
        ("emitter_clips", coverage.sliding.into()),
        ("share_above", coverage.share_above().into()),
        ("share_below", coverage.share_below().into()),
        ("peak", peak.into()),
    ]
}
