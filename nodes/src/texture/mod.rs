//! Images of surfaces, and the maps, isophotes and noise made from them.
//!
//! A [`Luma`] image is the start of everything. Each map stores its density, so that a position in metres means the same on all.
//! Data flows in one direction: [`image`] reads files; [`class`] finds simple and complex textures; [`filter`] makes
//! gradients and features; [`map_code`], [`noise`] and [`isophote`] make what a contact reads; [`size`] compares their
//! bytes.

pub mod class;
pub mod figure;
pub mod filter;
pub mod grid;
pub mod holes;
pub mod image;
pub mod isophote;
pub mod map_code;
pub mod maps;
pub mod noise;
pub mod size;

pub(crate) use figure::picture::image_element;
pub(crate) use filter::pyramid::level_for;

#[doc(no_inline)]
pub use class::histogram;
#[doc(no_inline)]
pub use filter::{bilateral, dog, sobel};
#[doc(no_inline)]
pub use image::{decode, luma};
#[doc(no_inline)]
pub use map_code::code;
#[doc(no_inline)]
pub use noise::{detail, profile, psd, spectrum, split};

pub use filter::kernel::Kernel;
pub use filter::pyramid::{Pyramid, PyramidLevel};
pub use filter::separable::smooth;
pub use grid::{Grid, Wrap};
pub use isophote::code::{decode_isophotes, encode_isophotes};
pub use isophote::contour::{Field, Line, Lines, Saddle, contours};
pub use isophote::curves::{Curve, Isophotes};
pub use isophote::extract::{Drawing, IsophotesError, Levels, isophotes};
pub use isophote::simplify::{Tolerance, simplify};
pub use map_code::file::{decode_map, encode_map};
pub use maps::{
    Detail, DiscontinuityMap, FeatureMap, Luma, LumaKind, NoiseMap, NoisePart, NoiseProfile, NoiseValue,
    Surface,
};
pub use noise::detail::NoiseLine;
