//! Entropic optimal transport between two clouds, and clusters for clouds that are too large for it.
//!
//! # Source
//! Cuturi, "Sinkhorn distances" (NIPS 2013); Schmitzer, "Stabilized sparse scaling algorithms for entropy regularized transport
//! problems" (SIAM J. Sci. Comput. 41(3), 2019), section 3.1, for scaling that neither over- nor underflows.

use rayon::prelude::*;

use crate::statistics::{Points, k_means, squared};

/// Maximum number of rounds of scaling.
const ROUNDS: usize = 300;
/// Change of a potential, over epsilon, below which it has settled.
const SETTLED: f64 = 1e-4;
/// Logarithm of a factor at which it is moved into the potentials.
const LARGE: f64 = 20.0;
/// Rows that are summed as one part, whatever the threads.
const ROWS: usize = 64;

/// A cloud of points that have different masses.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Cloud {
    pub points: Points,
    /// Masses of the points, which add up to 1.
    pub masses: Vec<f64>,
    /// Index of the merged point of each original one.
    pub of: Vec<usize>,
}

/// At most `most` points in place of many: the centres of clusters.
///
/// # Complexity
/// O(points x most) per round, of which there are eight; on all cores.
pub(super) fn clustered(points: Points, most: usize) -> Cloud {
    let n = points.len();
    let count = n.min(most.max(1));
    let (centres, of) = if n <= count { (points, (0..n).collect()) } else { k_means(&points, count) };
    let mut masses = vec![0.0; centres.len()];
    of.iter().for_each(|k: &usize| masses[*k] += 1.0 / n.max(1) as f64);
    Cloud { points: centres, masses, of }
}

/// Potentials over epsilon, the factors that change them, and the kernel of both.
struct Scaling<'a> {
    /// `-cost / epsilon`, `[n, m]`.
    scaled: Vec<f32>,
    masses: [&'a [f64]; 2],
    potentials: [Vec<f64>; 2],
    factors: [Vec<f64>; 2],
    kernel: Vec<f32>,
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 16];
    let ((a16, a_rest), (b16, b_rest)) = (a.as_chunks::<16>(), b.as_chunks::<16>());
    for (a, b) in a16.iter().zip(b16) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>()
}

/// `ln sum mass exp(value)`, relative to the largest value, without underflow.
fn log_sum(values: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let largest = values.clone().map(|(value, _)| value).fold(f64::NEG_INFINITY, f64::max);
    largest + libm::log(values.map(|(value, mass)| mass * libm::exp(value - largest)).sum::<f64>())
}

impl<'a> Scaling<'a> {
    fn new(a: &'a Cloud, b: &'a Cloud) -> Self {
        let m = b.points.len();
        let mut scaled = vec![0.0_f32; a.points.len() * m];
        let rows = scaled.par_chunks_exact_mut(m.max(1)).zip(a.points.at.par_chunks_exact(a.points.dims));
        rows.for_each(|(row, x)| {
            row.iter_mut().zip(b.points.rows()).for_each(|(cost, y)| *cost = squared(x, y) as f32);
        });
        let mut sorted = scaled.clone();
        let middle = sorted.len() / 2;
        let median = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
        let epsilon = (0.05 * median).max(1e-9);
        scaled.par_iter_mut().for_each(|cost| *cost /= -epsilon);
        let (n, masses) = (a.points.len(), [&a.masses[..], &b.masses[..]]);
        let potentials = [vec![0.0; n], vec![0.0; m]];
        let mut this =
            Self { scaled, masses, factors: potentials.clone(), potentials, kernel: vec![0.0; n * m] };
        this.exactly();
        this
    }

    fn width(&self) -> usize {
        self.potentials[1].len().max(1)
    }

    /// One round on the potentials themselves, without loss of precision, and the kernel again.
    fn exactly(&mut self) {
        let (m, scaled, masses) = (self.width(), &self.scaled, self.masses);
        let [f, g] = &mut self.potentials;
        let row = |i: usize| scaled[i * m..(i + 1) * m].iter().zip(&*g).zip(masses[1]);
        *f = (0..f.len())
            .into_par_iter()
            .map(|i| -log_sum(row(i).map(|((s, g), mass)| (f64::from(*s) + g, *mass))))
            .collect();
        let column = |j: usize| scaled[j..].iter().step_by(m).zip(&*f).zip(masses[0]);
        *g = (0..g.len())
            .into_par_iter()
            .map(|j| -log_sum(column(j).map(|((s, f), mass)| (f64::from(*s) + f, *mass))))
            .collect();
        self.absorb();
    }

