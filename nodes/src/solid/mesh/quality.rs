//! Quality of the elements of a mesh, and the parts that it consists of.

use super::element::{faces, signed_volume};
use super::error::TetMeshError;
use crate::contact::vector::{cross, dot, norm, sub};
use crate::mesh::topology::DisjointSets;
use std::collections::HashMap;

/// Smallest dihedral angle, degrees, below which a mesh is refused.
pub const MIN_ANGLE: f64 = 0.1;
/// Ratio of radii below which a mesh is refused.
pub const MIN_RATIO: f64 = 1e-3;
/// Smallest dihedral angle, degrees, below which there is a warning.
pub const WARN_ANGLE: f64 = 2.0;

/// The worst element of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worst {
    /// Index of the element with the smallest dihedral angle, or of one below the minimum ratio.
    pub tet: usize,
    /// Smallest dihedral angle of all, degrees.
    pub angle: f64,
    /// Smallest ratio of all: three times the radius of the inscribed sphere over that of the circumscribed one, 1 if regular.
    pub ratio: f64,
}

/// Quality of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// The worst element.
    pub worst: Worst,
    /// Number of parts that share no face.
    pub components: usize,
}

/// Quality of a mesh.
#[must_use]
pub fn quality(nodes: &[[f64; 3]], tets: &[[u32; 4]]) -> Quality {
    Quality { worst: worst(nodes, tets), components: by_faces(tets) }
}

/// The worst element.
pub(super) fn worst(nodes: &[[f64; 3]], tets: &[[u32; 4]]) -> Worst {
    let mut worst = Worst { tet: 0, angle: f64::INFINITY, ratio: f64::INFINITY };
    for (tet, corners) in tets.iter().enumerate() {
        let (angle, ratio) = shape(&corners.map(|c| nodes[c as usize]));
        if angle < worst.angle || ratio < worst.ratio.min(MIN_RATIO) {
            worst.tet = tet;
        }
        worst.angle = worst.angle.min(angle);
        worst.ratio = worst.ratio.min(ratio);
    }
    worst
}

/// Smallest dihedral angle in degrees, and ratio of radii, of a tetrahedron of positive volume.
#[must_use]
pub fn shape(p: &[[f64; 3]; 4]) -> (f64, f64) {
    let normals = faces(&[0, 1, 2, 3]).map(|f| {
        let [a, b, c] = f.map(|i| p[i as usize]);
        cross(sub(b, a), sub(c, a))
    });
    let mut angle = f64::INFINITY;
    for i in 0..4 {
        for j in 0..i {
            // Outward normals enclose pi minus the dihedral angle.
            let cosine = -dot(normals[i], normals[j]) / (norm(normals[i]) * norm(normals[j]));
            angle = angle.min(libm::acos(cosine.clamp(-1.0, 1.0)));
        }
    }
    let volume = signed_volume(p);
    let area: f64 = normals.iter().map(|n| 0.5 * norm(*n)).sum();
    let inscribed = 3.0 * volume / area;
    // Products of the lengths of opposite edges are the sides of a triangle of area 6 V R.
    let edge = |i: usize, j: usize| norm(sub(p[i], p[j]));
    let (a, b, c) = (edge(0, 1) * edge(2, 3), edge(0, 2) * edge(1, 3), edge(0, 3) * edge(1, 2));
    let heron = ((a + b + c) * (a + b - c) * (a - b + c) * (b + c - a)).max(0.0).sqrt() / 4.0;
    let circumscribed = heron / (6.0 * volume);
    (angle.to_degrees(), 3.0 * inscribed / circumscribed)
}

/// Number of parts by shared faces.
fn by_faces(tets: &[[u32; 4]]) -> usize {
    let mut sets = DisjointSets::new(tets.len());
    let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(2 * tets.len());
    for (tet, corners) in tets.iter().enumerate() {
        for mut face in faces(corners) {
            face.sort_unstable();
            if let Some(other) = first.insert(face, tet as u32) {
                sets.join(other, tet as u32);
            }
        }
    }
    sets.number().1
}

/// The part of each node, by shared nodes, and the number of parts.
///
/// # Errors
/// Parts that share nodes but no face.
pub fn components(nodes: usize, tets: &[[u32; 4]]) -> Result<(Vec<u32>, usize), TetMeshError> {
    let mut sets = DisjointSets::new(nodes);
    for [a, rest @ ..] in tets {
        rest.iter().for_each(|b| sets.join(*a, *b));
    }
    let (part, count) = sets.number();
    let parts = by_faces(tets);
    if parts == count { Ok((part, count)) } else { Err(TetMeshError::Hinge { parts }) }
}
