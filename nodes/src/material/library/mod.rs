//! Materials as files.

pub mod material;
pub mod material_blend;
pub mod material_file;
pub mod material_out;
mod reader;

pub use material::{Elastic, FitOrigin, Material, Uncertainty};
pub use reader::{read_material, write_material};
