//! Features of sound: a few numbers per short unit that tell how loud it is and what colour it has.
//!
//! [`FeatureConventions`] say how they were made, and travel with every stream and artefact of features, so that features of
//! two kinds never meet unnoticed.

pub mod conventions;
pub mod item;
pub mod mel_cepstrum;
pub mod mfcc;
pub mod params;
pub mod temporal_filter;
pub mod temporal_gaussian;

pub use conventions::{
    BandShape, Difference, FeatureConventions, FeatureWindow, FloorRule, LogScale, MelScale,
};
pub use item::{FeatureFormat, Features};
pub use mel_cepstrum::MelCepstrum;
pub use params::{ConventionParams, FloorFrom, UnitLength};
pub use temporal_filter::TemporalFilter;
