//! Joint refinement of modes by Levenberg and Marquardt's method.

use super::dictionary::{Problem, Products};
use super::exponentials::{C, add, moment_products};
use faer::Mat;
use faer::linalg::solvers::Solve;
use std::f64::consts::TAU;

/// Maximum number of steps.
const STEPS: usize = 12;
/// Number of times that a step is shortened.
const TRIALS: usize = 6;
/// Relative gain of a step below which the refinement ends.
const GAIN: f64 = 1e-3;

/// Limits of modes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Lowest and highest frequency, Hz.
    pub(super) band: [f64; 2],
    /// Smallest and largest decay rate, 1/s.
    pub(super) decays: [f64; 2],
}

/// Damped sines with their amplitudes: `sum of Re(a exp(s n))`.
#[derive(Clone, Debug, Default)]
pub(super) struct Sines {
    /// Exponents, per sample.
    pub(super) exponents: Vec<C>,
    /// Complex amplitudes at the first sample.
    pub(super) amplitudes: Vec<C>,
}

/// The sound without the sines.
pub(super) fn without(sound: &[f64], sines: &Sines) -> Vec<f64> {
    let mut residual = sound.to_vec();
    let negative: Vec<C> = sines.amplitudes.iter().map(|a| -a).collect();
    add(&mut residual, &sines.exponents, &negative);
    residual
}

/// The part of a recording that a set of exponents explains.
struct State {
    sines: Sines,
    /// Products of the recording with `exp(s n)` and `n exp(s n)`.
    products: Vec<[C; 2]>,
    explained: f64,
}

fn state(x: &[f64], problem: &Problem, exponents: Vec<C>) -> Option<State> {
    let products = moment_products(x, &exponents);
    let first: Vec<C> = products.iter().map(|p| p[0]).collect();
    let (amplitudes, explained) = problem.amplitudes(&exponents, &first)?;
    Some(State { sines: Sines { exponents, amplitudes }, products, explained })
}

/// Columns of the model for mode k: `n Re(u exp(s n))` for ln d and omega, `Re(u exp(s n))` for Re a and Im a, as powers of n and u.
fn columns(sines: &Sines, k: usize) -> [(usize, C); 4] {
    let (a, d) = (sines.amplitudes[k], -sines.exponents[k].re);
    let i = C::new(0.0, 1.0);
    [(1, -d * a), (1, i * a), (0, C::new(1.0, 0.0)), (0, i)]
}

/// Products of the columns of the model with each other, four for each mode.
fn normal_matrix(sines: &Sines, problem: &Problem) -> Mat<f64> {
    let m = sines.exponents.len();
    let mut matrix = Mat::<f64>::zeros(4 * m, 4 * m);
    for k in 0..m {
        for l in 0..=k {
            let products = Products::new(sines.exponents[k], sines.exponents[l], problem);
            for (r, (p, u)) in columns(sines, k).into_iter().enumerate() {
                for (c, (q, v)) in columns(sines, l).into_iter().enumerate() {
                    let x = products.of(p + q, u, v);
                    matrix[(4 * k + r, 4 * l + c)] = x;
                    matrix[(4 * l + c, 4 * k + r)] = x;
                }
            }
        }
    }
    matrix
}

/// The normal matrix with the penalty, and the gradient: products of the columns with the residual.
fn normal_equations(state: &State, problem: &Problem) -> (Mat<f64>, Vec<f64>) {
    let sines = &state.sines;
    let m = sines.exponents.len();
    let mut matrix = normal_matrix(sines, problem);
    for k in 0..m {
        matrix[(4 * k + 2, 4 * k + 2)] += problem.ridge;
        matrix[(4 * k + 3, 4 * k + 3)] += problem.ridge;
    }
    let entry = |row: usize| {
        let (power, u) = columns(sines, row / 4)[row % 4];
        let recording = (u * state.products[row / 4][power].conj()).re;
        // The penalty of the amplitudes is part of the matrix.
        let model = |l: usize| {
            let a = sines.amplitudes[l];
            matrix[(row, 4 * l + 2)] * a.re + matrix[(row, 4 * l + 3)] * a.im
        };
        recording - (0..m).map(model).sum::<f64>()
    };
    let gradient = (0..4 * m).map(entry).collect();
    (matrix, gradient)
}

fn scaled(matrix: &Mat<f64>, damping: f64) -> (Mat<f64>, Vec<f64>) {
    let n = matrix.nrows();
    let scale: Vec<f64> = (0..n).map(|i| 1.0 / matrix[(i, i)].max(1e-300).sqrt()).collect();
    let unit = |i: usize, j: usize| matrix[(i, j)] * scale[i] * scale[j] + if i == j { damping } else { 0.0 };
    (Mat::from_fn(n, n, unit), scale)
}

