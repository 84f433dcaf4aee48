//! Weights over time, piecewise linear.

use serde::{Deserialize, Serialize};

/// A weight over time: linear between points, 0 outside of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WeightCurve {
    /// Times in s, which do not decrease, and weights.
    pub points: Vec<(f64, f64)>,
}

impl WeightCurve {
    /// The same weight from one time to another.
    #[must_use]
    pub fn constant(from: f64, to: f64, weight: f64) -> Self {
        Self { points: vec![(from, weight), (to, weight)] }
    }

    /// The first and the last time; `None` without points.
    #[must_use]
    pub fn ends(&self) -> Option<(f64, f64)> {
        Some((self.points.first()?.0, self.points.last()?.0))
    }

    /// The integral from the first point to a time.
    fn integral(&self, sums: &[f64], t: f64) -> f64 {
        let after = self.points.partition_point(|(at, _)| *at <= t);
        let Some(k) = after.checked_sub(1) else { return 0.0 };
        let (from, a) = self.points[k];
        let Some((to, b)) = self.points.get(after) else { return sums[k] };
        let x = t - from;
        sums[k] + x * (a + 0.5 * (b - a) * x / (to - from))
    }

    /// The integrals from the first point to each.
    fn sums(&self) -> Vec<f64> {
        let mut sums = vec![0.0];
        for pair in self.points.windows(2) {
            let last = sums[sums.len() - 1];
            sums.push(last + 0.5 * (pair[0].1 + pair[1].1) * (pair[1].0 - pair[0].0));
        }
        sums
    }

    /// The intervals in which the weight is exactly `value`.
    #[must_use]
    pub fn plateaus(&self, value: f64) -> Vec<(f64, f64)> {
        let mut all: Vec<(f64, f64)> = Vec::new();
        for pair in self.points.windows(2) {
            let ((from, a), (to, b)) = (pair[0], pair[1]);
            if a == value && b == value && to > from {
                match all.last_mut() {
                    Some(last) if last.1 == from => last.1 = to,
                    _ => all.push((from, to)),
                }
            }
        }
        all
    }
}

/// A curve whose means over intervals are fast to find.
#[derive(Clone, Debug)]
pub struct MeanCurve {
    curve: WeightCurve,
    sums: Vec<f64>,
    inclusions: Vec<(f64, f64)>,
    exclusions: Vec<(f64, f64)>,
}

impl MeanCurve {
    /// Prepares a curve.
    #[must_use]
    pub fn new(curve: &WeightCurve) -> Self {
        let (inclusions, exclusions) = (curve.plateaus(1.0), curve.plateaus(-1.0));
        Self { curve: curve.clone(), sums: curve.sums(), inclusions, exclusions }
    }

    /// The mean weight over an interval.
    ///
    /// # Complexity
    /// Logarithmic in the points.
    #[must_use]
    pub fn mean(&self, from: f64, to: f64) -> f64 {
        if to <= from || self.curve.points.is_empty() {
            return 0.0;
        }
        let at = |t| self.curve.integral(&self.sums, t);
        ((at(to) - at(from)) / (to - from)).clamp(-1.0, 1.0)
    }

    /// The intervals in which the weight is 1.
    #[must_use]
    pub fn inclusions(&self) -> &[(f64, f64)] {
        &self.inclusions
    }

    /// The intervals in which the weight is -1.
    #[must_use]
    pub fn exclusions(&self) -> &[(f64, f64)] {
        &self.exclusions
    }
}

/// True if one of the intervals, in order, contains the interval from one time to another.
#[must_use]
pub fn contains(intervals: &[(f64, f64)], from: f64, to: f64) -> bool {
    let k = intervals.partition_point(|(start, _)| *start <= from);
    k.checked_sub(1).is_some_and(|k| to <= intervals[k].1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_exact_integrals() {
        let curve = WeightCurve { points: vec![(1.0, 0.0), (2.0, 1.0), (4.0, 1.0), (4.0, 0.5), (5.0, 0.5)] };
        let mean = MeanCurve::new(&curve);
        for (from, to, expected) in [
            (0.0, 1.0, 0.0),
            (1.0, 2.0, 0.5),
            (1.0, 1.5, 0.25),
            (2.5, 3.0, 1.0),
            (3.0, 5.0, 0.75),
            (0.0, 10.0, 0.3),
            (4.5, 5.5, 0.25),
            (6.0, 7.0, 0.0),
            (3.0, 3.0, 0.0),
        ] {
            assert!((mean.mean(from, to) - expected).abs() < 1e-12, "{from} {to}: {}", mean.mean(from, to));
        }
        assert_eq!(mean.inclusions(), [(2.0, 4.0)]);
        assert!(contains(mean.inclusions(), 2.0, 4.0) && !contains(mean.inclusions(), 1.9, 3.0));
        assert!(!contains(mean.inclusions(), 3.0, 4.1) && !contains(&[], 0.0, 1.0));
        let constant = MeanCurve::new(&WeightCurve::constant(0.0, 2.0, -1.0));
        assert_eq!((constant.exclusions(), constant.mean(1.0, 3.0)), (&[(0.0, 2.0)][..], -0.5));
    }
}
