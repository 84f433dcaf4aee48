//! Distribution functions of energies and their inverses.

/// Number of bins of [`Binned`].
const BINS: usize = 20;

/// Returns the quantile `p` of sorted numbers, linear between plotting positions `(k - 0.5) / n` (Hazen).
pub(super) fn hazen(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let position = (p * sorted.len() as f64 - 0.5).clamp(0.0, last as f64);
    let low = position.floor() as usize;
    let fraction = position - low as f64;
    // This form does not overflow.
    if fraction <= 0.0 { sorted[low] } else { sorted[low] * (1.0 - fraction) + sorted[low + 1] * fraction }
}

/// Returns the fraction of sorted numbers below `x`, with equal numbers counted half: `(midrank - 0.5) / n`.
pub(super) fn rank(sorted: &[f64], x: f64) -> f64 {
    if sorted.is_empty() {
        return 0.5;
    }
    let below = sorted.partition_point(|e| *e < x);
    let equal = sorted[below..].partition_point(|e| *e <= x);
    (below as f64 + 0.5 * equal as f64) / sorted.len() as f64
}

/// Returns the logarithm of an energy that may be 0.
pub(super) fn log(energy: f64) -> f64 {
    energy.max(f64::MIN_POSITIVE).ln()
}

/// Returns an energy on a linear or logarithmic scale.
fn scaled(log: bool, x: f64) -> f64 {
    if log { x.max(f64::MIN_POSITIVE).ln() } else { x }
}

/// The distribution function of equal bins from the minimum to the maximum, linear between their edges.
#[derive(Clone, Debug)]
pub(super) struct Binned {
    log: bool,
    low: f64,
    width: f64,
    /// Fraction of all numbers below each edge.
    knots: [f64; BINS + 1],
}

impl Binned {
    /// Creates bins of sorted numbers, or of their logarithms.
    pub fn new(sorted: &[f64], log: bool) -> Self {
        let end = |x: Option<&f64>| x.map_or(0.0, |x| scaled(log, *x));
        let (low, high) = (end(sorted.first()), end(sorted.last()));
        let width = (high - low) / BINS as f64;
        let mut knots = [0.0; BINS + 1];
        for x in sorted {
            let bin = if width > 0.0 { ((scaled(log, *x) - low) / width) as usize } else { 0 };
            knots[bin.min(BINS - 1) + 1] += 1.0 / sorted.len() as f64;
        }
        for k in 0..BINS {
            knots[k + 1] += knots[k];
        }
        knots[BINS] = 1.0;
        Self { log, low, width, knots }
    }

    /// Returns the fraction of numbers below `x`.
    pub fn rank(&self, x: f64) -> f64 {
        let x = scaled(self.log, x) - self.low;
        if self.width <= 0.0 {
            return if x < 0.0 {
                0.0
            } else if x > 0.0 {
                1.0
            } else {
                0.5
            };
        }
        let position = (x / self.width).clamp(0.0, BINS as f64);
        let bin = (position as usize).min(BINS - 1);
        self.knots[bin] + (position - bin as f64) * (self.knots[bin + 1] - self.knots[bin])
    }

    /// Returns the smallest number whose rank is at least `p`. In empty bins the rank is constant.
    pub fn value(&self, p: f64) -> f64 {
        let bin = self.knots[1..].partition_point(|k| *k < p).min(BINS - 1);
        let rise = self.knots[bin + 1] - self.knots[bin];
        let fraction = if rise > 0.0 { ((p - self.knots[bin]) / rise).clamp(0.0, 1.0) } else { 0.0 };
        let x = self.low + self.width * (bin as f64 + fraction);
        if self.log { x.exp() } else { x }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_equal_those_of_numpy() {
        // numpy.quantile([1, 2, 4, 8, 16], p, method="hazen")
        let x = [1.0, 2.0, 4.0, 8.0, 16.0];
        for (p, want) in
            [(0.0, 1.0), (0.1, 1.0), (0.25, 1.75), (0.5, 4.0), (0.63, 6.6), (0.9, 16.0), (1.0, 16.0)]
        {
            assert!((hazen(&x, p) - want).abs() < 1e-12, "{p}: {}", hazen(&x, p));
        }
        assert_eq!(hazen(&[], 0.5), 0.0);
    }

    #[test]
    fn ranks_count_equal_numbers_half() {
        let x = [1.0, 2.0, 2.0, 3.0];
        assert_eq!([0.5, 1.0, 2.0, 2.5, 3.0, 9.0].map(|e| rank(&x, e)), [0.0, 0.125, 0.5, 0.75, 0.875, 1.0]);
    }

    #[test]
    fn binned_ranks_and_values_are_inverse() {
        let x: Vec<f64> = (0..400).map(|k| f64::from(k) / 100.0).map(f64::exp).collect();
        for log in [false, true] {
            let binned = Binned::new(&x, log);
            assert_eq!((binned.rank(0.5), binned.rank(1e9)), (0.0, 1.0));
            for p in [0.03, 0.4, 0.77, 1.0] {
                assert!((binned.rank(binned.value(p)) - p).abs() < 1e-12, "{log} {p}");
            }
        }
        // Two groups: the rank is constant between them, and the lower edge is returned.
        let groups = Binned::new(&[0.0, 0.1, 19.9, 20.0], false);
        assert_eq!(groups.rank(10.0), 0.5);
        assert_eq!(groups.value(0.5), 1.0);
        let single = Binned::new(&[3.0, 3.0], true);
        assert_eq!([2.0, 3.0, 4.0].map(|x| single.rank(x)), [0.0, 0.5, 1.0]);
        assert!((single.value(0.3) - 3.0).abs() < 1e-12);
    }
}
