//! Synthetic meshes with known motion, for tests and demonstrations.

use std::f64::consts::{PI, TAU};

use super::Topology;

/// A mesh whose positions are a function of time.
///
/// # Shapes
/// `positions(t)` writes one position per vertex of `topology()`, in metres with Z up; the rest pose is that of `t = 0`.
pub trait Synthetic {
    /// Triangles and rest pose.
    fn topology(&self) -> Topology;

    /// Writes the positions at a time in seconds into `out`, up to the shorter of both lengths.
    fn positions(&self, t: f64, out: &mut [[f32; 3]]);
}

/// Vertices of a grid of `nx` by `ny`, row by row, centred on the origin.
fn grid_points(nx: usize, ny: usize, size: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let coordinate = |k: usize, n: usize, length: f64| length * (k as f64 / (n - 1) as f64 - 0.5);
    (0..nx * ny).map(move |k| [coordinate(k % nx, nx, size[0]), coordinate(k / nx, ny, size[1])])
}

/// Triangles of a grid whose first vertex has index `first`, facing +z.
fn grid_triangles(nx: usize, ny: usize, first: usize, out: &mut Vec<[u32; 3]>) {
    for y in 0..ny - 1 {
        for x in 0..nx - 1 {
            let a = (first + y * nx + x) as u32;
            let (b, c) = (a + 1, a + nx as u32);
            out.push([a, b, c + 1]);
            out.push([a, c + 1, c]);
        }
    }
}

fn write(out: &mut [[f32; 3]], points: impl Iterator<Item = [f64; 3]>) {
    out.iter_mut().zip(points).for_each(|(o, p)| *o = p.map(|x| x as f32));
}

/// Topology of a synthetic mesh with the rest pose of time 0.
fn topology_at_rest(synthetic: &impl Synthetic, vertices: usize, triangles: Vec<[u32; 3]>) -> Topology {
    let mut rest = vec![[0.0; 3]; vertices];
    synthetic.positions(0.0, &mut rest);
    Topology { rest, triangles }
}

/// Topology of a sheet with as many vertices along x and y, in the rest pose of time 0.
fn sheet_topology(sheet: &impl Synthetic, vertices: [usize; 2]) -> Topology {
    let (nx, ny) = counts(vertices);
    let mut triangles = Vec::new();
    grid_triangles(nx, ny, 0, &mut triangles);
    topology_at_rest(sheet, nx * ny, triangles)
}

/// A flat sheet in the plane z = 0 that moves with a constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatSheet {
    /// Vertices along x and y; fewer than 2 count as 2.
    pub vertices: [usize; 2],
    /// Size in metres.
    pub size: [f64; 2],
    /// Velocity in m/s.
    pub velocity: [f64; 3],
}

fn counts(n: [usize; 2]) -> (usize, usize) {
    (n[0].max(2), n[1].max(2))
}

impl Synthetic for FlatSheet {
    fn topology(&self) -> Topology {
        sheet_topology(self, self.vertices)
    }

    fn positions(&self, t: f64, out: &mut [[f32; 3]]) {
        let (nx, ny) = counts(self.vertices);
        let v = self.velocity.map(|v| v * t);
        write(out, grid_points(nx, ny, self.size).map(|[x, y]| [x + v[0], y + v[1], v[2]]));
    }
}

/// Two flat sheets at a distance of `gap`; the upper one slides along x, so that the slip speed is `speed` at time 0 and grows by
/// `acceleration`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlidingPlanes {
    /// Vertices of each sheet along x and y; fewer than 2 count as 2.
    pub vertices: [usize; 2],
    /// Size of each sheet in metres.
    pub size: [f64; 2],
    /// Distance between the sheets in metres.
    pub gap: f64,
    /// Speed of the upper sheet along x in m/s, at time 0.
    pub speed: f64,
    /// Acceleration of the upper sheet along x in m/s².
    pub acceleration: f64,
}

impl Synthetic for SlidingPlanes {
    fn topology(&self) -> Topology {
        let (nx, ny) = counts(self.vertices);
        let mut triangles = Vec::new();
        grid_triangles(nx, ny, 0, &mut triangles);
        grid_triangles(nx, ny, nx * ny, &mut triangles);
        topology_at_rest(self, 2 * nx * ny, triangles)
    }

    fn positions(&self, t: f64, out: &mut [[f32; 3]]) {
        let (nx, ny) = counts(self.vertices);
        let (gap, shift) = (self.gap, (self.speed + 0.5 * self.acceleration * t) * t);
        let lower = grid_points(nx, ny, self.size).map(|[x, y]| [x, y, 0.0]);
        let upper = grid_points(nx, ny, self.size).map(move |[x, y]| [x + shift, y, gap]);
        write(out, lower.chain(upper));
    }
}

