//! Warps of the features of a target to those of similar sounds in a database.
//!
//! A user marks moments that should sound alike ([`mod@correspondence`]). Their units become pairs of feature vectors. A thin-plate
//! spline ([`mod@spline`]) through the pairs ([`mod@fit`]) warps all other features ([`Warp`]). [`mod@suggestion`] proposes
//! correspondences, [`mod@diagnostics`] finds bad ones.

pub mod correspondence;
pub mod diagnostics;
pub mod fit;
pub mod spline;
pub mod suggestion;
#[cfg(test)]
mod tests;

pub use crate::artefact::text::{Location, TextError};
pub use correspondence::{
    Correspondence, CorrespondenceSet, SourceName, read_correspondences, write_correspondences,
};
pub use correspondence::{Interval, Pairing, SetError, SetErrors, Target, intervals, pairs, whole_units};
pub use diagnostics::{Baseline, Effect, LeaveOut, Suspicion, suspicions, without};
pub use fit::{FitError, FitReport, MAX_NODES, Stiffness, WARP_VERSION, Warp, WarpMap, fit};
pub use spline::{Pair, Tps, Warper};
pub use suggestion::{Cause, Proposal, Silence, SuggestParams, sliced_wasserstein, suggest};
