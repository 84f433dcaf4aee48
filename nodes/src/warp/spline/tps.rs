//! A thin-plate spline in any number of dimensions: evaluation and Jacobian.

use fearless_simd::{Level, dispatch};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::kernel::thin_plate;
use super::linear::{dot, solve_dense};

/// Numbers of nodes are filled up to a multiple of this, so that vector registers are full.
pub(in crate::warp) const LANES: usize = 16;

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
    /// Scaled coordinates of the nodes, `[d][padded]`: up to whole lanes there are nodes without weight.
    nodes: Vec<f64>,
    /// `[d][padded]`.
    weights: Vec<f64>,
    at: Vec<f64>,
    kernels: Vec<f64>,
    sums: Vec<f64>,
    level: Level,
}

impl Warper {
    /// Lays a spline out.
    #[must_use]
    pub fn new(tps: &Tps) -> Self {
        let (d, padded) = (tps.dims, tps.len().next_multiple_of(LANES));
        Self {
            dims: d,
            centre: tps.centre.clone(),
            inverse: 1.0 / tps.scale,
            affine: tps.affine.clone(),
            nodes: columns(&scaled_nodes(tps), d, padded),
            weights: columns(&tps.weights, d, padded),
            at: vec![0.0; d],
            kernels: vec![0.0; padded],
            sums: vec![0.0; d],
            level: Level::new(),
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
        let Self { at, nodes, weights, kernels, sums, .. } = self;
        // All instruction sets compute the same bits.
        dispatch!(self.level, _simd => {
            set_kernels(nodes, at, kernels);
            let rows = weights.chunks_exact(kernels.len().max(1));
            sums.iter_mut().zip(rows).for_each(|(sum, row)| *sum += dot(row, kernels));
        });
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
        let padded = self.kernels.len();
        for k in 0..padded {
            let apart = |i: usize| at[i] - self.nodes[i * padded + k];
            let square: f64 = (0..d).map(|i| apart(i).powi(2)).sum();
            if square == 0.0 {
                continue;
            }
            let slope = 2.0 * self.inverse * (thin_plate(square) / square + 1.0);
            for row in 0..d {
                let weight = slope * self.weights[row * padded + k];
                (0..d).for_each(|column| j[row * d + column] += weight * apart(column));
            }
        }
        j
    }
}

/// Nodes in the coordinates that a spline works in, `[n, d]`.
pub(super) fn scaled_nodes(tps: &Tps) -> Vec<f64> {
    let inverse = 1.0 / tps.scale;
    let scaled = tps.nodes.iter().zip(tps.centre.iter().cycle()).map(|(x, centre)| (x - centre) * inverse);
    scaled.collect()
}

/// Vectors `[n, d]` as `[d][padded]`, with zeros after the last.
pub(in crate::warp) fn columns(rows: &[f64], d: usize, padded: usize) -> Vec<f64> {
    let mut out = vec![0.0; d * padded];
    for (k, row) in rows.chunks_exact(d.max(1)).enumerate() {
        row.iter().enumerate().for_each(|(i, x)| out[i * padded + k] = *x);
    }
    out
}

/// Kernels between a place and all nodes, `[d][padded]`.
#[inline(always)]
pub(in crate::warp) fn set_kernels(nodes: &[f64], at: &[f64], kernels: &mut [f64]) {
    let padded = kernels.len();
    for (k, squares) in kernels.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        let mut sums = [0.0; LANES];
        for (i, x) in at.iter().enumerate() {
            let nodes = &nodes[i * padded + k * LANES..][..LANES];
            sums.iter_mut().zip(nodes).for_each(|(sum, node)| *sum += (x - node) * (x - node));
        }
        *squares = sums;
    }
    // Apart from the squares: a processor computes many logarithms at once if nothing waits for them.
    kernels.iter_mut().for_each(|u| *u = thin_plate(*u));
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
