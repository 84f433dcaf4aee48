//! A shell of revolution: plates, bowls, cups, bells and tubes.

use super::element::signed_volume;
use super::error::TetMeshError;
use super::shapes::KUHN;
use super::tet_mesh::TetMesh;
use std::f64::consts::TAU;
use thiserror::Error;

/// A shell of revolution about the z axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Revolution {
    /// Points of the middle of the wall as radius and height, m; a radius of 0 is allowed for the first point only.
    pub profile: Vec<[f64; 2]>,
    /// Thickness of the wall at each point, or at all points, m.
    pub thickness: Vec<f64>,
    /// Cells around the axis.
    pub around: usize,
    /// Cells between two points of the profile.
    pub along: usize,
    /// Cells through the wall.
    pub layers: usize,
}

/// Error in a shell of revolution.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RevolutionError {
    /// Fewer than two points.
    #[error("the profile has {found} points; at least 2 are needed")]
    Points {
        /// The number found.
        found: usize,
    },
    /// Thicknesses that do not fit.
    #[error("{found} thicknesses for {points} points; one, or one for each, is needed")]
    Thicknesses {
        /// Number of thicknesses.
        found: usize,
        /// Number of points.
        points: usize,
    },
    /// A radius that is not above 0.
    #[error("point {point} of the profile has radius {found} m; it must be above 0, or 0 at the first point")]
    Radius {
        /// Number of the point, from 0.
        point: usize,
        /// The radius.
        found: f64,
    },
    /// Two equal points.
    #[error("points {point} and {} of the profile are equal", .point + 1)]
    Equal {
        /// Number of the first one, from 0.
        point: usize,
    },
    /// A wall that is thicker than the shell is wide.
    #[error(
        "the wall is so thick at point {point} of the profile that it reaches over the axis or folds: {radius:.5} m from the axis"
    )]
    Folds {
        /// Number of the point, from 0.
        point: usize,
        /// Radius of its inner side, m.
        radius: f64,
    },
    /// Cells that cannot be made.
    #[error(transparent)]
    Mesh(#[from] TetMeshError),
}

