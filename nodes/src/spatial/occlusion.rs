//! Whether something stands between a sound and an ear, and what that does to it.

use crate::contact::vector::{Vec3, cross, dot, sub, widen};
use serde::{Deserialize, Serialize};

/// Whether the way between two points passes through a triangle; the ends themselves do not count.
///
/// # Source
/// Möller and Trumbore, "Fast, minimum storage ray-triangle intersection" (Journal of Graphics Tools 2(1), 1997).
#[must_use]
pub fn crosses(from: Vec3, to: Vec3, [a, b, c]: [Vec3; 3]) -> bool {
    /// Parts of the way at both ends that do not count: a source lies on its own surface.
    const ENDS: f64 = 1e-4;
    let (way, e1, e2) = (sub(to, from), sub(b, a), sub(c, a));
    let p = cross(way, e2);
    let det = dot(e1, p);
    if det.abs() < 1e-18 {
        return false;
    }
    let s = sub(from, a);
    let u = dot(s, p) / det;
    let q = cross(s, e1);
    let v = dot(way, q) / det;
    let t = dot(e2, q) / det;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (ENDS..=1.0 - ENDS).contains(&t)
}

/// Whether a mesh stands between two points.
///
/// # Complexity
/// O(vertices) where its box is not on the way, else O(triangles).
#[must_use]
pub fn blocked(from: Vec3, to: Vec3, places: &[[f32; 3]], triangles: &[[u32; 3]]) -> bool {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for place in places {
        for (k, x) in widen(*place).into_iter().enumerate() {
            (low[k], high[k]) = (low[k].min(x), high[k].max(x));
        }
    }
    let beside = |k: usize| from[k].max(to[k]) < low[k] || from[k].min(to[k]) > high[k];
    if (0..3).any(beside) {
        return false;
    }
    let at = |v: u32| places.get(v as usize).copied().map(widen);
    triangles.iter().any(|[a, b, c]| match (at(*a), at(*b), at(*c)) {
        (Some(a), Some(b), Some(c)) => crosses(from, to, [a, b, c]),
        _ => false,
    })
}

/// Sound that reaches an ear around a body: softer and without its highs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Muffle {
    /// Of the low-pass, and of the way between free and blocked.
    pass: f64,
    turn: f64,
    gain: f64,
    low: f64,
    level: f64,
}

impl Muffle {
    /// Free, at `fs` hertz; blocked it passes up to `cutoff` hertz at `gain`, after `time` seconds for two thirds of the way.
    #[must_use]
    pub fn new(cutoff: f64, gain: f64, time: f64, fs: f64) -> Self {
        let rise = |seconds: f64| 1.0 - libm::exp(-1.0 / (seconds * fs).max(1e-9));
        Self {
            pass: rise(1.0 / (std::f64::consts::TAU * cutoff)),
            turn: rise(time),
            gain,
            low: 0.0,
            level: 0.0,
        }
    }

    /// One sample, for whether the way to it is blocked.
    pub fn next(&mut self, x: f32, blocked: bool) -> f32 {
        let x = f64::from(x);
        self.low += self.pass * (x - self.low);
        self.level += self.turn * (f64::from(u8::from(blocked)) - self.level);
        // What is left after a long time is nothing, and costs no denormals.
        if self.level < 1e-9 {
            self.level = 0.0;
        }
        if self.low.abs() < 1e-30 {
            self.low = 0.0;
        }
        if self.level == 0.0 { x as f32 } else { (x + self.level * (self.gain * self.low - x)) as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WALL: [[f32; 3]; 3] = [[1.0, -1.0, -1.0], [1.0, 2.0, -1.0], [1.0, -1.0, 2.0]];

    #[test]
    fn a_wall_blocks_what_is_behind_it_alone() {
        let blocks = |from: Vec3, to: Vec3| blocked(from, to, &WALL, &[[0, 1, 2]]);
        assert!(blocks([0.0; 3], [2.0, 0.0, 0.0]) && blocks([2.0, 0.0, 0.0], [0.0; 3]));
        assert!(!blocks([0.0; 3], [0.9, 0.0, 0.0]), "before it");
        assert!(
            !blocks([0.0; 3], [2.0, 3.0, 0.0]),
            "beside it: it crosses its plane at y = 1.5, beyond the edge"
        );
        assert!(!blocks([1.0, 0.0, 0.0], [2.0, 0.0, 0.0]), "on it");
        assert!(!blocks([0.0; 3], [0.0, 5.0, 0.0]), "along it");
        assert!(!blocked([0.0; 3], [2.0, 0.0, 0.0], &WALL, &[[0, 1, 9]]), "no such vertex");
        assert!(!blocked([0.0; 3], [2.0, 0.0, 0.0], &[], &[]));
    }

    #[test]
    fn muffled_sound_is_6_db_softer_and_3_db_less_again_at_the_cutoff() {
        let fs = 96_000.0;
        let level = |hz: f64| {
            let mut muffle = Muffle::new(1500.0, 0.5, 0.05, fs);
            let tone = |k: usize| (std::f64::consts::TAU * hz * k as f64 / fs).sin() as f32;
            let out: Vec<f64> = (0..96_000).map(|k| f64::from(muffle.next(tone(k), true))).collect();
            let square = out[48_000..].iter().map(|x| x * x).sum::<f64>() / 48_000.0;
            10.0 * (2.0 * square).log10()
        };
        assert!((level(20.0) + 6.02).abs() < 0.05, "{}", level(20.0));
        assert!((level(1500.0) + 9.03).abs() < 0.3, "{}", level(1500.0));
        assert!(level(12_000.0) < -22.0);
    }

    #[test]
    fn going_behind_a_body_takes_50_ms_and_free_sound_is_untouched() {
        let mut muffle = Muffle::new(1500.0, 0.5, 0.05, 48_000.0);
        assert!((0..100).all(|k| muffle.next(k as f32, false) == k as f32));
        let mut muffle = Muffle::new(1500.0, 0.5, 0.05, 48_000.0);
        (0..4800).for_each(|_| {
            muffle.next(1.0, false);
        });
        let out: Vec<f32> = (0..4800).map(|_| muffle.next(1.0, true)).collect();
        let expected = 1.0 - 0.5 * (1.0 - (-1.0_f32).exp());
        assert!((out[2399] - expected).abs() < 1e-3, "{}", out[2399]);
        assert!(out.windows(2).all(|w| (w[1] - w[0]).abs() < 3e-4), "no step");
    }
}
