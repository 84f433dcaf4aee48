//! Search trees over the units of a database and over their windows.

use std::ops::Range;

use fearless_simd::{Level, dispatch};

use crate::unit::selection::kdtree::{KdTree, LANES};
use crate::unit::selection::selector::{SelectorParams, Units};

/// Index of the units, shared by all searches.
pub(super) struct Index {
    pub dims: usize,
    /// Unit after unit.
    pub features: Vec<f32>,
    /// Dimension after dimension, with [`LANES`] zeros after each.
    columns: Vec<f32>,
    /// The unit after the last one of the segment of each unit.
    pub segment_end: Vec<u32>,
    /// Number of units of a window that each unit has room for, beside itself.
    room: Vec<u32>,
    causal: bool,
    pub allowed: Vec<bool>,
    /// Number of allowed units that count as different ones.
    pub allowed_count: usize,
    /// First unit with the sound of each; empty if each has its own.
    pub same: Vec<u32>,
    /// The units that may be chosen, by their features; only the first of those with equal windows.
    pub by_features: KdTree,
    /// The units that have room for a whole window, by the mean of their window.
    pub by_mean: KdTree,
    /// The next unit with a window equal to that of this one, or [`LAST`].
    next_equal: Vec<u32>,
}

/// Marks a unit without a later unit of an equal window.
const LAST: u32 = u32::MAX;

impl Index {
    pub fn new(units: &Units<'_>, params: &SelectorParams) -> Self {
        let dims = units.dims;
        // Zero has one sign, so that units that are alike sort as one.
        let features: Vec<f32> = units.features.iter().map(|x| x + 0.0).collect();
        let count = features.len() / dims;
        let (mut segment_end, mut room) = (vec![0; count], vec![0; count]);
        for &(from, count) in &units.segments {
            let to = from + count;
            segment_end[from..to].fill(to as u32);
            for (j, room) in (from..to).zip(&mut room[from..to]) {
                let beside = if params.causal { j - from } else { to - 1 - j };
                *room = beside.min(params.look) as u32;
            }
        }
        let mut index = Self {
            dims,
            columns: columns(&features, dims),
            features,
            segment_end,
            room,
            causal: params.causal,
            allowed_count: units.different(0..count),
            allowed: units.allowed.clone(),
            same: units.same.clone(),
            by_features: KdTree::new(&[], &[], dims),
            by_mean: KdTree::new(&[], &[], dims),
            next_equal: vec![LAST; count],
        };
        let firsts = index.distinct();
        (index.by_features, index.by_mean) =
            rayon::join(|| index.feature_tree(&firsts), || index.mean_tree(&firsts, params.look));
        index
    }

    /// The tree of units by their features.
    fn feature_tree(&self, units: &[u32]) -> KdTree {
        KdTree::from_fn(units, self.dims, |j, point| point.copy_from_slice(self.rows(j as usize, 1)))
    }

    /// The tree of those units that have room for a whole window, by the mean of their window.
    fn mean_tree(&self, units: &[u32], look: usize) -> KdTree {
        let starts = self.allowed.len().saturating_sub(look);
        let mut means = vec![0.0; self.dims * starts];
        let columns = self.columns.chunks_exact(self.allowed.len() + LANES);
        for (means, column) in means.chunks_exact_mut(starts.max(1)).zip(columns) {
            // All instruction sets compute the same bits.
            dispatch!(Level::new(), _simd => set_means(means, column, look + 1));
        }
        let whole: Vec<u32> =
            units.iter().copied().filter(|j| self.start(*j as usize, look).is_some()).collect();
        KdTree::from_fn(&whole, self.dims, |j, point| {
            let start = self.start(j as usize, look).unwrap_or(0);
            let means = means.iter().skip(start).step_by(starts.max(1));
            point.iter_mut().zip(means).for_each(|(x, mean)| *x = *mean);
        })
    }

