//! Triangulation of polygons: a fan for a convex polygon, ear clipping for a concave one.

use super::MeshError;

/// Maximum number of corners of a concave polygon: ear clipping takes quadratic time.
pub const MAX_CORNERS: usize = 1024;

/// Triangles of a list of polygons.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Triangulation {
    /// Corner indices, with the winding of the polygons.
    pub triangles: Vec<[u32; 3]>,
    /// Polygons and triangles left out because they have fewer than three different vertices.
    pub dropped: usize,
}

/// Triangulates polygons one after the other.
#[derive(Debug, Default)]
pub struct Triangulator {
    result: Triangulation,
    face: usize,
    corners: Vec<u32>,
    projected: Vec<[f64; 2]>,
    ring: Vec<usize>,
    is_ear: Vec<bool>,
}

impl Triangulator {
    /// An empty triangulation.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds one polygon over `positions`.
    ///
    /// Repeated neighbouring corners count once. A triangle of three different vertices without area stays: it may
    /// have area in a later frame.
    ///
    /// # Errors
    /// A corner outside of `positions`, or a concave polygon of more than [`MAX_CORNERS`] corners.
    ///
    /// # Complexity
    /// O(n) for a convex polygon of n corners, else O(n^2).
    ///
    /// # Source
    /// Meisters, "Polygons have ears" (1975); the normal of the plane is Newell's.
    pub fn push(&mut self, positions: &[[f64; 3]], corners: &[u32]) -> Result<(), MeshError> {
        let face = self.face;
        self.face += 1;
        self.corners.clear();
        for &c in corners {
            if c as usize >= positions.len() {
                return Err(MeshError::FaceIndex { face, vertex: i64::from(c), vertices: positions.len() });
            }
            if self.corners.last() != Some(&c) {
                self.corners.push(c);
            }
        }
        while self.corners.len() > 1 && self.corners.first() == self.corners.last() {
            self.corners.pop();
        }
        match self.corners.len() {
            0..=2 => self.result.dropped += 1,
            3 => self.emit(0, 1, 2),
            n => {
                self.project(positions);
                if self.is_convex() {
                    for k in 1..n - 1 {
                        self.emit(0, k, k + 1);
                    }
                } else if n > MAX_CORNERS {
                    return Err(MeshError::Malformed {
                        format: "mesh",
                        what: format!(
                            "face {face} is concave and has {n} corners, at most {MAX_CORNERS} can be split: \
                             triangulate it before export"
                        ),
                    });
                } else {
                    self.clip_ears();
                }
            }
        }
        Ok(())
    }

