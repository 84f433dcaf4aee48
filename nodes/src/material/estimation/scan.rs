//! The scan over shapes: a global optimum of a plain likelihood whose curve is linear in its parameters.

use super::emg::{log_shape, terms};
use super::likelihood::{ETA, Likelihood, SIGMA_MAX};
use super::newton::{Objective, Stop, newton};
use super::point::Sample;

/// Smallest and largest shape `k = eta sigma` of the default grid.
const GRID: [f64; 2] = [1e-3, 30.0];
/// Number of shapes of the default grid.
const GRID_COUNT: usize = 25;
/// Expected gain in nats of a step along the shapes that is taken without an evaluation.
const SCAN_GAIN: f64 = 0.1;
/// The end of an ascent at a shape between those of the grid.
const EXACT: Stop = Stop::Gradient(1e-7);
/// Maximum number of basis functions.
const MAX_TERMS: usize = 16;
/// Smallest shape of the thorough grid.
const THOROUGH_FROM: f64 = 1e-4;
/// Number of shapes of the thorough grid.
const THOROUGH_COUNT: usize = 60;

/// A local maximum of the likelihood.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalMaximum {
    /// `theta`, `ln sigma`, `ln eta` in normalised units.
    pub z: Vec<f64>,
    /// Mean log-likelihood.
    pub value: f64,
    /// Largest component of the projected gradient of the mean.
    pub gradient: f64,
}

/// Counters of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effort {
    /// Number of steps.
    pub iterations: usize,
    /// Number of evaluations of the likelihood.
    pub evaluations: usize,
}

impl Effort {
    pub(super) fn add(&mut self, iterations: usize, evaluations: usize) {
        self.iterations += iterations;
        self.evaluations += evaluations;
    }
}

/// The log-likelihood at a fixed shape `k`, in `tau = 1/sigma` and `psi = theta/sigma`: jointly concave.
///
/// Each term is `ln k + ln tau + h(tau y - x psi, k)`, and `h` is concave in its first argument because the density is
/// log-concave. The columns of `x` have unit root mean square.
struct FixedShape {
    /// Observation, weight and values of the basis functions of each point.
    rows: Vec<f64>,
    /// Number of basis functions.
    terms: usize,
    total: f64,
    k: f64,
}

impl FixedShape {
    fn new(sample: &Sample, basis: &[f64], total: f64, k: f64) -> Self {
        let terms = basis.len() / sample.len();
        let mut rows = Vec::with_capacity(sample.len() * (terms + 2));
        for ((row, y), w) in basis.chunks_exact(terms).zip(&sample.y).zip(&sample.weight) {
            if *w > 0.0 {
                rows.extend([*y, *w]);
                rows.extend(row);
            }
        }
        Self { rows, terms, total, k }
    }

    /// Sums of the weighted terms and of their derivatives, for at most `P` basis functions.
    fn sums<const P: usize>(&self, z: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        let p = self.terms;
        let mut psi = [0.0; P];
        psi[..p].copy_from_slice(&z[1..]);
        let mut row = [0.0; P];
        let (mut sum, mut by_tau, mut tau_tau) = (0.0, 0.0, 0.0);
        let (mut by_psi, mut tau_psi, mut psi_psi) = ([0.0; P], [0.0; P], [[0.0; P]; P]);
        for point in self.rows.chunks_exact(p + 2) {
            let (y, w) = (point[0], point[1]);
            row[..p].copy_from_slice(&point[2..]);
            let curve: f64 = row.iter().zip(&psi).map(|(b, p)| b * p).sum();
            let t = terms(z[0] * y - curve, self.k);
            sum += w * t.value;
            let (slope, bend) = (w * t.u, w * t.uu);
            by_tau += slope * y;
            tau_tau += bend * y * y;
            for a in 0..P {
                by_psi[a] -= slope * row[a];
                tau_psi[a] -= bend * row[a] * y;
                for b in a..P {
                    psi_psi[a][b] += bend * row[a] * row[b];
                }
            }
        }
        let n = p + 1;
        (gradient[0], hessian[0]) = (by_tau, tau_tau);
        for a in 0..p {
            gradient[a + 1] = by_psi[a];
            (hessian[a + 1], hessian[(a + 1) * n]) = (tau_psi[a], tau_psi[a]);
            for b in a..p {
                hessian[(a + 1) * n + b + 1] = psi_psi[a][b];
                hessian[(b + 1) * n + a + 1] = psi_psi[a][b];
            }
        }
        sum
    }
}

