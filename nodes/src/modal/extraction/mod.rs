//! Modes from recordings.
//!
//! Candidates come from ESPRIT in bands (`subband`), from peaks of spectrograms (`greedy`), or from both. They are selected by the energy that
//! they explain (`dictionary`), and refined jointly (`refinement`).

mod bands;
pub mod comparison;
mod dictionary;
mod exponentials;
pub mod extract;
pub mod feature;
mod greedy;
pub mod impacts_from_recording;
pub mod modal_features;
pub mod modal_from_recording;
mod noise_bands;
mod noise_floor;
pub mod one_object;
pub mod onset;
pub mod peak_fit;
mod phase_drift;
pub mod poles;
mod refinement;
pub mod report;
mod report_tables;
pub mod room;
pub mod sound_comparison;
mod sources;
mod spectrograms;
mod subband;
pub mod surrogate;
pub mod takes;
mod trial;
mod warnings;
