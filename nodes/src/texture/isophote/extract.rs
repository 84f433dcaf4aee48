//! Extraction of isophotes from an image, with the gradient along them.

use super::contour::{Field, Line, Lines, MAX_LEVELS, Saddle, contours};
use super::curves::{Curve, Isophotes, STEPS};
use super::simplify::{Tolerance, simplify};
use crate::texture::filter::Kernel;
use crate::texture::filter::masked::smooth_masked;
use crate::texture::grid::{Grid, Wrap};
use crate::texture::maps::Luma;
use rayon::prelude::*;

/// Bins of the histogram for quantiles of luminance.
const BINS: usize = 1 << 16;
/// Lines that one task simplifies.
const TASK_LINES: usize = 64;
/// Minimum gradient of the tolerance, relative to the root mean square of all gradients.
const MIN_GRADIENT: f64 = 0.3;

/// Levels of luminance of the curves.
#[derive(Clone, Debug, PartialEq)]
pub enum Levels {
    /// A number of levels at quantiles, with as many pixels between each two.
    Quantiles(usize),
    /// A number of levels, evenly spaced from the 2nd percentile to the 98th.
    Uniform(usize),
    /// Explicit levels.
    These(Vec<f32>),
}

/// Parameters of the extraction.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Levels of the curves.
    pub levels: Levels,
    /// Standard deviation of the Gaussian that is applied first, in pixels.
    pub pre_blur: f64,
    /// Rule for cells with two opposite high corners.
    pub saddle: Saddle,
    /// Maximum distance of a simplified curve from the exact one, in pixels; 0 retains all points.
    pub simplify: f64,
    /// Maximum relative error of the gradient along a simplified curve.
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

/// Error of [`isophotes`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IsophotesError {
    /// The image has no cell of four pixels.
    #[error("the image has {0} x {1} pixels; isophotes need 2 x 2")]
    TooSmall(usize, usize),
    /// The number of samples does not match the size.
    #[error("the image has {2} samples for {0} x {1} pixels")]
    Damaged(usize, usize, usize),
    /// No level is in the range of the luminance.
    #[error("none of the {count} levels lies in the luminance of the image, {low} to {high}")]
    Outside {
        /// Number of explicit levels.
        count: usize,
        /// Lowest luminance after the blur.
        low: f32,
        /// Highest luminance after the blur.
        high: f32,
    },
}

/// Extracts the isophotes of an image.
///
/// Holes have no isophotes and do not affect those around them. Equal levels count once, so that the result may have fewer levels;
/// an image of constant luminance has none.
///
/// # Errors
/// An image without cells, or no explicit level in the range of its luminance.
///
/// # Complexity
/// O(pixels x levels + points log points). In addition to the result it needs memory for one image (two if it is not periodic) and for
/// all points of one level.
///
/// # Source
/// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.1.
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
        distance: drawing.simplify,
        gradient: drawing.gradient_error,
        min_gradient: if drawing.simplify > 0.0 { MIN_GRADIENT * rms_gradient(&blurred, wrap) } else { 0.0 },
    };
    // An image that is not periodic is padded by one pixel, so that curves continue beyond paths along its border.
    let margin = usize::from(wrap != Wrap::Repeat);
    let padded = (margin > 0).then(|| {
        let index = |at: usize, len| wrap.index(at as i64 - 1, len);
        Grid::from_fn(width + 2, height + 2, |x, y| {
            blurred.samples[index(y, height) * width + index(x, width)]
        })
    });
    let field = Field {
        width: width + 2 * margin,
        samples: padded.as_ref().map_or(&blurred.samples, |padded| &padded.samples),
        torus: margin == 0,
    };
    // One level after the other: lines take many times the memory of simplified ones.
    for (height, level) in all.levels.clone().into_iter().zip(0..) {
        for lines in contours(&field, &[height], drawing.saddle) {
            let origin = margin as f64;
            let simplified = |chunk: &[Line]| {
                to_curves(&lines, chunk, |p| p.map(|x| x - origin), &blurred, wrap, tolerance)
            };
            let chunks: Vec<_> = lines.lines.par_chunks(TASK_LINES).map(simplified).collect();
            // Exact, because these vectors may be larger than several images.
            let count = chunks.iter().map(|(_, points, _)| points.len()).sum();
            all.points.reserve_exact(count);
            all.gradients.reserve_exact(count);
            for (curves, points, gradients) in chunks {
                all.curves.extend(curves.iter().map(|curve| Curve { level, ..*curve }));
                all.points.extend(points);
                all.gradients.extend(gradients);
            }
        }
    }
    Ok(all)
}

