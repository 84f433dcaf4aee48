//! Lines of equal luminance through an image, with the slope that a tip meets on each.

use super::contour::{Field, Line, Lines, MOST_LEVELS, Saddle, contours};
use super::curves::{Curve, Isophotes, STEPS};
use super::simplify::{Tolerance, simplify};
use crate::texture::filter::Kernel;
use crate::texture::filter::masked::smooth_masked;
use crate::texture::grid::{Grid, Wrap};
use crate::texture::maps::Luma;
use rayon::prelude::*;

/// Bins from which quantiles of luminance are read.
const BINS: usize = 1 << 16;
/// Lines that one task simplifies.
const LINES: usize = 64;
/// Share of the root mean square of all gradients below which a gradient counts as so large when lines are simplified.
const FAINT: f64 = 0.3;

/// Which levels of luminance curves are drawn at.
#[derive(Clone, Debug, PartialEq)]
pub enum Levels {
    /// As many as said, at quantiles: each between two of them has as many pixels.
    Quantiles(usize),
    /// As many as said, evenly from the 2nd percentile to the 98th.
    Uniform(usize),
    /// These.
    These(Vec<f32>),
}

/// How isophotes are made.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Where.
    pub levels: Levels,
    /// Standard deviation in pixels of the blur before.
    pub pre_blur: f64,
    /// How cells with two opposite high corners are read.
    pub saddle: Saddle,
    /// Pixels that a curve may be off to have fewer points; 0 keeps all.
    pub simplify: f64,
    /// Share of a gradient by which the one of such a curve may be off.
    pub gradient_error: f64,
}

impl Default for Drawing {
    fn default() -> Self {
        Self {
            levels: Levels::Quantiles(8),
            pre_blur: 1.0,
            saddle: Saddle::Decider,
            simplify: 0.25,
            gradient_error: 0.05,
        }
    }
}

/// Why an image has no isophotes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IsophotesError {
    /// There is nothing between four pixels.
    #[error("the image has {0} x {1} pixels; isophotes need 2 x 2")]
    TooSmall(usize, usize),
    /// The rows are not what they should be.
    #[error("the image says {0} x {1} pixels, and has {2}")]
    Damaged(usize, usize, usize),
    /// No level lies where the luminance does.
    #[error("none of the {count} levels lies in the luminance of the image, {low} to {high}")]
    Outside {
        /// Levels that were asked for.
        count: usize,
        /// Lowest luminance after the blur.
        low: f32,
        /// Highest luminance after the blur.
        high: f32,
    },
}

/// The isophotes of an image.
///
/// Holes have none, and do not darken what is around them. Fewer levels come back than were asked for where several are the same,
/// and none for an image of one luminance.
///
/// # Errors
/// When the image has no cell, or none of the levels that were given lies in its luminance.
///
/// # Complexity
/// O(pixels x levels + points log points). Memory of one image beside the result (two where it does not repeat), and of one level with
/// all of its points.
///
/// # Source
/// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.2.
pub fn isophotes(luma: &Luma, drawing: &Drawing) -> Result<Isophotes, IsophotesError> {
    let Grid { width, height, ref samples } = luma.grid;
    if width < 2 || height < 2 {
        return Err(IsophotesError::TooSmall(width, height));
    }
    if samples.len() != width * height || !(luma.holes.is_empty() || luma.holes.len() == samples.len()) {
        return Err(IsophotesError::Damaged(width, height, samples.len()));
    }
    let wrap = luma.surface.wrap;
    let kernel = Kernel::gaussian(drawing.pre_blur, 4.0);
    let blurred = smooth_masked(&luma.grid, &luma.holes, &kernel, wrap);
    let levels = levels(&blurred, &drawing.levels)?;
    let mut all = Isophotes { width, height, surface: luma.surface, levels, ..Isophotes::default() };
    let tolerance = Tolerance {
        reach: drawing.simplify,
        share: drawing.gradient_error,
        least: if drawing.simplify > 0.0 { FAINT * steepness(&blurred, wrap) } else { 0.0 },
    };
    // One pixel more on each side of what does not repeat, so that paths along the border meet curves that go on.
    let margin = usize::from(wrap != Wrap::Repeat);
    let wide = (margin > 0).then(|| {
        let place = |at: usize, len| wrap.index(at as i64 - 1, len);
        Grid::from_fn(width + 2, height + 2, |x, y| {
            blurred.samples[place(y, height) * width + place(x, width)]
        })
    });
    let field = Field {
        width: width + 2 * margin,
        samples: wide.as_ref().map_or(&blurred.samples, |wide| &wide.samples),
        torus: margin == 0,
    };
    // One level after the other: with all of their points, lines are many times as large as what is left of them.
    for (height, level) in all.levels.clone().into_iter().zip(0..) {
        for lines in contours(&field, &[height], drawing.saddle) {
            let origin = margin as f64;
            let shorter =
                |some: &[Line]| keep(&lines, some, |p| p.map(|x| x - origin), &blurred, wrap, tolerance);
            let kept: Vec<_> = lines.lines.par_chunks(LINES).map(shorter).collect();
            // No more than is needed: there are several images in these.
            let more = kept.iter().map(|(_, points, _)| points.len()).sum();
            all.points.reserve_exact(more);
            all.gradients.reserve_exact(more);
            for (curves, points, gradients) in kept {
                all.curves.extend(curves.iter().map(|curve| Curve { level, ..*curve }));
                all.points.extend(points);
                all.gradients.extend(gradients);
            }
        }
    }
    Ok(all)
}

