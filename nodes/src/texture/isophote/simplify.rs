//! Fewer points for the same line.

/// Points of a line longer than this are simplified piece by piece, which bounds the work of unlucky lines.
const PIECE: usize = 256;

/// How far off a line with fewer points may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Pixels between a point that is left out and the straight line that takes its place; 0 keeps all points.
    pub reach: f64,
    /// Share of its gradient by which the one in between on that line may differ.
    pub share: f64,
    /// Size below which a gradient counts as so large, lest points around peaks are kept for next to nothing.
    pub least: f64,
}

/// Which points of a line say as much as all of them, within a tolerance: their numbers, in order, with both ends.
///
/// `points` and `gradients` are of equal length.
///
/// # Complexity
/// O(n log n) as a rule, O(256 n) at most.
///
/// # Source
/// Douglas and Peucker, "Algorithms for the reduction of the number of points required to represent a digitized line" (Cartographica,
/// 1973).
#[must_use]
pub fn simplify(points: &[[f64; 2]], gradients: &[[f32; 2]], tolerance: Tolerance) -> Vec<usize> {
    if tolerance.reach <= 0.0 || points.len() < 3 {
        return (0..points.len()).collect();
    }
    let last = points.len() - 1;
    let mut kept = vec![0];
    let mut todo = Vec::new();
    for from in (0..last).step_by(PIECE) {
        todo.push([from, (from + PIECE).min(last)]);
        while let Some([a, b]) = todo.pop() {
            match worst(points, gradients, [a, b], tolerance) {
                Some(k) => todo.extend([[k, b], [a, k]]),
                None => kept.push(b),
            }
        }
    }
    kept
}

/// The point between two others that a straight line between them misses by most, where that is too much.
fn worst(
    points: &[[f64; 2]],
    gradients: &[[f32; 2]],
    [a, b]: [usize; 2],
    tolerance: Tolerance,
) -> Option<usize> {
    let (p, q) = (points[a], points[b]);
    let step = [q[0] - p[0], q[1] - p[1]];
    let long = step[0] * step[0] + step[1] * step[1];
    let [from, to] = [gradients[a], gradients[b]].map(|g| g.map(f64::from));
    let (mut most, mut found) = (1.0, None);
    for k in a + 1..b {
        let off = [points[k][0] - p[0], points[k][1] - p[1]];
        let along =
            if long > 0.0 { ((off[0] * step[0] + off[1] * step[1]) / long).clamp(0.0, 1.0) } else { 0.0 };
        let miss = [0, 1].map(|i| off[i] - along * step[i]);
        let own = gradients[k].map(f64::from);
        let other = [0, 1].map(|i| from[i] + along * (to[i] - from[i]) - own[i]);
        let square = |v: [f64; 2]| v[0] * v[0] + v[1] * v[1];
        let slack = tolerance.share.powi(2) * square(own).max(tolerance.least.powi(2));
        let error = (square(miss) / tolerance.reach.powi(2)).max(square(other) / slack);
        if error > most {
            (most, found) = (error, Some(k));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn within(reach: f64, share: f64) -> Tolerance {
        Tolerance { reach, share, least: 1.0 }
    }

    #[test]
    fn straight_lines_keep_their_ends_and_corners_stay() {
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
    fn nothing_lies_further_off_than_allowed() {
        let round = |k: usize| {
            let turn = k as f64 * 0.01;
            [20.0 * turn.cos() + 0.3 * (7.0 * turn).sin(), 20.0 * turn.sin()]
        };
        let points: Vec<[f64; 2]> = (0..700).map(round).collect();
        let gradients: Vec<[f32; 2]> = points.iter().map(|p| p.map(|x| (x / 20.0) as f32)).collect();
        for (reach, share) in [(0.25, 10.0), (1.0, 0.05), (0.05, 0.5)] {
            let kept = simplify(&points, &gradients, within(reach, share));
            assert!(kept.len() < 130 && kept[0] == 0 && kept[kept.len() - 1] == 699, "{}", kept.len());
            for pair in kept.windows(2) {
                assert!(pair[0] < pair[1]);
                assert_eq!(worst(&points, &gradients, [pair[0], pair[1]], within(reach, share)), None);
            }
        }
        assert!(simplify(&[], &[], within(0.25, 1.0)).is_empty());
        assert_eq!(simplify(&points[..2], &gradients[..2], within(9.0, 9.0)), [0, 1]);
    }
}
