//! Modes from recordings.
//!
//! Candidates come from ESPRIT in bands (`subband`), are selected by what they explain (`dictionary`), and refined jointly (`refinement`).

mod bands;
pub mod comparison;
mod dictionary;
mod exponentials;
pub mod extract;
pub mod feature;
pub mod impacts_from_recording;
pub mod modal_features;
pub mod modal_from_recording;
mod noise_bands;
mod noise_floor;
pub mod onset;
pub mod poles;
mod refinement;
pub mod report;
pub mod sound_comparison;
mod subband;
pub mod surrogate;
