//! Textures from models: each node of the output is chosen by its ancestors, its predecessors and a score.

mod choice;
mod classes;
mod join_gains;
mod layer;
pub mod morph;
mod node_constraints;
mod output;
pub mod position;
mod recent;
pub mod rules;
mod soundtrack_figure;
pub mod soundtrack_report;
mod step;
pub mod synthesizer;
pub mod texture_stream;
pub mod texture_synthesis;
pub mod tree_step;
mod waveform;

pub use morph::OverlapMode;
pub use position::{SourcePosition, SourcePositions};
pub use rules::{CandidateSearch, MatchCount, MatchCriterion, SynthesisCounts, SynthesisRules, WeightBias};
pub use synthesizer::Synthesizer;
pub use texture_stream::TextureStream;
