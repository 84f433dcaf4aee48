//! Projected Newton ascent within bounds.

use crate::statistics::linear::cholesky_solve;

/// A smooth function to be maximised.
pub(crate) trait Objective {
    /// Its value; not finite outside of its domain.
    fn value(&mut self, z: &[f64]) -> f64;
    /// Its value, gradient `[n]` and Hessian `[n * n]`.
    fn derivatives(&mut self, z: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64;
}

/// Maximum number of times that a step is damped more.
const MAX_DAMPINGS: usize = 40;
/// Shortest fraction of a Newton step that is tried.
const MIN_LENGTH: f64 = 1e-9;
/// Relative gain below which a change of the value is rounding error.
const ROUNDING: f64 = 1e-13;

/// Condition at which an ascent ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stop {
    /// The largest component of the projected gradient is at most this.
    Gradient(f64),
    /// A Newton step is expected to gain at most this; the step is taken, and its gain is not evaluated.
    Gain(f64),
}

/// Result of an ascent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Ascent {
    /// Value at the end.
    pub value: f64,
    /// Largest component of the projected gradient at the end.
    pub gradient: f64,
    /// Number of steps.
    pub steps: usize,
    /// Number of evaluations of the value, with or without derivatives.
    pub evaluations: usize,
}

/// Returns true if the bound at `z` prevents a step along the gradient `g`.
pub(crate) fn blocked(z: f64, g: f64, [low, high]: [f64; 2]) -> bool {
    (z <= low && g <= 0.0) || (z >= high && g >= 0.0)
}

/// Largest component of the gradient that no bound blocks.
pub(crate) fn projected_norm(z: &[f64], gradient: &[f64], bounds: &[[f64; 2]]) -> f64 {
    let free = z.iter().zip(gradient).zip(bounds).filter(|((z, g), b)| !blocked(**z, **g, **b));
    free.map(|((_, g), _)| g.abs()).fold(0.0, f64::max)
}

