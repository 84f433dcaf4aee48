//! Selection of a unit of a database for each unit of a target: parameters, choices and the interface of a search.

use crate::core::fault::Fault;
use crate::core::state::StateArchive;
use crate::unit::database::UnitDatabase;

/// Parameters of a selection.
#[derive(Clone, Debug, PartialEq)]
pub struct SelectorParams {
    /// Number of units after the current one that are also compared.
    pub look: usize,
    /// Maximum distance of a unit that is similar to the target.
    pub d_max: f64,
    /// Number of targets for which a chosen unit is not chosen again.
    pub cool_off: usize,
    /// Number of targets within which the last four picks are not repeated in order; 0 allows it.
    pub loop_guard: usize,
    /// Compare units before the current one in place of units after it.
    pub causal: bool,
    /// Maximal number of tree nodes and units that one choice examines; `None` for no limit.
    pub effort: Option<usize>,
}

impl Default for SelectorParams {
    fn default() -> Self {
        Self { look: 5, d_max: 2.0, cool_off: 20, loop_guard: 0, causal: false, effort: None }
    }
}

/// One choice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choice {
    /// The unit.
    pub unit: u32,
    /// True if no unit was within `d_max`, and this is the nearest.
    pub fallback: bool,
    /// Distance to the target.
    pub d1: f64,
    /// Sum of distances over the units compared; 0 for a fallback, which has none.
    pub d2: f64,
    /// True if the search stopped at the limit `effort`.
    pub cut: bool,
}

/// Index of the first vector that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotFinite(pub u64);

impl NotFinite {
    /// Returns an error for a number that is not finite, and for an empty list of vectors.
    pub(in crate::unit) fn check(window: &[f32], dims: usize) -> Result<(), Self> {
        match window.iter().position(|x| !x.is_finite()) {
            Some(at) => Err(Self((at / dims.max(1)) as u64)),
            None if window.len() < dims => Err(Self(0)),
            None => Ok(()),
        }
    }

    /// The index after `before` other vectors.
    #[must_use]
    pub fn after(self, before: usize) -> Self {
        Self(self.0 + before as u64)
    }
}

/// Chooses a unit of a database for each unit of a target.
///
/// # Complexity
/// O(log m) expected per target for features of few dimensions; O(m) memory.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), algorithm 1, whose table of all
/// distances is replaced by a search in the order of a lower bound: the sum of distances over a window is at least its length times
/// the distance of the means. A search that exceeds `effort` continues the run of units: an addition, for live use.
pub trait Selector: Send + Sync {
    /// Chooses for the next unit of the target.
    ///
    /// `window` holds the compared vectors in order of time: the current one is the first or, if the selector is causal, the last.
    ///
    /// # Errors
    /// A feature that is not finite.
    fn choose(&mut self, window: &[f32]) -> Result<Choice, NotFinite>;

    /// Replaces the history by `picks`, the latest last.
    fn set_history(&mut self, picks: &[u32]);

    /// Saves or restores the history.
    ///
    /// # Errors
    /// An archive of another type.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault>;

    /// A copy that shares the features and trees.
    fn boxed_clone(&self) -> Box<dyn Selector>;
}

/// Features and segments of a database.
#[derive(Clone, Debug)]
pub struct Units<'a> {
    /// `[units * dims]`.
    pub features: &'a [f32],
    /// Numbers in a vector.
    pub dims: usize,
    /// First unit and number of units of each segment.
    pub segments: Vec<(usize, usize)>,
    /// True for each unit that may be chosen.
    pub allowed: Vec<bool>,
    /// First unit with the sound of each unit at any level; empty if each is its own. Those with one sound count as one unit that recurs.
    pub same: Vec<u32>,
}

impl<'a> Units<'a> {
    /// Units that may all be chosen and have sounds of their own.
    #[must_use]
    pub fn new(features: &'a [f32], dims: usize, segments: Vec<(usize, usize)>) -> Self {
        let allowed = vec![true; features.len() / dims.max(1)];
        Self { features, dims, segments, allowed, same: Vec::new() }
    }

    /// Returns how many of some units may be chosen and differ in more than their level.
    #[must_use]
    pub fn different(&self, units: impl Iterator<Item = usize>) -> usize {
        let mut counted = vec![false; self.allowed.len()];
        let first = |j: &usize| {
            let sound = self.same.get(*j).map_or(*j, |&first| first as usize);
            !std::mem::replace(&mut counted[sound], true)
        };
        units.filter(|&j| self.allowed.get(j) == Some(&true)).filter(first).count()
    }
}

/// All units of a database.
impl<'a> From<&'a UnitDatabase> for Units<'a> {
    fn from(db: &'a UnitDatabase) -> Self {
        Self {
            features: &db.features,
            dims: db.dims(),
            segments: db.segments.iter().map(|s| (s.start as usize, s.units as usize)).collect(),
            allowed: vec![true; db.len()],
            same: db.same_sounds(),
        }
    }
}

/// Maximal number of dimensions of a vector.
pub const MAX_DIMS: usize = 64;
