//! Directives: the weight of a set of sounds over time.

use super::curve::WeightCurve;
use crate::artefact::text::Location;

/// End of an interval without an end, s.
pub const NEVER: f64 = 1e12;
/// Greatest weight of a soft constraint.
pub const SOFT: f64 = 0.99;

/// The constraints of a score on a set of sounds, and their location.
#[derive(Clone, Debug)]
pub struct Directive {
    /// The set.
    pub set: usize,
    /// Its weight over time.
    pub curve: WeightCurve,
    /// Location in the score.
    pub location: Location,
}
