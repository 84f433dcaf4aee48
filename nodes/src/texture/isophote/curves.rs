//! Isophotes as a value.

use crate::texture::grid::Wrap;
use crate::texture::maps::Surface;
use serde::{Deserialize, Serialize};

/// Parts of a pixel in which points are kept where lines are simplified.
pub(super) const STEPS: f64 = 64.0;

/// One isocurve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Curve {
    /// Number of its level.
    pub level: u16,
    /// Whether it comes back to its first point, which is then also its last.
    pub closed: bool,
    /// Points on it.
    pub len: u32,
}

/// Lines of equal luminance of an image, with its gradient along them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Isophotes {
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// How the image lies on the surface.
    pub surface: Surface,
    /// Luminance of each level, rising.
    pub levels: Vec<f32>,
    /// The curves, by level; their points follow one after the other.
    pub curves: Vec<Curve>,
    /// Points in pixels, with the high side on the left where y points down.
    ///
    /// Curves of a repeated image go on beyond its size; those of any other reach one pixel beyond its border.
    pub points: Vec<[f32; 2]>,
    /// Gradient of the luminance at each point, per pixel.
    pub gradients: Vec<[f32; 2]>,
}

impl Isophotes {
    /// The curves with their points and gradients.
    pub fn iter(&self) -> impl Iterator<Item = (Curve, &[[f32; 2]], &[[f32; 2]])> {
        let mut at = 0;
        self.curves.iter().map_while(move |curve| {
            let span = at..at + curve.len as usize;
            at = span.end;
            Some((*curve, self.points.get(span.clone())?, self.gradients.get(span)?))
        })
    }

    /// Whether curves go on across the seam of the image.
    #[must_use]
    pub fn is_torus(&self) -> bool {
        self.surface.wrap == Wrap::Repeat && self.width >= 3 && self.height >= 3
    }
}
