//! Non-decreasing splines in the logarithm of a frequency.

/// Basis of monotone splines in `ln lambda`: a constant, and integrated quadratic B-splines, which rise from 0 to 1.
///
/// Any combination with coefficients of at least 0 is non-decreasing, of at least 0, twice differentiable between the outer
/// knots, and constant beyond them.
///
/// # Source
/// Ramsay, "Monotone regression splines in action" (Statist. Sci. 3(4), 1988).
#[derive(Clone, Debug, PartialEq)]
pub struct MonotoneSpline {
    /// Knots in `ln lambda`, the outer ones three times.
    padded: Vec<f64>,
}

impl MonotoneSpline {
    /// The basis of at least 2 increasing knots, in `ln lambda`.
    #[must_use]
    pub fn new(knots: &[f64]) -> Self {
        let (first, last) = (knots.first().copied().unwrap_or(0.0), knots.last().copied().unwrap_or(1.0));
        let mut padded = vec![first; 2];
        padded.extend(knots);
        padded.extend([last; 2]);
        Self { padded }
    }

    /// Number of basis functions of `knots` knots, with the constant.
    #[must_use]
    pub fn terms(knots: usize) -> usize {
        knots + 2
    }

    /// Values of the basis functions at `ln lambda`, `[knots + 2]`.
    pub fn basis(&self, at: f64, out: &mut [f64]) {
        let t = &self.padded;
        let (first, last) = (t[0], t[t.len() - 1]);
        let x = at.clamp(first, last);
        // Cubic B-splines over knots with one more at each end; the sum of those from j on is the j-th integrated spline.
        let knot = |i: usize| t[i.saturating_sub(1).min(t.len() - 1)];
        let count = t.len() + 2 - 4;
        let mut b = vec![0.0; t.len() + 1];
        let span = (3..count).rev().find(|&i| knot(i) <= x).unwrap_or(3);
        b[span] = 1.0;
        for degree in 1..=3 {
            for i in span - degree..=span {
                let left = knot(i + degree) - knot(i);
                let right = knot(i + degree + 1) - knot(i + 1);
                let mut value = 0.0;
                if left > 0.0 {
                    value += (x - knot(i)) / left * b[i];
                }
                if right > 0.0 && i + 1 < b.len() {
                    value += (knot(i + degree + 1) - x) / right * b[i + 1];
                }
                b[i] = value;
            }
        }
        let mut sum = 0.0;
        for j in (1..count).rev() {
            sum += b[j];
            if let Some(out) = out.get_mut(j) {
                *out = sum.min(1.0);
            }
        }
        if let Some(out) = out.first_mut() {
            *out = 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_functions_rise_from_0_to_1_and_are_smooth() {
        let knots = [1.0, 2.0, 2.5, 4.0, 7.0];
        let spline = MonotoneSpline::new(&knots);
        let n = MonotoneSpline::terms(knots.len());
        let at = |x: f64| {
            let mut out = vec![f64::NAN; n];
            spline.basis(x, &mut out);
            out
        };
        assert_eq!(at(0.0), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(at(9.0).iter().all(|x| (x - 1.0).abs() < 1e-14), "{:?}", at(9.0));
        let mut last = at(1.0);
        for k in 1..=600 {
            let next = at(1.0 + 0.01 * f64::from(k));
            for (a, b) in last.iter().zip(&next) {
                assert!(*b >= a - 1e-15 && b - a < 0.06, "at {k}: {last:?} {next:?}");
            }
            last = next;
        }
        // A second difference without jumps at the knots.
        let bend = |x: f64, j: usize| (at(x + 1e-3)[j] - 2.0 * at(x)[j] + at(x - 1e-3)[j]) / 1e-6;
        for knot in [2.0, 2.5, 4.0] {
            for j in 1..n {
                assert!((bend(knot - 2e-3, j) - bend(knot + 2e-3, j)).abs() < 0.1, "{knot} {j}");
            }
        }
    }
}