/// A sheet with a travelling wave z = amplitude sin(2 pi (x / wavelength - frequency t)).
///
/// Its mean curvature is h'' / (2 (1 + h'^2)^(3/2)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SineSheet {
    /// Vertices along x and y; fewer than 2 count as 2.
    pub vertices: [usize; 2],
    /// Size in metres.
    pub size: [f64; 2],
    /// Amplitude in metres.
    pub amplitude: f64,
    /// Wavelength along x in metres.
    pub wavelength: f64,
    /// Periods per second.
    pub frequency: f64,
}

impl Synthetic for SineSheet {
    fn topology(&self) -> Topology {
        sheet_topology(self, self.vertices)
    }

    fn positions(&self, t: f64, out: &mut [[f32; 3]]) {
        let (nx, ny) = counts(self.vertices);
        let height = |x: f64| self.amplitude * libm::sin(TAU * (x / self.wavelength - self.frequency * t));
        write(out, grid_points(nx, ny, self.size).map(|[x, y]| [x, y, height(x)]));
    }
}

/// A paraboloid z = k(t) (x^2 + y^2) / 2 with k(t) = `curvature` cos(2 pi `frequency` t): it changes from a bowl to a dome
/// and back, so that every vertex buckles twice per period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bowl {
    /// Vertices along x and y; fewer than 2 count as 2.
    pub vertices: [usize; 2],
    /// Size in metres.
    pub size: [f64; 2],
    /// Mean curvature at the centre at t = 0, 1/m.
    pub curvature: f64,
    /// Periods per second.
    pub frequency: f64,
}

impl Synthetic for Bowl {
    fn topology(&self) -> Topology {
        sheet_topology(self, self.vertices)
    }

    fn positions(&self, t: f64, out: &mut [[f32; 3]]) {
        let (nx, ny) = counts(self.vertices);
        let k = self.curvature * libm::cos(TAU * self.frequency * t);
        write(out, grid_points(nx, ny, self.size).map(|[x, y]| [x, y, k * (x * x + y * y) / 2.0]));
    }
}

/// An icosphere that rotates about z: a closed surface of mean curvature 1 / radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Number of subdivisions of the triangles of an icosahedron into four; at most 7 (163,842 vertices).
    pub subdivisions: u32,
    /// Radius in metres.
    pub radius: f64,
    /// Revolutions per second about z.
    pub turns: f64,
}

impl Sphere {
    fn mesh(&self) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let g = (1.0 + 5.0f64.sqrt()) / 2.0;
        let mut points: Vec<[f64; 3]> = Vec::new();
        for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
            points.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
        }
        // Faces of an icosahedron: the triples of vertices at the distance of one edge (2), facing outward.
        let adjacent = |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>() < 4.5;
        let mut triangles = Vec::new();
        for a in 0..12u32 {
            for b in a + 1..12 {
                for c in b + 1..12 {
                    let [p, q, r] = [a, b, c].map(|k| points[k as usize]);
                    if adjacent(p, q) && adjacent(q, r) && adjacent(r, p) {
                        let cross =
                            [q[1] * r[2] - q[2] * r[1], q[2] * r[0] - q[0] * r[2], q[0] * r[1] - q[1] * r[0]];
                        let outward = (0..3).map(|k| p[k] * cross[k]).sum::<f64>() > 0.0;
                        triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                    }
                }
            }
        }
        for _ in 0..self.subdivisions.min(7) {
            let mut midpoints = std::collections::BTreeMap::new();
            let mut midpoint = |a: u32, b: u32, points: &mut Vec<[f64; 3]>| {
                *midpoints.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let (p, q) = (points[a as usize], points[b as usize]);
                    points.push(std::array::from_fn(|k| (p[k] + q[k]) / 2.0));
                    points.len() as u32 - 1
                })
            };
            let mut subdivided = Vec::with_capacity(4 * triangles.len());
            for [a, b, c] in triangles {
                let (ab, bc, ca) =
                    (midpoint(a, b, &mut points), midpoint(b, c, &mut points), midpoint(c, a, &mut points));
                subdivided.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
            }
            triangles = subdivided;
            for p in &mut points {
                let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
                p.iter_mut().for_each(|x| *x /= length);
            }
        }
        for p in &mut points {
            let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
            p.iter_mut().for_each(|x| *x *= self.radius / length);
        }
        (points, triangles)
    }
}

impl Synthetic for Sphere {
    fn topology(&self) -> Topology {
        let (points, triangles) = self.mesh();
        topology_at_rest(self, points.len(), triangles)
    }

    fn positions(&self, t: f64, out: &mut [[f32; 3]]) {
        let (s, c) = (libm::sin(TAU * self.turns * t), libm::cos(TAU * self.turns * t));
        let (points, _) = self.mesh();
        write(out, points.into_iter().map(|[x, y, z]| [c * x - s * y, s * x + c * y, z]));
    }
}

