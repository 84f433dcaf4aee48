//! A map of a surface as a pyramid, read at the level of detail of the speed.

use super::padded_map::{Interp, Lanes, PaddedMap, Patch};
use crate::scrape::force::approximation::log2;
use crate::scrape::force::segment::{CELL, Cell};
use crate::texture::sobel::gradient;
use crate::texture::{DiscontinuityMap, FeatureMap, Grid, Pyramid, Surface, level_for};

/// Maximum number of levels of a pyramid: steps of 2048 pixels.
const LEVELS: usize = 13;

/// One level of a map: the map, and the size of its pixels relative to full ones along x and y.
type Scaled<const C: usize> = (PaddedMap<C>, [f64; 2]);

/// Reading of a map.
#[derive(Clone, Debug, PartialEq)]
enum Reading {
    /// A gradient along the path.
    Slope(Vec<Scaled<2>>),
    /// The change of a value along the path.
    Change(Vec<Scaled<1>>),
    /// A value.
    Value(Vec<Scaled<1>>),
}

/// A map of a surface, ready to be read at any position and at any speed.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMap {
    reading: Reading,
    pub(super) surface: Surface,
    /// Factors of changes along x and y, if these are per metre instead of per pixel.
    pub(super) per_metre: Option<[f32; 2]>,
    rms: f64,
}

/// Root mean square of the part of a gradient along any direction.
fn slope_rms([gx, gy]: [&Grid; 2], [x, y]: [f64; 2]) -> f64 {
    let squares = |grid: &Grid| grid.samples.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>();
    let all = squares(gx) * x * x + squares(gy) * y * y;
    (0.5 * all / gx.samples.len().max(1) as f64).sqrt()
}

/// The same of the gradient of a grid.
fn change_rms(grid: &Grid, surface: &Surface, unit: [f64; 2]) -> f64 {
    let [gx, gy] = gradient(grid, surface.wrap);
    slope_rms([&gx, &gy], unit)
}

/// Standard deviation.
fn deviation(grid: &Grid) -> f64 {
    let n = grid.samples.len().max(1) as f64;
    let mean = grid.samples.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
    (grid.samples.iter().map(|x| (f64::from(*x) - mean).powi(2)).sum::<f64>() / n).sqrt()
}

fn levels(grid: &Grid, surface: &Surface) -> Vec<(Grid, [f64; 2])> {
    let pyramid = Pyramid::new(grid.clone(), surface.wrap);
    pyramid.levels.into_iter().take(LEVELS).map(|level| (level.grid, level.scale)).collect()
}

fn scalar(grid: &Grid, surface: &Surface) -> Vec<Scaled<1>> {
    let laid = |(grid, scale): (Grid, _)| (PaddedMap::new([&grid], [[false; 2]], surface.wrap), scale);
    levels(grid, surface).into_iter().map(laid).collect()
}

impl SurfaceMap {
    /// Slope under a contact: the gradient of a map along its path.
    #[must_use]
    pub fn slope(map: &DiscontinuityMap) -> Self {
        let surface = map.surface;
        let both = levels(&map.gx, &surface).into_iter().zip(levels(&map.gy, &surface));
        let along = [[true, false], [false, true]];
        let laid = both.map(|((x, scale), (y, _))| (PaddedMap::new([&x, &y], along, surface.wrap), scale));
        let rms = slope_rms([&map.gx, &map.gy], [1.0; 2]);
        Self { reading: Reading::Slope(laid.collect()), surface, per_metre: None, rms }
    }

    /// The size of the gradient of a map.
    #[must_use]
    pub fn size(map: &DiscontinuityMap) -> Self {
        let samples = map.gx.samples.iter().zip(&map.gy.samples).map(|(x, y)| x.hypot(*y)).collect();
        let size = Grid { width: map.gx.width, height: map.gx.height, samples };
        let reading = Reading::Value(scalar(&size, &map.surface));
        Self { reading, surface: map.surface, per_metre: None, rms: deviation(&size) }
    }

    /// Map of the change of features along the path of a contact, per pixel.
    #[must_use]
    pub fn feature_change(map: &FeatureMap) -> Self {
        Self {
            reading: Reading::Change(scalar(&map.grid, &map.surface)),
            surface: map.surface,
            per_metre: None,
            rms: change_rms(&map.grid, &map.surface, [1.0; 2]),
        }
    }

    /// Map of the change of heights in m along the path of a contact, m/m.
    #[must_use]
    pub fn height_change(heights: &Grid, surface: Surface) -> Self {
        let per_metre = Some(surface.density.map(|d| d as f32));
        let rms = change_rms(heights, &surface, surface.density);
        Self { reading: Reading::Change(scalar(heights, &surface)), surface, per_metre, rms }
    }

