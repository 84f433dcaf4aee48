//! Objects that are struck: impacts, their forces, and the modes that ring.
//!
//! An [`Impact`] is one collision. [`impact`] turns impacts into force at audio rate. A [`Bank`] rings [`Modes`], which come
//! from a file, from a recording of one impact ([`extract`]), or from a stretched sheet ([`Membrane`]).

#[cfg(feature = "impact")]
pub mod bank;
#[cfg(feature = "material")]
pub mod extraction;
pub mod impact;
#[cfg(feature = "impact")]
pub mod mode;
#[cfg(feature = "impact")]
pub mod residual;
#[cfg(feature = "impact")]
pub mod surface;

#[cfg(feature = "impact")]
pub use bank::{
    fourier_form::BankForm,
    loudness::loudness,
    resonators::{Bank, BankOutput},
};
#[cfg(feature = "material")]
pub use extraction::{
    comparison::{Comparison, compare},
    extract::{ExtractError, ExtractParams, Extracted, Extractor, extract},
    feature::{Feature, FeatureSet, FeatureSets},
    one_object::{ONE_OBJECT, TakePair, unexplained_by},
    onset::{impacts, loudest_impact, onset, onsets},
    report::{ExtractionReport, RecordingReport},
    room::Room,
    surrogate::surrogate,
    takes::{Take, read_takes},
};
pub use impact::event::{Body, Impact};
pub use impact::force_ring::ForceRing;
pub use impact::pulse::{Law, PulseShape, contact_time};
pub use impact::reader::{Defaults, ImpactError, read_impacts};
#[cfg(feature = "impact")]
pub use mode::{
    membrane::Membrane,
    modes::{Modes, ModesError},
    modes_file::read_modes,
};
#[cfg(feature = "impact")]
pub use residual::{noise_band::NoiseBand, noise_bank::NoiseBank};
