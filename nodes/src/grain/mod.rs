//! Grains: short pieces of recordings that follow a simulation.
//!
//! In the order of the data: [`recording`] reads recordings with their metadata, [`segmentation`] cuts them at inflections of their
//! spectral flux, [`dictionary`] stores the grains, [`correlation`] finds where each grain occurs in each recording, [`reduction`] makes
//! dictionaries smaller, [`statistics`] are models of patterns that generate others, and [`synthesis`] plays patterns of grains, and grains
//! that follow contacts. [`sinusoid`] splits recordings into sinusoids and the residual.

pub mod correlation;
pub mod dictionary;
mod distortion;
pub mod recording;
pub mod reduction;
pub mod segmentation;
pub mod sinusoid;
pub mod statistics;
pub mod synthesis;
#[cfg(test)]
mod testing;

pub use correlation::{CorrelationPatterns, Pattern, Peak};
pub use dictionary::{Grain, GrainDictionary};
pub use distortion::Distortion;
pub use recording::{Component, GrainRecording, GrainRecordings, SourceKind};

/// Returns a small constant dictionary, to which the patterns of trials refer.
pub(crate) fn trial_dictionary() -> GrainDictionary {
    use crate::core::item::Data;
    let recordings = GrainRecordings::trial(&mut crate::core::random::Rng::new(1));
    dictionary::extract(&recordings, &dictionary::ExtractRules::at_rate(recordings.rate)).0
}