impl Objective for FixedShape {
    fn value(&mut self, z: &[f64]) -> f64 {
        if z[0] <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let term = |point: &[f64]| {
            let curve: f64 = point[2..].iter().zip(&z[1..]).map(|(b, p)| b * p).sum();
            point[1] * log_shape(z[0] * point[0] - curve, self.k)
        };
        let sum: f64 = self.rows.chunks_exact(self.terms + 2).map(term).sum();
        libm::log(self.k * z[0]) + sum / self.total
    }

    fn derivatives(&mut self, z: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        if z[0] <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let sum = match self.terms {
            0..=2 => self.sums::<2>(z, gradient, hessian),
            3 | 4 => self.sums::<4>(z, gradient, hessian),
            _ => self.sums::<MAX_TERMS>(z, gradient, hessian),
        };
        gradient.iter_mut().for_each(|g| *g /= self.total);
        hessian.iter_mut().for_each(|h| *h /= self.total);
        gradient[0] += 1.0 / z[0];
        hessian[0] -= 1.0 / (z[0] * z[0]);
        libm::log(self.k * z[0]) + sum / self.total
    }
}

/// The scan of one likelihood for one exponent.
struct Scan {
    objective: FixedShape,
    /// Root mean square of each column.
    scale: Vec<f64>,
    bounds: Vec<[f64; 2]>,
    effort: Effort,
}

impl Scan {
    /// Maximises at `k` from `z` on; returns the mean log-likelihood.
    fn at(&mut self, log_k: f64, z: &mut [f64], stop: Stop) -> f64 {
        self.objective.k = libm::exp(log_k);
        // eta = k tau has bounds of its own.
        let most = (ETA[1] / self.objective.k).min(self.bounds[0][1]);
        let mut bounds = self.bounds.clone();
        bounds[0] = [(ETA[0] / self.objective.k).max(bounds[0][0]), most];
        let out = newton(&mut self.objective, &bounds, z, stop, 100);
        self.effort.add(out.steps, out.evaluations);
        out.value
    }

    /// `theta`, `ln sigma`, `ln eta` of `z` at `k`.
    fn parameters(&self, log_k: f64, z: &[f64]) -> Vec<f64> {
        let mut out: Vec<f64> = z[1..].iter().zip(&self.scale).map(|(p, s)| p / s / z[0]).collect();
        let log_tau = libm::log(z[0]);
        out.extend([-log_tau, log_k + log_tau]);
        out
    }
}

/// Local maxima of a plain likelihood along the shape, each refined, the best first.
///
/// At every shape `k = eta sigma` of a logarithmic grid the problem is concave, so its maximum is the global one; each local maximum
/// of this profile is then refined in all parameters. `exponent` is fixed where the family has one.
///
/// # Complexity
/// O(s n p^2) for s evaluations, 74 in all for 752 points: each of 25 shapes starts from an extrapolation of those before it.
#[must_use]
pub fn scan(
    likelihood: &Likelihood<'_>,
    exponent: Option<f64>,
    start: &[f64],
    floor: f64,
    thorough: bool,
    effort: &mut Effort,
) -> Vec<LocalMaximum> {
    let sample = likelihood.sample();
    let p = sample.family.linear_parameters();
    let mut basis = sample.basis_of(exponent.unwrap_or(1.0));
    let mut scale = vec![0.0; p];
    basis.chunks_exact(p).for_each(|row| row.iter().zip(&mut scale).for_each(|(b, s)| *s += b * b));
    scale.iter_mut().for_each(|s| *s = (*s / sample.len() as f64).sqrt().max(1e-150));
    basis.chunks_exact_mut(p).for_each(|row| row.iter_mut().zip(&scale).for_each(|(b, s)| *b /= s));
    let mut bounds = vec![[1.0 / SIGMA_MAX, 1.0 / floor]];
    bounds.extend(vec![[0.0, f64::MAX]; p]);
    let total = likelihood.total_weight();
    let objective = FixedShape::new(sample, &basis, total, 1.0);
    let mut scan = Scan { objective, scale, bounds, effort: *effort };
    let (from, count) = if thorough { (THOROUGH_FROM, THOROUGH_COUNT) } else { (GRID[0], GRID_COUNT) };
    let (top, bottom) = (libm::log(GRID[1]), libm::log(from));
    let grid: Vec<f64> = (0..count).map(|j| top + (bottom - top) * j as f64 / (count - 1) as f64).collect();
    let sigma = start.get(p).copied().unwrap_or(0.5);
    let mut z = vec![1.0 / sigma];
    z.extend(start[..p].iter().zip(&scan.scale).map(|(t, s)| t * s / sigma));
    let mut profile: Vec<(f64, Vec<f64>)> = Vec::with_capacity(count);
    for log_k in &grid {
        extrapolate(&profile, &mut z);
        let value = scan.at(*log_k, &mut z, Stop::Gain(SCAN_GAIN / total));
        profile.push((value, z.clone()));
    }
    let mut found = Vec::new();
    for j in 0..count {
        let value = profile[j].0;
        let left = j == 0 || profile[j - 1].0 < value;
        let right = j + 1 == count || profile[j + 1].0 <= value;
        if !(left && right && value.is_finite()) {
            continue;
        }
        let mut maximum =
            refine(likelihood, exponent, scan.parameters(grid[j], &profile[j].1), floor, &mut scan.effort);
        let log_k = maximum.z[maximum.z.len() - 2] + maximum.z[maximum.z.len() - 1];
        let inside = (j == 0 || log_k < grid[j - 1]) && (j + 1 == count || log_k > grid[j + 1]);
        if !inside || maximum.value < value - SCAN_GAIN / total {
            // The polish left the interval of this maximum: refine it along the profile first.
            let (low, high) = (grid[(j + 1).min(count - 1)], grid[j.saturating_sub(1)]);
            let mut z = profile[j].1.clone();
            let best = maximum_within(low, high, |log_k| scan.at(log_k, &mut z, EXACT));
            scan.at(best, &mut z, EXACT);
            let start = scan.parameters(best, &z);
            let again = refine(likelihood, exponent, start, floor, &mut scan.effort);
            if again.value > maximum.value || !inside {
                maximum = again;
            }
        }
        found.push(maximum);
    }
    *effort = scan.effort;
    found.sort_by(|a, b| b.value.total_cmp(&a.value));
    let close = |a: &LocalMaximum, b: &LocalMaximum| a.z.iter().zip(&b.z).all(|(a, b)| (a - b).abs() < 1e-5);
    found.dedup_by(|b, a| close(a, b));
    found
}

