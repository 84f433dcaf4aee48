//! Statistics of patterns, and patterns that are drawn from them.

mod generator;
mod model;
pub mod pattern_generator;
pub mod pattern_statistics;

pub use generator::{GeneratedGrain, Generator, GeneratorRules, generated};
pub use model::{ModelError, PatternModel, fit};
