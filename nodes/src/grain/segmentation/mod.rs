//! Cuts of recordings into grains.

pub mod flux;
pub mod onset_strength;
pub mod segments;

pub use flux::{FluxFrames, FluxMeter, spectral_flux};
pub use onset_strength::{ONSET_RISE, onset_strength, onsets};
pub use segments::{CutKind, SegmentRules, Segments, segment};
