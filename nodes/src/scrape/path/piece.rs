//! Items of the links between the nodes of scraping.

use crate::core::item::Event;
use crate::core::random::Rng;
use crate::core::time::{Tick, seconds, ticks};
use serde::{Deserialize, Serialize};

/// The path of one contact over a surface between two frames of the physics.
///
/// It begins at the time of its event. With `s` from 0 to 1 over its duration the place is `c[0] + c[1] s + c[2] s^2 + c[3] s^3`; force
/// and gain go in a straight line. Pieces of one contact that touch in time continue smoothly; where a contact jumps, an
/// old piece fades out while a new one with another `piece` fades in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathPiece {
    /// Number of the contact, constant while it lasts.
    pub contact: u64,
    /// Counts the jumps of the contact: pieces of the same count join.
    pub jump: u32,
    /// Number of the object that is excited.
    pub object: u32,
    /// Its duration.
    pub duration: Tick,
    /// Coefficients of the position on the surface, m.
    #[serde(rename = "place")]
    pub position: [[f64; 2]; 4],
    /// The same on the other surface, if it is known, m.
    pub other: Option<[[f64; 2]; 4]>,
    /// Normal force at its start and end, N.
    pub force: [f32; 2],
    /// Amplitude at its start and end: fades, kinds of contact, levels of detail.
    pub gain: [f32; 2],
    /// Effective mass of the two bodies, kg, if known.
    #[serde(default)]
    pub mass: Option<f32>,
}

impl PathPiece {
    /// The number of all contacts of two bodies together, where these are joined: beyond all that contacts have.
    #[must_use]
    pub fn pair([a, b]: [u32; 2]) -> u64 {
        1 << 63 | u64::from(a) << 32 | u64::from(b)
    }

    /// The position at `s` from 0 to 1 of its duration, m.
    #[must_use]
    pub fn position_at(&self, s: f64) -> [f64; 2] {
        position(&self.position, s)
    }

    /// Velocity over the surface at `s`, m/s.
    #[must_use]
    pub fn velocity_at(&self, s: f64) -> [f64; 2] {
        let [_, b, c, d] = self.position;
        let time = seconds(self.duration.max(1));
        std::array::from_fn(|k| (b[k] + s * (2.0 * c[k] + s * 3.0 * d[k])) / time)
    }

    /// Normal force at `s`, at least 0, N.
    #[must_use]
    pub fn force_at(&self, s: f64) -> f64 {
        let [a, b] = self.force.map(f64::from);
        (a + s * (b - a)).max(0.0)
    }

    /// Amplitude at `s`.
    #[must_use]
    pub fn gain_at(&self, s: f64) -> f64 {
        let [a, b] = self.gain.map(f64::from);
        a + s * (b - a)
    }

    /// The part of it from `s` to `t` of its duration as a piece of its own that lasts `duration`.
    #[must_use]
    pub fn part(&self, s: f64, t: f64, duration: Tick) -> Self {
        let cut = |c: &[[f64; 2]; 4]| shifted(c, s, t - s);
        Self {
            duration,
            position: cut(&self.position),
            other: self.other.as_ref().map(cut),
            force: [s, t].map(|s| self.force_at(s) as f32),
            gain: [s, t].map(|s| self.gain_at(s) as f32),
            ..*self
        }
    }
}

/// The position at `s` of a polynomial.
pub(crate) fn position(c: &[[f64; 2]; 4], s: f64) -> [f64; 2] {
    let [a, b, c, d] = c;
    std::array::from_fn(|k| a[k] + s * (b[k] + s * (c[k] + s * d[k])))
}

/// The velocity on a polynomial in samples, `n` samples after its anchor, m/s.
pub(crate) fn velocity(c: &[[f64; 2]; 4], n: f64, rate: f64) -> [f64; 2] {
    std::array::from_fn(|k| rate * (c[1][k] + n * (2.0 * c[2][k] + n * 3.0 * c[3][k])))
}

/// The coefficients of `p(s + t scale)` as a polynomial of `t`.
pub(crate) fn shifted([a, b, c, d]: &[[f64; 2]; 4], s: f64, scale: f64) -> [[f64; 2]; 4] {
    let part = |f: &dyn Fn(usize) -> f64| [f(0), f(1)];
    [
        part(&|k| a[k] + s * (b[k] + s * (c[k] + s * d[k]))),
        part(&|k| scale * (b[k] + s * (2.0 * c[k] + s * 3.0 * d[k]))),
        part(&|k| scale * scale * (c[k] + 3.0 * s * d[k])),
        part(&|k| scale.powi(3) * d[k]),
    ]
}

impl Event for PathPiece {
    const NAME: &'static str = "path";

    fn trial(rng: &mut Rng) -> Self {
        let mut pair = |size: f64| [rng.between(-size, size), rng.between(-size, size)];
        let position = [pair(0.5), pair(0.02), pair(0.01), pair(0.005)];
        Self {
            contact: rng.below(3) as u64,
            jump: rng.below(2) as u32,
            object: rng.below(2) as u32,
            duration: ticks(1.0 / 60.0),
            position,
            other: (rng.below(2) == 0).then_some(position),
            force: [rng.between(0.0, 20.0) as f32, rng.between(0.0, 20.0) as f32],
            gain: [rng.uniform() as f32, rng.uniform() as f32],
            mass: (rng.below(2) == 0).then_some(0.2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_has_the_same_path() {
        let whole = PathPiece::trial(&mut Rng::new(3));
        let part = whole.part(0.25, 0.75, whole.duration / 2);
        for t in [0.0, 0.3, 1.0] {
            let s = 0.25 + 0.5 * t;
            let near = |a: [f64; 2], b: [f64; 2], tol: f64| (0..2).all(|k| (a[k] - b[k]).abs() < tol);
            assert!(near(part.position_at(t), whole.position_at(s), 1e-14));
            assert!(near(part.velocity_at(t), whole.velocity_at(s), 1e-9));
            assert!((part.force_at(t) - whole.force_at(s)).abs() < 1e-5);
            assert!((part.gain_at(t) - whole.gain_at(s)).abs() < 1e-6);
        }
    }
}
