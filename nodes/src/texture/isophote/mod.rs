//! Isophotes: contours of an image, their simplification, and their coding.

pub mod code;
pub mod contour;
pub mod curves;
pub mod extract;
pub mod isophotes;
pub mod isophotes_file;
mod rice;
pub mod simplify;
mod value;
