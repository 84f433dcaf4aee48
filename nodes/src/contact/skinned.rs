//! Cloth that only follows its skeleton: an approximate lag behind its body, and where its joints bend.

use super::vector::{Vec3, add, cross, dot, norm, scale, sub, widen};
use crate::impl_state;
use crate::mesh::{Regions, Topology};

/// A damped spring between each skinned place of a garment and the cloth that would be there.
///
/// With x the skinned place and y the cloth, `y'' = w^2 (x - y) + 2 d w (x' - y')`. The lag `y - x` swings freely while the skin
/// moves evenly, and takes a step of speed wherever the skin changes its own; both are exact for places on straight lines from
/// frame to frame, so no frame rate makes it unstable.
#[derive(Clone, Debug)]
pub struct Lag {
    /// Of (lag, speed) over one frame: lag from lag, lag from speed, speed from lag, speed from speed.
    over: [f64; 4],
    dt: f64,
    lags: Vec<Vec3>,
    speeds: Vec<Vec3>,
    /// Speed of the skin in the last frame.
    skin: Vec<Vec3>,
    last: Vec<[f32; 3]>,
    frames: u64,
}
impl_state!(Lag { lags, speeds, skin, last, frames });

impl Lag {
    /// At rest, for `vertices` at `rate` frames per second; `frequency` in Hz, `damping` below 1.
    #[must_use]
    pub fn new(vertices: usize, rate: f64, frequency: f64, damping: f64) -> Self {
        let (dt, w) = (1.0 / rate, std::f64::consts::TAU * frequency);
        let swing = w * (1.0 - damping * damping).max(1e-12).sqrt();
        let (fall, sin, cos) = (libm::exp(-damping * w * dt), libm::sin(swing * dt), libm::cos(swing * dt));
        let held = damping * w / swing * sin;
        let over = [cos + held, sin / swing, -w * w / swing * sin, cos - held].map(|x| fall * x);
        let zeros = vec![[0.0; 3]; vertices];
        let (lags, speeds, skin) = (zeros.clone(), zeros.clone(), zeros);
        Self { over, dt, lags, speeds, skin, last: vec![[0.0; 3]; vertices], frames: 0 }
    }

    /// Takes the next frame of skinned places.
    pub fn take(&mut self, places: &[[f32; 3]]) {
        for (v, place) in places.iter().enumerate().take(self.last.len()) {
            let moved = scale(sub(widen(*place), widen(self.last[v])), 1.0 / self.dt);
            // What moves from the first frame on has always done so.
            if self.frames > 1 {
                self.speeds[v] = sub(self.speeds[v], sub(moved, self.skin[v]));
            }
            if self.frames > 0 {
                let (lag, speed) = (self.lags[v], self.speeds[v]);
                self.lags[v] = add(scale(lag, self.over[0]), scale(speed, self.over[1]));
                self.speeds[v] = add(scale(lag, self.over[2]), scale(speed, self.over[3]));
                self.skin[v] = moved;
            }
            self.last[v] = *place;
        }
        self.frames += 1;
    }

    /// How fast each vertex of the cloth slides along the surface that the last frame's triangles make.
    ///
    /// # Shapes
    /// `out: [vertices]`, m/s.
    pub fn slip(&self, triangles: &[[u32; 3]], normals: &mut [Vec3], out: &mut [f32]) {
        surface_normals(&self.last, triangles, normals);
        for ((out, speed), normal) in out.iter_mut().zip(&self.speeds).zip(&*normals) {
            let along = sub(*speed, scale(*normal, dot(*speed, *normal)));
            *out = norm(along) as f32;
        }
    }
}

/// Normals of vertices, weighted by area; zero where there is no triangle.
fn surface_normals(places: &[[f32; 3]], triangles: &[[u32; 3]], normals: &mut [Vec3]) {
    normals.fill([0.0; 3]);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| places.get(v as usize).copied().map(widen).unwrap_or_default());
        let twice = cross(sub(b, a), sub(c, a));
        for &v in triangle {
            if let Some(normal) = normals.get_mut(v as usize) {
                *normal = add(*normal, twice);
            }
        }
    }
    for normal in normals {
        let length = norm(*normal);
        *normal = if length > 0.0 { scale(*normal, 1.0 / length) } else { [0.0; 3] };
    }
}

/// A part of a garment, in which edges are stretched and squeezed together where a joint bends.
#[derive(Clone, Debug, Default)]
struct Region {
    edges: Vec<[u32; 2]>,
    /// Lengths at rest.
    rest: Vec<f64>,
    vertices: Vec<u32>,
    area: f64,
    strain: f64,
    /// Whether the last change was fast, until it is slow.
    fast: bool,
}
impl_state!(Region { strain, fast });

