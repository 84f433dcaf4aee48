//! Drawings of maps as SVG.

mod maps;
pub mod panels;
pub mod picture;
pub mod texture_figure;
