//! Features of sound: a few numbers per short unit that tell how loud it is and what colour it has.
//!
//! [`FeatureConventions`] say how they were made, and travel with every stream and artefact of features, so that features of
//! two kinds never meet unnoticed.

pub mod conventions;
pub mod gaussian;
pub mod gaussian_node;
pub mod item;
pub mod mel;
pub mod mfcc_node;
pub mod params;

pub use conventions::{
    BandShape, Difference, FeatureConventions, FeatureWindow, FloorRule, LogScale, MelScale,
};
pub use gaussian::TemporalFilter;
pub use item::{FeatureFormat, Features};
pub use mel::MelCepstrum;
pub use params::{FloorFrom, Given, UnitLength};
