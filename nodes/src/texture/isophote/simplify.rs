//! Line simplification by Douglas and Peucker, with a tolerance for gradients.

/// Maximum number of points that are simplified at once, which bounds the work in the worst case.
const MAX_SPAN: usize = 256;

/// Tolerance of a simplified line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Maximum distance in pixels of an omitted point from the line; 0 retains all points.
    pub distance: f64,
    /// Maximum relative error of the gradient interpolated at an omitted point.
    pub gradient: f64,
    /// Minimum magnitude to which that error is relative, so that small gradients around peaks need no points.
    pub min_gradient: f64,
}

/// Simplifies a line within a tolerance. Returns the indices of the remaining points, in order, with both ends.
///
/// # Shapes
/// `points` and `gradients` have the same length.
///
/// # Complexity
/// O(n log n) on average, O(256 n) at most.
///
/// # Source
/// Douglas and Peucker, "Algorithms for the reduction of the number of points required to represent a digitized line" (Cartographica,
/// 1973).
#[must_use]
pub fn simplify(points: &[[f64; 2]], gradients: &[[f32; 2]], tolerance: Tolerance) -> Vec<usize> {
    if tolerance.distance <= 0.0 || points.len() < 3 {
        return (0..points.len()).collect();
    }
    let last = points.len() - 1;
    let mut indices = vec![0];
    let mut spans = Vec::new();
    for from in (0..last).step_by(MAX_SPAN) {
        spans.push([from, (from + MAX_SPAN).min(last)]);
        while let Some([a, b]) = spans.pop() {
            match worst(points, gradients, [a, b], tolerance) {
                Some(k) => spans.extend([[k, b], [a, k]]),
                None => indices.push(b),
            }
        }
    }
    indices
}

/// Index of the point between two others with the largest error against the line between them, if it exceeds the tolerance.
fn worst(
    points: &[[f64; 2]],
    gradients: &[[f32; 2]],
    [a, b]: [usize; 2],
    tolerance: Tolerance,
) -> Option<usize> {
    let (p, q) = (points[a], points[b]);
    let step = [q[0] - p[0], q[1] - p[1]];
    let length_squared = step[0] * step[0] + step[1] * step[1];
    let [from, to] = [gradients[a], gradients[b]].map(|g| g.map(f64::from));
    let (mut max, mut found) = (1.0, None);
    for k in a + 1..b {
        let offset = [points[k][0] - p[0], points[k][1] - p[1]];
        let along = if length_squared > 0.0 {
            ((offset[0] * step[0] + offset[1] * step[1]) / length_squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let distance = [0, 1].map(|i| offset[i] - along * step[i]);
        let own = gradients[k].map(f64::from);
        let other = [0, 1].map(|i| from[i] + along * (to[i] - from[i]) - own[i]);
        let square = |v: [f64; 2]| v[0] * v[0] + v[1] * v[1];
        let allowed = tolerance.gradient.powi(2) * square(own).max(tolerance.min_gradient.powi(2));
        let error = (square(distance) / tolerance.distance.powi(2)).max(square(other) / allowed);
        if error > max {
            (max, found) = (error, Some(k));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn within(distance: f64, gradient: f64) -> Tolerance {
        Tolerance { distance, gradient, min_gradient: 1.0 }
    }

    #[test]
    fn simplified_lines_keep_their_ends_and_corners() {
        let points: Vec<[f64; 2]> =
            (0..=40).map(|k| if k < 20 { [f64::from(k), 0.0] } else { [20.0, f64::from(k - 20)] }).collect();
        let flat = vec![[1.0, 0.0]; 41];
        assert_eq!(simplify(&points, &flat, within(0.25, 0.1)), [0, 20, 40]);
        assert_eq!(simplify(&points, &flat, within(0.0, 0.1)).len(), 41);
        // A change of the gradient counts as much as a corner.
        let mut steep = flat;
        steep[30] = [1.5, 0.0];
        assert_eq!(simplify(&points, &steep, within(0.25, 0.1)), [0, 20, 29, 30, 31, 40]);
    }

    #[test]
    fn omitted_points_are_within_the_tolerance() {
        let round = |k: usize| {
            let turn = k as f64 * 0.01;
            [20.0 * turn.cos() + 0.3 * (7.0 * turn).sin(), 20.0 * turn.sin()]
        };
        let points: Vec<[f64; 2]> = (0..700).map(round).collect();
        let gradients: Vec<[f32; 2]> = points.iter().map(|p| p.map(|x| (x / 20.0) as f32)).collect();
        for (distance, gradient) in [(0.25, 10.0), (1.0, 0.05), (0.05, 0.5)] {
            let indices = simplify(&points, &gradients, within(distance, gradient));
            assert!(
                indices.len() < 130 && indices[0] == 0 && indices[indices.len() - 1] == 699,
                "{}",
                indices.len()
            );
            for pair in indices.windows(2) {
                assert!(pair[0] < pair[1]);
                assert_eq!(worst(&points, &gradients, [pair[0], pair[1]], within(distance, gradient)), None);
            }
        }
        assert!(simplify(&[], &[], within(0.25, 1.0)).is_empty());
        assert_eq!(simplify(&points[..2], &gradients[..2], within(9.0, 9.0)), [0, 1]);
    }
}
