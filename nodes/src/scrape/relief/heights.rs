//! Heights of a surface, and their offsets under a ball and between two surfaces.

use crate::scrape::force::segment::{CELL, Cell};
use crate::scrape::map::padded_map::{Interp, PaddedMap};
use crate::texture::{Grid, Luma, LumaKind, Surface};

/// The heights of a surface in m, for reading at positions in m.
#[derive(Clone, Debug, PartialEq)]
pub struct Relief {
    padded: PaddedMap<1>,
    density: [f64; 2],
    /// Highest minus lowest height, m.
    range: f64,
}

/// Heights of an image in m: `depth` for the full range of its luminance.
#[must_use]
pub fn heights(luma: &Luma) -> Grid {
    let full = match luma.kind {
        LumaKind::Lstar => 100.0,
        LumaKind::Rec601 => 255.0,
    };
    let scale = (luma.surface.depth / full) as f32;
    Grid { samples: luma.grid.samples.iter().map(|l| l * scale).collect(), ..luma.grid }
}

impl Relief {
    /// The relief of heights in m.
    #[must_use]
    pub fn new(heights: &Grid, surface: &Surface) -> Self {
        let ends = |(low, high): (f32, f32), h: &f32| (low.min(*h), high.max(*h));
        let (low, high) = heights.samples.iter().fold((f32::MAX, f32::MIN), ends);
        let range = f64::from(high - low).max(0.0);
        Self {
            padded: PaddedMap::new([heights], [[false; 2]], surface.wrap),
            density: surface.density,
            range,
        }
    }

    /// Highest minus lowest height, m.
    #[must_use]
    pub fn range(&self) -> f64 {
        self.range
    }

    #[inline(always)]
    fn pixel(&self, position: [f64; 2]) -> ([i64; 2], [f32; 2]) {
        let at = [position[0] * self.density[0], position[1] * self.density[1]];
        let whole = [below(at[0]), below(at[1])];
        (whole, [(at[0] - whole[0] as f64) as f32, (at[1] - whole[1] as f64) as f32])
    }

    /// Heights at positions in m from `start` on, `step` m from one to the next.
    #[inline(always)]
    pub fn line(&self, start: [f64; 2], step: [f64; 2], out: &mut [f32]) {
        let (base, [x, y]) = self.pixel(start);
        let [dx, dy] = [0, 1].map(|k| (step[k] * self.density[k]) as f32);
        let (mut px, mut py, mut heights) = ([0.0; CELL], [0.0; CELL], [[0.0; CELL]]);
        for (part, out) in out.chunks_mut(CELL).enumerate() {
            for n in 0..CELL {
                let k = (part * CELL + n) as f32;
                (px[n], py[n]) = (x + k * dx, y + k * dy);
            }
            let range = [0, out.len()];
            self.padded.read(
                base,
                [&px, &py],
                range,
                &mut heights,
                #[inline(always)]
                |patch, t| patch.values(Interp::Bspline3, t),
            );
            out.copy_from_slice(&heights[0][..out.len()]);
        }
    }

    /// Height at a position in m.
    #[inline(always)]
    #[must_use]
    pub fn height(&self, position: [f64; 2]) -> f32 {
        let (base, [x, y]) = self.pixel(position);
        self.padded.value(Interp::Bspline3, base, x, y)
    }

    /// Slopes along x and y at the positions of a range in m, m/m; these are near `centre`.
    #[inline(always)]
    pub fn slopes(
        &self,
        centre: [f64; 2],
        positions: &[[f64; 2]; CELL],
        range: [usize; 2],
        out: &mut [Cell; 2],
    ) {
        let (base, _) = self.pixel(centre);
        let [dx, dy] = self.density;
        let (mut x, mut y) = ([0.0; CELL], [0.0; CELL]);
        for n in 0..CELL {
            x[n] = (positions[n][0] * dx - base[0] as f64) as f32;
            y[n] = (positions[n][1] * dy - base[1] as f64) as f32;
        }
        self.padded.read(
            base,
            [&x, &y],
            range,
            out,
            #[inline(always)]
            |patch, t| patch.gradient(Interp::Bspline3, t),
        );
        for (out, density) in out.iter_mut().zip(self.density) {
            out.iter_mut().for_each(|slope| *slope *= density as f32);
        }
    }
}

/// The whole number at or below a position.
#[inline(always)]
fn below(x: f64) -> i64 {
    let toward_zero = x as i64;
    toward_zero - i64::from(toward_zero as f64 > x)
}
