//! Data that several works share, from the formulas of the other programs' scripts.

use foley_nodes::mesh::Topology;
use foley_nodes::texture::Grid;
use std::f32::consts::{PI, TAU};

/// A small generator (xorshift), the same as that of the other Rust programs.
pub struct Rng(pub u64);

impl Rng {
    /// Uniform on `[-1, 1)`.
    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Uniform on `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (high - low) * (self.uniform() + 1.0)
    }

    /// Normal, of variance 1: the sum of 12 uniform numbers.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| 0.5 * self.uniform()).sum()
    }

    /// Exponential, of mean 1.
    pub fn exponential(&mut self) -> f64 {
        -(1.0 - self.between(0.0, 1.0)).ln()
    }
}

/// Normal noise.
pub fn noise(seed: u64, samples: usize) -> Vec<f32> {
    let mut rng = Rng(seed);
    (0..samples).map(|_| rng.normal() as f32).collect()
}

/// A first-order autoregressive sequence of vectors, of variance 1: each is 0.9 times the one before and noise.
pub fn autoregressive(seed: u64, dims: usize, count: usize) -> Vec<f32> {
    let mut rng = Rng(seed);
    let mut last: Vec<f64> = (0..dims).map(|_| rng.normal()).collect();
    let mut out = Vec::with_capacity(count * dims);
    for _ in 0..count {
        for x in &mut last {
            *x = 0.9 * *x + 0.19_f64.sqrt() * rng.normal();
            out.push(*x as f32);
        }
    }
    out
}

/// Smooth noise between 0 and 1: B-splines over random numbers at every 16th pixel.
pub fn smooth_noise(n: usize) -> Grid {
    let (mut rng, m) = (Rng(9), n / 16 + 4);
    let coarse: Vec<f32> = (0..m * m).map(|_| rng.uniform() as f32).collect();
    let weights = |x: usize| {
        let t = (x % 16) as f32 / 16.0;
        let u = 1.0 - t;
        [
            u * u * u / 6.0,
            (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
            (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
            t * t * t / 6.0,
        ]
    };
    Grid::from_fn(n, n, |x, y| {
        let (wx, wy) = (weights(x), weights(y));
        let at = |i: usize, j: usize| wx[i] * wy[j] * coarse[(y / 16 + j) * m + x / 16 + i];
        0.5 + 0.5 * (0..16).map(|k| at(k % 4, k / 4)).sum::<f32>()
    })
}

/// A sheet of 1 m and `n` by `n` vertices with folds that come near each other. `phase` moves the folds.
pub fn cloth(n: usize, phase: f32) -> Topology {
    let point = |k: usize| {
        let (u, v) = ((k / n) as f32 / (n - 1) as f32, (k % n) as f32 / (n - 1) as f32);
        let z = 0.10 * (9.0 * u + phase).sin() * (7.0 * v).cos() + 0.004 * (60.0 * u * v + 3.0 * phase).sin();
        [u + 0.055 * (TAU * 6.0 * u + phase).sin(), v, z]
    };
    let cell = |k: usize| [k, k + n, k + n + 1, k + 1];
    let cells = (0..n * (n - 1)).filter(|k| k % n < n - 1).map(cell);
    Topology { rest: (0..n * n).map(point).collect(), triangles: cells.flat_map(halves).collect() }
}

/// A body like a ball, of `n` by `n` vertices, under the cloth.
pub fn body(n: usize) -> Topology {
    let point = |k: usize| {
        let (u, v) = (TAU * (k / n) as f32 / n as f32, 0.01 + (PI - 0.02) * (k % n) as f32 / (n - 1) as f32);
        let r = 0.35 + 0.03 * (5.0 * u).sin() * (3.0 * v).sin();
        [0.5 + r * v.sin() * u.cos(), 0.5 + r * v.sin() * u.sin(), -0.3 + r * v.cos()]
    };
    let cell = |k: usize| {
        let next = (k + n) % (n * n);
        [k, next, next + 1, k + 1]
    };
    let cells = (0..n * n).filter(|k| k % n < n - 1).map(cell);
    Topology { rest: (0..n * n).map(point).collect(), triangles: cells.flat_map(halves).collect() }
}

/// The two triangles of four corners.
fn halves(corners: [usize; 4]) -> [[u32; 3]; 2] {
    let [a, b, c, d] = corners.map(|k| k as u32);
    [[a, b, c], [a, c, d]]
}