/// A region that starts to bend fast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// Lowest vertex of the region.
    pub id: u32,
    /// Vertices of the region.
    pub vertices: u32,
    /// Change of its mean strain per second.
    pub rate: f64,
    /// Its area at rest, m^2.
    pub area: f64,
    /// Its middle, m.
    pub position: [f32; 3],
}

/// Strains of the regions of a garment.
#[derive(Clone, Debug)]
pub struct Bends {
    regions: Vec<Region>,
    /// Change of strain per second from which on a region is fast; at half of it it is slow again.
    threshold: f64,
    dt: f64,
    frames: u64,
}
impl_state!(Bends { each regions, frames });

impl Bends {
    /// Cuts the rest pose of a garment into boxes of at most `size` metres.
    #[must_use]
    pub fn new(topology: &Topology, areas: &[f32], size: f64, threshold: f64, rate: f64) -> Self {
        let cut = Regions::new(&topology.rest, size);
        let area = |v: &u32| f64::from(areas.get(*v as usize).copied().unwrap_or(0.0));
        let region = |vertices: Vec<u32>| Region {
            area: vertices.iter().map(area).sum(),
            vertices,
            ..Region::default()
        };
        let mut regions: Vec<Region> = cut.vertices.into_iter().map(region).collect();
        let sides = topology.triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
        let mut edges: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges.dedup();
        for edge in edges {
            let length = length(&topology.rest, edge);
            let region = cut.of_vertex.get(edge[0] as usize).and_then(|of| regions.get_mut(*of as usize));
            if let Some(region) = region.filter(|_| length > 0.0) {
                region.edges.push(edge);
                region.rest.push(length);
            }
        }
        Self { regions, threshold, dt: 1.0 / rate, frames: 0 }
    }

    /// Takes the next frame, and gives the regions that have begun to bend fast.
    pub fn take(&mut self, places: &[[f32; 3]], mut found: impl FnMut(Bend)) {
        for region in &mut self.regions {
            let strain = region.mean_strain(places);
            let rate = (strain - region.strain) / self.dt;
            region.strain = strain;
            if self.frames == 0 {
                continue;
            }
            if !region.fast && rate.abs() > self.threshold {
                region.fast = true;
                found(region.bend(rate, places));
            } else if rate.abs() < 0.5 * self.threshold {
                region.fast = false;
            }
        }
        self.frames += 1;
    }
}

fn length(places: &[[f32; 3]], [a, b]: [u32; 2]) -> f64 {
    let at = |v: u32| places.get(v as usize).copied().map(widen).unwrap_or_default();
    norm(sub(at(b), at(a)))
}

impl Region {
    /// Mean of the changes of length over the length at rest, however they are signed: a bent joint has both.
    fn mean_strain(&self, places: &[[f32; 3]]) -> f64 {
        let each =
            self.edges.iter().zip(&self.rest).map(|(edge, rest)| (length(places, *edge) / rest - 1.0).abs());
        each.sum::<f64>() / self.edges.len().max(1) as f64
    }

