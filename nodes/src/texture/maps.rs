//! The values that nodes of textures exchange: luminance, maps and profiles of a surface.

use super::grid::{Grid, Wrap};
use serde::{Deserialize, Serialize};

/// Scale and continuation of an image on a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Pixels per metre along x and y.
    pub density: [f64; 2],
    /// Height in m of the full range of luminance.
    pub depth: f64,
    /// Continuation beyond the border.
    pub wrap: Wrap,
}

/// Measure of luminance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum LumaKind {
    /// CIE lightness, 0 to 100, of linear light.
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
    /// True for holes, the transparent pixels; empty if there are none.
    pub holes: Vec<bool>,
    /// Measure of luminance.
    pub kind: LumaKind,
    /// Scale on the surface.
    pub surface: Surface,
}

/// Gradient of the luminance of a surface, per pixel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiscontinuityMap {
    /// Change along x per pixel.
    pub gx: Grid,
    /// Change along y per pixel.
    pub gy: Grid,
    /// Scale on the surface.
    pub surface: Surface,
}

/// Main features of a surface: lines and grooves, 0 to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FeatureMap {
    /// 1 on a feature, 0 elsewhere.
    pub grid: Grid,
    /// Scale on the surface.
    pub surface: Surface,
}

/// Residual of an image without its features: noise of mean 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoiseMap {
    /// In units of luminance, 0 in holes.
    pub grid: Grid,
    /// True for holes, which are no part of the noise; empty if there are none.
    pub holes: Vec<bool>,
    /// Scale on the surface.
    pub surface: Surface,
}

/// A closed loop of noise at a known spacing: the profile under a scraping tip.
///
/// Detail finer than the image is not stored: [`line`](Self::line) adds it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoiseProfile {
    /// One period of the loop, in units of luminance.
    pub samples: Vec<f32>,
    /// Distance between samples, m: one pixel.
    pub spacing: f64,
    /// Detail that is added when the profile is read.
    pub detail: Option<Detail>,
    /// Part of the spectrum that is read.
    pub part: NoisePart,
}

/// Detail finer than an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Detail {
    /// Samples with detail for each one without.
    pub factor: u32,
    /// Seed of the detail.
    pub seed: u64,
}

/// Part of the spectrum of a noise profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoisePart {
    /// The noise of the image, and the detail.
    #[default]
    Whole,
    /// The detail alone, to be added to a map of the image.
    Detail,
}

/// Quantity that a tip follows on a noise profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoiseValue {
    /// Change of luminance per pixel, as of maps.
    #[default]
    Slope,
    /// Luminance.
    Height,
}

impl Default for Surface {
    fn default() -> Self {
        Self { density: [512.0; 2], depth: 1e-4, wrap: Wrap::Repeat }
    }
}