/// Returns the root mean square of the gradients of an image.
fn rms_gradient(grid: &Grid, wrap: Wrap) -> f64 {
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

/// Curves, their points and gradients.
type Curves = (Vec<Curve>, Vec<[f32; 2]>, Vec<[f32; 2]>);

/// Converts some lines of one level to curves with gradients, and simplifies them; `position` maps points of lines to the image.
fn to_curves(
    lines: &Lines,
    chunk: &[Line],
    position: impl Fn([f64; 2]) -> [f64; 2],
    blurred: &Grid,
    wrap: Wrap,
    tolerance: Tolerance,
) -> Curves {
    let (mut curves, mut points, mut slopes) = (Vec::new(), Vec::new(), Vec::new());
    for Line { from, to, closed } in chunk {
        // Points are rounded before the simplification, so that the rounding does not add to the tolerance.
        let round = |x: f64| if tolerance.distance > 0.0 { (x * STEPS).round() / STEPS } else { x };
        let mut all: Vec<[f64; 2]> =
            lines.points[*from..*to].iter().map(|p| position(*p).map(round)).collect();
        all.dedup();
        let gradients: Vec<[f32; 2]> = all.iter().map(|p| slope(blurred, wrap, *p)).collect();
        let start = points.len();
        for k in simplify(&all, &gradients, tolerance) {
            points.push(all[k].map(|x| x as f32));
            slopes.push(gradients[k]);
        }
        // A ring smaller than the tolerance has less than three points left; a straight line around a periodic image has two.
        let ring = *closed && all.first() == all.last();
        let min_points = if ring { 3 } else { 2 };
        if points.len() < start + min_points {
            points.truncate(start);
            slopes.truncate(start);
        } else {
            curves.push(Curve { level: 0, closed: *closed, len: (points.len() - start) as u32 });
        }
    }
    (curves, points, slopes)
}

/// Returns the levels in rising order, without duplicates.
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
            let fractions: Vec<f64> = (0..*n).map(|k| (k as f64 + 0.5) / *n as f64).collect();
            quantiles(grid, [low, high], &fractions)
        }
        Levels::Uniform(n) => {
            let ends = quantiles(grid, [low, high], &[0.02, 0.98]);
            let along = |k: usize| if *n > 1 { k as f32 / (n - 1) as f32 } else { 0.5 };
            (0..*n).map(|k| ends[0] + (ends[1] - ends[0]) * along(k)).collect()
        }
    };
    levels.sort_by(f32::total_cmp);
    levels.dedup();
    levels.truncate(MAX_LEVELS);
    Ok(levels)
}

/// Returns the quantiles at rising fractions, to 1/65536 of the range.
fn quantiles(grid: &Grid, [low, high]: [f32; 2], fractions: &[f64]) -> Vec<f32> {
    let scale = BINS as f32 / (high - low);
    let mut bins = vec![0_u32; BINS];
    for x in grid.samples.iter().filter(|x| x.is_finite()) {
        bins[(((x - low) * scale) as usize).min(BINS - 1)] += 1;
    }
    let count: f64 = bins.iter().map(|n| f64::from(*n)).sum();
    let (mut below, mut bin) = (0.0, 0);
    let mut found = Vec::with_capacity(fractions.len());
    for fraction in fractions {
        let wanted = fraction * count;
        while bin + 1 < BINS && below + f64::from(bins[bin]) < wanted {
            below += f64::from(bins[bin]);
            bin += 1;
        }
        let within = ((wanted - below) / f64::from(bins[bin]).max(1.0)).clamp(0.0, 1.0);
        found.push(low + ((bin as f64 + within) / f64::from(scale)) as f32);
    }
    found
}

/// Returns the gradient of an image at a position: bilinear interpolation of the Sobel gradient.
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

/// Returns the Sobel gradient at a pixel, 1 for a ramp of 1 per pixel; missing neighbours are replaced by the pixel itself.
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
