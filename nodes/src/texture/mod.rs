//! Images of surfaces, and what of them can be heard: maps of discontinuities, isophotes, features and noise.
//!
//! A [`Luma`] image is the start of everything; each map keeps its density, so that a place in metres means the same on all.

mod filter;
mod item;
mod mips;
mod pyramid;

pub use filter::{Kernel, smooth};
pub use item::{DiscontinuityMap, FeatureMap, Grid, Luma, LumaKind, NoiseMap, NoiseProfile, Surface, Wrap};
pub use mips::ProfileMips;
pub use pyramid::{Pyramid, PyramidLevel};