impl Revolution {
    /// The mesh: cells of six tetrahedra, of three at the axis. Edges are straight; radii are scaled so that the polygons around the axis
    /// have the area of their circles, and the mesh the volume of the shell.
    ///
    /// # Errors
    /// Profiles that do not describe a shell, and more tetrahedra than a mesh may have.
    ///
    /// # Example
    /// ```
    /// use foley_nodes::solid::mesh::revolution::Revolution;
    /// let plate = Revolution {
    ///     profile: vec![[0.0, 0.0], [0.1, 0.0]],
    ///     thickness: vec![0.004],
    ///     around: 24,
    ///     along: 6,
    ///     layers: 1,
    /// };
    /// let volume = std::f64::consts::PI * 0.1 * 0.1 * 0.004;
    /// assert!((plate.mesh()?.volume() / volume - 1.0).abs() < 1e-9);
    /// # Ok::<(), foley_nodes::solid::mesh::revolution::RevolutionError>(())
    /// ```
    pub fn mesh(&self) -> Result<TetMesh, RevolutionError> {
        self.check()?;
        let (around, layers) = (self.around.max(3), self.layers.max(1));
        let rows = self.rows()?;
        let step = TAU / around as f64;
        let widen = (step / libm::sin(step)).sqrt();
        let mut nodes = Vec::new();
        // Node of each position around, along and through the wall; at the axis all positions around share one.
        let mut first = Vec::with_capacity(rows.len());
        for sides in &rows {
            let is_axis = sides[0][0] == 0.0;
            let count = if is_axis { 1 } else { around };
            first.push((nodes.len(), count));
            for i in 0..count {
                let angle = step * i as f64;
                let (sin, cos) = (libm::sin(angle), libm::cos(angle));
                for k in 0..=layers {
                    let share = k as f64 / layers as f64;
                    let [r, z] = [0, 1].map(|c| sides[0][c] + share * (sides[1][c] - sides[0][c]));
                    nodes.push([widen * r * cos, widen * r * sin, z]);
                }
            }
        }
        let node = |i: usize, j: usize, k: usize| {
            let (start, count) = first[j];
            (start + i % count * (layers + 1) + k) as u32
        };
        let mut tets: Vec<[u32; 4]> = Vec::with_capacity(6 * around * layers * rows.len());
        for i in 0..around {
            for j in 0..rows.len() - 1 {
                for k in 0..layers {
                    let corner = |c: usize| node(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                    let cell = KUHN.map(|tet| tet.map(corner));
                    // At the axis some have two equal corners.
                    tets.extend(cell.into_iter().filter(|t| (0..4).all(|a| !t[..a].contains(&t[a]))));
                }
            }
        }
        for tet in &mut tets {
            if signed_volume(&tet.map(|c| nodes[c as usize])) < 0.0 {
                tet.swap(2, 3);
            }
        }
        Ok(TetMesh::new(nodes, tets)?)
    }

    fn check(&self) -> Result<(), RevolutionError> {
        let (points, found) = (self.profile.len(), self.thickness.len());
        if points < 2 {
            return Err(RevolutionError::Points { found: points });
        }
        if found != 1 && found != points {
            return Err(RevolutionError::Thicknesses { found, points });
        }
        for (point, [r, _]) in self.profile.iter().enumerate() {
            if !(*r > 0.0 || (*r == 0.0 && point == 0)) {
                return Err(RevolutionError::Radius { point, found: *r });
            }
        }
        match self.profile.windows(2).position(|pair| pair[0] == pair[1]) {
            Some(point) => Err(RevolutionError::Equal { point }),
            None => Ok(()),
        }
    }

    /// Both sides of the wall at each row of nodes, as radius and height.
    fn rows(&self) -> Result<Vec<[[f64; 2]; 2]>, RevolutionError> {
        let along = self.along.max(1);
        let last = self.profile.len() - 1;
        let thickness = |point: usize| self.thickness[point.min(self.thickness.len() - 1)];
        let mut rows: Vec<[[f64; 2]; 2]> = Vec::with_capacity(last * along + 1);
        let sides = |point: usize| {
            let normal = self.normal(point);
            let half = 0.5 * thickness(point);
            [1.0, -1.0].map(|side| [0, 1].map(|c| self.profile[point][c] + side * half * normal[c]))
        };
        for point in 0..last {
            let (a, b) = (sides(point), sides(point + 1));
            for step in 0..along {
                let share = step as f64 / along as f64;
                rows.push([0, 1].map(|s| [0, 1].map(|c| a[s][c] + share * (b[s][c] - a[s][c]))));
            }
        }
        rows.push(sides(last));
        for (row, pair) in rows.windows(2).enumerate() {
            // Each side runs in the direction of the profile, and stays off the axis.
            let point = row / along;
            let [[a, b], [c, d]] = [self.profile[point], self.profile[point + 1]];
            let folds = [0, 1].iter().any(|s| {
                let step = [pair[1][*s][0] - pair[0][*s][0], pair[1][*s][1] - pair[0][*s][1]];
                step[0] * (c - a) + step[1] * (d - b) <= 0.0
            });
            let radius = pair[1].iter().fold(f64::INFINITY, |m, side| m.min(side[0]));
            if folds || radius <= 0.0 {
                return Err(RevolutionError::Folds { point, radius });
            }
        }
        let start = rows[0].iter().fold(f64::INFINITY, |m, side| m.min(side[0]));
        if start < 0.0 {
            return Err(RevolutionError::Folds { point: 0, radius: start });
        }
        Ok(rows)
    }

    /// Unit normal of the profile at a point: of the mean direction of both sides, vertical at the axis.
    fn normal(&self, point: usize) -> [f64; 2] {
        if self.profile[point][0] == 0.0 {
            return [0.0, 1.0];
        }
        let direction = |from: usize| {
            let ([a, b], [c, d]) = (self.profile[from], self.profile[from + 1]);
            let length = (c - a).hypot(d - b);
            [(c - a) / length, (d - b) / length]
        };
        let before = point.checked_sub(1).map(direction);
        let after = (point + 1 < self.profile.len()).then(|| direction(point));
        let [x, y] = match (before, after) {
            (Some(a), Some(b)) => [a[0] + b[0], a[1] + b[1]],
            (Some(a), None) | (None, Some(a)) => a,
            (None, None) => [1.0, 0.0],
        };
        let length = x.hypot(y);
        if length > 0.0 { [-y / length, x / length] } else { [0.0, 1.0] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::fem::eigen::Request;
    use crate::solid::fem::elements::{Isotropic, Order};
    use crate::solid::model::modal_model::ModalModel;

    fn shell(profile: Vec<[f64; 2]>, thickness: f64) -> Revolution {
        Revolution { profile, thickness: vec![thickness], around: 24, along: 4, layers: 1 }
    }

    #[test]
    fn a_closed_surface_surrounds_each_shell() {
        let bowl = vec![[0.0, 0.0], [0.03, 0.0], [0.06, 0.02], [0.08, 0.06]];
        for (profile, holes) in [(bowl, 0), (vec![[0.02, 0.0], [0.02, 0.3]], 1)] {
            let mesh = shell(profile, 0.004).mesh().unwrap();
            let faces = mesh.surface().unwrap();
            let mut edges = std::collections::HashSet::new();
            for f in &faces {
                for k in 0..3 {
                    let (a, b) = (f[k], f[(k + 1) % 3]);
                    edges.insert([a.min(b), a.max(b)]);
                }
            }
            let corners: std::collections::HashSet<u32> = faces.iter().flatten().copied().collect();
            // Euler's formula: 2 for a ball, 0 for a ring.
            let characteristic = corners.len() as i64 - edges.len() as i64 + faces.len() as i64;
            assert_eq!(characteristic, 2 - 2 * holes);
            assert_eq!(mesh.quality().components, 1);
        }
    }

    #[test]
    fn a_disc_has_the_frequencies_of_a_free_circular_plate() {
        // Leissa, Vibration of Plates (NASA SP-160, 1969), table 2.5, Poisson's ratio 0.33: two and three nodal diameters, and one circle.
        let (radius, thickness) = (0.1, 0.002);
        let steel = Isotropic { young: 200e9, poisson: 0.33, density: 7850.0 };
        let disc = Revolution { around: 32, along: 8, ..shell(vec![[0.0, 0.0], [radius, 0.0]], thickness) };
        let request = Request { highest: 1400.0, ..Request::default() };
        let model =
            ModalModel::analyse(&disc.mesh().unwrap(), &steel, Order::Quadratic, &request, &|_| false)
                .unwrap();
        let stiffness = steel.young * thickness.powi(3) / 12.0 / (1.0 - 0.33 * 0.33);
        let unit = (stiffness / (steel.density * thickness)).sqrt() / (TAU * radius * radius);
        let f = model.frequencies();
        for (k, expected) in [5.253, 5.253, 9.084, 12.23, 12.23].into_iter().enumerate() {
            let found = f[k] / unit;
            assert!((found / expected - 1.0).abs() < 0.012, "{k}: {found} for {expected}");
        }
    }

    #[test]
    fn profiles_that_are_no_shell_are_errors() {
        let error = |profile, thickness| shell(profile, thickness).mesh().unwrap_err().to_string();
        assert!(error(vec![[0.0, 0.0]], 0.01).contains("1 points"));
        assert!(error(vec![[0.0, 0.0], [0.0, 0.1]], 0.01).contains("point 1"));
        assert!(error(vec![[0.1, 0.0], [-0.1, 0.1]], 0.01).contains("-0.1"));
        assert!(error(vec![[0.1, 0.0], [0.1, 0.0]], 0.01).contains("equal"));
        assert!(error(vec![[0.01, 0.0], [0.01, 0.1]], 0.03).contains("so thick"));
        let two = Revolution { thickness: vec![0.01; 3], ..shell(vec![[0.0, 0.0], [0.1, 0.0]], 0.01) };
        assert!(two.mesh().unwrap_err().to_string().contains("3 thicknesses for 2 points"));
    }
}
