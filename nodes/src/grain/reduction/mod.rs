//! Dictionaries of fewer grains: clusters of similar grains, grains under a budget, and the errors of both.

mod clusters;
mod compression;
pub mod grain_cluster;
pub mod grain_compression;
pub mod grain_subset;
mod similarity;
mod subset;
#[cfg(test)]
mod testing;
mod variation;
pub mod variation_report;

pub use clusters::{Reduced, Substitute, merged, substitutes};
pub use compression::{CompressionRules, compression_table};
pub(crate) use similarity::grain_features;
pub use similarity::{SimilarPair, norms, similar_pairs};
pub use subset::{reduced, retained_grains};
