//! Search trees over the units of a database and over their windows.

use std::cmp::Ordering;

use crate::unit::selection::kdtree::KdTree;
use crate::unit::selection::selector::{SelectorParams, Units};

/// Index of the units, shared by all searches.
pub(super) struct Index<const P: usize> {
    pub dims: usize,
    pub features: Vec<[f64; P]>,
    /// Segment of each unit, with its first unit and the one after its last.
    pub segment: Vec<(u32, u32)>,
    pub allowed: Vec<bool>,
    /// Number of allowed units.
    pub allowed_count: usize,
    /// Every unit that may be chosen, by its features.
    pub by_features: KdTree<P>,
    /// Every unit with room for a whole window, by the mean of its window; only the first of those with equal windows.
    pub by_mean: KdTree<P>,
    /// The next unit with a window equal to that of this one, or [`LAST`].
    pub next_equal: Vec<u32>,
}

/// Marks a unit without a later unit of an equal window.
const LAST: u32 = u32::MAX;

impl<const P: usize> Index<P> {
    pub fn new(units: &Units<'_>, params: &SelectorParams) -> Self {
        let features: Vec<[f64; P]> = units.features.chunks_exact(units.dims).map(padded).collect();
        let mut segment = vec![(0, 0); features.len()];
        for &(from, count) in &units.segments {
            segment[from..from + count].fill((from as u32, (from + count) as u32));
        }
        let all = (0..features.len()).filter(|&j| units.allowed[j]);
        let by_features = KdTree::new(all.clone().map(|j| (j as u32, features[j])).collect());
        let mut index = Self {
            dims: units.dims,
            features,
            segment,
            allowed_count: units.allowed.iter().filter(|&&a| a).count(),
            allowed: units.allowed.clone(),
            by_features,
            by_mean: KdTree::new(Vec::new()),
            next_equal: Vec::new(),
        };
        let windows = all.filter_map(|j| {
            let start = index.start(j, params.look, params.causal)?;
            Some((j as u32, mean(&index.features[start..][..=params.look])))
        });
        let windows = windows.collect();
        (index.by_mean, index.next_equal) = index.distinct_windows(windows, params);
        index
    }

    /// The tree of all distinct windows, and the links from each unit to the next with an equal window.
    fn distinct_windows(
        &self,
        mut windows: Vec<(u32, [f64; P])>,
        params: &SelectorParams,
    ) -> (KdTree<P>, Vec<u32>) {
        let window = |j: u32| {
            let start = self.start(j as usize, params.look, params.causal).unwrap_or(0);
            self.features[start..][..=params.look].as_flattened()
        };
        let order = |a: &[f64], b: &[f64]| {
            let differs = a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne());
            differs.unwrap_or(Ordering::Equal)
        };
        windows.sort_unstable_by(|(j, a), (k, b)| {
            order(a, b).then_with(|| order(window(*j), window(*k))).then(j.cmp(k))
        });
        let (mut next_equal, mut firsts) = (vec![LAST; self.features.len()], Vec::new());
        let mut last: Option<u32> = None;
        for (j, mean) in windows {
            match last {
                Some(k) if window(k) == window(j) => next_equal[k as usize] = j,
                _ => firsts.push((j, mean)),
            }
            last = Some(j);
        }
        (KdTree::new(firsts), next_equal)
    }

    /// The next unit whose window is like that of unit `j`.
    pub fn next_equal_window(&self, j: u32) -> Option<u32> {
        self.next_equal.get(j as usize).copied().filter(|next_equal_window| *next_equal_window != LAST)
    }

    /// First unit of the window of `look + 1` units at unit `j`; `None` if it would leave the segment.
    pub fn start(&self, j: usize, look: usize, causal: bool) -> Option<usize> {
        let (from, to) = self.segment[j];
        if causal {
            j.checked_sub(look).filter(|&start| start >= from as usize)
        } else {
            (j + look < to as usize).then_some(j)
        }
    }
}

pub(super) fn padded<const P: usize>(vector: &[f32]) -> [f64; P] {
    let mut out = [0.0; P];
    for (out, &x) in out.iter_mut().zip(vector) {
        // Zero has one sign, so that units that are alike sort as one.
        *out = f64::from(x) + 0.0;
    }
    out
}

pub(super) fn mean<const P: usize>(vectors: &[[f64; P]]) -> [f64; P] {
    let mut out = [0.0; P];
    for vector in vectors {
        for d in 0..P {
            out[d] += vector[d];
        }
    }
    out.map(|x| x / vectors.len().max(1) as f64)
}
