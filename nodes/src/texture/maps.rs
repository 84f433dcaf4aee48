//! The values that nodes of textures exchange: luminance, maps and profiles of a surface.

use super::grid::{Grid, Wrap};
use serde::{Deserialize, Serialize};

/// How a picture lies on a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Pixels per metre along x and y.
    pub density: [f64; 2],
    /// Height in m of the full range of luminance, where a height is needed.
    pub depth: f64,
    /// What lies beyond the border.
    pub wrap: Wrap,
}

/// What a number of luminance means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum LumaKind {
    /// Lightness of CIE, 0 to 100, from linear light.
    #[default]
    Lstar,
    /// Weighted sum of the coded channels, 0 to 255.
    Rec601,
}

impl LumaKind {
    /// Greatest luminance of the kind.
    #[must_use]
    pub fn max(self) -> f32 {
        match self {
            Self::Lstar => 100.0,
            Self::Rec601 => 255.0,
        }
    }
}

/// The luminance of an image on a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Luma {
    /// Luminance, 0 in holes.
    pub grid: Grid,
    /// Which pixels are holes (transparent); empty where none is.
    pub holes: Vec<bool>,
    /// What the numbers mean.
    pub kind: LumaKind,
    /// How it lies on the surface.
    pub surface: Surface,
}

/// Where the luminance of a surface changes: its gradient, per pixel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiscontinuityMap {
    /// Change along x per pixel.
    pub gx: Grid,
    /// Change along y per pixel.
    pub gy: Grid,
    /// How it lies on the surface.
    pub surface: Surface,
}

/// The main features of a surface: lines and grooves, 0 to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FeatureMap {
    /// 1 on a feature, 0 off it.
    pub grid: Grid,
    /// How it lies on the surface.
    pub surface: Surface,
}

/// What is left of an image without its features: noise of mean 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoiseMap {
    /// In units of luminance, 0 in holes.
    pub grid: Grid,
    /// Which pixels are holes and no part of the noise; empty where none is.
    pub holes: Vec<bool>,
    /// How it lies on the surface.
    pub surface: Surface,
}

/// A line of noise at a known spacing, closed to a loop: what a scraping tip meets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoiseProfile {
    /// One round of the loop.
    pub samples: Vec<f32>,
    /// Metres from one sample to the next.
    pub spacing: f64,
}

impl Default for Surface {
    fn default() -> Self {
        Self { density: [512.0; 2], depth: 1e-4, wrap: Wrap::Repeat }
    }
}