/// The root mean square of the gradients of an image.
fn steepness(grid: &Grid, wrap: Wrap) -> f64 {
    let row = |y: usize| {
        let squares = (0..grid.width).filter_map(|x| {
            let own = grid.samples.get(y * grid.width + x).filter(|own| own.is_finite());
            own.map(|_| sobel(grid, wrap, x as i64, y as i64).map(|g| f64::from(g).powi(2)).iter().sum())
        });
        squares.fold((0.0, 0_usize), |(sum, count), square: f64| (sum + square, count + 1))
    };
    let rows: Vec<(f64, usize)> = (0..grid.height).into_par_iter().map(row).collect();
    let (sum, count) = rows.iter().fold((0.0, 0), |(sum, n), row| (sum + row.0, n + row.1));
    (sum / count.max(1) as f64).sqrt()
}

type Kept = (Vec<Curve>, Vec<[f32; 2]>, Vec<[f32; 2]>);

/// Some lines of one level as curves, with the gradient along them, simplified where that is wanted.
fn keep(
    lines: &Lines,
    some: &[Line],
    place: impl Fn([f64; 2]) -> [f64; 2],
    blurred: &Grid,
    wrap: Wrap,
    tolerance: Tolerance,
) -> Kept {
    let (mut curves, mut points, mut slopes) = (Vec::new(), Vec::new(), Vec::new());
    for Line { from, to, closed } in some {
        // Points lie where they are kept before anything is measured, so that no rounding adds to the tolerance.
        let snap = |x: f64| if tolerance.reach > 0.0 { (x * STEPS).round() / STEPS } else { x };
        let mut all: Vec<[f64; 2]> = lines.points[*from..*to].iter().map(|p| place(*p).map(snap)).collect();
        all.dedup();
        let steep: Vec<[f32; 2]> = all.iter().map(|p| slope(blurred, wrap, *p)).collect();
        let start = points.len();
        for k in simplify(&all, &steep, tolerance) {
            points.push(all[k].map(|x| x as f32));
            slopes.push(steep[k]);
        }
        // What is left of a ring smaller than the tolerance is no line; a straight line around a repeated image is one.
        let ring = *closed && all.first() == all.last();
        let least = if ring { 3 } else { 2 };
        if points.len() < start + least {
            points.truncate(start);
            slopes.truncate(start);
        } else {
            curves.push(Curve { level: 0, closed: *closed, len: (points.len() - start) as u32 });
        }
    }
    (curves, points, slopes)
}

