//! One tetrahedron: its edges, faces and volume.

use super::isoparametric::EDGES;
use crate::contact::vector::{cross, dot, sub};

/// The edges of an element, in the order of [`EDGES`], with ascending ends.
pub(in crate::solid) fn edges(tet: &[u32; 4]) -> [[u32; 2]; 6] {
    EDGES.map(|[a, b]| [tet[a].min(tet[b]), tet[a].max(tet[b])])
}

/// The four faces of an element of positive volume, anticlockwise seen from outside.
pub(in crate::solid) fn faces([a, b, c, d]: &[u32; 4]) -> [[u32; 3]; 4] {
    let (a, b, c, d) = (*a, *b, *c, *d);
    [[a, c, b], [a, b, d], [b, c, d], [a, d, c]]
}

/// Signed volume of a tetrahedron.
pub(in crate::solid) fn signed_volume(p: &[[f64; 3]; 4]) -> f64 {
    dot(sub(p[1], p[0]), cross(sub(p[2], p[0]), sub(p[3], p[0]))) / 6.0
}