    /// The allowed units that are the first with their windows, in order; links each to the next with an equal window.
    fn distinct(&mut self) -> Vec<u32> {
        let longest = self.room.iter().max().map_or(0, |room| *room as usize + 1);
        let hashes = Hashes::new(&self.features, self.dims, longest);
        let hash = |index: &Self, j: usize| hashes.of(index.window(j));
        // The last unit so far with each window, at the first free place from that of its hash on.
        let bits = (2 * self.allowed.len()).next_power_of_two().ilog2().max(1);
        let mut table = vec![LAST; 1 << bits];
        let mut firsts = Vec::with_capacity(self.allowed.len());
        for j in (0..self.allowed.len()).filter(|&j| self.allowed[j]) {
            let own = hash(self, j);
            let mut at = (own >> (64 - bits)) as usize;
            loop {
                let last = table[at] as usize;
                if table[at] == LAST {
                    firsts.push(j as u32);
                    break;
                }
                if hash(self, last) == own && self.window_rows(last) == self.window_rows(j) {
                    self.next_equal[last] = j as u32;
                    break;
                }
                at = (at + 1) % table.len();
            }
            table[at] = j as u32;
        }
        firsts
    }

    /// The units of the window of one; near an end of its segment that is a part of a window.
    fn window(&self, j: usize) -> Range<usize> {
        let room = self.room[j] as usize;
        let start = if self.causal { j - room } else { j };
        start..start + room + 1
    }

    fn window_rows(&self, j: usize) -> &[f32] {
        let window = self.window(j);
        self.rows(window.start, window.len())
    }

    /// Unit `j` and those with equal windows after it.
    pub fn equal_windows(&self, j: u32) -> impl Iterator<Item = usize> {
        let next = |j: &u32| self.next_equal.get(*j as usize).copied().filter(|next| *next != LAST);
        std::iter::successors(Some(j), next).map(|j| j as usize)
    }

    /// The features of `count` units.
    pub fn rows(&self, start: usize, count: usize) -> &[f32] {
        &self.features[start * self.dims..(start + count) * self.dims]
    }

    /// Dimension `d` of [`LANES`] units, with zeros after the last.
    #[inline(always)]
    pub fn column(&self, d: usize, start: usize) -> &[f32] {
        &self.columns[d * (self.allowed.len() + LANES) + start..][..LANES]
    }

    /// First unit of the window of `look + 1` units at unit `j`; `None` if it would leave the segment.
    #[inline(always)]
    pub fn start(&self, j: usize, look: usize) -> Option<usize> {
        (look <= self.room[j] as usize).then(|| if self.causal { j - look } else { j })
    }
}

/// Dimension after dimension, with [`LANES`] zeros after each.
fn columns(features: &[f32], dims: usize) -> Vec<f32> {
    let stride = features.len() / dims + LANES;
    let mut columns = vec![0.0; dims * stride];
    // A few units at a time, so that their features stay in the cache.
    for (from, rows) in (0..).step_by(LANES).zip(features.chunks(LANES * dims)) {
        for (d, column) in columns.chunks_exact_mut(stride).enumerate() {
            column[from..].iter_mut().zip(rows.chunks_exact(dims)).for_each(|(x, row)| *x = row[d]);
        }
    }
    columns
}

/// Means of `units` numbers from each of a column on, in the precision of the trees.
#[inline(always)]
fn set_means(means: &mut [f32], column: &[f32], units: usize) {
    for (from, means) in (0..).step_by(LANES).zip(means.chunks_mut(LANES)) {
        let mut sums = [0.0; LANES];
        for numbers in column[from..].array_windows::<LANES>().take(units) {
            sums.iter_mut().zip(numbers).for_each(|(sum, x)| *sum += f64::from(*x));
        }
        means.iter_mut().zip(sums).for_each(|(mean, sum)| *mean = (sum / units as f64) as f32);
    }
}

/// Hashes of windows: polynomials over the hashes of their vectors, each the difference of two from the first vector on.
struct Hashes {
    /// For each unit, and after the last, that of all vectors before it.
    sums: Vec<u64>,
    /// Powers of [`FACTOR`].
    powers: Vec<u64>,
}

impl Hashes {
    /// Hashes of windows of up to `longest` vectors.
    fn new(features: &[f32], dims: usize, longest: usize) -> Self {
        let mut sums = Vec::with_capacity(features.len() / dims + 1);
        sums.push(0_u64);
        let mut sum = 0_u64;
        for row in features.chunks_exact(dims) {
            let hash = row.iter().fold(1, |hash, x| mixed(hash ^ u64::from(x.to_bits())));
            sum = sum.wrapping_mul(FACTOR).wrapping_add(hash);
            sums.push(sum);
        }
        let next = |power: &u64| Some(power.wrapping_mul(FACTOR));
        Self { sums, powers: std::iter::successors(Some(1), next).take(longest + 1).collect() }
    }

