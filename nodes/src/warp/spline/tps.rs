//! A thin-plate spline in any number of dimensions: evaluation and Jacobian.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::kernel::thin_plate;
use super::linear::solve_dense;

/// Number of nodes processed together, so that radii and kernels of a group stay in registers and in the cache.
const GROUP: usize = 32;

/// W(f) = f + [1, g] A + sum_k w_k U(|g - g_k|) with g = (f - centre) / scale and U(r) = r^2 ln r^2.
///
/// Centred and scaled coordinates make the sums small; the spline is the same as one in plain coordinates.
///
/// # Shapes
/// `nodes: [n, d]` in plain coordinates, `weights: [n, d]`, `affine: [d + 1, d]`.
///
/// # Source
/// An, James and Marschner (SIGGRAPH 2012), eqs. 7 and 8, with the side conditions that eq. 8 leaves out; Bookstein, "Principal
/// warps" (IEEE PAMI 11(6), 1989); Belongie, Malik and Puzicha (IEEE PAMI 24(4), 2002), section 4.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tps {
    /// Dimensions, d.
    pub dims: usize,
    /// Middle of the nodes.
    pub centre: Vec<f64>,
    /// Unit of the coordinates that the spline works in.
    pub scale: f64,
    /// Nodes.
    pub nodes: Vec<f64>,
    /// Weights of the kernels.
    pub weights: Vec<f64>,
    /// Constant and linear part of the displacement.
    pub affine: Vec<f64>,
}

impl Tps {
    /// The identity.
    #[must_use]
    pub fn identity(dims: usize) -> Self {
        Self {
            dims,
            centre: vec![0.0; dims],
            scale: 1.0,
            nodes: Vec::new(),
            weights: Vec::new(),
            affine: vec![0.0; (dims + 1) * dims],
        }
    }

    /// Returns the number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len() / self.dims.max(1)
    }

    /// Returns true if it is affine.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Returns an error message if its fields are inconsistent.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let d = self.dims;
        let lengths = [
            ("centre", self.centre.len(), d),
            ("affine", self.affine.len(), (d + 1) * d),
            ("weights", self.weights.len(), self.nodes.len()),
            ("nodes", self.nodes.len(), self.len() * d),
        ];
        if d == 0 || !(self.scale > 0.0 && self.scale.is_finite()) {
            return Some(format!("it has {d} dimensions and a scale of {}", self.scale));
        }
        if let Some((field, found, wanted)) = lengths.into_iter().find(|(_, found, wanted)| found != wanted) {
            return Some(format!("`{field}` holds {found} numbers; {wanted} are needed"));
        }
        let all = [&self.centre, &self.affine, &self.weights, &self.nodes];
        let bad = all.into_iter().flatten().find(|x| !x.is_finite());
        bad.map(|x| format!("it holds {x}; only finite numbers can be used"))
    }
}

/// A [`Tps`] laid out for speed, with room for its intermediate results.
///
/// # Complexity
/// O(n d) per vector; no allocation after `new`.
#[derive(Clone, Debug)]
pub struct Warper {
    dims: usize,
    centre: Vec<f64>,
    inverse: f64,
    affine: Vec<f64>,
    /// Nodes in groups: `[groups, d, GROUP]`, scaled; the last group is filled up with nodes without weight.
    nodes: Vec<[f64; GROUP]>,
    weights: Vec<[f64; GROUP]>,
    at: Vec<f64>,
    sums: Vec<f64>,
}

impl Warper {
    /// Lays a spline out.
    #[must_use]
    pub fn new(tps: &Tps) -> Self {
        let (d, n) = (tps.dims, tps.len());
        let inverse = 1.0 / tps.scale;
        let grouped = |value: &dyn Fn(usize, usize) -> f64| {
            let groups = n.div_ceil(GROUP) * d;
            let group = |g: usize| std::array::from_fn(|k| value(g / d * GROUP + k, g % d));
            (0..groups).map(group).collect()
        };
        let node =
            |k: usize, i: usize| tps.nodes.get(k * d + i).map_or(0.0, |x| (x - tps.centre[i]) * inverse);
        Self {
            dims: d,
            centre: tps.centre.clone(),
            inverse,
            affine: tps.affine.clone(),
            nodes: grouped(&node),
            weights: grouped(&|k, i| tps.weights.get(k * d + i).copied().unwrap_or(0.0)),
            at: vec![0.0; d],
            sums: vec![0.0; d],
        }
    }

    /// Dimensions.
    #[must_use]
    pub fn dims(&self) -> usize {
        self.dims
    }

