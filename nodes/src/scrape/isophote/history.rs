//! Recent slopes under a contact, by distance along its path.

use crate::core::state::long;
use serde::{Deserialize, Serialize};

/// Distance over which slopes are compared, px, and number of positions on it.
const APART: f64 = 1.0;
const STEPS: usize = 32;
/// Stored positions: more than a pixel, and a power of two.
const STORED: usize = 64;

/// Slopes under a contact, at even steps along its path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SlopeHistory {
    #[serde(with = "long")]
    slopes: [f64; STORED],
    newest: usize,
    /// Distance since the newest of them, px.
    since: f64,
    last: f64,
}

impl Default for SlopeHistory {
    fn default() -> Self {
        Self { slopes: [0.0; STORED], newest: 0, since: 0.0, last: 0.0 }
    }
}

impl SlopeHistory {
    /// Advances by a distance in px to a position of another slope, and returns the slope one pixel before that position.
    #[inline(always)]
    pub fn go(&mut self, distance: f64, slope: f64) -> f64 {
        let step = APART / STEPS as f64;
        let mut since = self.since + distance;
        if since >= step {
            since = self.pass(distance, slope);
        }
        self.since = since;
        self.last = slope;
        let back = (APART - self.since) / step;
        // Never negative: a cast is the floor.
        let whole = back as usize;
        let at = |k: usize| self.slopes[(self.newest + STORED - k) % STORED];
        let (a, b) = (at(whole), at(whole + 1));
        a + (b - a) * (back - whole as f64)
    }

    /// Stores the slopes at the steps along a path, and returns the distance after the last step.
    #[inline(always)]
    fn pass(&mut self, distance: f64, slope: f64) -> f64 {
        let step = APART / STEPS as f64;
        let mut next = step - self.since;
        // Only the last pixel counts.
        if distance > next + STORED as f64 * step {
            next += (((distance - next) / step).floor() - STORED as f64) * step;
        }
        // Rounding can leave a whole step over for a contact that then rests.
        let share = 1.0 / distance.max(f64::MIN_POSITIVE);
        while next <= distance {
            self.newest = (self.newest + 1) % STORED;
            self.slopes[self.newest] = self.last + (slope - self.last) * (next * share);
            next += step;
        }
        (distance - (next - step)).max(0.0)
    }

    /// The latest slope.
    pub fn last(&self) -> f64 {
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_past_is_one_pixel_behind() {
        for distance in [0.001, 0.0116, 0.03125, 0.2, 0.7] {
            let (mut history, mut x) = (SlopeHistory::default(), 0.0);
            for n in 0..4000 {
                x += distance;
                let before = history.go(distance, 3.0 * x);
                if x > 1.2 && n > 3 {
                    assert!((before - 3.0 * (x - 1.0)).abs() < 1e-9, "{distance} {x}: {before}");
                }
            }
            assert_eq!(history.go(0.0, 3.0 * x), history.go(0.0, 3.0 * x), "at rest nothing changes");
        }
        // Rest, or a path too short for its inverse, with a whole step left over.
        for distance in [0.0, 1e-320] {
            let mut history = SlopeHistory { since: APART / STEPS as f64, ..SlopeHistory::default() };
            assert!(
                history.go(distance, 2.0).is_finite() && history.slopes.iter().all(|x| x.is_finite()),
                "{distance}"
            );
        }
        // A step of many pixels: only its end counts.
        let mut history = SlopeHistory::default();
        history.go(100.0, 50.0);
        assert!((history.go(0.5, 50.25) - 49.75).abs() < 1e-9);
    }
}