    /// A number that is equal for equal windows, and hardly ever for others.
    fn of(&self, units: Range<usize>) -> u64 {
        let before = self.sums[units.start].wrapping_mul(self.powers[units.len()]);
        mixed(self.sums[units.end].wrapping_sub(before))
    }
}

/// An odd number whose bits look random: the golden ratio.
const FACTOR: u64 = 0x9E37_79B9_7F4A_7C15;

/// A number whose low bits depend on the high ones of the product too.
fn mixed(x: u64) -> u64 {
    let x = x.wrapping_mul(FACTOR);
    x ^ x >> 32
}

/// Mean of vectors, in the precision of the trees.
pub(super) fn mean(rows: &[f32], dims: usize) -> impl Iterator<Item = f32> {
    (0..dims).map(move |d| mean_of(rows, dims, d) as f32)
}

fn mean_of(rows: &[f32], dims: usize, d: usize) -> f64 {
    rows.iter().skip(d).step_by(dims).map(|x| f64::from(*x)).sum::<f64>() / (rows.len() / dims) as f64
}

/// Squared distance of the means of two windows.
pub(super) fn squared_of_means(a: &[f32], b: &[f32], dims: usize) -> f64 {
    (0..dims).map(|d| (mean_of(a, dims, d) - mean_of(b, dims, d)).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use std::collections::BTreeMap;

    /// The index of some units, a few of which are not allowed, with the content of its trees: the first unit of each window with its
    /// features, and those with a whole window with their mean.
    fn check(features: &[f32], dims: usize, segments: Vec<(usize, usize)>, look: usize, causal: bool) {
        let count = features.len() / dims;
        let allowed: Vec<bool> = (0..count).map(|j| j % 11 != 3).collect();
        let units = Units { allowed: allowed.clone(), ..Units::new(features, dims, segments.clone()) };
        let params = SelectorParams { look, causal, ..SelectorParams::default() };
        let index = Index::new(&units, &params);
        let mut windows: BTreeMap<Vec<u32>, Vec<usize>> = BTreeMap::new();
        let mut means = Vec::new();
        for (from, count) in segments {
            for j in (from..from + count).filter(|j| allowed[*j]) {
                let (first, last) = match causal {
                    true => (from.max(j.saturating_sub(look)), j),
                    false => (j, (from + count - 1).min(j.saturating_add(look))),
                };
                let rows = &features[first * dims..(last + 1) * dims];
                let equal = windows.entry(rows.iter().map(|x| (x + 0.0).to_bits()).collect()).or_default();
                equal.push(j);
                if equal.len() == 1 && last - first == look {
                    means.push((j as u32, mean(rows, dims).collect::<Vec<_>>()));
                }
            }
        }
        let mut firsts = Vec::new();
        for equal in windows.values() {
            assert!(index.equal_windows(equal[0] as u32).eq(equal.iter().copied()));
            firsts.push((equal[0] as u32, features[equal[0] * dims..][..dims].to_vec()));
        }
        firsts.sort_by_key(|unit| unit.0);
        let sorted = |tree: &KdTree| {
            let mut items = tree.items();
            items.sort_by_key(|unit| unit.0);
            items
        };
        assert_eq!(sorted(&index.by_features), firsts);
        assert_eq!(sorted(&index.by_mean), means);
        for (d, j) in (0..dims).flat_map(|d| (0..count).map(move |j| (d, j))) {
            let column = index.column(d, j);
            assert!((0..LANES).all(|k| column[k] == features.get((j + k) * dims + d).map_or(0.0, |x| *x)));
        }
    }

    #[test]
    fn the_trees_hold_the_first_unit_of_each_window() {
        let mut rng = Rng::new(5);
        for (count, dims, grid) in
            [(1, 1, 0.0), (40, 2, 1.0), (67, 3, 0.0), (300, 1, 1.0), (700, 6, 0.5), (2000, 2, 1.0)]
        {
            let mut number = || (rng.between(-2.0, 2.0) * grid) as f32;
            let features: Vec<f32> = (0..count * dims).map(|_| number().round()).collect();
            for look in [0, 1, 5, 17, usize::MAX] {
                let segments = vec![(0, count / 3), (count / 3, count - count / 3)];
                check(&features, dims, segments.clone(), look, false);
                check(&features, dims, segments, look, true);
            }
        }
    }
}
