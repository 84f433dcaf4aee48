//! Rank correlation, and distances of distributions.

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_are_those_of_scipy() {
        let rho = spearman(&[1.0, 2.0, 2.0, 5.0, 7.0, 3.0], &[2.0, 1.0, 4.0, 6.0, 5.0, 5.0]);
        assert!((rho - 0.794_117_647_058_823_6).abs() < 1e-14, "{rho}");
        assert_eq!(spearman(&[1.0, 1.0], &[2.0, 3.0]), 0.0);
        assert!((distance_to_uniform(&[0.4, 0.1, 0.9, 0.35, 0.77]) - 0.2).abs() < 1e-15);
    }
}
