//! The fraction of the rendered clips outside the speeds of a friction model.

use serde::{Deserialize, Serialize};

use crate::core::node::Summary;

/// Numbers of rendered emitter clips, and of those outside the model's speeds.
///
/// All clips have the same length, so fractions of counts are fractions of emitter time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SpeedCoverage {
    /// Clips of sliding emitters.
    pub sliding: u64,
    /// Clips above the fastest measured speed, whose spectrum was held.
    pub above: u64,
    /// Clips below the slowest measured speed, whose level was extrapolated.
    pub below: u64,
}

impl SpeedCoverage {
    /// Returns the fraction of emitter time above the fastest measured speed.
    #[must_use]
    pub fn share_above(&self) -> f64 {
        self.above as f64 / self.sliding.max(1) as f64
    }

    /// Returns the fraction of emitter time below the slowest measured speed.
    #[must_use]
    pub fn share_below(&self) -> f64 {
        self.below as f64 / self.sliding.max(1) as f64
    }
}

/// Summary of friction noise for the report.
pub(super) fn coverage_summary(coverage: SpeedCoverage, peak: f32) -> Summary {
    vec![
        ("emitter_clips", coverage.sliding.into()),
        ("share_above", coverage.share_above().into()),
        ("share_below", coverage.share_below().into()),
        ("peak", peak.into()),
    ]
}
