//! Cuts of recordings into grains.

mod cut_stream;
pub mod flux;
pub mod flux_segmenter;
pub mod onset_strength;
pub mod segments;
pub mod spectral_flux;

pub use cut_stream::CutStream;
pub use flux::{Excerpt, FluxFrames, FluxMeter, FluxStream, spectral_flux};
pub use onset_strength::{ONSET_RISE, onset_strength, onsets};
pub use segments::{CutKind, SegmentRules, Segments, segment};
