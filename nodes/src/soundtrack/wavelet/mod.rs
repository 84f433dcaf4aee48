//! Wavelet transforms of sounds: trees of coefficients, and models of textures.

pub(super) mod envelope;
pub mod family;
mod file;
pub mod model;
mod progression;
pub mod texture_model;
pub mod texture_model_file;
pub mod transform;
pub mod tree;
pub mod wavelet_tree;

pub use envelope::{Border, BorderKind, Envelopes};
pub use family::Wavelet;
pub use model::{TextureModel, ThresholdRules, ThresholdScale};
pub use transform::{Coefficients, FilterBank, StreamingInverse, forward, inverse};
pub use tree::{MIN_SAMPLES, TreeError, TreeFit, TreeRecording, TreeRules, TreeSource, WaveletTree};
