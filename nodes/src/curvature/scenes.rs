//! Surfaces of known curvature in double precision, for tests.

use crate::mesh::Topology;

/// A surface.
#[derive(Clone)]
pub(crate) struct Scene {
    pub points: Vec<[f64; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

impl Scene {
    pub fn topology(&self) -> Topology {
        let rest = self.points.iter().map(|p| p.map(|x| x as f32)).collect();
        Topology { rest, triangles: self.triangles.clone() }
    }

    pub fn map(&self, f: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<[f64; 3]> {
        self.points.iter().map(|p| f(*p)).collect()
    }

    pub fn flipped(&self) -> Self {
        let triangles = self.triangles.iter().map(|t| [t[0], t[2], t[1]]).collect();
        Self { points: self.points.clone(), triangles }
    }
}

/// An icosahedron of radius 1, each triangle split into four `level` times.
pub(crate) fn icosphere(level: usize) -> Scene {
    let g = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let unit = |p: [f64; 3]| {
        let n = p.iter().map(|x| x * x).sum::<f64>().sqrt();
        p.map(|x| x / n)
    };
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let mut points: Vec<[f64; 3]> = corners.into_iter().map(unit).collect();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..level {
        let mut middles = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32, points: &mut Vec<[f64; 3]>| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let (p, q) = (points[a as usize], points[b as usize]);
                points.push(unit([p[0] + q[0], p[1] + q[1], p[2] + q[2]]));
                points.len() as u32 - 1
            })
        };
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let (d, e, f) = (middle(a, b, &mut points), middle(b, c, &mut points), middle(c, a, &mut points));
            finer.extend([[a, d, f], [b, e, d], [c, f, e], [d, e, f]]);
        }
        triangles = finer;
    }
    Scene { points, triangles }
}

/// A grid of `nx` by `ny` over the unit square, facing +z where it is flat; with parallel or alternating diagonals.
pub(crate) fn grid(nx: usize, ny: usize, alternating: bool, at: impl Fn(f64, f64) -> [f64; 3]) -> Scene {
    let coordinate = |k: usize, n: usize| k as f64 / (n - 1) as f64;
    let points = (0..nx * ny).map(|k| at(coordinate(k % nx, nx), coordinate(k / nx, ny))).collect();
    let mut triangles = Vec::new();
    for y in 0..ny - 1 {
        for x in 0..nx - 1 {
            let a = (y * nx + x) as u32;
            let (b, c, d) = (a + 1, a + nx as u32, a + nx as u32 + 1);
            if alternating && (x + y) % 2 == 1 {
                triangles.extend([[a, b, c], [b, d, c]]);
            } else {
                triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
    }
    Scene { points, triangles }
}

/// The paraboloid `z = -(q/2) r^2` over the unit square, 41 by 41.
pub(crate) fn paraboloid(q: f64) -> Scene {
    grid(41, 41, true, |u, v| {
        let (x, y) = (u - 0.5, v - 0.5);
        [x, y, -0.5 * q * (x * x + y * y)]
    })
}

/// Rotates and translates a point.
pub(crate) fn moved(p: [f64; 3], angle: f64, shift: [f64; 3]) -> [f64; 3] {
    let (s, c) = angle.sin_cos();
    let [x, y, z] = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
    let (s, c) = (0.7 * angle).sin_cos();
    [x + shift[0], c * y - s * z + shift[1], s * y + c * z + shift[2]]
}

/// A sheet with random folds, the same for the same seed.
pub(crate) fn crumpled(n: usize, seed: u64) -> Scene {
    let random = crate::core::random::Random::new(seed, "crumpled");
    let wave = |k: u64| {
        let f = |lane| random.uniform(0, k, lane);
        (9.0 * f(0) - 4.5, 9.0 * f(1) - 4.5, std::f64::consts::TAU * f(2), 0.02 + 0.02 * f(3))
    };
    let waves: Vec<_> = (0..6).map(wave).collect();
    grid(n, n, true, |u, v| {
        let z = waves.iter().map(|(a, b, phase, amplitude)| amplitude * (a * u + b * v + phase).sin()).sum();
        [u, v, z]
    })
}
