//! Drawings of maps as SVG.

mod maps;
pub mod picture;