    /// Number of triangles so far.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.result.triangles.len()
    }

    /// The triangles of all polygons.
    #[must_use]
    pub fn finish(self) -> Triangulation {
        self.result
    }

    fn emit(&mut self, a: usize, b: usize, c: usize) {
        let t = [self.corners[a], self.corners[b], self.corners[c]];
        if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
            self.result.dropped += 1;
        } else {
            self.result.triangles.push(t);
        }
    }

    /// Projects along the largest component of Newell's normal, so that the polygon is anticlockwise in the plane.
    fn project(&mut self, positions: &[[f64; 3]]) {
        let n = self.corners.len();
        let origin = positions[self.corners[0] as usize];
        let local = |c: u32| {
            let p = positions[c as usize];
            [p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]]
        };
        let mut normal = [0.0; 3];
        for k in 0..n {
            let (p, q) = (local(self.corners[k]), local(self.corners[(k + 1) % n]));
            normal[0] += (p[1] - q[1]) * (p[2] + q[2]);
            normal[1] += (p[2] - q[2]) * (p[0] + q[0]);
            normal[2] += (p[0] - q[0]) * (p[1] + q[1]);
        }
        let axis = (0..3).fold(0, |best, k| if normal[k].abs() > normal[best].abs() { k } else { best });
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            std::mem::swap(&mut u, &mut v);
        }
        self.projected.clear();
        self.projected.extend(self.corners.iter().map(|&c| {
            let p = local(c);
            [p[u], p[v]]
        }));
    }

    /// Twice the signed area of a triangle in the plane; positive if it is anticlockwise.
    fn orientation(&self, a: usize, b: usize, c: usize) -> f64 {
        let (a, b, c) = (self.projected[a], self.projected[b], self.projected[c]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    }

    /// Returns true if no corner turns right and the outline goes round once.
    fn is_convex(&self) -> bool {
        let n = self.projected.len();
        if (0..n).any(|k| self.orientation((k + n - 1) % n, k, (k + 1) % n) < 0.0) {
            return false;
        }
        // A self-intersecting star turns left at every corner too, but not in its fan.
        (1..n - 1).all(|k| self.orientation(0, k, k + 1) >= 0.0)
    }

    fn check_ear(&self, index: usize) -> bool {
        let n = self.ring.len();
        let (a, b, c) = (self.ring[(index + n - 1) % n], self.ring[index], self.ring[(index + 1) % n]);
        if self.orientation(a, b, c) <= 0.0 {
            return false;
        }
        self.ring.iter().all(|&p| {
            let q = self.projected[p];
            // A hole is often connected through duplicate corners: a point on a corner of the ear does not block it.
            [a, b, c].iter().any(|&k| k == p || self.projected[k] == q)
                || self.orientation(a, b, p) < 0.0
                || self.orientation(b, c, p) < 0.0
                || self.orientation(c, a, p) < 0.0
        })
    }

    fn clip_ears(&mut self) {
        self.ring.clear();
        self.ring.extend(0..self.corners.len());
        self.is_ear = (0..self.ring.len()).map(|k| self.check_ear(k)).collect();
        while self.ring.len() > 3 {
            // Without an ear the outline crosses itself or has no area: take any corner.
            let index = self.is_ear.iter().position(|&e| e).unwrap_or(0);
            let n = self.ring.len();
            self.emit(self.ring[(index + n - 1) % n], self.ring[index], self.ring[(index + 1) % n]);
            self.ring.remove(index);
            self.is_ear.remove(index);
            let n = self.ring.len();
            for k in [(index + n - 1) % n, index % n] {
                self.is_ear[k] = self.check_ear(k);
            }
        }
        self.emit(self.ring[0], self.ring[1], self.ring[2]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn split(points: &[[f64; 3]], corners: &[u32]) -> Triangulation {
        let mut t = Triangulator::new();
        t.push(points, corners).unwrap();
        t.finish()
    }

    fn area(points: &[[f64; 3]], t: [u32; 3]) -> f64 {
        let [a, b, c] = t.map(|i| points[i as usize]);
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
    }

    #[test]
    fn a_convex_quad_becomes_a_fan() {
        let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(split(&p, &[0, 1, 2, 3]).triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_concave_quad_is_split_at_its_concave_corner() {
        let p = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.4, 0.4, 0.0], [0.0, 2.0, 0.0]];
        let t = split(&p, &[1, 2, 3, 0]).triangles;
        assert_eq!(t.len(), 2);
        assert!(t.iter().all(|&t| area(&p, t) > 0.0), "{t:?}");
    }

    #[test]
    fn repeated_corners_are_dropped_and_counted() {
        let p = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        let mut t = Triangulator::new();
        t.push(&p, &[0, 1, 1]).unwrap();
        t.push(&p, &[2, 2]).unwrap();
        t.push(&p, &[0, 1, 1, 2]).unwrap();
        assert_eq!(t.finish(), Triangulation { triangles: vec![[0, 1, 2]], dropped: 2 });
    }

    #[test]
    fn a_corner_outside_of_the_mesh_names_the_face() {
        let mut t = Triangulator::new();
        let error = t.push(&[[0.0; 3]], &[0, 7, 0]).unwrap_err();
        assert!(matches!(error, MeshError::FaceIndex { face: 0, vertex: 7, vertices: 1 }));
    }

    #[test]
    fn a_polygon_without_area_terminates() {
        let p = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0], [2.0, 0.0, 0.0], [0.25, 0.0, 0.0]];
        assert_eq!(split(&p, &[0, 1, 2, 3, 4]).triangles.len(), 3);
    }

    proptest! {
        #[test]
        fn the_triangles_of_a_star_shaped_polygon_cover_its_area(
            radii in prop::collection::vec(0.2..2.0f64, 4..24), tilt in 0.0..1.4f64,
        ) {
            let n = radii.len();
            let flat: Vec<[f64; 3]> = radii.iter().enumerate().map(|(k, r)| {
                let a = std::f64::consts::TAU * k as f64 / n as f64;
                [r * a.cos(), r * a.sin(), 0.0]
            }).collect();
            let tilted: Vec<[f64; 3]> =
                flat.iter().map(|p| [p[0], p[1] * tilt.cos(), p[1] * tilt.sin()]).collect();
            let corners: Vec<u32> = (0..n as u32).collect();
            let expected: f64 = (0..n).map(|k| {
                let (p, q) = (flat[k], flat[(k + 1) % n]);
                (p[0] * q[1] - p[1] * q[0]) / 2.0
            }).sum();
            let t = split(&tilted, &corners).triangles;
            prop_assert_eq!(t.len(), n - 2);
            prop_assert!(t.iter().all(|&t| area(&flat, t) > -1e-12));
            let sum: f64 = t.iter().map(|&t| area(&flat, t)).sum();
            prop_assert!((sum - expected).abs() < 1e-9, "{} {}", sum, expected);
        }
    }
}
