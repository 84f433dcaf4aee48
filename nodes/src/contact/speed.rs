//! From the speed of the motion to the speed at which the friction model is asked.

use serde::{Deserialize, Serialize};

/// s' = (k s)^p.
///
/// `factor` brings an animation into the range of speeds that was measured; the authors scaled by amounts they don't give.
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

/// Counts of emitter samples by where their mapped speed lies against the measured range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClampReport {
    /// Samples that move at all.
    pub moving: u64,
    /// Those above the top measured speed, which sound with its spectrum.
    pub above: u64,
    /// Those below the bottom measured speed, which sound with its spectrum made softer.
    pub below: u64,
}

impl ClampReport {
    /// Share of moving emitter time above the measured range; 0 if nothing moves.
    #[must_use]
    pub fn share_above(&self) -> f64 {
        self.above as f64 / self.moving.max(1) as f64
    }

    /// Share of moving emitter time below the measured range; 0 if nothing moves.
    #[must_use]
    pub fn share_below(&self) -> f64 {
        self.below as f64 / self.moving.max(1) as f64
    }

    /// Adds another report's counts.
    pub fn add(&mut self, other: ClampReport) {
        self.moving += other.moving;
        self.above += other.above;
        self.below += other.below;
    }
}

impl SpeedMap {
    /// The preset for windbreaker: (s / 4)^1.5.
    pub const WINDBREAKER: SpeedMap = SpeedMap { factor: 0.25, power: 1.5 };

    /// Maps one speed; a speed that isn't positive maps to 0.
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

    /// Maps speeds in place and counts those outside the measured range `bottom ..= top`. They are not clamped here.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_changes_no_speed() {
        assert_eq!([0.0, 0.02, 3.5].map(|s| SpeedMap::default().map(s)), [0.0, 0.02, 3.5]);
    }

    #[test]
    fn windbreaker_leaves_4_metres_per_second_at_1_and_maps_16_to_8() {
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