/// Refines decay rates and frequencies jointly, with the best amplitudes at each step; `None` if the modes are linearly dependent.
///
/// All products of the model with itself have closed forms: a step costs one pass over the recording for each mode.
///
/// # Complexity
/// O(steps (samples modes + modes^3)).
///
/// # Source
/// Golub and Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares problems whose variables separate" (SIAM J.
/// Numer. Anal. 10, 1973), with the full Jacobian.
pub(super) fn refine(
    x: &[f64],
    problem: &Problem,
    rate: f64,
    limits: &Limits,
    exponents: &[C],
) -> Option<Sines> {
    let total: f64 = x.iter().map(|x| x * x).sum();
    let mut now = state(x, problem, exponents.to_vec())?;
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let (matrix, gradient) = normal_equations(&now, problem);
        let mut better = None;
        for _ in 0..TRIALS {
            let (scaled, scale) = scaled(&matrix, damping);
            let Ok(decomposition) = scaled.llt(faer::Side::Lower) else {
                damping *= 5.0;
                continue;
            };
            let step = decomposition.solve(&Mat::from_fn(gradient.len(), 1, |i, _| gradient[i] * scale[i]));
            let step = |row: usize| step[(row, 0)] * scale[row];
            let moved = now.sines.exponents.iter().enumerate().map(|(k, s)| {
                let d = -s.re;
                let log_step = step(4 * k).clamp(-0.7, 0.7);
                let d_new = (d * log_step.exp()).clamp(limits.decays[0] / rate, limits.decays[1] / rate);
                let reach = 2.0 * d + 1e-4;
                let w = s.im + step(4 * k + 1).clamp(-reach, reach);
                C::new(-d_new, w.clamp(TAU * limits.band[0] / rate, TAU * limits.band[1] / rate))
            });
            if let Some(trial) = state(x, problem, moved.collect()).filter(|t| t.explained > now.explained) {
                better = Some(trial);
                break;
            }
            damping *= 5.0;
        }
        let Some(better) = better else { break };
        let gain = (better.explained - now.explained) / (total - now.explained).max(1e-12 * total);
        now = better;
        damping = (damping / 5.0).max(1e-9);
        if gain < GAIN {
            break;
        }
    }
    Some(now.sines)
}

/// Standard deviations of frequency and decay rate, in 1/sample, per unit standard deviation of white noise.
pub(super) fn unit_deviations(sines: &Sines, problem: &Problem) -> Option<Vec<[f64; 2]>> {
    let m = sines.exponents.len();
    let matrix = normal_matrix(sines, problem);
    let n = 4 * m;
    // Nearly equal modes make the matrix singular; their deviations are large, whatever is added to its diagonal.
    let (inverse, scale) = [0.0, 1e-12, 1e-10, 1e-8].into_iter().find_map(|damping| {
        let (scaled, scale) = scaled(&matrix, damping);
        let decomposition = scaled.llt(faer::Side::Lower).ok()?;
        Some((decomposition.solve(&Mat::<f64>::identity(n, n)), scale))
    })?;
    let deviation = |row: usize| inverse[(row, row)].max(0.0).sqrt() * scale[row];
    Some((0..m).map(|k| [deviation(4 * k + 1), deviation(4 * k) * -sines.exponents[k].re]).collect())
}

#[cfg(test)]
mod tests {
    use super::super::exponentials::add;
    use super::*;
    use crate::core::random::Rng;
    use crate::statistics::normal::normal_quantile;

    const RATE: f64 = 44_100.0;
    const LIMITS: Limits = Limits { band: [20.0, 20_000.0], decays: [0.1, 8000.0] };

    fn exponent(f: f64, d: f64) -> C {
        C::new(-d / RATE, TAU * f / RATE)
    }

    #[test]
    fn a_start_nearby_ends_at_the_modes_of_the_signal() {
        let truth = [exponent(500.0, 8.0), exponent(503.0, 10.0), exponent(3000.0, 60.0)];
        let mut x = vec![0.0; 44_100];
        add(&mut x, &truth, &[C::new(0.5, 0.1), C::new(0.2, -0.4), C::new(0.3, 0.0)]);
        let start = [exponent(500.3, 6.0), exponent(502.6, 13.0), exponent(2998.0, 80.0)];
        let problem = Problem { count: x.len(), after: 0, ridge: 0.0 };
        let found = refine(&x, &problem, RATE, &LIMITS, &start).unwrap();
        for (found, truth) in found.exponents.iter().zip(truth) {
            assert!((found - truth).norm() < 1e-4 * -truth.re, "{found} {truth}");
        }
    }

    #[test]
    fn deviations_in_white_noise_are_those_of_the_estimates() {
        let truth = exponent(1000.0, 20.0);
        let (noise, runs) = (0.01, 60);
        let mut rng = Rng::new(11);
        let mut errors = [0.0; 2];
        let mut deviation = [0.0; 2];
        for _ in 0..runs {
            let mut x: Vec<f64> = (0..22_050).map(|_| noise * normal_quantile(rng.uniform())).collect();
            add(&mut x, &[truth], &[C::new(1.0, 0.0)]);
            let problem = Problem { count: x.len(), after: 0, ridge: 0.0 };
            let found = refine(&x, &problem, RATE, &LIMITS, &[truth]).unwrap();
            let error = found.exponents[0] - truth;
            errors = [errors[0] + error.im * error.im, errors[1] + error.re * error.re];
            deviation = unit_deviations(&found, &problem).unwrap()[0];
        }
        for (error, deviation) in errors.into_iter().zip(deviation) {
            let ratio = (error / f64::from(runs)).sqrt() / (noise * deviation);
            assert!((0.75..1.3).contains(&ratio), "{ratio}");
        }
        // The bound 4 (s / a) d^(3/2) rate^(-1/2).
        let bound = 4.0 * noise * 20.0_f64.powf(1.5) / RATE.sqrt();
        assert!(
            (0.9..1.2).contains(&(deviation[1] * noise * RATE / bound)),
            "{}",
            deviation[1] * noise * RATE / bound
        );
    }
}