/// The next point of a path by a parabola or a line through its last ones, apart from components whose sign would change.
fn extrapolate(path: &[(f64, Vec<f64>)], z: &mut [f64]) {
    for (i, z) in z.iter_mut().enumerate() {
        let next = match path {
            [.., (_, a), (_, b), (_, c)] => 3.0 * (c[i] - b[i]) + a[i],
            [(_, b), (_, c)] => 2.0 * c[i] - b[i],
            _ => return,
        };
        // It is the last point still.
        if next * *z > 0.0 {
            *z = next;
        }
    }
}

/// Newton steps in all parameters; an `exponent` that is given stays.
fn refine(
    likelihood: &Likelihood<'_>,
    exponent: Option<f64>,
    mut z: Vec<f64>,
    floor: f64,
    effort: &mut Effort,
) -> LocalMaximum {
    let mut bounds = likelihood.bounds(floor);
    if let Some(exponent) = exponent {
        let p = likelihood.sample().family.linear_parameters();
        z.insert(p, exponent);
        bounds[p] = [exponent; 2];
    }
    let out = newton(&mut likelihood.clone(), &bounds, &mut z, Stop::Gradient(1e-12), 60);
    effort.add(out.steps, out.evaluations);
    LocalMaximum { z, value: out.value, gradient: out.gradient }
}

/// The position of a maximum of a function of one variable, by golden sections, to 1e-9.
pub(crate) fn maximum_within(mut low: f64, mut high: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let (mut a, mut b) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut fa, mut fb) = (f(a), f(b));
    while (high - low).abs() > 1e-9 {
        if fa > fb {
            (high, b, fb) = (b, a, fa);
            a = high - RATIO * (high - low);
            fa = f(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + RATIO * (high - low);
            fb = f(b);
        }
    }
    0.5 * (low + high)
}

/// `theta`, `ln sigma`, `ln eta` of the maximum at one shape, without a floor of `sigma`.
#[cfg(test)]
pub(super) fn at_shape(likelihood: &Likelihood<'_>, k: f64) -> Vec<f64> {
    let sample = likelihood.sample();
    let p = sample.family.linear_parameters();
    let basis = sample.basis_of(1.0);
    let objective = FixedShape::new(sample, &basis, likelihood.total_weight(), k);
    let mut bounds = vec![[1e-9, 1e12]];
    bounds.extend(vec![[0.0, f64::MAX]; p]);
    let mut scan = Scan { objective, scale: vec![1.0; p], bounds, effort: Effort::default() };
    let mut z = vec![1.0];
    z.extend(vec![0.1; p]);
    // From a wide shape to a narrow one, or the reverse, each from the last.
    let steps = 60;
    for j in 1..=steps {
        scan.at(libm::log(k) * f64::from(j) / f64::from(steps), &mut z, Stop::Gradient(1e-13));
    }
    scan.parameters(libm::log(k), &z)
}