    /// Displacement of a vector.
    ///
    /// # Shapes
    /// `point: [d]`; the result is `[d]`.
    pub fn displacement(&mut self, point: impl Iterator<Item = f64>) -> &[f64] {
        let d = self.dims;
        for ((at, x), c) in self.at.iter_mut().zip(point).zip(&self.centre) {
            *at = (x - c) * self.inverse;
        }
        self.sums.copy_from_slice(&self.affine[..d]);
        for (x, row) in self.at.iter().zip(self.affine[d..].chunks_exact(d)) {
            self.sums.iter_mut().zip(row).for_each(|(s, a)| *s += x * a);
        }
        for (nodes, weights) in self.nodes.chunks_exact(d).zip(self.weights.chunks_exact(d)) {
            let mut u = [0.0; GROUP];
            for (x, nodes) in self.at.iter().zip(nodes) {
                u.iter_mut().zip(nodes).for_each(|(u, n)| *u += (x - n) * (x - n));
            }
            u.iter_mut().for_each(|u| *u = thin_plate(*u));
            for (sum, weights) in self.sums.iter_mut().zip(weights) {
                *sum += total(&u, weights);
            }
        }
        &self.sums
    }

    /// Warps a vector.
    ///
    /// # Shapes
    /// `point` and `out`: `[d]`.
    pub fn warp(&mut self, point: &[f32], out: &mut [f32]) {
        let moved = self.displacement(point.iter().map(|x| f64::from(*x)));
        for ((out, x), m) in out.iter_mut().zip(point).zip(moved) {
            *out = (f64::from(*x) + m) as f32;
        }
    }

    /// Determinant of the Jacobian at a vector: below 0 the warp turns what lies around it inside out, as a mirror does.
    #[must_use]
    pub fn determinant(&mut self, point: &[f32]) -> f64 {
        solve_dense(&mut self.jacobian(point), self.dims, &mut [])
    }

    /// J = I + A_linear^T + sum_k w_k (2 (ln r^2 + 1) (f - x_k))^T, `[d, d]`, row i being the gradient of coordinate i.
    pub(crate) fn jacobian(&mut self, point: &[f32]) -> Vec<f64> {
        let d = self.dims;
        let at: Vec<f64> =
            point.iter().zip(&self.centre).map(|(x, c)| (f64::from(*x) - c) * self.inverse).collect();
        let mut j = vec![0.0; d * d];
        for row in 0..d {
            for column in 0..d {
                j[row * d + column] = self.inverse * self.affine[(column + 1) * d + row];
            }
            j[row * d + row] += 1.0;
        }
        for (nodes, weights) in self.nodes.chunks_exact(d).zip(self.weights.chunks_exact(d)) {
            for k in 0..GROUP {
                let square: f64 = (0..d).map(|i| (at[i] - nodes[i][k]).powi(2)).sum();
                if square == 0.0 {
                    continue;
                }
                let slope = 2.0 * self.inverse * (thin_plate(square) / square + 1.0);
                for row in 0..d {
                    let weight = slope * weights[row][k];
                    (0..d).for_each(|column| j[row * d + column] += weight * (at[column] - nodes[column][k]));
                }
            }
        }
        j
    }
}

/// Sum of products in a fixed order of eight lanes.
#[inline]
fn total(a: &[f64; GROUP], b: &[f64; GROUP]) -> f64 {
    let mut lanes = [0.0; 8];
    for (a, b) in a.as_chunks::<8>().0.iter().zip(b.as_chunks::<8>().0) {
        lanes.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5])) + ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]))
}
/// Number of units whose folds one thread checks at a time.
const CHUNK: usize = 64;

/// Orientation of the units of a target under a warp.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Orientation {
    /// Share of the units around which it preserves the sense of rotation.
    pub preserved: f64,
    /// Share of the units around which it reverses it. The rest is flattened.
    pub reversed: f64,
}

impl Orientation {
    /// On all cores.
    ///
    /// # Shapes
    /// `features: [units, d]`; `units` are those that are looked at.
    pub fn new(features: &[f32], tps: &Tps, units: &[usize]) -> Self {
        let d = tps.dims.max(1);
        let counted = units.par_chunks(CHUNK).map(|units| {
            let mut warper = Warper::new(tps);
            let vectors = units.iter().filter_map(|k| features.get(k * d..(k + 1) * d));
            vectors.fold([0_usize; 2], |[preserved, reversed], x| {
                let determinant_sign = warper.determinant(x);
                [
                    preserved + usize::from(determinant_sign > 0.0),
                    reversed + usize::from(determinant_sign < 0.0),
                ]
            })
        });
        let sum = counted.reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let [preserved, reversed] = sum.map(|count| count as f64 / units.len().max(1) as f64);
        if units.is_empty() { Self { preserved: 1.0, reversed: 0.0 } } else { Self { preserved, reversed } }
    }

    /// Returns true if most of the target is mirrored. A mirror alone has no folds: neighbours stay neighbours.
    pub fn mirrored(self) -> bool {
        self.reversed > self.preserved
    }

    /// Share of the units with an orientation opposite to most: there the warp folds over.
    pub fn folds(self) -> f64 {
        1.0 - self.preserved.max(self.reversed)
    }
}

/// At most `most` indices below `count`, evenly spread.
pub(crate) fn evenly_spaced(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let some = count.min(most);
    (0..some).map(move |k| k * count / some.max(1))
}
