//! Images of surfaces, and what of them can be heard: maps of discontinuities, isophotes, features and noise.
//!
//! A [`Luma`] image is the start of everything; each map keeps its density, so that a place in metres means the same on all.
//! [`decode`] and [`luma`] read images, [`histogram`] tells simple from complex ones; [`sobel`] and [`code`] make the maps of simple
//! ones, [`bilateral`], [`dog`] and [`split`] part complex ones into features and noise, [`profile`], [`spectrum`], [`psd`] and [`detail`]
//! make one line of that noise. [`isophotes()`] draws curves of equal luminance through them.

pub mod bilateral;
pub mod class_node;
pub mod code;
mod contour;
pub mod decode;
pub mod detail;
pub mod dog;
pub mod feature_nodes;
mod figure;
mod filter;
pub mod histogram;
pub mod holes;
pub mod image_node;
mod isophote_code;
mod isophote_value;
mod isophotes;
pub mod isophotes_node;
mod item;
pub mod luma;
mod map_code;
pub mod map_file_node;
pub mod map_nodes;
mod orientation;
mod palette;
mod picture;
pub mod profile;
pub mod profile_node;
pub mod psd;
mod pyramid;
mod simplify;
pub mod sizes;
pub mod sobel;
pub mod spectrum;
pub mod split;
pub mod texture_report;

pub(crate) use picture::image;

pub use contour::{Field, Line, Lines, Saddle, contours};
pub use filter::{Kernel, smooth};
pub use isophote_code::{decode_isophotes, encode_isophotes};
pub use isophotes::{Curve, Drawing, Isophotes, IsophotesError, Levels, isophotes};
pub use item::{DiscontinuityMap, FeatureMap, Grid, Luma, LumaKind, NoiseMap, NoiseProfile, Surface, Wrap};
pub use map_code::{decode_map, encode_map};
pub(crate) use pyramid::level_for;
pub use pyramid::{Pyramid, PyramidLevel};
pub use simplify::{Tolerance, simplify};
