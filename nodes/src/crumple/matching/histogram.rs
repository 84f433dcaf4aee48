//! Distribution functions of energies, and their inverses.

/// Bins of the binned forms.
const BINS: usize = 20;

/// Value at `p` of sorted numbers, with plotting positions `(k - 0.5) / n` and straight lines between (Hazen).
pub(super) fn hazen(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let at = (p * sorted.len() as f64 - 0.5).clamp(0.0, last as f64);
    let low = at.floor() as usize;
    let way = at - low as f64;
    // Both ends may be equal, or as far apart as numbers get.
    if way <= 0.0 { sorted[low] } else { sorted[low] * (1.0 - way) + sorted[low + 1] * way }
}

/// Share of sorted numbers below `x`, those equal to it counted half: `(midrank - 0.5) / n`.
pub(super) fn rank(sorted: &[f64], x: f64) -> f64 {
    if sorted.is_empty() {
        return 0.5;
    }
    let below = sorted.partition_point(|e| *e < x);
    let equal = sorted[below..].partition_point(|e| *e <= x);
    (below as f64 + 0.5 * equal as f64) / sorted.len() as f64
}

/// Logarithm of an energy that may be 0.
pub(super) fn log(energy: f64) -> f64 {
    energy.max(f64::MIN_POSITIVE).ln()
}

/// Energy on the scale of a binned form.
fn scaled(log: bool, x: f64) -> f64 {
    if log { x.max(f64::MIN_POSITIVE).ln() } else { x }
}

/// The distribution function of equal bins between the least and the greatest number, linear between their edges.
#[derive(Clone, Debug)]
pub(super) struct Binned {
    log: bool,
    low: f64,
    width: f64,
    /// Share of all numbers below each edge.
    knots: [f64; BINS + 1],
}

impl Binned {
    /// Over sorted numbers, or over their logarithms.
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
        let at = (x / self.width).clamp(0.0, BINS as f64);
        let bin = (at as usize).min(BINS - 1);
        self.knots[bin] + (at - bin as f64) * (self.knots[bin + 1] - self.knots[bin])
    }

    /// The least number whose share is at least `p`: empty bins are flat, so there may be many.
    pub fn value(&self, p: f64) -> f64 {
        let bin = self.knots[1..].partition_point(|k| *k < p).min(BINS - 1);
        let rise = self.knots[bin + 1] - self.knots[bin];
        let way = if rise > 0.0 { ((p - self.knots[bin]) / rise).clamp(0.0, 1.0) } else { 0.0 };
        let x = self.low + self.width * (bin as f64 + way);
        if self.log { x.exp() } else { x }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hazen_is_that_of_numpy() {
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
    fn binned_shares_rise_to_one_and_back() {
        let x: Vec<f64> = (0..400).map(|k| f64::from(k) / 100.0).map(f64::exp).collect();
        for log in [false, true] {
            let binned = Binned::new(&x, log);
            assert_eq!((binned.rank(0.5), binned.rank(1e9)), (0.0, 1.0));
            for p in [0.03, 0.4, 0.77, 1.0] {
                assert!((binned.rank(binned.value(p)) - p).abs() < 1e-12, "{log} {p}");
            }
        }
        // Two lumps: nothing between them, and the lower edge is taken.
        let lumps = Binned::new(&[0.0, 0.1, 19.9, 20.0], false);
        assert_eq!(lumps.rank(10.0), 0.5);
        assert_eq!(lumps.value(0.5), 1.0);
        let single = Binned::new(&[3.0, 3.0], true);
        assert_eq!([2.0, 3.0, 4.0].map(|x| single.rank(x)), [0.0, 0.5, 1.0]);
        assert!((single.value(0.3) - 3.0).abs() < 1e-12);
    }
}