/// Maximises a function from `z` on, in place: Newton steps in the free variables, damped where the Hessian is not negative definite,
/// with backtracking (Armijo, 1e-4) along the projected step.
///
/// Ends by `stop`, when a step gains nothing, or after `max_steps`. A step costs one evaluation of value and derivatives unless it has to be
/// shortened.
///
/// # Source
/// Bertsekas, "Projected Newton methods for optimization problems with simple constraints" (SIAM J. Control Optim. 20(2), 1982).
pub(crate) fn newton(
    objective: &mut impl Objective,
    bounds: &[[f64; 2]],
    z: &mut [f64],
    stop: Stop,
    max_steps: usize,
) -> Ascent {
    let n = z.len();
    let (tolerance, enough) = match stop {
        Stop::Gradient(tolerance) => (tolerance, 0.0),
        Stop::Gain(gain) => (0.0, gain),
    };
    let (mut g, mut h) = (vec![0.0; n], vec![0.0; n * n]);
    let (mut next_g, mut next_h) = (vec![0.0; n], vec![0.0; n * n]);
    let (mut trial, mut direction) = (vec![0.0; n], Vec::with_capacity(n));
    let (mut system, mut free) = (Vec::with_capacity(n * n), Vec::with_capacity(n));
    z.iter_mut().zip(bounds).for_each(|(z, [low, high])| *z = z.clamp(*low, *high));
    let mut out =
        Ascent { value: objective.derivatives(z, &mut g, &mut h), evaluations: 1, ..Ascent::default() };
    let mut damping = 0.0;
    'steps: while out.value.is_finite() {
        out.gradient = projected_norm(z, &g, bounds);
        if out.gradient <= tolerance || out.steps >= max_steps {
            break;
        }
        free.clear();
        free.extend((0..n).filter(|&i| !blocked(z[i], g[i], bounds[i])));
        let m = free.len();
        for _ in 0..MAX_DAMPINGS {
            system.clear();
            for &i in &free {
                system.extend(free.iter().map(|&j| -h[i * n + j]));
            }
            for (k, &i) in free.iter().enumerate() {
                system[k * m + k] += damping * (h[i * n + i].abs() + 1e-12);
            }
            direction.clear();
            direction.extend(free.iter().map(|&i| g[i]));
            let solved = cholesky_solve(&mut system, &mut direction, m);
            let mut length = 1.0;
            while solved && length > MIN_LENGTH {
                trial.copy_from_slice(z);
                for (&i, d) in free.iter().zip(&direction) {
                    trial[i] = (z[i] + length * d).clamp(bounds[i][0], bounds[i][1]);
                }
                let gain: f64 = (0..n).map(|i| g[i] * (trial[i] - z[i])).sum();
                let inside = || {
                    free.iter().zip(&direction).all(|(&i, d)| (trial[i] - z[i] - d).abs() <= 1e-9 * d.abs())
                };
                if gain > 0.0 && 0.5 * gain <= enough && length == 1.0 && damping == 0.0 && inside() {
                    z.copy_from_slice(&trial);
                    out.value += 0.5 * gain;
                    out.steps += 1;
                    break 'steps;
                }
                if gain <= ROUNDING * out.value.abs().max(1.0) {
                    // The value has no digits left for such a step; the gradient has.
                    let next = objective.derivatives(&trial, &mut next_g, &mut next_h);
                    out.evaluations += 1;
                    let shorter = projected_norm(&trial, &next_g, bounds) < 0.5 * out.gradient;
                    if !(next.is_finite() && shorter) {
                        break 'steps;
                    }
                    z.copy_from_slice(&trial);
                    (g, next_g) = (next_g, g);
                    (h, next_h) = (next_h, h);
                    out.value = next;
                    out.steps += 1;
                    continue 'steps;
                }
                // Full steps are accepted as a rule, and need derivatives next.
                let full = length == 1.0;
                let next = if full {
                    objective.derivatives(&trial, &mut next_g, &mut next_h)
                } else {
                    objective.value(&trial)
                };
                out.evaluations += 1;
                if next.is_finite() && next >= out.value + 1e-4 * gain {
                    z.copy_from_slice(&trial);
                    if full {
                        (g, next_g) = (next_g, g);
                        (h, next_h) = (next_h, h);
                        out.value = next;
                    } else {
                        out.value = objective.derivatives(z, &mut g, &mut h);
                        out.evaluations += 1;
                    }
                    out.steps += 1;
                    damping = if length == 1.0 && damping > 1e-9 { damping * 0.1 } else { 0.0 };
                    continue 'steps;
                }
                length *= 0.3;
            }
            damping = if damping == 0.0 { 1e-3 } else { damping * 8.0 };
        }
        break;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `-(x - 1)^2 - 10 (y - x^2)^2`.
    struct Valley;

    impl Objective for Valley {
        fn value(&mut self, z: &[f64]) -> f64 {
            -(z[0] - 1.0).powi(2) - 10.0 * (z[1] - z[0] * z[0]).powi(2)
        }

        fn derivatives(&mut self, z: &[f64], g: &mut [f64], h: &mut [f64]) -> f64 {
            let r = z[1] - z[0] * z[0];
            g.copy_from_slice(&[-2.0 * (z[0] - 1.0) + 40.0 * r * z[0], -20.0 * r]);
            h.copy_from_slice(&[-2.0 + 40.0 * r - 80.0 * z[0] * z[0], 40.0 * z[0], 40.0 * z[0], -20.0]);
            self.value(z)
        }
    }

    #[test]
    fn a_bent_valley_is_climbed_to_its_top_and_to_a_bound() {
        let mut z = [-1.2, 1.0];
        let out = newton(&mut Valley, &[[-5.0, 5.0]; 2], &mut z, Stop::Gradient(1e-12), 100);
        assert!((z[0] - 1.0).abs() < 1e-12 && (z[1] - 1.0).abs() < 1e-12, "{z:?} {out:?}");
        let mut z = [-1.2, 1.0];
        newton(&mut Valley, &[[-5.0, 0.5], [-5.0, 5.0]], &mut z, Stop::Gradient(1e-12), 100);
        assert!(z[0] == 0.5 && (z[1] - 0.25).abs() < 1e-12, "{z:?}");
    }
}
