//! Dynamic time warping with a band.

use std::collections::VecDeque;

/// The distance of two sequences of equal lengths: the root of the least sum of squared differences over paths with the steps (1, 0), (0, 1)
/// and (1, 1) within `radius` of the diagonal. `None` if it is greater than `limit`.
///
/// # Shapes
/// `a`, `b`: frames of `channels` numbers.
///
/// # Complexity
/// Frames times twice the radius; less if the limit is reached early.
///
/// # Source
/// Sakoe and Chiba, "Dynamic programming algorithm optimization for spoken word recognition" (IEEE TASSP 26(1), 1978).
#[must_use]
pub fn distance(a: &[f32], b: &[f32], channels: usize, radius: usize, limit: f64) -> Option<f64> {
    squared_distance(a, b, channels, radius, limit * limit, &mut Default::default()).map(f64::sqrt)
}

/// The square of [`distance`], if it is not greater than `most`. `rows` are buffers.
#[must_use]
pub fn squared_distance(
    a: &[f32],
    b: &[f32],
    channels: usize,
    radius: usize,
    most: f64,
    rows: &mut [Vec<f64>; 2],
) -> Option<f64> {
    let channels = channels.max(1);
    let n = a.len().min(b.len()) / channels;
    if n == 0 {
        return None;
    }
    let local = |i: usize, j: usize| -> f64 {
        let (a, b) = (&a[i * channels..(i + 1) * channels], &b[j * channels..(j + 1) * channels]);
        a.iter().zip(b).map(|(x, y)| f64::from(x - y).powi(2)).sum()
    };
    for row in rows.iter_mut() {
        row.clear();
        row.resize(n + 1, f64::INFINITY);
    }
    let [last, row] = rows;
    last[0] = 0.0;
    for i in 0..n {
        let (from, to) = (i.saturating_sub(radius), (i + radius + 1).min(n));
        let mut least = f64::INFINITY;
        row[from] = f64::INFINITY;
        for j in from..to {
            // Column j + 1 is element j.
            let before = last[j].min(last[j + 1]).min(row[j]);
            row[j + 1] = local(i, j) + before;
            least = least.min(row[j + 1]);
        }
        if to < n {
            row[to + 1] = f64::INFINITY;
        }
        if least > most {
            return None;
        }
        std::mem::swap(last, row);
        row[0] = f64::INFINITY;
    }
    (last[n] <= most).then(|| last[n])
}

/// Least and greatest value of each channel within `radius` frames of each frame.
///
/// # Complexity
/// Linear.
///
/// # Source
/// Lemire, "Streaming maximum-minimum filter using no more than three comparisons per element" (Nordic Journal of Computing 13(4), 2006).
#[must_use]
pub fn envelope(x: &[f32], channels: usize, radius: usize) -> Vec<[f32; 2]> {
    let channels = channels.max(1);
    let n = x.len() / channels;
    let mut out = vec![[0.0; 2]; n * channels];
    // Frames whose values are less, or greater, than all after them within reach.
    let (mut low, mut high) = (VecDeque::new(), VecDeque::new());
    for c in 0..channels {
        let value = |k: usize| x[k * channels + c];
        low.clear();
        high.clear();
        for k in 0..n + radius {
            if k < n {
                while low.back().is_some_and(|last| value(*last) >= value(k)) {
                    low.pop_back();
                }
                while high.back().is_some_and(|last| value(*last) <= value(k)) {
                    high.pop_back();
                }
                low.push_back(k);
                high.push_back(k);
            }
            let Some(at) = k.checked_sub(radius).filter(|at| *at < n) else { continue };
            for queue in [&mut low, &mut high] {
                while queue.front().is_some_and(|first| first + radius < at) {
                    queue.pop_front();
                }
            }
            let of = |queue: &VecDeque<usize>| queue.front().map_or(value(at), |k| value(*k));
            out[at * channels + c] = [of(&low), of(&high)];
        }
    }
    out
}

/// Squared distance of a number from an interval.
#[inline]
pub fn outside(x: f32, [low, high]: [f32; 2]) -> f64 {
    f64::from((low - x).max(x - high).max(0.0)).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn known_distances() {
        let a = [0.0, 0.0, 1.0, 2.0, 1.0, 0.0, 1.0, 0.0, 0.0];
        let b = [0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let d = |radius| distance(&a, &b, 1, radius, 1e9).unwrap();
        assert!((d(9) - std::f64::consts::SQRT_2).abs() < 1e-12 && (d(0) - 8_f64.sqrt()).abs() < 1e-12);
        assert_eq!(distance(&a, &b, 1, 9, 1.4), None);
        assert_eq!((distance(&a, &a, 1, 2, 0.0), distance(&[], &[], 1, 2, 1.0)), (Some(0.0), None));
        // Two equal channels count twice.
        let twice = |x: &[f32]| x.iter().flat_map(|x| [*x, *x]).collect::<Vec<f32>>();
        let both = distance(&twice(&a), &twice(&b), 2, 9, 1e9).unwrap();
        assert!((both - 2.0).abs() < 1e-12, "{both}");
    }

    #[test]
    fn the_envelope_has_the_extremes_within_the_radius() {
        let mut rng = Rng::new(6);
        for radius in [0, 1, 3, 50] {
            let x: Vec<f32> = (0..60).map(|_| rng.between(-1.0, 1.0).round() as f32 * 0.5).collect();
            for (k, found) in envelope(&x, 2, radius).into_iter().enumerate() {
                let (frame, c) = (k / 2, k % 2);
                let near = (frame.saturating_sub(radius)..(frame + radius + 1).min(30)).map(|k| x[2 * k + c]);
                let expected =
                    near.fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
                assert_eq!(found, expected, "{radius} {k}");
            }
        }
    }

    #[test]
    fn the_distance_from_the_envelope_is_no_greater() {
        let mut rng = Rng::new(4);
        for _ in 0..300 {
            let mut walk = || {
                let mut x = 0.0;
                (0..48)
                    .map(|_| {
                        x += rng.between(-1.0, 1.0) as f32;
                        x
                    })
                    .collect::<Vec<f32>>()
            };
            let (a, b) = (walk(), walk());
            let bound: f64 = envelope(&a, 1, 5).iter().zip(&b).map(|(e, x)| outside(*x, *e)).sum();
            let d = distance(&a, &b, 1, 5, 1e9).unwrap();
            assert!(bound.sqrt() <= d + 1e-9);
            assert!(distance(&a, &b, 1, 5, d - 1e-6).is_none() && distance(&a, &b, 1, 5, d + 1e-9).is_some());
        }
    }
}
