//! Slow methods that other fits are compared with.

use super::emg::hazard;
use super::likelihood::{ETA, Likelihood};
use super::newton::{Objective, projected_norm};
use super::nnls::nnls;
use super::scan::{Effort, LocalMaximum};

/// Largest change of a parameter in one step of the ascent.
const STEP: f64 = 1e-3;

/// The paper's method: steps of fixed length factor along the gradient of the mean, from `z` on.
///
/// # Source
/// Sterling et al. (IEEE TVCG 25(5), 2019), section 4.4, which states neither step nor stopping rule.
#[must_use]
pub fn gradient_ascent(
    likelihood: &Likelihood<'_>,
    mut z: Vec<f64>,
    floor: f64,
    steps: usize,
    effort: &mut Effort,
) -> LocalMaximum {
    let bounds = likelihood.bounds(floor);
    let p = z.len() - 2;
    let mut gradient = vec![0.0; z.len()];
    let mut value = likelihood.gradient(&z, &mut gradient);
    for _ in 0..steps {
        // In sigma and eta themselves, as in the paper, not in their logarithms.
        for k in [p, p + 1] {
            let x = libm::exp(z[k]);
            let moved = x + STEP * gradient[k] / x;
            z[k] = libm::log(moved.clamp(0.5 * x, 2.0 * x)).clamp(bounds[k][0], bounds[k][1]);
        }
        for k in 0..p {
            z[k] = (z[k] + STEP * gradient[k]).clamp(bounds[k][0], bounds[k][1]);
        }
        value = likelihood.gradient(&z, &mut gradient);
        effort.add(1, 1);
    }
    let gradient = projected_norm(&z, &gradient, &bounds);
    LocalMaximum { z, value, gradient }
}

/// Expectation-maximisation for one `sigma`: monotone, and closed at each step.
///
/// The expected excess `e_i = -sigma q_i` is taken off, the curve is a non-negative least-squares fit of the rest at the exponent of the
/// start, and `sigma^2 = mean((y - c - e)^2 + V)`, `eta = 1/mean(e)`. Stops when a step gains less than 1e-12 nats a point.
#[must_use]
pub fn em(
    likelihood: &Likelihood<'_>,
    mut z: Vec<f64>,
    floor: f64,
    steps: usize,
    effort: &mut Effort,
) -> LocalMaximum {
    let sample = likelihood.sample();
    let (linear, p) = (sample.family.linear_parameters(), z.len() - 2);
    let exponent = if sample.family.has_exponent() { z[linear] } else { 1.0 };
    let root: Vec<f64> = sample.weight.iter().map(|w| w.sqrt()).collect();
    let mut basis = sample.basis_of(exponent);
    basis.chunks_exact_mut(linear).zip(&root).for_each(|(row, w)| row.iter_mut().for_each(|b| *b *= w));
    let mut objective = likelihood.clone();
    let mut value = objective.value(&z);
    for _ in 0..steps {
        let (sigma, eta) = (libm::exp(z[p]), libm::exp(z[p + 1]));
        let curve = sample.curve(&z[..p]);
        let (mut rest, mut excess) = (vec![0.0; sample.len()], vec![0.0; sample.len()]);
        let (mut mean, mut variance) = (0.0, 0.0);
        for i in 0..sample.len() {
            let hazard = hazard(eta * sigma - (sample.y[i] - curve[i]) / sigma);
            excess[i] = -sigma * hazard.q;
            rest[i] = root[i] * (sample.y[i] - excess[i]);
            mean += sample.weight[i] * excess[i];
            variance += sample.weight[i] * sigma * sigma * hazard.dq;
        }
        let theta = nnls(&basis, &rest, linear);
        z[..linear].copy_from_slice(&theta);
        let curve = sample.curve(&z[..p]);
        for i in 0..sample.len() {
            variance += sample.weight[i] * (sample.y[i] - curve[i] - excess[i]).powi(2);
        }
        let total = likelihood.total_weight();
        z[p] = libm::log((variance / total).sqrt().max(floor));
        z[p + 1] = libm::log((total / mean).clamp(ETA[0], ETA[1]));
        let next = objective.value(&z);
        effort.add(1, 2);
        let gain = next - value;
        value = next;
        if gain < 1e-12 {
            break;
        }
    }
    let mut gradient = vec![0.0; z.len()];
    likelihood.gradient(&z, &mut gradient);
    LocalMaximum { gradient: projected_norm(&z, &gradient, &likelihood.bounds(floor)), z, value }
}
