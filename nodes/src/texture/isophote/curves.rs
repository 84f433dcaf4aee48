//! Isophotes as a value.

use crate::texture::grid::Wrap;
use crate::texture::maps::Surface;
use serde::{Deserialize, Serialize};

/// Resolution of the points of simplified lines, in steps per pixel.
pub(super) const STEPS: f64 = 64.0;

/// One isophote.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Curve {
    /// Index of its level.
    pub level: u16,
    /// True for a closed curve, whose last point equals the first.
    pub closed: bool,
    /// Number of its points.
    pub len: u32,
}

/// The isophotes of an image, with the gradient of the luminance along them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Isophotes {
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// Scale of the image on the surface.
    pub surface: Surface,
    /// Luminance of each level, in rising order.
    pub levels: Vec<f32>,
    /// The curves, in order of level.
    pub curves: Vec<Curve>,
    /// Points of all curves in pixels, with the high side on the left if y points down.
    ///
    /// Curves of a periodic image continue beyond its size; others extend one pixel beyond the border.
    pub points: Vec<[f32; 2]>,
    /// Gradient of the luminance at each point, per pixel.
    pub gradients: Vec<[f32; 2]>,
}

impl Isophotes {
    /// Returns the curves with their points and gradients.
    pub fn iter(&self) -> impl Iterator<Item = (Curve, &[[f32; 2]], &[[f32; 2]])> {
        let mut end = 0;
        self.curves.iter().map_while(move |curve| {
            let span = end..end + curve.len as usize;
            end = span.end;
            Some((*curve, self.points.get(span.clone())?, self.gradients.get(span)?))
        })
    }

    /// Returns true if curves continue across the border of the image.
    #[must_use]
    pub fn is_torus(&self) -> bool {
        self.surface.wrap == Wrap::Repeat && self.width >= 3 && self.height >= 3
    }
}
