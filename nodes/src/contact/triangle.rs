//! The exact closest point on a triangle.

use super::vector::{Vec3, add, cross, dot, scale, sub};

/// Part of a triangle that the closest point lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Corner 0, 1 or 2.
    Vertex(u8),
    /// The interior of the edge from corner k to corner (k + 1) mod 3.
    Edge(u8),
    /// The interior of the face.
    Face,
}

/// The point of a triangle nearest to a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// The point itself.
    pub point: [f64; 3],
    /// Its barycentric weights: none negative, sum 1.
    pub barycentric: [f64; 3],
    /// The feature it lies on.
    pub feature: Feature,
    /// Squared distance to the query point.
    pub squared_distance: f64,
}

/// Squared area over the fourth power of the longest edge below which a triangle is degenerate: (1e-12)^2.
const DEGENERATE: f64 = 1e-24;

/// Returns true if a triangle with this squared normal |e1 x e2|^2 and longest squared edge has less area than 1e-12 edge^2.
#[inline]
pub(crate) fn is_degenerate(squared_normal: f64, longest_squared_edge: f64) -> bool {
    // The area is half the normal's length. `<=` includes the triangle that is a single point.
    squared_normal <= 4.0 * DEGENERATE * longest_squared_edge * longest_squared_edge
}

/// Finds the point of a triangle nearest to `p` by the seven Voronoi regions (three corners, three edges, the face).
///
/// A degenerate triangle (area < 1e-12 longest edge^2) counts as its longest edge. Two triangles that share the closest
/// edge or corner have exactly the same distance, whatever the order of its corners, so ties between neighbours are
/// exact.
///
/// # Source
/// Regions after Ericson, *Real-Time Collision Detection*, section 5.1.5.
#[inline]
#[must_use]
pub fn closest_point(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> Closest {
    // Relative to p, so that the error scales with the triangle and not with its distance from the origin.
    let q = [sub(a, p), sub(b, p), sub(c, p)];
    let (ab, ac, bc) = (sub(b, a), sub(c, a), sub(c, b));
    let normal = cross(ab, ac);
    let squared_normal = dot(normal, normal);
    let edges = [dot(ab, ab), dot(bc, bc), dot(ac, ac)];
    let longest = edges[0].max(edges[1]).max(edges[2]);
    if is_degenerate(squared_normal, longest) {
        let k = if edges[0] == longest {
            0
        } else if edges[1] == longest {
            1
        } else {
            2
        };
        return on_edge(p, &q, k);
    }

    let (d1, d2) = (-dot(ab, q[0]), -dot(ac, q[0]));
    if d1 <= 0.0 && d2 <= 0.0 {
        return on_corner(p, &q, 0);
    }
    let (d3, d4) = (-dot(ab, q[1]), -dot(ac, q[1]));
    if d3 >= 0.0 && d4 <= d3 {
        return on_corner(p, &q, 1);
    }
    let (d5, d6) = (-dot(ab, q[2]), -dot(ac, q[2]));
    if d6 >= 0.0 && d5 <= d6 {
        return on_corner(p, &q, 2);
    }
    let wc = d1 * d4 - d3 * d2;
    if wc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return on_edge(p, &q, 0);
    }
    let wb = d5 * d2 - d1 * d6;
    if wb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return on_edge(p, &q, 2);
    }
    let wa = d3 * d6 - d5 * d4;
    if wa <= 0.0 && d4 >= d3 && d5 >= d6 {
        return on_edge(p, &q, 1);
    }
    let sum = wa + wb + wc;
    let height = dot(normal, q[0]);
    Closest {
        point: add(p, scale(normal, height / squared_normal)),
        barycentric: [wa / sum, wb / sum, wc / sum],
        feature: Feature::Face,
        squared_distance: height * height / squared_normal,
    }
}