    fn bend(&self, rate: f64, places: &[[f32; 3]]) -> Bend {
        let sum = self
            .vertices
            .iter()
            .filter_map(|v| places.get(*v as usize))
            .fold([0.0; 3], |sum, p| add(sum, widen(*p)));
        let count = self.vertices.len().max(1) as f64;
        Bend {
            id: self.vertices.first().copied().unwrap_or(0),
            vertices: self.vertices.len() as u32,
            rate,
            area: self.area,
            position: sum.map(|x| (x / count) as f32),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{FlatSheet, Synthetic};

    /// The lag at `times` of one vertex that goes along the first axis, at some frames per second.
    fn lag(rate: f64, frames: usize, at: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let mut lag = Lag::new(1, rate, 3.0, 0.5);
        let place = |k: usize| [at(k as f64 / rate) as f32, 0.0, 0.0];
        (0..frames)
            .map(|k| {
                lag.take(&[place(k)]);
                (lag.lags[0][0], lag.speeds[0][0])
            })
            .collect()
    }

    #[test]
    fn a_skin_that_stops_leaves_a_damped_swing_at_any_frame_rate() {
        // 1 m/s until it stops at 0.5 s: the cloth goes on.
        let at = |t: f64| t.min(0.5);
        let (w, d) = (std::f64::consts::TAU * 3.0, 0.5);
        let swing = w * (1.0_f64 - d * d).sqrt();
        for rate in [20.0, 60.0, 240.0] {
            let found = lag(rate, (1.5 * rate) as usize, at);
            for (k, (place, speed)) in found.iter().enumerate() {
                let t = k as f64 / rate - 0.5;
                let (s, c) = (swing * t).sin_cos();
                let wanted = if t > 1e-9 {
                    let fall = (-d * w * t).exp();
                    [fall * s / swing, fall * (c - d * w / swing * s)]
                } else {
                    [0.0, 0.0]
                };
                assert!(
                    (place - wanted[0]).abs() < 2e-5 && (speed - wanted[1]).abs() < 2e-4,
                    "{rate} {k}: {place} {speed}"
                );
            }
        }
    }

    #[test]
    fn what_moves_evenly_does_not_lag_and_steady_acceleration_lags_by_a_over_w_squared() {
        assert!(lag(60.0, 100, |t| 3.0 * t).iter().all(|(x, v)| x.abs() < 1e-5 && v.abs() < 1e-3));
        let w = std::f64::consts::TAU * 3.0;
        let (x, v) = lag(240.0, 960, |t| 0.5 * t * t).last().copied().unwrap();
        assert!((x + 1.0 / (w * w)).abs() < 2e-5 && v.abs() < 5e-3, "{x} {v}");
    }

    #[test]
    fn only_what_goes_along_the_surface_is_slip() {
        let sheet = FlatSheet { vertices: [4, 4], size: [0.3, 0.3], velocity: [0.0; 3] }.topology();
        let slips = |velocity: [f32; 3]| {
            let n = sheet.rest.len();
            let mut lag = Lag::new(n, 60.0, 3.0, 0.5);
            let moved = |t: f32| -> Vec<[f32; 3]> {
                sheet.rest.iter().map(|p| std::array::from_fn(|k| p[k] + velocity[k] * t)).collect()
            };
            // It rests for two frames, and then goes.
            for t in [0.0, 0.0, 1.0 / 60.0] {
                lag.take(&moved(t));
            }
            let (mut normals, mut out) = (vec![[0.0; 3]; n], vec![9.0; n]);
            lag.slip(&sheet.triangles, &mut normals, &mut out);
            out
        };
        assert!(slips([0.0, 0.0, 1.0]).iter().all(|s| *s < 1e-4), "away from the body");
        let along = slips([1.0, 0.0, 0.0]);
        assert!(along.iter().all(|s| (s - along[0]).abs() < 1e-4) && along[0] > 0.3, "{along:?}");
        let both = slips([1.0, 0.0, 5.0]);
        assert!((both[0] - along[0]).abs() < 1e-3);
    }

    #[test]
    fn a_joint_that_bends_fast_is_told_once_until_it_rests() {
        let sheet = FlatSheet { vertices: [9, 3], size: [0.8, 0.2], velocity: [0.0; 3] }.topology();
        let areas = vec![0.01; sheet.rest.len()];
        let mut bends = Bends::new(&sheet, &areas, 0.2, 0.5, 60.0);
        // What lies beyond 0.4 m is squeezed by up to a fifth.
        let squeezed = |by: f32| -> Vec<[f32; 3]> {
            let middle = sheet.rest.iter().map(|p| p[0]).fold(f32::MIN, f32::max) - 0.3;
            sheet
                .rest
                .iter()
                .map(|&[x, y, z]| [if x > middle { middle + (x - middle) * (1.0 - by) } else { x }, y, z])
                .collect()
        };
        let mut told = Vec::new();
        let strains: Vec<f32> = (0..60)
            .map(|k| match k {
                0..10 => 0.0,
                10..20 => 0.02 * (k - 9) as f32,
                20..40 => 0.2,
                40..50 => 0.2 - 0.02 * (k - 39) as f32,
                _ => 0.0,
            })
            .collect();
        for (k, by) in strains.into_iter().enumerate() {
            bends.take(&squeezed(by), |bend| told.push((k, bend)));
        }
        assert!(!told.is_empty() && told.iter().all(|(k, _)| [10, 40].contains(k)), "{told:?}");
        let rising: Vec<_> = told.iter().filter(|(k, _)| *k == 10).collect();
        assert!(rising.len() * 2 == told.len() && rising.iter().all(|(_, b)| b.rate > 0.5), "{told:?}");
        assert!(told.iter().filter(|(k, _)| *k == 40).all(|(_, b)| b.rate < -0.5));
        // A garment that turns as a whole has no strain.
        let mut still = Bends::new(&sheet, &areas, 0.2, 0.5, 60.0);
        for k in 0..20 {
            let (s, c) = (0.2 * k as f32).sin_cos();
            let turned: Vec<[f32; 3]> =
                sheet.rest.iter().map(|&[x, y, z]| [c * x - s * y, s * x + c * y, z]).collect();
            still.take(&turned, |bend| panic!("{bend:?}"));
        }
    }
}
