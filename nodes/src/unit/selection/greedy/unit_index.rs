//! Search trees over the units of a database and over their windows.

use std::cmp::Ordering;

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
    /// Number of allowed units.
    pub allowed_count: usize,
    /// The units that may be chosen, by their features; only the first of those with equal windows.
    pub by_features: KdTree,
    /// Those that have room for a whole window, by the mean of their window.
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
            columns: (0..dims)
                .flat_map(|d| features.iter().skip(d).step_by(dims).copied().chain([0.0; LANES]))
                .collect(),
            features,
            segment_end,
            room,
            causal: params.causal,
            allowed_count: units.allowed.iter().filter(|&&a| a).count(),
            allowed: units.allowed.clone(),
            by_features: KdTree::new(&[], &[], dims),
            by_mean: KdTree::new(&[], &[], dims),
            next_equal: vec![LAST; count],
        };
        let firsts = index.distinct();
        index.by_features = index.tree(&firsts, |index, j, out| out.extend_from_slice(index.rows(j, 1)));
        let whole = |j: &u32| index.start(*j as usize, params.look).is_some();
        let whole: Vec<u32> = firsts.into_iter().filter(whole).collect();
        index.by_mean = index.tree(&whole, |index, j, out| {
            let start = index.start(j, params.look).unwrap_or(j);
            out.extend(mean(index.rows(start, params.look + 1), dims));
        });
        index
    }

    fn tree(&self, labels: &[u32], point: impl Fn(&Self, usize, &mut Vec<f32>)) -> KdTree {
        let mut points = Vec::with_capacity(labels.len() * self.dims);
        labels.iter().for_each(|j| point(self, *j as usize, &mut points));
        KdTree::new(labels, &points, self.dims)
    }

    /// The allowed units that are the first with their windows, in order; links each to the next with an equal window.
    fn distinct(&mut self) -> Vec<u32> {
        // Near an end of its segment a unit has a part of a window.
        let window = |index: &Self, j: u32| {
            let (j, room) = (j as usize, index.room[j as usize] as usize);
            let start = if index.causal { j - room } else { j };
            start * index.dims..(start + room + 1) * index.dims
        };
        let mut order: Vec<u32> =
            (0..self.allowed.len()).filter(|&j| self.allowed[j]).map(|j| j as u32).collect();
        order.sort_unstable_by(|&j, &k| {
            let (a, b) = (&self.features[window(self, j)], &self.features[window(self, k)]);
            compare(a, b).then(j.cmp(&k))
        });
        let mut firsts = Vec::new();
        let mut last: Option<u32> = None;
        for j in order {
            match last {
                Some(k) if self.features[window(self, k)] == self.features[window(self, j)] => {
                    self.next_equal[k as usize] = j;
                }
                _ => firsts.push(j),
            }
            last = Some(j);
        }
        firsts.sort_unstable();
        firsts
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

fn compare(a: &[f32], b: &[f32]) -> Ordering {
    let differs = a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne());
    differs.unwrap_or(a.len().cmp(&b.len()))
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
