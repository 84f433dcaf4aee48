//! Features warped by several splines at once, such as those that leave out one correspondence each.

use fearless_simd::{Level, dispatch};
use rayon::prelude::*;

use super::linear::dot;
use super::tps::{LANES, Tps, Warper, columns, scaled_nodes, set_kernels};

/// Units in a part that one thread warps at a time.
const CHUNK: usize = 512;
/// Units whose kernels are stored for the weights of all splines.
const BATCH: usize = 4;

/// Warped features for each of some splines, `[units, d]` each; on all cores.
///
/// Splines over the same nodes share the kernels between these and a unit: for each spline only a sum of products remains.
///
/// # Complexity
/// O(units n d) for each spline, and once O(units n) kernels for all that have the nodes of the first.
pub(crate) fn warped(features: &[f32], splines: &[&Tps]) -> Vec<Vec<f32>> {
    let Some(first) = splines.first() else { return Vec::new() };
    let alike = |tps: &Tps| {
        (tps.dims, tps.scale, &tps.centre, &tps.nodes)
            == (first.dims, first.scale, &first.centre, &first.nodes)
    };
    let shared: Vec<&Tps> = splines.iter().copied().filter(|tps| alike(tps)).collect();
    let mut of_shared =
        if shared.len() > 1 { Shared::new(&shared).warp(features) } else { Vec::new() }.into_iter();
    let each = splines.iter().map(|tps| match alike(tps).then(|| of_shared.next()).flatten() {
        Some(found) => found,
        None => warp_one(features, tps),
    });
    each.collect()
}

fn warp_one(features: &[f32], tps: &Tps) -> Vec<f32> {
    let d = tps.dims.max(1);
    let mut out = vec![0.0; features.len()];
    let parts = out.par_chunks_mut(CHUNK * d).zip(features.par_chunks(CHUNK * d));
    parts.for_each(|(out, x)| {
        let mut warper = Warper::new(tps);
        out.chunks_exact_mut(d).zip(x.chunks_exact(d)).for_each(|(out, x)| warper.warp(x, out));
    });
    out
}

/// Splines over the same nodes.
struct Shared<'a> {
    splines: &'a [&'a Tps],
    d: usize,
    /// Nodes as they are computed with, filled up to whole lanes with nodes without weight.
    padded: usize,
    /// Scaled coordinates, `[d][padded]`.
    nodes: Vec<f64>,
    /// Weights of each output of each spline, `[splines * d][padded]`.
    weights: Vec<f64>,
}

impl<'a> Shared<'a> {
    fn new(splines: &'a [&'a Tps]) -> Self {
        let (d, n) = splines.first().map_or((1, 0), |tps| (tps.dims.max(1), tps.len()));
        let padded = n.next_multiple_of(LANES);
        let nodes = splines.first().map_or_else(Vec::new, |tps| columns(&scaled_nodes(tps), d, padded));
        let weights = splines.iter().flat_map(|tps| columns(&tps.weights, d, padded)).collect();
        Self { splines, d, padded, nodes, weights }
    }

    fn warp(&self, features: &[f32]) -> Vec<Vec<f32>> {
        let d = self.d;
        let parts: Vec<Vec<Vec<f32>>> = features
            .par_chunks(CHUNK * d)
            // All instruction sets compute the same bits.
            .map(|part| dispatch!(Level::new(), _simd => self.part(part)))
            .collect();
        let of = |k: usize| parts.iter().filter_map(move |part| part.get(k)).flatten().copied().collect();
        (0..self.splines.len()).map(of).collect()
    }

    /// A part of the features, warped by each spline.
    #[inline(always)]
    fn part(&self, features: &[f32]) -> Vec<Vec<f32>> {
        let (d, padded) = (self.d, self.padded);
        let mut out = vec![Vec::with_capacity(features.len()); self.splines.len()];
        let mut kernels = vec![0.0; BATCH * padded];
        let mut at = vec![0.0; BATCH * d];
        let first = self.splines[0];
        let inverse = 1.0 / first.scale;
        for units in features.chunks(BATCH * d) {
            for (u, unit) in units.chunks_exact(d).enumerate() {
                let at = &mut at[u * d..(u + 1) * d];
                for ((at, x), centre) in at.iter_mut().zip(unit).zip(&first.centre) {
                    *at = (f64::from(*x) - centre) * inverse;
                }
                set_kernels(&self.nodes, at, &mut kernels[u * padded..(u + 1) * padded]);
            }
            let count = units.len() / d;
            for (k, (tps, out)) in self.splines.iter().zip(&mut out).enumerate() {
                let start = out.len();
                out.resize(start + count * d, 0.0);
                for i in 0..d {
                    let row = &self.weights[(k * d + i) * padded..(k * d + i + 1) * padded];
                    for u in 0..count {
                        let kernels = &kernels[u * padded..(u + 1) * padded];
                        let slope = |j: usize| tps.affine[(j + 1) * d + i] * at[u * d + j];
                        let moved = dot(row, kernels) + tps.affine[i] + (0..d).map(slope).sum::<f64>();
                        out[start + u * d + i] = (f64::from(units[u * d + i]) + moved) as f32;
                    }
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::warp::spline::Pair;
    use crate::warp::{Stiffness, fit};

    fn spline(rng: &mut Rng, n: usize, d: usize) -> Tps {
        let mut vector = || (0..d).map(|_| rng.between(-5.0, 5.0)).collect::<Vec<f64>>();
        let pairs: Vec<Pair> = (0..n).map(|_| Pair { from: vector(), to: vector(), weight: 1.0 }).collect();
        fit(&pairs, d, Stiffness::Lambda(3.0)).unwrap().0
    }

    #[test]
    fn splines_that_share_their_nodes_warp_as_each_does_alone() {
        let mut rng = Rng::new(4);
        for (n, d, units) in [(37, 3, 1030), (4, 2, 7), (9, 1, 3), (40, 6, 5), (0, 3, 6)] {
            let first = spline(&mut rng, n, d);
            let mut second = first.clone();
            second.weights.iter_mut().for_each(|w| *w *= rng.between(-1.0, 1.0));
            second.affine.iter_mut().for_each(|a| *a += rng.between(-1.0, 1.0));
            let other = spline(&mut rng, n + 3, d);
            let features: Vec<f32> = (0..units * d).map(|_| rng.between(-9.0, 9.0) as f32).collect();
            let splines = [&first, &second, &other, &first];
            let found = warped(&features, &splines);
            assert_eq!(found.len(), 4);
            for (found, tps) in found.iter().zip(splines) {
                let wanted = warp_one(&features, tps);
                let near = found.iter().zip(&wanted).all(|(a, b)| (a - b).abs() <= 1e-5 * b.abs().max(1.0));
                assert!(found.len() == wanted.len() && near, "{n} {d}");
            }
        }
        assert!(warped(&[1.0], &[]).is_empty());
    }
}
