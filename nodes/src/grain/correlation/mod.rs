//! Correlation of recordings with grains, and the patterns of grains that it finds.

mod bounds;
pub mod correlation_patterns_file;
mod file;
pub mod grain_correlate;
mod normaliser;
mod patterns;
mod peaks;
mod search;
mod transform;

pub use patterns::{
    CorrelationPatterns, PATTERNS_VERSION, Pattern, PatternError, Peak, stored_correlation, stored_gain,
};
pub use search::{CorrelateRules, Retention, correlate, memory};
