//! Correspondences between a target and a database, and the pairs of feature vectors made of them.

pub mod correspondence_set;
pub mod pairing;
pub mod set;
pub(crate) mod target_features;

pub use pairing::{Pairing, SetError, SetErrors, Stretch, Target, pairs, stretches, whole_units};
pub use set::{Correspondence, CorrespondenceSet, SourceName, read_correspondences, write_correspondences};
