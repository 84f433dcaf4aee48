//! Are the errors of two estimators different?

use super::estimators::Compared;
use crate::statistics::quantile;
use crate::statistics::ranks::{holm, signed_rank};
use crate::table::{Cell, ResultTable};

/// A comparison of two estimators over materials and objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Significance {
    /// Relative standard deviation of the dampings.
    pub noise: f64,
    /// Share of spurious features.
    pub spurious: f64,
    /// Parameter: 0 for `a1`, 1 for `a2`.
    pub parameter: usize,
    /// The estimator whose error is smaller in the median of the differences.
    pub better: Compared,
    /// The other one.
    pub worse: Compared,
    /// Number of materials and objects that both could fit.
    pub pairs: usize,
    /// Median difference of their mean relative errors.
    pub median_difference: f64,
    /// Two-sided probability of Wilcoxon's signed-rank test.
    pub probability: f64,
    /// The same, adjusted for all tests of one noise by Holm's method.
    pub adjusted: f64,
}

/// Probability below which a difference is significant.
pub const SIGNIFICANT: f64 = 0.05;

/// The table of comparisons.
#[must_use]
pub fn significance_table(all: &[Significance]) -> ResultTable {
    let mut table = ResultTable::new(&[
        "noise",
        "spurious",
        "parameter",
        "better",
        "worse",
        "pairs",
        "median_difference",
        "p",
        "p_holm",
    ]);
    for s in all {
        table.push([
            Cell::from(s.noise),
            s.spurious.into(),
            ["a1", "a2"][s.parameter].into(),
            s.better.name().into(),
            s.worse.name().into(),
            s.pairs.into(),
            s.median_difference.into(),
            s.probability.into(),
            s.adjusted.into(),
        ]);
    }
    table
}

/// Compares each two estimators by their relative errors of `a1` and `a2`, for each pair of a material and an object.
///
/// # Source
/// Wilcoxon's signed-rank test, adjusted by Holm's method.
#[must_use]
pub fn compare(pairs: &[[Option<[f64; 2]>; 6]], noise: f64, spurious: f64) -> Vec<Significance> {
    let mut out = Vec::new();
    for (parameter, a, b) in (0..2).flat_map(|j| {
        (0..Compared::ALL.len()).flat_map(move |a| (a + 1..Compared::ALL.len()).map(move |b| (j, a, b)))
    }) {
        let difference = |x: &[Option<[f64; 2]>; 6]| Some(x[a]?[parameter] - x[b]?[parameter]);
        let mut differences: Vec<f64> = pairs.iter().filter_map(difference).collect();
        let Some(probability) = signed_rank(&differences) else { continue };
        differences.sort_by(f64::total_cmp);
        let median_difference = quantile(&differences, 0.5);
        let (a, b) = (Compared::ALL[a], Compared::ALL[b]);
        let [better, worse] = if median_difference <= 0.0 { [a, b] } else { [b, a] };
        let pairs = differences.len();
        let median_difference = median_difference.abs();
        out.push(Significance {
            noise,
            spurious,
            parameter,
            better,
            worse,
            pairs,
            median_difference,
            probability,
            adjusted: 1.0,
        });
    }
    let adjusted = holm(&out.iter().map(|s| s.probability).collect::<Vec<_>>());
    out.iter_mut().zip(adjusted).for_each(|(s, p)| s.adjusted = p);
    out
}
