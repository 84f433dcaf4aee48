//! Images of surfaces, and what of them can be heard: maps of discontinuities, isophotes, features and noise.
//!
//! A [`Luma`] image is the start of everything; each map keeps its density, so that a place in metres means the same on all.

mod item;

pub use item::{DiscontinuityMap, FeatureMap, Grid, Luma, LumaKind, NoiseMap, NoiseProfile, Surface, Wrap};
