//! The units that may be chosen, in the order in which the programme reads them.

use super::path::GlobalParams;
use crate::unit::selection::selector::{NotFinite, Units};

/// Features of all units that may be chosen, dimension by dimension, and the columns without a following unit.
///
/// A unit's place here is called its column; units that may not be chosen have none.
#[derive(Clone, Debug)]
pub struct Table {
    dims: usize,
    /// `[dims, columns]`.
    pub(super) columns: Vec<f32>,
    /// The unit of each column.
    units: Vec<u32>,
    /// Columns that the next column does not follow in a recording.
    pub(super) ends: Vec<usize>,
}

impl Table {
    /// Gathers the units; `None` without units or dimensions.
    #[must_use]
    pub fn new(units: &Units<'_>) -> Option<Self> {
        let mut chosen = Vec::new();
        let mut ends = Vec::new();
        for &(from, count) in &units.segments {
            for j in (from..from + count).filter(|&j| units.allowed.get(j) == Some(&true)) {
                let follows = j > from && chosen.last() == Some(&(j as u32 - 1));
                if !follows && !chosen.is_empty() {
                    ends.push(chosen.len() - 1);
                }
                chosen.push(j as u32);
            }
        }
        ends.push(chosen.len().checked_sub(1)?);
        let dims = units.dims;
        let feature = |d: usize, j: u32| units.features.get(j as usize * dims + d).copied();
        let columns: Option<Vec<f32>> =
            (0..dims).flat_map(|d| chosen.iter().map(move |&j| feature(d, j))).collect();
        Some(Self { dims, columns: columns.filter(|c| !c.is_empty())?, units: chosen, ends })
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

    /// Returns true if column `b` follows column `a` in a recording.
    #[must_use]
    pub fn follows(&self, a: usize, b: usize) -> bool {
        b == a + 1 && self.next(a).is_some()
    }

    /// The column that follows one in its recording.
    #[must_use]
    pub fn next(&self, column: usize) -> Option<usize> {
        self.ends.binary_search(&column).is_err().then_some(column + 1)
    }

    /// Features of a column.
    pub fn features(&self, column: usize) -> impl Iterator<Item = f32> + '_ {
        self.columns.iter().skip(column).step_by(self.count()).copied()
    }

    /// Distance of a column from a feature vector.
    #[must_use]
    pub fn distance(&self, target: &[f32], column: usize) -> f64 {
        let square = |(a, b): (f32, &f32)| (f64::from(a) - f64::from(*b)).powi(2);
        self.features(column).zip(target).map(square).sum::<f64>().sqrt()
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