/// An open tube about z that twists: the rotation angle grows along z from 0 to 2 pi `twist` sin(2 pi `frequency` t).
///
/// Its mean curvature at rest is 1 / (2 radius).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Vertices around z (fewer than 3 count as 3) and along z (fewer than 2 count as 2).
    pub vertices: [usize; 2],
    /// Radius in metres.
    pub radius: f64,
    /// Length in metres.
    pub length: f64,
    /// Maximum twist between the ends, revolutions.
    pub twist: f64,
    /// Periods of the twist per second.
    pub frequency: f64,
}

impl Synthetic for Cylinder {
    fn topology(&self) -> Topology {
        let (around, along) = (self.vertices[0].max(3), self.vertices[1].max(2));
        let mut triangles = Vec::new();
        for z in 0..along - 1 {
            for k in 0..around {
                let next = (k + 1) % around;
                let [a, b] = [k, next].map(|k| (z * around + k) as u32);
                let [c, d] = [k, next].map(|k| ((z + 1) * around + k) as u32);
                triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
        topology_at_rest(self, around * along, triangles)
    }

    fn positions(&self, t: f64, out: &mut [[f32; 3]]) {
        let (around, along) = (self.vertices[0].max(3), self.vertices[1].max(2));
        let twist = TAU * self.twist * libm::sin(TAU * self.frequency * t);
        let points = (0..around * along).map(|k| {
            let z = (k / around) as f64 / (along - 1) as f64;
            let angle = 2.0 * PI * (k % around) as f64 / around as f64 + twist * z;
            [self.radius * libm::cos(angle), self.radius * libm::sin(angle), self.length * (z - 0.5)]
        });
        write(out, points);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::MeshPrepare;

    fn volume(t: &Topology) -> f64 {
        t.triangles
            .iter()
            .map(|f| {
                let [a, b, c] = f.map(|v| t.rest[v as usize].map(f64::from));
                (a[0] * (b[1] * c[2] - b[2] * c[1])
                    + a[1] * (b[2] * c[0] - b[0] * c[2])
                    + a[2] * (b[0] * c[1] - b[1] * c[0]))
                    / 6.0
            })
            .sum()
    }

    #[test]
    fn a_fine_icosphere_is_closed_and_has_the_volume_of_a_ball() {
        let t = Sphere { subdivisions: 4, radius: 0.5, turns: 0.0 }.topology();
        assert_eq!((t.rest.len(), t.triangles.len()), (2562, 5120));
        assert!((volume(&t) / (4.0 / 3.0 * PI * 0.125) - 1.0).abs() < 0.01, "{}", volume(&t));
        let prepared = MeshPrepare::new(&t).unwrap();
        assert_eq!((prepared.flipped(), prepared.component_count()), (0, 1));
        assert!(prepared.boundary().iter().all(|b| !b));
    }

    #[test]
    fn a_sliding_plane_moves_by_speed_times_time() {
        let planes =
            SlidingPlanes { vertices: [4, 3], size: [1.0, 1.0], gap: 0.01, speed: 0.3, acceleration: 0.0 };
        let t = planes.topology();
        let mut later = t.rest.clone();
        planes.positions(0.5, &mut later);
        assert_eq!(t.rest[..12], later[..12]);
        assert!(
            t.rest[12..]
                .iter()
                .zip(&later[12..])
                .all(|(a, b)| (b[0] - a[0] - 0.15).abs() < 1e-6 && a[2] == 0.01)
        );
        assert_eq!(MeshPrepare::new(&t).unwrap().component_count(), 2);
    }

    #[test]
    fn a_bowl_is_a_dome_after_half_a_period() {
        let bowl = Bowl { vertices: [5, 5], size: [0.2, 0.2], curvature: 4.0, frequency: 1.0 };
        let (t, mut dome) = (bowl.topology(), vec![[0.0; 3]; 25]);
        bowl.positions(0.5, &mut dome);
        assert!((t.rest[0][2] - 0.04).abs() < 1e-7);
        assert!(t.rest.iter().zip(&dome).all(|(a, b)| (a[2] + b[2]).abs() < 1e-7));
    }

    #[test]
    fn sheets_face_up_and_a_tube_faces_outward() {
        let sheet =
            SineSheet { vertices: [3, 3], size: [1.0, 1.0], amplitude: 0.0, wavelength: 1.0, frequency: 1.0 };
        for f in sheet.topology().triangles {
            let t = sheet.topology();
            let [a, b, c] = f.map(|v| t.rest[v as usize]);
            assert!((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0);
        }
        let tube = Cylinder { vertices: [64, 2], radius: 0.1, length: 1.0, twist: 0.25, frequency: 1.0 };
        // Without caps a tube centred on the origin encloses two thirds of its volume.
        assert!((volume(&tube.topology()) / (PI * 0.01 * 2.0 / 3.0) - 1.0).abs() < 0.01);
        let flat = FlatSheet { vertices: [0, 0], size: [1.0, 1.0], velocity: [0.0; 3] };
        assert_eq!(flat.topology().triangles.len(), 2);
    }
}
