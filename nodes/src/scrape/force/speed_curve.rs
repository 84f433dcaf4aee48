//! The strength of an excitation by speed.

use super::approximation::log2;
use serde::{Deserialize, Serialize};

/// Maximum strength, and maximum factor of it.
pub(super) const MAX_FACTOR: f64 = 1e6;
/// Number of speeds of a curve.
pub const POINTS: usize = 17;
/// Number of these speeds per octave.
const OCTAVE: f64 = 4.0;

/// Multiplier of a strength at each speed, over two octaves on either side of one speed, constant beyond.
///
/// The loudness of a surface at a speed depends on its image and on the modes: it is no power of the speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpeedCurve {
    /// The lowest speed, m/s.
    lowest: f32,
    /// Factors at each quarter of an octave from there on.
    factors: [f32; POINTS],
    /// Power of the size of the surface with which it grows.
    pub growth: f32,
}

impl SpeedCurve {
    /// The speeds of a curve around one in the middle, m/s.
    #[must_use]
    pub fn speeds(middle: f64) -> [f64; POINTS] {
        std::array::from_fn(|k| middle * libm::exp2((k as f64 - (POINTS / 2) as f64) / OCTAVE))
    }

    /// A curve around a speed in m/s.
    #[must_use]
    pub fn new(middle: f64, factors: [f64; POINTS]) -> Self {
        let [lowest, ..] = Self::speeds(middle);
        Self { lowest: lowest as f32, factors: factors.map(|x| x as f32), growth: 0.0 }
    }

    /// The same for forces that are compared with a relief: a relief of twice the size is also twice as high.
    #[must_use]
    pub fn of_relief(self) -> Self {
        Self { growth: 1.0, ..self }
    }

    /// The factor at a speed, m/s.
    #[inline]
    #[must_use]
    pub fn at(&self, speed: f32) -> f32 {
        let position = OCTAVE as f32 * log2((speed / self.lowest).max(1.0));
        let position = position.min((POINTS - 1) as f32);
        let low = (position as usize).min(POINTS - 2);
        let [a, b] = [self.factors[low], self.factors[low + 1]];
        a + (position - low as f32) * (b - a)
    }

    pub(super) fn holds(&self) -> bool {
        self.lowest.is_normal()
            && self.lowest > 0.0
            && (0.0..=1.0).contains(&self.growth)
            && self.factors.iter().all(|x| (0.0..=MAX_FACTOR as f32).contains(x))
    }
}
