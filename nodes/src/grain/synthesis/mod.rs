//! Sounds of grains: from patterns, and from contacts.

mod chain;
mod contact_pairs;
mod gap_noise;
pub mod grain_retarget;
mod impact_voices;
pub mod pattern_report;
pub mod pattern_resynth;
pub mod pattern_timescale;
pub mod pattern_variation;
mod repertoire;
mod segment;
mod segment_queue;
mod selection;
mod walk;

pub use chain::{Chain, ChainRules};
pub use contact_pairs::ContactPairs;
pub use impact_voices::ImpactVoices;
pub(crate) use repertoire::rendered;
pub use repertoire::{ContactSound, ImpactSound, RepertoireRules, contact_sounds, impact_sounds, sources_of};
pub use segment::{Fade, FadeShape, GrainSegment, GrainStep, join, segments, single, sound_of};
pub use segment_queue::SegmentQueue;
pub(crate) use selection::{check_patterns, check_rate};
pub use walk::{GapRule, VariationRules, frames_of, onset_steps, sequence, time_scaled, varied, walk};
