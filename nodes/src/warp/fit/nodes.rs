//! Pairs as the nodes of a spline: centred, scaled, and merged where they start at one point.

use crate::warp::spline::Pair;
use crate::warp::spline::linear::principal;
use crate::warp::spline::tps::{LANES, columns, set_kernels};
use fearless_simd::{Level, dispatch};

/// Nodes nearer than this, relative to the scale of all, are one.
const MERGE_DISTANCE: f64 = 1e-9;
/// Spread relative to the widest below which a direction is ignored.
///
/// Loudness spreads over some twenty units of feature space, and features of one sound differ by tenths: a spread below a hundredth of
/// the widest is noise, and a slope fitted to it would extrapolate arbitrarily beside the nodes.
const MIN_SPREAD: f64 = 1e-2;

/// Merged nodes in centred and scaled coordinates, `[n, d]` each.
#[derive(Debug)]
pub(super) struct Nodes {
    pub centre: Vec<f64>,
    pub scale: f64,
    pub points: Vec<f64>,
    pub moves: Vec<f64>,
    pub weights: Vec<f64>,
    /// Node of each pair.
    pub of_pair: Vec<usize>,
    pub conflict: f64,
    /// Directions in which the nodes spread, `[rank][d]`; all nodes lie in their span.
    pub directions: Vec<Vec<f64>>,
}

/// Directions in which scaled points spread, the widest first.
fn spread_directions(points: &[f64], d: usize) -> Vec<Vec<f64>> {
    let found = principal(points, d);
    let widest = found.first().map_or(0.0, |(s, _)| *s);
    // Points in one place are not scaled, and spread by rounding alone.
    let min_spread = MERGE_DISTANCE * (points.len() as f64 / d.max(1) as f64).sqrt();
    found.into_iter().filter(|(s, _)| *s > MIN_SPREAD * widest && *s > min_spread).map(|(_, v)| v).collect()
}

impl Nodes {
    /// Centred and scaled pairs; with `merge`, pairs that start at one point become one.
    pub fn of(pairs: &[Pair], d: usize, merge: bool) -> Self {
        let n = pairs.len().max(1) as f64;
        let centre: Vec<f64> = (0..d).map(|i| pairs.iter().map(|p| p.from[i]).sum::<f64>() / n).collect();
        let square = pairs.iter().flat_map(|p| p.from.iter().zip(&centre)).map(|(x, c)| (x - c).powi(2));
        let spread = (square.sum::<f64>() / n).sqrt();
        let size = pairs.iter().flat_map(|p| &p.from).fold(0.0_f64, |m, x| m.max(x.abs()));
        // Points that differ by rounding alone are one point.
        let scale = if spread > 1e-12 * size { spread } else { 1.0 };
        let mut this = Self {
            centre,
            scale,
            points: Vec::new(),
            moves: Vec::new(),
            weights: Vec::new(),
            of_pair: Vec::new(),
            conflict: 0.0,
            directions: Vec::new(),
        };
        let all: Vec<f64> = pairs.iter().flat_map(|p| this.scaled(p)).collect();
        this.directions = spread_directions(&all, d);
        pairs.iter().for_each(|p| this.add(p, d, merge));
        this.conflict = pairs.iter().zip(&this.of_pair).fold(0.0, |max, (p, node)| {
            let mean = &this.moves[node * d..(node + 1) * d];
            let distance =
                p.from.iter().zip(&p.to).zip(mean).map(|((x, u), m)| (u - x - m).powi(2)).sum::<f64>();
            f64::max(max, distance.sqrt())
        });
        this
    }

    fn scaled(&self, pair: &Pair) -> Vec<f64> {
        pair.from.iter().zip(&self.centre).map(|(x, c)| (x - c) / self.scale).collect()
    }

    /// A point without its part along ignored directions: the kernels need side conditions along all others.
    fn flattened(&self, point: Vec<f64>) -> Vec<f64> {
        if self.directions.len() == point.len() {
            return point;
        }
        let mut flat = vec![0.0; point.len()];
        for direction in &self.directions {
            let along: f64 = point.iter().zip(direction).map(|(x, v)| x * v).sum();
            flat.iter_mut().zip(direction).for_each(|(x, v)| *x += along * v);
        }
        flat
    }

    fn add(&mut self, pair: &Pair, d: usize, merge: bool) {
        let point = self.flattened(self.scaled(pair));
        let near = |p: &[f64]| {
            p.iter().zip(&point).map(|(a, b)| (a - b).powi(2)).sum::<f64>() <= MERGE_DISTANCE * MERGE_DISTANCE
        };
        let displacement = pair.to.iter().zip(&pair.from).map(|(u, x)| u - x);
        let known = if merge { self.points.chunks_exact(d).position(near) } else { None };
        match known {
            Some(node) => {
                let total = self.weights[node] + pair.weight;
                for (mean, v) in self.moves[node * d..].iter_mut().zip(displacement) {
                    *mean += pair.weight / total * (v - *mean);
                }
                self.weights[node] = total;
                self.of_pair.push(node);
            }
            None => {
                self.of_pair.push(self.weights.len());
                self.points.extend(point);
                self.moves.extend(displacement);
                self.weights.push(pair.weight);
            }
        }
    }

    pub fn len(&self) -> usize {
        self.weights.len()
    }

    fn distance(&self, d: usize, i: usize, j: usize) -> f64 {
        let (a, b) = (&self.points[i * d..(i + 1) * d], &self.points[j * d..(j + 1) * d]);
        a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
    }

    /// Kernels between all nodes, each times the roots of both weights.
    pub fn kernels(&self, d: usize, roots: &[f64]) -> Vec<f64> {
        let (n, padded) = (self.len(), self.len().next_multiple_of(LANES));
        let nodes = columns(&self.points, d, padded);
        let mut row = vec![0.0; padded];
        let mut k = Vec::with_capacity(n * n);
        for (at, root) in self.points.chunks_exact(d).zip(roots) {
            // All instruction sets compute the same bits.
            dispatch!(Level::new(), _simd => set_kernels(&nodes, at, &mut row));
            k.extend(row.iter().zip(roots).map(|(u, other)| root * other * u));
        }
        k
    }

    /// Mean distance of two nodes, in plain units.
    pub fn mean_distance(&self, d: usize) -> f64 {
        let n = self.len();
        let all: f64 = (0..n)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| self.distance(d, i, j).sqrt())
            .sum();
        self.scale * all / (n * n.saturating_sub(1) / 2).max(1) as f64
    }
}

/// Number of directions in which the starts of pairs spread.
pub(in crate::warp) fn rank(pairs: &[Pair], d: usize) -> usize {
    Nodes::of(pairs, d, false).directions.len()
}
