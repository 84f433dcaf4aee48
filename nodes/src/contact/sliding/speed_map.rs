//! Map from sliding speeds to the speeds of a friction model, and the node `SpeedMap`.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::contact::item::Speeds;
use crate::core::fault::Reject;
use crate::core::node::Each;
use crate::params;

/// Map of speeds, s' = (k s)^p.
///
/// `factor` scales the speeds of an animation to the measured range; the authors do not state their factors.
///
/// # Source
/// An, James and Marschner 2012, section 5.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpeedMap {
    /// k.
    pub factor: f32,
    /// p.
    pub power: f32,
}

impl Default for SpeedMap {
    fn default() -> Self {
        Self { factor: 1.0, power: 1.0 }
    }
}

/// Numbers of emitter samples inside and outside the measured range of speeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClampReport {
    /// Samples with a speed above 0.
    pub moving: u64,
    /// Samples above the highest measured speed, which have its spectrum.
    pub above: u64,
    /// Samples below the lowest measured speed, which have its spectrum at a lower level.
    pub below: u64,
}

impl ClampReport {
    /// Returns the fraction of moving samples above the measured range; 0 if nothing moves.
    #[must_use]
    pub fn share_above(&self) -> f64 {
        self.above as f64 / self.moving.max(1) as f64
    }

    /// Returns the fraction of moving samples below the measured range; 0 if nothing moves.
    #[must_use]
    pub fn share_below(&self) -> f64 {
        self.below as f64 / self.moving.max(1) as f64
    }

    /// Adds the counts of another report.
    pub fn add(&mut self, other: ClampReport) {
        self.moving += other.moving;
        self.above += other.above;
        self.below += other.below;
    }
}

impl SpeedMap {
    /// Preset for windbreaker: (s / 4)^1.5.
    pub const WINDBREAKER: SpeedMap = SpeedMap { factor: 0.25, power: 1.5 };

    /// Maps one speed; a speed that is not positive maps to 0.
    #[inline]
    #[must_use]
    pub fn map(&self, speed: f32) -> f32 {
        let scaled = self.factor * speed;
        if scaled > 0.0 {
            if self.power == 1.0 { scaled } else { libm::powf(scaled, self.power) }
        } else {
            0.0
        }
    }

    /// Maps speeds in place and counts those outside the measured range `bottom ..= top`, without clamping them.
    pub fn map_all(&self, speeds: &mut [f32], bottom: f32, top: f32) -> ClampReport {
        let mut report = ClampReport::default();
        for speed in speeds {
            *speed = self.map(*speed);
            report.moving += u64::from(*speed > 0.0);
            report.above += u64::from(*speed > top);
            report.below += u64::from(*speed > 0.0 && *speed < bottom);
        }
        report
    }
}

params! {
    /// Maps sliding speeds to the speeds of a friction model: (factor s)^power.
    ///
    /// The preset for windbreaker is factor 0.25, power 1.5.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 5.
    pub struct SpeedMapParams {
        /// Factor on the speed.
        factor: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Exponent of the speed.
        power: f32 = 1.0, unit "", range 0.1..=10.0;
    }
}

/// The node `SpeedMap`.
pub struct SpeedMapNode(SpeedMap);

impl Each for SpeedMapNode {
    type Params = SpeedMapParams;
    type In = Speeds;
    type Out = Speeds;
    const NAME: &'static str = "SpeedMap";
    const INPUT: (&'static str, &'static str) = ("speeds", "Sliding speed per vertex.");
    const OUTPUT: (&'static str, &'static str) = ("mapped", "Mapped speed per vertex.");

    fn format(_: &SpeedMapParams, areas: &Arc<[f32]>) -> Result<Arc<[f32]>, Reject> {
        Ok(Arc::clone(areas))
    }

    fn new(p: &SpeedMapParams, _: &Arc<[f32]>) -> Self {
        Self(SpeedMap { factor: p.factor, power: p.power })
    }

    fn each(&mut self, item: &[f32], out: &mut [f32]) {
        out.iter_mut().zip(item).for_each(|(out, &s)| *out = self.0.map(s).min(f32::MAX));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_changes_no_speed() {
        assert_eq!([0.0, 0.02, 3.5].map(|s| SpeedMap::default().map(s)), [0.0, 0.02, 3.5]);
    }

    #[test]
    fn windbreaker_maps_4_metres_per_second_to_1_and_16_to_8() {
        assert_eq!(SpeedMap::WINDBREAKER.map(4.0), 1.0);
        assert!((SpeedMap::WINDBREAKER.map(16.0) - 8.0).abs() < 1e-6);
        assert_eq!(SpeedMap::WINDBREAKER.map(0.0), 0.0);
        assert_eq!(SpeedMap { factor: 1.0, power: 0.0 }.map(0.0), 0.0);
    }

    #[test]
    fn the_report_counts_moving_samples_outside_the_measured_range() {
        let mut speeds = [0.0, 0.05, 0.1, 0.5, 1.0, 1.5];
        let report = SpeedMap::default().map_all(&mut speeds, 0.1, 1.0);
        assert_eq!(report, ClampReport { moving: 5, above: 1, below: 1 });
        assert_eq!((report.share_above(), report.share_below()), (0.2, 0.2));
        assert_eq!(ClampReport::default().share_above(), 0.0);
        let mut twice = report;
        twice.add(report);
        assert_eq!(twice, ClampReport { moving: 10, above: 2, below: 2 });
    }
}
