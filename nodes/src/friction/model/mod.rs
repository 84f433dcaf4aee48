//! The friction model: its fields, its file, and its spectra at any speed.
//!
//! [`displacement`] interpolates two spectra, [`interpolate`] the spectra of a model, [`spectrum_table`] tabulates them
//! for synthesis.

mod clip_length;
pub mod conventions;
pub mod displacement;
mod friction_model;
pub mod friction_model_file;
pub mod interpolate;
pub mod interpolated_spectra;
pub mod pair_friction_model;
pub mod rebin;
mod report;
pub mod spectrum_table;
mod speed_bracket;

pub use clip_length::{MAX_CLIP_SAMPLES, clip_samples};
pub use conventions::{Conventions, Origin, REFERENCE_AREA, Rejections, Source};
pub use displacement::{Gain, displace};
pub use friction_model::{FrictionModel, MODEL_VERSION, ModelError};
pub use interpolate::SpectrumInterpolator;
pub use pair_friction_model::inferred_pair;
pub(super) use report::model_summary;
pub use spectrum_table::SpectrumTable;
