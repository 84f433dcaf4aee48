//! Distance that a vertex slides over the triangle that it touches, from one frame to the next.

use serde::{Deserialize, Serialize};

use super::triangle::{closest_point, is_degenerate};
use super::vector::{Vec3, add, cross, dot, norm, scale, sub};

/// Measure of the slide of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum SlipMode {
    /// Distance along the triangle, exactly 0 under any rigid motion of the pair: [`slide`].
    #[default]
    Exact,
    /// Displacement relative to the closest point: [`naive`].
    Naive,
}

/// Motion of a vertex relative to one triangle between two frames, metres.
///
/// Divided by the time between the frames it is a speed, at the middle of the two frame times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slide {
    /// Distance moved along the triangle; never negative.
    pub tangential: f64,
    /// Change of the distance from the triangle's plane; negative while approaching.
    pub normal: f64,
    /// Unclamped in-plane coordinates at the first frame: x = a + beta_0 (b - a) + beta_1 (c - a) + height n.
    pub beta: [f64; 2],
    /// True if the triangle was degenerate at either frame; every other field is then 0.
    pub degenerate: bool,
}

/// A point in the frame of a triangle: in-plane coordinates, metric and height.
struct LocalPoint {
    beta: [f64; 2],
    /// e1.e1, e1.e2, e2.e2.
    metric: [f64; 3],
    height: f64,
}

#[inline]
fn local_point(x: Vec3, [a, b, c]: [Vec3; 3]) -> Option<LocalPoint> {
    let (e1, e2, offset) = (sub(b, a), sub(c, a), sub(x, a));
    let metric = [dot(e1, e1), dot(e1, e2), dot(e2, e2)];
    let normal = cross(e1, e2);
    // |e1 x e2|^2 is the determinant of the metric, without the cancellation of e1.e1 e2.e2 - (e1.e2)^2.
    let determinant = dot(normal, normal);
    let bc = sub(c, b);
    if is_degenerate(determinant, metric[0].max(metric[2]).max(dot(bc, bc))) {
        return None;
    }
    let (r1, r2) = (dot(e1, offset), dot(e2, offset));
    Some(LocalPoint {
        beta: [
            (metric[2] * r1 - metric[1] * r2) / determinant,
            (metric[0] * r2 - metric[1] * r1) / determinant,
        ],
        metric,
        height: dot(normal, offset) / determinant.sqrt(),
    })
}

/// Returns the unclamped in-plane coordinates of a point; none over a degenerate triangle.
#[must_use]
pub fn in_plane(x: [f64; 3], triangle: [[f64; 3]; 3]) -> Option<[f64; 2]> {
    local_point(x, triangle).map(|local| local.beta)
}

/// Returns the height of a point over the triangle's plane, positive on its outer side by winding; none if degenerate.
#[must_use]
pub fn height(x: [f64; 3], triangle: [[f64; 3]; 3]) -> Option<f64> {
    local_point(x, triangle).map(|local| local.height)
}

/// Measures the distance that `x` slides over the *same* triangle while both move from frame 0 to frame 1.
///
/// The in-plane coordinates are not clamped to the triangle: a clamp in one frame only would appear as slip. The slip is exactly
/// 0 under a rigid motion of the pair, and for a vertex glued to a triangle that stretches.
///
/// # Source
/// An, James and Marschner 2012, section 2, take a difference of "relative contact speed" without naming the point or the
/// direction. This form is invariant under rigid motion: sqrt(dbeta^T G dbeta) with G the mean metric of the two frames.
#[must_use]
pub fn slide(x0: [f64; 3], triangle0: [[f64; 3]; 3], x1: [f64; 3], triangle1: [[f64; 3]; 3]) -> Slide {
    let (Some(first), Some(second)) = (local_point(x0, triangle0), local_point(x1, triangle1)) else {
        return Slide { degenerate: true, ..Slide::default() };
    };
    let d = [second.beta[0] - first.beta[0], second.beta[1] - first.beta[1]];
    let g = |k: usize| 0.5 * (first.metric[k] + second.metric[k]);
    let squared = d[0] * d[0] * g(0) + 2.0 * d[0] * d[1] * g(1) + d[1] * d[1] * g(2);
    Slide {
        tangential: squared.max(0.0).sqrt(),
        normal: second.height.abs() - first.height.abs(),
        beta: first.beta,
        degenerate: false,
    }
}

