//! The units that may be chosen, in the order in which the programme reads them.

use super::path::GlobalParams;
use crate::unit::selection::kdtree::{KdTree, Search, squared};
use crate::unit::selection::selector::{NotFinite, Units};
use fearless_simd::Level;
use std::collections::HashMap;

/// Features of all units that may be chosen, dimension by dimension, and the columns that another follows.
///
/// A unit's place here is called its column; units that may not be chosen have none.
#[derive(Clone, Debug)]
pub struct Table {
    dims: usize,
    /// `[dims, columns]`.
    pub(super) columns: Vec<f32>,
    /// `[columns, dims]`.
    rows: Vec<f32>,
    /// Columns by their features.
    pub(super) near: KdTree,
    /// The unit of each column.
    units: Vec<u32>,
    /// True for each column that the next column follows in its recording.
    continues: Vec<bool>,
    /// First column with the sound of each at any level; empty if each has its own.
    pub(super) same: Vec<u32>,
}

impl Table {
    /// Gathers the units; `None` without units or dimensions.
    #[must_use]
    pub fn new(units: &Units<'_>) -> Option<Self> {
        let mut chosen = Vec::new();
        let mut continues: Vec<bool> = Vec::new();
        for &(from, count) in &units.segments {
            for j in (from..from + count).filter(|&j| units.allowed.get(j) == Some(&true)) {
                let follows = j > from && chosen.last() == Some(&(j as u32 - 1));
                if let (true, Some(before)) = (follows, continues.last_mut()) {
                    *before = true;
                }
                continues.push(false);
                chosen.push(j as u32);
            }
        }
        let dims = units.dims;
        let feature = |d: usize, j: u32| units.features.get(j as usize * dims + d).copied();
        let columns: Option<Vec<f32>> =
            (0..dims).flat_map(|d| chosen.iter().map(move |&j| feature(d, j))).collect();
        let columns = columns.filter(|c| !c.is_empty())?;
        let rows: Vec<f32> =
            chosen.iter().flat_map(|&j| &units.features[j as usize * dims..][..dims]).copied().collect();
        let labels: Vec<u32> = (0..chosen.len() as u32).collect();
        let mut firsts = HashMap::new();
        let sounds = chosen.iter().filter_map(|&j| units.same.get(j as usize));
        let same = (0..).zip(sounds).map(|(column, sound)| *firsts.entry(sound).or_insert(column)).collect();
        let near = KdTree::new(&labels, &rows, dims);
        Some(Self { dims, columns, near, rows, units: chosen, continues, same })
    }

    /// Returns the number of allowed units.
    #[must_use]
    pub fn count(&self) -> usize {
        self.units.len()
    }

    /// Numbers in a feature vector.
    #[must_use]
    pub fn dims(&self) -> usize {
        self.dims
    }

    /// The unit of a column.
    #[must_use]
    pub fn unit(&self, column: usize) -> u32 {
        self.units[column]
    }

    /// The column of a unit.
    #[must_use]
    pub fn column(&self, unit: u32) -> Option<usize> {
        self.units.binary_search(&unit).ok()
    }

    /// The first column with the sound of one at any level.
    #[must_use]
    pub(super) fn sound(&self, column: usize) -> usize {
        self.same.get(column).map_or(column, |&first| first as usize)
    }

    /// Returns true if column `b` follows column `a` in a recording.
    #[must_use]
    pub fn follows(&self, a: usize, b: usize) -> bool {
        b == a + 1 && self.next(a).is_some()
    }

    /// The column that follows one in its recording.
    #[must_use]
    pub fn next(&self, column: usize) -> Option<usize> {
        self.continues[column].then_some(column + 1)
    }

    /// Features of a column.
    #[must_use]
    #[inline(always)]
    pub fn features(&self, column: usize) -> &[f32] {
        &self.rows[column * self.dims..][..self.dims]
    }

    /// Distance of a column from a feature vector.
    #[must_use]
    pub fn distance(&self, target: &[f32], column: usize) -> f64 {
        squared(self.features(column), target).sqrt()
    }

    /// Marks the columns that follow none in costs of the columns that each follows.
    pub(super) fn close(&self, costs: &mut [f32]) {
        costs[0] = f32::INFINITY;
        for (cost, continues) in costs[1..].iter_mut().zip(&self.continues) {
            *cost = if *continues { *cost } else { f32::INFINITY };
        }
    }

    /// The nearest column that is not barred; of equally near ones the first.
    #[must_use]
    pub(super) fn nearest(&self, target: &[f32], barred: &dyn Fn(usize) -> bool) -> Option<usize> {
        let of = |column: u32| {
            let column = column as usize;
            (!barred(column)).then(|| (self.distance(target, column), column))
        };
        self.near.nearest(Level::new(), target, &mut Search::default(), of).map(|(_, column)| column)
    }

    /// Returns the cost of a path of columns.
    ///
    /// # Shapes
    /// `target`: `[path.len() * dims]`.
    #[must_use]
    pub fn cost(&self, target: &[f32], path: &[usize], params: &GlobalParams) -> f64 {
        let near = target.chunks_exact(self.dims).zip(path);
        let distances: f64 = near.map(|(t, &j)| self.distance(t, j).min(params.cap)).sum();
        let jumps = path.windows(2).filter(|w| !self.follows(w[0], w[1])).count();
        distances + params.switch_cost * jumps as f64
    }

    /// The units of columns.
    #[must_use]
    pub(super) fn named(&self, path: &[usize]) -> Vec<u32> {
        path.iter().map(|&j| self.unit(j)).collect()
    }

    /// Refuses a target with numbers that are not finite.
    pub(super) fn check(&self, target: &[f32]) -> Result<(), NotFinite> {
        match target.iter().position(|x| !x.is_finite()) {
            Some(at) => Err(NotFinite((at / self.dims) as u64)),
            None => Ok(()),
        }
    }
}
