//! What travels between the nodes of textures.

use super::profile::stored;
use crate::core::item::Data;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};

/// Numbers on a grid, row by row from the top left; pixel centres lie at integers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` numbers.
    pub samples: Vec<f32>,
}

/// What lies beyond the border of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wrap {
    /// The image again: tiles.
    #[default]
    Repeat,
    /// The image mirrored, its border pixel twice.
    Mirror,
    /// The pixel of the border for ever.
    Clamp,
}

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

impl Grid {
    /// A grid of a function of column and row.
    #[must_use]
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> f32) -> Self {
        let samples =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| f(x, y)).collect();
        Self { width, height, samples }
    }
}

impl Wrap {
    /// The place inside a row of `len` pixels (at least 1) that place `at` of the endless row shows.
    #[must_use]
    pub fn place(self, at: i64, len: usize) -> usize {
        let n = len.max(1) as i64;
        (match self {
            Self::Repeat => at.rem_euclid(n),
            Self::Mirror => {
                let at = at.rem_euclid(2 * n);
                at.min(2 * n - 1 - at)
            }
            Self::Clamp => at.clamp(0, n - 1),
        }) as usize
    }
}

impl Default for Surface {
    fn default() -> Self {
        Self { density: [512.0; 2], depth: 1e-4, wrap: Wrap::Repeat }
    }
}

/// All trials are of one size, for nodes that take two maps of one image.
fn trial_grid(rng: &mut Rng, low: f64, high: f64) -> Grid {
    let (width, height) = (29, 22);
    Grid::from_fn(width, height, |_, _| rng.between(low, high) as f32)
}

fn trial_surface(rng: &mut Rng) -> Surface {
    let wrap = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp][rng.below(3)];
    Surface { density: [rng.between(100.0, 4000.0), rng.between(100.0, 4000.0)], depth: 1e-4, wrap }
}

impl Data for Luma {
    const NAME: &'static str = "luma";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        Self {
            grid: trial_grid(rng, 0.0, 100.0),
            holes: Vec::new(),
            kind: LumaKind::Lstar,
            surface: trial_surface(rng),
        }
    }

    fn plot(&self) -> Option<String> {
        super::figure::luma(self)
    }
}

impl Data for DiscontinuityMap {
    const NAME: &'static str = "discontinuity map";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let gx = trial_grid(rng, -20.0, 20.0);
        let gy = Grid::from_fn(gx.width, gx.height, |_, _| rng.between(-20.0, 20.0) as f32);
        Self { gx, gy, surface: trial_surface(rng) }
    }

    fn plot(&self) -> Option<String> {
        super::figure::discontinuities(self)
    }
}

impl Data for FeatureMap {
    const NAME: &'static str = "feature map";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        Self { grid: trial_grid(rng, 0.0, 1.0), surface: trial_surface(rng) }
    }

    fn plot(&self) -> Option<String> {
        super::figure::features(self)
    }
}

impl Data for NoiseMap {
    const NAME: &'static str = "noise map";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let mut grid = trial_grid(rng, -5.0, 5.0);
        let mut holes = Vec::new();
        if rng.below(2) == 0 {
            holes = grid.samples.iter().map(|_| rng.below(4) == 0).collect();
            grid.samples.iter_mut().zip(&holes).for_each(|(x, hole)| *x = if *hole { 0.0 } else { *x });
        }
        Self { grid, holes, surface: trial_surface(rng) }
    }

    fn plot(&self) -> Option<String> {
        super::figure::noise(self)
    }
}

impl Data for NoiseProfile {
    const NAME: &'static str = "noise profile";
    const PLOTS: bool = true;
    const FILES: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let samples = (0..64 + rng.below(200)).map(|_| rng.between(-5.0, 5.0) as f32).collect();
        Self { samples, spacing: 1.0 / rng.between(500.0, 20_000.0) }
    }

    fn plot(&self) -> Option<String> {
        super::figure::profile(self)
    }

    /// The samples in 16 bits each, the lower byte first.
    fn file(&self) -> Option<Vec<u8>> {
        Some(self.samples.iter().flat_map(|x| stored(*x).to_le_bytes()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_go_on_beyond_their_ends_as_said() {
        let row = |wrap: Wrap| (-4..7).map(|at| wrap.place(at, 3)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(row(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
    }
}