/// Displacement of `x` relative to the material point that was closest in frame 0, metres: the literal reading of the paper.
///
/// For comparison only. It includes the normal component, and a rotation of the pair counts as sliding at omega times the gap.
#[must_use]
pub fn naive(x0: [f64; 3], triangle0: [[f64; 3]; 3], x1: [f64; 3], triangle1: [[f64; 3]; 3]) -> f64 {
    let w = closest_point(x0, triangle0).barycentric;
    let material = |t: [Vec3; 3]| add(scale(t[0], w[0]), add(scale(t[1], w[1]), scale(t[2], w[2])));
    norm(sub(sub(x1, material(triangle1)), sub(x0, material(triangle0))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TRIANGLE: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.02, 0.09, 0.0]];

    /// Rodrigues' rotation about a unit axis, then a translation.
    fn moved(x: Vec3, axis: Vec3, angle: f64, shift: Vec3) -> Vec3 {
        let (s, c) = angle.sin_cos();
        let turned = add(add(scale(x, c), scale(cross(axis, x), s)), scale(axis, dot(axis, x) * (1.0 - c)));
        add(turned, shift)
    }

    #[test]
    fn rotation_at_5_rad_per_second_over_a_5_cm_gap_is_no_slide_but_25_cm_per_second_in_the_naive_form() {
        let dt = 1.0 / 60.0;
        let turn = |x: Vec3| moved(x, [1.0, 0.0, 0.0], 5.0 * dt, [0.0; 3]);
        let x = [0.04, 0.03, 0.05];
        let (x1, t1) = (turn(x), TRIANGLE.map(turn));
        assert!(slide(x, TRIANGLE, x1, t1).tangential / dt < 1e-13);
        assert!(slide(x, TRIANGLE, x1, t1).normal.abs() / dt < 1e-13);
        let false_speed = naive(x, TRIANGLE, x1, t1) / dt;
        assert!((false_speed - 0.25).abs() < 1e-3, "{false_speed}");
    }

    #[test]
    fn a_vertex_glued_to_a_stretching_triangle_does_not_slide() {
        let glued = |t: [Vec3; 3]| add(t[0], add(scale(sub(t[1], t[0]), 0.3), scale(sub(t[2], t[0]), 0.25)));
        let stretched = TRIANGLE.map(|c| [c[0] * 1.7, c[1] * 0.6, 0.0]);
        assert!(slide(glued(TRIANGLE), TRIANGLE, glued(stretched), stretched).tangential < 1e-16);
    }

    #[test]
    fn normal_approach_leaves_the_slide_unchanged() {
        let x = [0.03, 0.03, 0.02];
        let level = slide(x, TRIANGLE, [0.033, 0.034, 0.02], TRIANGLE);
        let falling = slide(x, TRIANGLE, [0.033, 0.034, 0.005], TRIANGLE);
        assert!((level.tangential - 0.005).abs() < 1e-15);
        assert!((falling.tangential - level.tangential).abs() < 1e-15);
        assert!((falling.normal + 0.015).abs() < 1e-15 && level.normal.abs() < 1e-15);
    }

    #[test]
    fn a_vertex_that_leaves_the_triangle_slides_the_full_distance() {
        let far = slide([0.05, 0.01, 0.01], TRIANGLE, [0.25, 0.01, 0.01], TRIANGLE);
        assert!((far.tangential - 0.2).abs() < 1e-14);
    }

    #[test]
    fn a_degenerate_triangle_at_either_frame_gives_zero_and_is_reported() {
        let flat = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        for (first, second) in [(TRIANGLE, flat), (flat, TRIANGLE), (flat, flat)] {
            let found = slide([0.1; 3], first, [0.2; 3], second);
            assert_eq!(found, Slide { degenerate: true, ..Slide::default() });
        }
    }

    fn coordinate(limit: f64) -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3(-limit..limit)
    }

    proptest! {
        #[test]
        fn rigid_motion_of_the_scene_leaves_slides_unchanged(
            x in coordinate(0.1), step in coordinate(0.02), axis in coordinate(1.0), angle in -3.0..3.0f64,
            shift in coordinate(2.0), second_shift in coordinate(2.0),
        ) {
            prop_assume!(norm(axis) > 0.1);
            let axis = scale(axis, 1.0 / norm(axis));
            let (x1, t1) = (add(x, step), TRIANGLE.map(|c| [c[0] * 1.02, c[1], c[2] + 0.001]));
            let plain = slide(x, TRIANGLE, x1, t1);
            let first = |p| moved(p, axis, angle, shift);
            let second = |p| moved(p, axis, -0.4 * angle, second_shift);
            let moved = slide(first(x), TRIANGLE.map(first), second(x1), t1.map(second));
            prop_assert!((moved.tangential - plain.tangential).abs() < 1e-9 * plain.tangential + 1e-13);
            prop_assert!((moved.normal - plain.normal).abs() < 1e-9 * plain.normal.abs() + 1e-13);
        }

        #[test]
        fn slide_scales_with_the_scene_and_not_with_the_winding(
            x in coordinate(0.1), step in coordinate(0.02), k in 0.01..100.0f64,
        ) {
            let x1 = add(x, step);
            let one = slide(x, TRIANGLE, x1, TRIANGLE);
            let large = slide(scale(x, k), TRIANGLE.map(|c| scale(c, k)), scale(x1, k), TRIANGLE.map(|c| scale(c, k)));
            prop_assert!((large.tangential - k * one.tangential).abs() <= 1e-9 * k * one.tangential + 1e-15);
            let [a, b, c] = TRIANGLE;
            let flipped = slide(x, [a, c, b], x1, [a, c, b]);
            prop_assert!((flipped.tangential - one.tangential).abs() < 1e-13);
            prop_assert!((flipped.normal - one.normal).abs() < 1e-13);
        }
    }
}
