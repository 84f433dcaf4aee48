//! The path of a contact between two frames, a cubic through positions and velocities, and estimates of missing
//! velocities.

use super::sample::ContactSample;
use crate::core::time::{Tick, seconds};

/// Velocity from one position to another, m/s.
pub(super) fn rate(from: [f64; 2], to: [f64; 2], time: Tick) -> [f64; 2] {
    let time = seconds(time.max(1));
    std::array::from_fn(|k| (to[k] - from[k]) / time)
}

/// A velocity that continues turning and growing for a time.
pub(super) fn turned(velocity: [f64; 2], [turn, growth]: [f64; 2], time: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(turn * time);
    let size = (1.0 + growth * time).max(0.0);
    [size * (velocity[0] * cos - velocity[1] * sin), size * (velocity[0] * sin + velocity[1] * cos)]
}

/// Velocity at a frame from those around it (Catmull and Rom).
pub(super) fn central(
    before: Option<(Tick, [f64; 2])>,
    at: &ContactSample,
    after: &ContactSample,
) -> [f64; 2] {
    let (tick, position) = before.unwrap_or((at.tick, at.position));
    rate(position, after.position, after.tick - tick)
}

/// Velocity at the end of a path whose start alone is known: half of that for constant acceleration, without overshoot.
pub(super) fn onward([from, velocity]: [[f64; 2]; 2], to: [f64; 2], time: f64) -> [f64; 2] {
    std::array::from_fn(|k| {
        let mean = (to[k] - from[k]) / time;
        if velocity[k].is_finite() { mean + 0.5 * (mean - velocity[k]) } else { mean }
    })
}

/// The cubic of Hermite between two positions with velocities.
pub(super) fn cubic([p, v]: [[f64; 2]; 2], [q, w]: [[f64; 2]; 2], time: f64, guard: bool) -> [[f64; 2]; 4] {
    let gap: [f64; 2] = std::array::from_fn(|k| q[k] - p[k]);
    let fastest = v[0].hypot(v[1]).max(w[0].hypot(w[1]));
    if guard && fastest * time > 3.0 * gap[0].hypot(gap[1]) {
        return [p, gap, [0.0; 2], [0.0; 2]];
    }
    let part = |f: &dyn Fn(usize) -> f64| [f(0), f(1)];
    [
        p,
        part(&|k| v[k] * time),
        part(&|k| 3.0 * gap[k] - (2.0 * v[k] + w[k]) * time),
        part(&|k| (v[k] + w[k]) * time - 2.0 * gap[k]),
    ]
}
