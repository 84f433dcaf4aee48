//! Bending the features of a target to where a database has the like.
//!
//! Somebody marks moments that should sound alike ([`CorrespondenceSet`]); their units become pairs of feature vectors
//! ([`pairing`]), and a thin-plate spline through them ([`fit`](fit()), [`Tps`]) warps all others ([`Warp`]).

pub mod artefact;
pub mod diagnostics;
pub mod diagnostics_node;
pub mod effect;
pub mod figure;
pub mod fit;
pub mod fit_node;
mod kernel;
pub(crate) mod linear;
mod many;
mod merged;
pub mod nodes;
pub mod pairing;
mod problem;
pub mod set;
pub mod sliced;
pub mod suggest;
pub mod suggest_node;
pub mod tps;
mod transport;
mod windows;

pub use crate::artefact::text::{Location as Place, TextError};
pub use artefact::{WARP_VERSION, Warp, WarpMap};
pub use diagnostics::{LeaveOut, Suspicion, suspicions, without};
pub use effect::{Baseline, Effect};
pub use fit::{FitError, FitReport, MAX_NODES, Pair, Stiffness, fit};
pub use pairing::{Pairing, SetError, SetErrors, Stretch, Target, pairs, stretches, whole_units};
pub use set::{Correspondence, CorrespondenceSet, SourceName, read_correspondences, write_correspondences};
pub use sliced::sliced_wasserstein;
pub use suggest::{Cause, Proposal, Silence, SuggestParams, suggest};
pub use tps::{Tps, Warper};
