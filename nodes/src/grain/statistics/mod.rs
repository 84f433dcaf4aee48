//! Statistics of patterns, and patterns that are drawn from them.

mod file;
mod generator;
pub mod grain_texture;
mod model;
pub mod pattern_generator;
pub mod pattern_model_file;
pub mod pattern_statistics;

pub use generator::{GeneratedGrain, Generator, GeneratorRules, generated};
pub use model::{ModelError, PatternModel, fit};
