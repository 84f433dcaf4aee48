//! Lines of sight between points, and the meshes that block them.

use crate::contact::vector::{Vec3, cross, dot, sub, widen};

/// Returns true if the segment between two points, without its ends, intersects a triangle.
///
/// # Source
/// Möller and Trumbore, "Fast, minimum storage ray-triangle intersection" (Journal of Graphics Tools 2(1), 1997).
#[must_use]
pub fn intersects_triangle(from: Vec3, to: Vec3, [a, b, c]: [Vec3; 3]) -> bool {
    /// Fractions of the segment that are ignored at both ends: a source may lie on its own surface.
    const END_MARGIN: f64 = 1e-4;
    let (direction, e1, e2) = (sub(to, from), sub(b, a), sub(c, a));
    let p = cross(direction, e2);
    let det = dot(e1, p);
    if det.abs() < 1e-18 {
        return false;
    }
    let s = sub(from, a);
    let u = dot(s, p) / det;
    let q = cross(s, e1);
    let v = dot(direction, q) / det;
    let t = dot(e2, q) / det;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (END_MARGIN..=1.0 - END_MARGIN).contains(&t)
}

/// Returns true if a mesh intersects the segment between two points.
///
/// # Complexity
/// O(vertices) if the segment misses the bounding box, else O(triangles).
#[must_use]
pub fn is_blocked(from: Vec3, to: Vec3, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> bool {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for position in positions {
        for (k, x) in widen(*position).into_iter().enumerate() {
            (low[k], high[k]) = (low[k].min(x), high[k].max(x));
        }
    }
    let outside = |k: usize| from[k].max(to[k]) < low[k] || from[k].min(to[k]) > high[k];
    if (0..3).any(outside) {
        return false;
    }
    let vertex = |v: u32| positions.get(v as usize).copied().map(widen);
    triangles.iter().any(|[a, b, c]| match (vertex(*a), vertex(*b), vertex(*c)) {
        (Some(a), Some(b), Some(c)) => intersects_triangle(from, to, [a, b, c]),
        _ => false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const WALL: [[f32; 3]; 3] = [[1.0, -1.0, -1.0], [1.0, 2.0, -1.0], [1.0, -1.0, 2.0]];

    #[test]
    fn a_wall_blocks_only_points_behind_it() {
        let blocks = |from: Vec3, to: Vec3| is_blocked(from, to, &WALL, &[[0, 1, 2]]);
        assert!(blocks([0.0; 3], [2.0, 0.0, 0.0]) && blocks([2.0, 0.0, 0.0], [0.0; 3]));
        assert!(!blocks([0.0; 3], [0.9, 0.0, 0.0]), "before it");
        assert!(
            !blocks([0.0; 3], [2.0, 3.0, 0.0]),
            "past its edge: the segment crosses its plane at y = 1.5"
        );
        assert!(!blocks([1.0, 0.0, 0.0], [2.0, 0.0, 0.0]), "on it");
        assert!(!blocks([0.0; 3], [0.0, 5.0, 0.0]), "along it");
        assert!(!is_blocked([0.0; 3], [2.0, 0.0, 0.0], &WALL, &[[0, 1, 9]]), "no such vertex");
        assert!(!is_blocked([0.0; 3], [2.0, 0.0, 0.0], &[], &[]));
    }
}