/// Levels in rising order, each once.
fn levels(grid: &Grid, wanted: &Levels) -> Result<Vec<f32>, IsophotesError> {
    let finite = || grid.samples.iter().copied().filter(|x| x.is_finite());
    let (low, high) = finite().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    let mut levels: Vec<f32> = match wanted {
        Levels::These(levels) => {
            let inside: Vec<f32> = levels.iter().copied().filter(|l| (low..high).contains(l)).collect();
            if inside.is_empty() {
                return Err(IsophotesError::Outside { count: levels.len(), low, high });
            }
            inside
        }
        _ if low >= high => Vec::new(),
        Levels::Quantiles(n) => {
            let at: Vec<f64> = (0..*n).map(|k| (k as f64 + 0.5) / *n as f64).collect();
            quantiles(grid, [low, high], &at)
        }
        Levels::Uniform(n) => {
            let ends = quantiles(grid, [low, high], &[0.02, 0.98]);
            let along = |k: usize| if *n > 1 { k as f32 / (n - 1) as f32 } else { 0.5 };
            (0..*n).map(|k| ends[0] + (ends[1] - ends[0]) * along(k)).collect()
        }
    };
    levels.sort_by(f32::total_cmp);
    levels.dedup();
    levels.truncate(MOST_LEVELS);
    Ok(levels)
}

/// Values below which these parts of all samples lie, to 1/65536 of their range.
fn quantiles(grid: &Grid, [low, high]: [f32; 2], at: &[f64]) -> Vec<f32> {
    let scale = BINS as f32 / (high - low);
    let mut bins = vec![0_u32; BINS];
    for x in grid.samples.iter().filter(|x| x.is_finite()) {
        bins[(((x - low) * scale) as usize).min(BINS - 1)] += 1;
    }
    let count: f64 = bins.iter().map(|n| f64::from(*n)).sum();
    let (mut below, mut bin) = (0.0, 0);
    let mut found = Vec::with_capacity(at.len());
    for part in at {
        let wanted = part * count;
        while bin + 1 < BINS && below + f64::from(bins[bin]) < wanted {
            below += f64::from(bins[bin]);
            bin += 1;
        }
        let within = ((wanted - below) / f64::from(bins[bin]).max(1.0)).clamp(0.0, 1.0);
        found.push(low + ((bin as f64 + within) / f64::from(scale)) as f32);
    }
    found
}

/// The gradient of an image at a place: Sobel's at the pixels around it, in straight lines between.
fn slope(grid: &Grid, wrap: Wrap, [x, y]: [f64; 2]) -> [f32; 2] {
    let (i, j) = (x.floor(), y.floor());
    let (u, v) = ((x - i) as f32, (y - j) as f32);
    let (i, j) = (i as i64, j as i64);
    let mix = |a: [f32; 2], b: [f32; 2], t: f32| [0, 1].map(|k| a[k] + (b[k] - a[k]) * t);
    let row = |j: i64| {
        let left = sobel(grid, wrap, i, j);
        if u > 0.0 { mix(left, sobel(grid, wrap, i + 1, j), u) } else { left }
    };
    let upper = row(j);
    if v > 0.0 { mix(upper, row(j + 1), v) } else { upper }
}

/// Sobel's gradient at a pixel, 1 for a ramp of 1 per pixel; what is missing around it counts as the pixel itself.
fn sobel(grid: &Grid, wrap: Wrap, x: i64, y: i64) -> [f32; 2] {
    let (w, h) = (grid.width, grid.height);
    let inside = x > 0 && y > 0 && x + 1 < w as i64 && y + 1 < h as i64;
    let at = |dx: i64, dy: i64| {
        let (x, y) = (x + dx, y + dy);
        let (x, y) = if inside { (x as usize, y as usize) } else { (wrap.index(x, w), wrap.index(y, h)) };
        grid.samples[y * w + x]
    };
    let middle = at(0, 0);
    let get = |dx, dy| {
        let x = at(dx, dy);
        if x.is_finite() { x } else { middle }
    };
    let [a, b, c] = [-1, 0, 1].map(|dx| get(dx, -1));
    let [d, e] = [-1, 1].map(|dx| get(dx, 0));
    let [f, g, i] = [-1, 0, 1].map(|dx| get(dx, 1));
    [(c - a + 2.0 * (e - d) + i - f) / 8.0, (f - a + 2.0 * (g - b) + i - c) / 8.0]
}

#[cfg(test)]
mod tests;
