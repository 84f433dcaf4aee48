//! Rank correlation, rank tests, and distances of distributions.

use std::f64::consts::FRAC_1_SQRT_2;

/// Ranks from 1, equal values sharing their mean rank.
fn ranks(x: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|a, b| x[*a].total_cmp(&x[*b]));
    let mut out = vec![0.0; x.len()];
    let mut from = 0;
    while from < order.len() {
        let mut to = from + 1;
        while to < order.len() && x[order[to]] == x[order[from]] {
            to += 1;
        }
        let rank = 0.5 * (from + to + 1) as f64;
        order[from..to].iter().for_each(|i| out[*i] = rank);
        from = to;
    }
    out
}

/// Spearman's rank correlation; 0 if one of the lists is constant.
#[must_use]
pub fn spearman(x: &[f64], y: &[f64]) -> f64 {
    let (x, y) = (ranks(x), ranks(y));
    let mean = 0.5 * (x.len() + 1) as f64;
    let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
    let scale = (sum(&x, &x) * sum(&y, &y)).sqrt();
    if scale > 0.0 { sum(&x, &y) / scale } else { 0.0 }
}

/// Kolmogorov and Smirnov's largest distance of values in 0 to 1 from a uniform distribution.
#[must_use]
pub fn distance_to_uniform(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let gap = |(i, x): (usize, &f64)| (x - i as f64 / n).max((i + 1) as f64 / n - x);
    sorted.iter().enumerate().map(gap).fold(0.0, f64::max)
}

/// Largest number of pairs whose signed ranks have an exact distribution here.
const EXACT_PAIRS: usize = 50;

/// Wilcoxon's signed-rank test: the two-sided probability of such differences of pairs if their distribution is symmetric about 0.
///
/// Exact for at most 50 pairs without ties, else by the normal approximation with its correction for ties. Differences of 0 are left out;
/// `None` if there are no others.
///
/// # Complexity
/// O(n log n), and O(n^3) for the exact distribution.
///
/// # Source
/// Wilcoxon, "Individual comparisons by ranking methods" (Biometrics Bulletin 1(6), 1945).
#[must_use]
pub fn signed_rank(differences: &[f64]) -> Option<f64> {
    let nonzero: Vec<f64> = differences.iter().copied().filter(|d| *d != 0.0).collect();
    let n = nonzero.len();
    if n == 0 {
        return None;
    }
    let ranks = ranks(&nonzero.iter().map(|d| d.abs()).collect::<Vec<_>>());
    let above: f64 = nonzero.iter().zip(&ranks).filter(|(d, _)| **d > 0.0).map(|(_, r)| r).sum();
    let total = (n * (n + 1) / 2) as f64;
    let less = above.min(total - above);
    let ties = tie_sizes(&ranks);
    if n <= EXACT_PAIRS && n == differences.len() && ties.iter().all(|t| *t == 1) {
        return Some((2.0 * exact_share(n, less as usize)).min(1.0));
    }
    let tied: f64 = ties.iter().map(|t| (t * t * t - t) as f64).sum();
    let variance = total * (2 * n + 1) as f64 / 12.0 - tied / 48.0;
    (variance > 0.0).then(|| libm::erfc((0.5 * total - less) / variance.sqrt() * FRAC_1_SQRT_2).min(1.0))
}

/// Numbers of equal ranks.
fn tie_sizes(ranks: &[f64]) -> Vec<usize> {
    let mut sorted = ranks.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.chunk_by(|a, b| a == b).map(<[f64]>::len).collect()
}

/// Probability that the sum of those of the ranks 1 to `n` that have a positive sign is at most `sum`.
fn exact_share(n: usize, sum: usize) -> f64 {
    // share[s]: probability of the sum s over the ranks so far.
    let mut share = vec![0.0; n * (n + 1) / 2 + 1];
    share[0] = 1.0;
    for rank in 1..=n {
        for s in (0..share.len()).rev() {
            let with = if s >= rank { share[s - rank] } else { 0.0 };
            share[s] = 0.5 * (share[s] + with);
        }
    }
    share[..=sum].iter().sum()
}

/// Holm's adjustment: probabilities that hold for all of several tests at once.
///
/// # Source
/// Holm, "A simple sequentially rejective multiple test procedure" (Scandinavian Journal of Statistics 6(2), 1979).
#[must_use]
pub fn holm(probabilities: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]));
    let mut out = vec![1.0; probabilities.len()];
    let mut highest: f64 = 0.0;
    for (k, i) in order.iter().enumerate() {
        highest = highest.max((probabilities.len() - k) as f64 * probabilities[*i]).min(1.0);
        out[*i] = highest;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: Option<f64>, expected: f64) {
        assert!((found.unwrap() - expected).abs() < 1e-12, "{found:?} {expected}");
    }

    #[test]
    fn signed_ranks_are_those_of_scipy() {
        // scipy.stats.wilcoxon, exact: without ties.
        close(signed_rank(&[1.5, -0.3, 2.2, 0.7, -1.1, 3.0, 0.2]), 0.218_75);
        let many: Vec<f64> = (0..40).map(|k| f64::from(k) - 12.25).collect();
        close(signed_rank(&many), 0.000_843_662_472_107_098_4);
        // method="approx" (zeros and ties).
        close(signed_rank(&[1.0, 1.0, -2.0, 3.0, 0.0, 4.0, -1.0, 5.0, 5.0, 2.0]), 0.056_705_722_800_754_63);
        assert_eq!(signed_rank(&[0.0, 0.0]), None);
        assert_eq!(signed_rank(&[]), None);
    }

    #[test]
    fn holm_orders_and_bounds() {
        let found = holm(&[0.01, 0.04, 0.03, 0.005]);
        let expected = [0.03, 0.06, 0.06, 0.02];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
        assert_eq!(holm(&[0.9, 0.8]), [1.0, 1.0]);
    }

    #[test]
    fn statistics_are_those_of_scipy() {
        let rho = spearman(&[1.0, 2.0, 2.0, 5.0, 7.0, 3.0], &[2.0, 1.0, 4.0, 6.0, 5.0, 5.0]);
        assert!((rho - 0.794_117_647_058_823_6).abs() < 1e-14, "{rho}");
        assert_eq!(spearman(&[1.0, 1.0], &[2.0, 3.0]), 0.0);
        assert!((distance_to_uniform(&[0.4, 0.1, 0.9, 0.35, 0.77]) - 0.2).abs() < 1e-15);
    }
}