    /// The strength of features.
    #[must_use]
    pub fn feature(map: &FeatureMap) -> Self {
        Self {
            reading: Reading::Value(scalar(&map.grid, &map.surface)),
            surface: map.surface,
            per_metre: None,
            rms: deviation(&map.grid),
        }
    }

    /// Returns its scale on the surface.
    #[must_use]
    pub fn surface(&self) -> Surface {
        self.surface
    }

    /// Root mean square of its readings without their mean, over all positions and directions.
    #[must_use]
    pub fn rms(&self) -> f64 {
        self.rms
    }

    /// Returns true if the sign of a reading depends on the direction; otherwise it is never negative.
    #[must_use]
    pub fn directional(&self) -> bool {
        !matches!(self.reading, Reading::Value(_))
    }

    /// Reads it at positions of pixels from pixel `base`; `footprints` are pixels from one sample to the next, where any is
    /// above a half.
    #[inline(always)]
    pub(super) fn read(
        &self,
        interp: Interp,
        positions: &Positions,
        footprints: Option<&Cell>,
        range: [usize; 2],
        out: &mut Cell,
    ) {
        let mut both = [[0.0; CELL]; 2];
        match &self.reading {
            Reading::Value(levels) => {
                let mut one = [[0.0; CELL]];
                each(
                    levels,
                    positions,
                    footprints,
                    range,
                    &mut one,
                    #[inline(always)]
                    |patch, t| patch.values(interp, t),
                    #[inline(always)]
                    |patch, t, _| patch.values(interp, t),
                );
                *out = one[0];
                return;
            }
            Reading::Slope(levels) => each(
                levels,
                positions,
                footprints,
                range,
                &mut both,
                #[inline(always)]
                |patch, t| patch.values(interp, t),
                #[inline(always)]
                |patch, t, _| patch.values(interp, t),
            ),
            Reading::Change(levels) => each(
                levels,
                positions,
                footprints,
                range,
                &mut both,
                #[inline(always)]
                |patch, t| patch.gradient(interp, t),
                #[inline(always)]
                |patch, t, scale| {
                    let [x, y] = patch.gradient(interp, t);
                    [[x[0] * scale[0]], [y[0] * scale[1]]]
                },
            ),
        }
        let ([x, y], [ux, uy]) = (&both, self.per_metre.unwrap_or([1.0; 2]));
        for n in 0..CELL {
            out[n] = x[n] * (ux * positions.tx[n]) + y[n] * (uy * positions.ty[n]);
        }
    }
}

/// Positions of samples in pixels from pixel `base`, and the directions there.
pub(super) struct Positions<'a> {
    pub base: [i64; 2],
    pub x: &'a Cell,
    pub y: &'a Cell,
    pub tx: &'a Cell,
    pub ty: &'a Cell,
}

/// Reads the samples of a range, each between the two levels that suit its step: `full` reads many positions of the map
/// itself, `one` a position of a level whose pixels are as much smaller as it is reported.
#[inline(always)]
fn each<const C: usize, const D: usize>(
    levels: &[Scaled<C>],
    positions: &Positions,
    footprints: Option<&Cell>,
    [from, to]: [usize; 2],
    out: &mut [Cell; D],
    full: impl Fn(&Patch<C>, &[Lanes; 2]) -> [Lanes; D],
    one: impl Fn(&Patch<C>, &[Lanes<1>; 2], [f32; 2]) -> [Lanes<1>; D],
) {
    let Some((map, _)) = levels.first() else { return };
    let Positions { base, x, y, .. } = *positions;
    let Some(footprints) = footprints else {
        map.read(base, [x, y], [from, to], out, full);
        return;
    };
    let last = levels.len() - 1;
    // A coarser level has a scale of its own; its positions are found in double precision.
    let coarse = |level: usize, n: usize| {
        let Some((padded, scale)) = levels.get(level).filter(|_| level > 0) else {
            return map.at(base, [x[n], y[n]], |patch, t| one(patch, t, [1.0; 2]));
        };
        let at = [(base[0], x[n]), (base[1], y[n])].map(|(base, x)| base as f64 + f64::from(x));
        let at = [at[0] / scale[0], at[1] / scale[1]];
        let whole = at.map(f64::floor);
        let part = [0, 1].map(|k| (at[k] - whole[k]) as f32);
        let smaller = scale.map(|s| (1.0 / s) as f32);
        padded.at(whole.map(|x| x as i64), part, |patch, t| one(patch, t, smaller))
    };
    for n in from..to.min(CELL) {
        let depth = level_for(log2(footprints[n].max(0.5))).min(last as f32);
        let level = depth as usize;
        let fraction = depth - level as f32;
        let near = coarse(level, n);
        let far = if fraction > 0.0 { coarse((level + 1).min(last), n) } else { near };
        for (out, (near, far)) in out.iter_mut().zip(near.into_iter().zip(far)) {
            out[n] = near + fraction * (far - near);
        }
    }
}