/// Returns true if a point lies on the inner side of the triangle's plane.
#[inline]
pub(super) fn is_behind(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> bool {
    dot(cross(sub(b, a), sub(c, a)), sub(p, a)) < 0.0
}

#[inline]
fn on_corner(p: Vec3, q: &[Vec3; 3], k: usize) -> Closest {
    let mut barycentric = [0.0; 3];
    barycentric[k] = 1.0;
    Closest {
        point: add(p, q[k]),
        barycentric,
        feature: Feature::Vertex(k as u8),
        squared_distance: dot(q[k], q[k]),
    }
}

#[inline]
fn on_edge(p: Vec3, q: &[Vec3; 3], k: usize) -> Closest {
    let (mut i, mut j) = (k, (k + 1) % 3);
    // Both triangles of an edge use the same direction, so that both round alike.
    if q[j] < q[i] {
        (i, j) = (j, i);
    }
    let direction = sub(q[j], q[i]);
    let along = -dot(q[i], direction);
    let squared_length = dot(direction, direction);
    if along <= 0.0 || squared_length <= 0.0 {
        return on_corner(p, q, i);
    }
    if along >= squared_length {
        return on_corner(p, q, j);
    }
    let t = along / squared_length;
    let offset = add(q[i], scale(direction, t));
    let mut barycentric = [0.0; 3];
    barycentric[i] = 1.0 - t;
    barycentric[j] = t;
    Closest {
        point: add(p, offset),
        barycentric,
        feature: Feature::Edge(k as u8),
        squared_distance: dot(offset, offset),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::vector::norm;
    use proptest::prelude::*;

    const TRIANGLE: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

    #[test]
    fn each_of_the_seven_regions_gives_its_feature_and_point() {
        let cases = [
            ([-1.0, -1.0, 2.0], Feature::Vertex(0), [0.0, 0.0, 0.0]),
            ([6.0, -1.0, 0.0], Feature::Vertex(1), [4.0, 0.0, 0.0]),
            ([-1.0, 7.0, 0.0], Feature::Vertex(2), [0.0, 4.0, 0.0]),
            ([1.0, -2.0, 1.0], Feature::Edge(0), [1.0, 0.0, 0.0]),
            ([4.0, 4.0, -1.0], Feature::Edge(1), [2.0, 2.0, 0.0]),
            ([-3.0, 1.0, 0.0], Feature::Edge(2), [0.0, 1.0, 0.0]),
            ([1.0, 1.0, 5.0], Feature::Face, [1.0, 1.0, 0.0]),
        ];
        for (p, feature, point) in cases {
            let found = closest_point(p, TRIANGLE);
            assert_eq!(found.feature, feature, "at {p:?}");
            assert_eq!(found.point, point, "at {p:?}");
            let offset = sub(p, point);
            assert_eq!(found.squared_distance, dot(offset, offset), "at {p:?}");
        }
    }

    #[test]
    fn a_degenerate_triangle_is_its_longest_edge() {
        let collinear = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
        let found = closest_point([2.0, 1.0, 0.0], collinear);
        assert_eq!((found.point, found.feature), ([2.0, 0.0, 0.0], Feature::Edge(2)));
        assert!((found.barycentric[2] - 2.0 / 3.0).abs() < 1e-15 && found.barycentric[1] == 0.0);
        let point = [[1.0, 1.0, 1.0]; 3];
        assert_eq!(closest_point([1.0, 1.0, 3.0], point).squared_distance, 4.0);
    }

    #[test]
    fn a_shared_edge_is_equally_far_from_both_of_its_triangles() {
        let (a, b) = ([0.1, 0.7, -0.3], [1.3, 0.2, 0.9]);
        let p = [0.9, 2.1, 0.6];
        let left = closest_point(p, [a, b, [0.5, -3.0, 0.1]]);
        let right = closest_point(p, [b, a, [0.4, -2.0, 0.3]]);
        assert_eq!((left.feature, right.feature), (Feature::Edge(0), Feature::Edge(0)));
        assert_eq!(left.squared_distance, right.squared_distance);
    }

    fn coordinate() -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3(-1.0..1.0f64)
    }

    proptest! {
        #[test]
        fn no_point_of_the_triangle_is_nearer(
            p in coordinate(), t in prop::array::uniform3(coordinate()), u in 0.0..1.0f64, v in 0.0..1.0f64,
        ) {
            let found = closest_point(p, t);
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let other = add(t[0], add(scale(sub(t[1], t[0]), u), scale(sub(t[2], t[0]), v)));
            prop_assert!(norm(sub(p, other)) >= found.squared_distance.sqrt() - 1e-12);
        }

        #[test]
        fn the_point_its_weights_and_its_distance_agree(p in coordinate(), t in prop::array::uniform3(coordinate())) {
            let found = closest_point(p, t);
            let w = found.barycentric;
            prop_assert!((w[0] + w[1] + w[2] - 1.0).abs() < 1e-12 && w.iter().all(|&x| x >= 0.0));
            let rebuilt = add(scale(t[0], w[0]), add(scale(t[1], w[1]), scale(t[2], w[2])));
            prop_assert!(norm(sub(rebuilt, found.point)) < 1e-9);
            prop_assert!((norm(sub(p, found.point)) - found.squared_distance.sqrt()).abs() < 1e-12);
        }
    }
}
