//! Selection of a unit of a database for each unit of a target: parameters, choices and the interface of a search.

use crate::core::fault::Fault;
use crate::core::state::StateArchive;

/// How units are chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct SelectorParams {
    /// Units after the present one that are compared too.
    pub look: usize,
    /// Distance beyond which a unit does not sound like the target.
    pub d_max: f64,
    /// Units for which a chosen one is not chosen again.
    pub cool_off: usize,
    /// Units within which the last picks are not repeated exactly; 0 to allow it.
    pub loop_guard: usize,
    /// Whether units before the present one are compared in place of those after it.
    pub causal: bool,
    /// Most nodes of a tree and units that are looked at for one choice; `None` looks at all that matter.
    pub effort: Option<usize>,
}

/// One choice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choice {
    /// The unit.
    pub unit: u32,
    /// Whether nothing was near enough, and this is only the nearest.
    pub fallback: bool,
    /// Distance to the target.
    pub d1: f64,
    /// Sum of distances over the units compared; 0 for a fallback, which has none.
    pub d2: f64,
    /// Whether the search was given up before it had seen all that matter.
    pub cut: bool,
}

/// Names the first vector that is not finite, counted from 0 in what was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotFinite(pub u64);

impl NotFinite {
    /// Refuses vectors with a number that is not finite, and no vector at all.
    pub(in crate::unit) fn check(window: &[f32], dims: usize) -> Result<(), Self> {
        match window.iter().position(|x| !x.is_finite()) {
            Some(at) => Err(Self((at / dims.max(1)) as u64)),
            None if window.len() < dims => Err(Self(0)),
            None => Ok(()),
        }
    }

    /// The same vector, counted with `before` others that come first.
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
/// the distance of the means. A search that is longer than `effort` goes on with the run of units: an addition, for live use.
pub trait Selector: Send + Sync {
    /// Chooses for the next unit of the target.
    ///
    /// `window` holds the vectors that are compared, in the order of time: the present one first or, where the selector looks back,
    /// last.
    ///
    /// # Errors
    /// A feature that is not finite.
    fn choose(&mut self, window: &[f32]) -> Result<Choice, NotFinite>;

    /// Goes on as if `picks`, the latest last, were all that has been chosen so far.
    fn set_history(&mut self, picks: &[u32]);

    /// Saves what was chosen so far, or puts it back.
    ///
    /// # Errors
    /// When something else was saved.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault>;

    /// Another one over the same units, which share the memory of this one.
    fn boxed_clone(&self) -> Box<dyn Selector>;
}

/// Features and gap-free stretches of a database.
#[derive(Clone, Debug)]
pub struct Units<'a> {
    /// `[units * dims]`.
    pub features: &'a [f32],
    /// Numbers in a vector.
    pub dims: usize,
    /// First unit and number of units of each stretch.
    pub segments: Vec<(usize, usize)>,
    /// Whether a unit may be chosen.
    pub allowed: Vec<bool>,
}

/// Most dimensions of a vector.
pub const MAX_DIMS: usize = 64;
