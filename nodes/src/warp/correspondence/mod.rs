//! Correspondences between a target and a database, and the pairs of feature vectors from them.

pub mod correspondence_figure;
pub mod correspondence_set;
pub mod marked_waveforms;
pub mod pairing;
pub mod set;
pub(crate) mod target_features;

pub use pairing::{Interval, Pairing, SetError, SetErrors, Target, intervals, pairs, whole_units};
pub use set::{Correspondence, CorrespondenceSet, SourceName, read_correspondences, write_correspondences};
