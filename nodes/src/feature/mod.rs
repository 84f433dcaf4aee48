//! Features of sound: a few numbers per short unit that describe its level and its spectrum.
//!
//! Every stream and artefact of features holds its [`FeatureConventions`], so features of different conventions are never compared
//! unnoticed. [`flux`] is the change of the spectrum, and [`onset_strength`](mod@onset_strength) finds onsets.

pub mod conventions;
pub mod flux;
mod frame_power;
pub mod item;
pub mod mel_cepstrum;
pub mod mfcc;
pub mod onset_strength;
pub mod params;
pub mod temporal_filter;
pub mod temporal_gaussian;

pub use conventions::{
    BandShape, Difference, FeatureConventions, FeatureWindow, FloorRule, LogScale, MelScale,
};
pub use flux::{FluxFrames, FluxMeter, FluxStream, spectral_flux};
pub use item::{FeatureFormat, Features};
pub use mel_cepstrum::MelCepstrum;
pub use onset_strength::{ONSET_RISE, onset_strength, onsets};
pub use params::{ConventionParams, FloorFrom, UnitLength};
pub use temporal_filter::TemporalFilter;
