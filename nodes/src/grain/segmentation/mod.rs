//! Cuts of recordings into grains.

mod cut_stream;
pub mod flux_segmenter;
pub mod segments;
pub mod spectral_flux;

pub use cut_stream::CutStream;
pub use segments::{CutKind, SegmentRules, Segments, segment};
