//! Clusters of points.

use crate::core::random::Rng;
use rayon::prelude::*;

/// Number of times that points are assigned to their nearest centre.
const ROUNDS: usize = 8;

/// Points, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Numbers of each point.
    pub dims: usize,
    /// `[points, dims]`.
    pub at: Vec<f64>,
}

impl Points {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.at.len() / self.dims.max(1)
    }

    /// Returns true if there is no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.at.is_empty()
    }

    /// A point.
    #[must_use]
    pub fn row(&self, k: usize) -> &[f64] {
        self.at.get(k * self.dims..(k + 1) * self.dims).unwrap_or_default()
    }

    /// Multiplies the weight of one dimension by a factor.
    pub fn scale_dim(&mut self, dim: usize, factor: f64) {
        self.at.iter_mut().skip(dim).step_by(self.dims.max(1)).for_each(|x| *x *= factor);
    }

    /// All points.
    pub fn rows(&self) -> std::slice::ChunksExact<'_, f64> {
        self.at.chunks_exact(self.dims.max(1))
    }
}

/// Squared distance of two points.
#[must_use]
pub fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// Distant points to begin with, each drawn with a chance in proportion to its squared distance from those before it.
fn seeds(points: &Points, count: usize) -> Points {
    let mut rng = Rng::new(0x6b6d_6561_6e73);
    let mut at = points.row(rng.below(points.len())).to_vec();
    let mut near: Vec<f64> = points.rows().map(|x| squared(x, &at)).collect();
    for _ in 1..count {
        let mut left = rng.uniform() * near.iter().sum::<f64>();
        let next = near.iter().position(|square| {
            left -= square;
            left < 0.0
        });
        let row = points.row(next.unwrap_or(0));
        near.iter_mut().zip(points.rows()).for_each(|(near, x)| *near = near.min(squared(x, row)));
        at.extend(row);
    }
    Points { dims: points.dims, at }
}

/// The index of the centre that is nearest to a point.
#[must_use]
pub fn nearest(x: &[f64], centres: &Points) -> usize {
    let far = centres.rows().map(|centre| squared(x, centre)).enumerate();
    far.fold((0, f64::INFINITY), |best, (k, far)| if far < best.1 { (k, far) } else { best }).0
}

/// The centres of clusters of points, and the cluster of each point. The same points have the same clusters.
///
/// # Complexity
/// O(points x count) for each of eight rounds, on all cores.
///
/// # Source
/// Lloyd, "Least squares quantization in PCM" (IEEE Transactions on Information Theory 28(2), 1982); Arthur and Vassilvitskii,
/// "k-means++" (SODA 2007), for the first centres.
#[must_use]
pub fn k_means(points: &Points, count: usize) -> (Points, Vec<usize>) {
    let count = count.clamp(1, points.len().max(1));
    if points.is_empty() {
        return (points.clone(), Vec::new());
    }
    let mut centres = seeds(points, count);
    let mut of = Vec::new();
    for _ in 0..ROUNDS {
        of = points.at.par_chunks_exact(points.dims).map(|x| nearest(x, &centres)).collect();
        let mut sums = vec![0.0; centres.at.len()];
        let mut counts = vec![0.0_f64; count];
        for (x, &k) in points.rows().zip(&of) {
            counts[k] += 1.0;
            sums[k * points.dims..].iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
        }
        for (k, centre) in centres.at.chunks_exact_mut(points.dims).enumerate() {
            // One that nothing is near stays where it is.
            if counts[k] > 0.0 {
                let sum = &sums[k * points.dims..(k + 1) * points.dims];
                centre.iter_mut().zip(sum).for_each(|(c, sum)| *c = sum / counts[k]);
            }
        }
    }
    (centres, of)
}