    /// Moves the factors into the potentials.
    fn absorb(&mut self) {
        for (potentials, factors) in self.potentials.iter_mut().zip(&mut self.factors) {
            potentials.iter_mut().zip(&*factors).for_each(|(p, ln)| *p += ln);
            factors.fill(0.0);
        }
        let (m, [f, g]) = (self.width(), &self.potentials);
        let rows = self.kernel.par_chunks_exact_mut(m).zip(self.scaled.par_chunks_exact(m)).zip(f);
        rows.for_each(|((kernel, scaled), f)| {
            for ((k, s), g) in kernel.iter_mut().zip(scaled).zip(g) {
                *k = libm::expf((f64::from(*s) + f + g) as f32);
            }
        });
    }

    /// Masses times factors of one side.
    fn weights(&self, side: usize) -> Vec<f32> {
        let all = self.masses[side].iter().zip(&self.factors[side]);
        all.map(|(mass, ln)| (mass * libm::exp(*ln)) as f32).collect()
    }

    /// One round; the largest change of a potential.
    fn round(&mut self) -> f64 {
        let m = self.width();
        let weights = self.weights(1);
        let sums: Vec<f32> = self.kernel.par_chunks_exact(m).map(|row| dot(row, &weights)).collect();
        self.factors[0] = sums.iter().map(|sum| -libm::log(f64::from(*sum))).collect();
        let weights = self.weights(0);
        let part = |(rows, weights): (&[f32], &[f32])| {
            let mut sums = vec![0.0_f32; m];
            for (row, weight) in rows.chunks_exact(m).zip(weights) {
                sums.iter_mut().zip(row).for_each(|(sum, k)| *sum += weight * k);
            }
            sums
        };
        let parts: Vec<Vec<f32>> =
            self.kernel.par_chunks(ROWS * m).zip(weights.par_chunks(ROWS)).map(part).collect();
        let mut change = 0.0_f64;
        for (j, factor) in self.factors[1].iter_mut().enumerate() {
            let sum: f64 = parts.iter().map(|part| f64::from(part[j])).sum();
            let ln = -libm::log(sum);
            change = change.max((ln - *factor).abs());
            *factor = ln;
        }
        change
    }

    fn settle(&mut self) {
        for _ in 0..ROUNDS {
            let change = self.round();
            let largest = self.factors.iter().flatten().fold(0.0_f64, |most, ln| most.max(ln.abs()));
            if !(change.is_finite() && largest.is_finite()) {
                self.factors.iter_mut().for_each(|factors| factors.fill(0.0));
                self.exactly();
            } else if change < SETTLED {
                break;
            } else if largest > LARGE {
                self.absorb();
            }
        }
    }
}

/// Position among the points of `b` to which entropic optimal transport moves each of `a`, with
/// an entropy of 0.05 of the median cost.
///
/// # Complexity
/// O(n m) per round, of which there are at most 300; two tables of n x m in single precision. On all cores, with the same result
/// for any number of them.
pub(super) fn transported(a: &Cloud, b: &Cloud) -> Points {
    let dims = b.points.dims;
    if a.points.is_empty() || b.points.is_empty() {
        return Points { dims, at: Vec::new() };
    }
    let mut scaling = Scaling::new(a, b);
    scaling.settle();
    let weights = scaling.weights(1);
    let mut at = vec![0.0; a.points.len() * dims];
    let rows = at.par_chunks_exact_mut(dims).zip(scaling.kernel.par_chunks_exact(scaling.width()));
    rows.for_each(|(out, row)| {
        let mut total = f64::MIN_POSITIVE;
        for ((k, weight), y) in row.iter().zip(&weights).zip(b.points.rows()) {
            let share = f64::from(k * weight);
            total += share;
            out.iter_mut().zip(y).for_each(|(out, y)| *out += share * y);
        }
        out.iter_mut().for_each(|x| *x /= total);
    });
    Points { dims, at }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::statistics::nearest;

    fn cloud(n: usize, seed: u64, extent: f64) -> Points {
        let mut rng = Rng::new(seed);
        Points { dims: 2, at: (0..2 * n).map(|_| extent * rng.between(-1.0, 1.0)).collect() }
    }

    /// The method as published, in logarithms and double precision.
    fn plainly(a: &Cloud, b: &Cloud, epsilon: f64) -> Points {
        let (n, m) = (a.points.len(), b.points.len());
        let s = |i: usize, j: usize| -squared(a.points.row(i), b.points.row(j)) / epsilon;
        let (mut f, mut g) = (vec![0.0; n], vec![0.0; m]);
        for _ in 0..=ROUNDS {
            f = (0..n).map(|i| -log_sum((0..m).map(|j| (s(i, j) + g[j], b.masses[j])))).collect();
            g = (0..m).map(|j| -log_sum((0..n).map(|i| (s(i, j) + f[i], a.masses[i])))).collect();
        }
        let at = (0..n).flat_map(|i| {
            let share: Vec<f64> = (0..m).map(|j| b.masses[j] * (s(i, j) + f[i] + g[j]).exp()).collect();
            let total: f64 = share.iter().sum();
            [0, 1].map(|k| (0..m).map(|j| share[j] * b.points.row(j)[k]).sum::<f64>() / total)
        });
        Points { dims: 2, at: at.collect() }
    }

    #[test]
    fn scaling_finds_what_logarithms_do_also_where_kernels_underflow() {
        let a = clustered(cloud(40, 1, 1.0), 100);
        for (b, masses) in [(cloud(55, 2, 1.5), false), (cloud(30, 3, 1.0), true)] {
            let mut b = clustered(b, 100);
            if masses {
                // One point far away has to be reached by someone: a cost of more than a thousand epsilons.
                b.points.at[0] = 9.0;
                b.masses[0] = 0.3;
                b.masses[1..].iter_mut().for_each(|mass| *mass = 0.7 / 29.0);
            }
            let mut costs: Vec<f32> = (0..40 * b.points.len())
                .map(|k| squared(a.points.row(k / b.points.len()), b.points.row(k % b.points.len())) as f32)
                .collect();
            costs.sort_unstable_by(f32::total_cmp);
            let wanted = plainly(&a, &b, 0.05 * f64::from(costs[costs.len() / 2]));
            let found = transported(&a, &b);
            let far = found.at.iter().zip(&wanted.at).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
            assert!(far < 0.01, "{far}");
        }
        assert_eq!(transported(&Cloud::default(), &a).len(), 0);
    }

    #[test]
    fn a_shifted_cloud_is_transported_onto_itself() {
        let a = clustered(cloud(300, 4, 1.0), 300);
        let mut b = a.clone();
        b.points.at.iter_mut().for_each(|x| *x += 0.3);
        let found = transported(&a, &b);
        let far = found.at.iter().zip(&b.points.at).map(|(x, y)| (x - y).abs()).sum::<f64>() / 600.0;
        assert!(far < 0.2, "{far}");
    }

    #[test]
    fn clusters_keep_the_mass_and_find_the_heaps() {
        let (n, heaps) = (900, [[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]]);
        let small = cloud(n, 5, 0.5);
        let points = Points {
            dims: 2,
            // Half of all lie in the first heap.
            at: small
                .rows()
                .enumerate()
                .flat_map(|(k, x)| {
                    let heap = heaps[[0, 0, 1, 2][k % 4]];
                    [heap[0] + x[0], heap[1] + x[1]]
                })
                .collect(),
        };
        let found = clustered(points.clone(), 3);
        assert!((found.masses.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for (heap, mass) in heaps.iter().zip([0.5, 0.25, 0.25]) {
            let k = nearest(heap, &found.points);
            assert!(squared(found.points.row(k), heap) < 0.01 && (found.masses[k] - mass).abs() < 1e-12);
        }
        assert_eq!(found, clustered(points.clone(), 3), "the same every time");
        let all = clustered(points.clone(), n);
        assert!(all.points == points && all.of == (0..n).collect::<Vec<_>>());
        // All points are equal: there are no clusters.
        let alike = clustered(Points { dims: 2, at: vec![1.0; 40] }, 5);
        assert!((alike.masses.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
