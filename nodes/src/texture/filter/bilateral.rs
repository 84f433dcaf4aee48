//! Bilateral filter: edge-preserving smoothing by weights of distance and similarity.
//!
//! `out(p) = sum_q w(q) L(q) / sum_q w(q)` over a circle around `p`, with
//! `w(q) = exp(-|q - p|^2 / (2 sigma_d^2)) exp(-(L(q) - L(p))^2 / (2 sigma_r^2))`.
//!
//! # Source
//! Tomasi and Manduchi, "Bilateral filtering for gray and color images" (ICCV 1998).

use super::masked::holes_as_outliers;
use super::rows::{copy_continued, strip_rows};
use super::simd::{Exp2, LANES, load, store};
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::grid::{Grid, Wrap};
use crate::texture::maps::Luma;
use crate::{params, ports};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};
use rayon::prelude::*;
use std::f64::consts::LOG2_E;
use std::ops::Range;

/// Standard deviations of the bilateral filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BilateralParams {
    /// Standard deviation of the distance, in pixels, above 0.
    pub sigma_d: f64,
    /// Standard deviation of the difference, in units of luminance, above 0.
    pub sigma_r: f64,
}

impl BilateralParams {
    /// Radius of the circle, in pixels: two standard deviations.
    #[must_use]
    pub fn radius(&self) -> usize {
        ((2.0 * self.sigma_d).round().max(1.0)) as usize
    }
}

/// Pixels of a row that are filtered together: the weights between their rows stay in the second-level cache.
const TILE: usize = 1024;
/// Vectors that are filtered together.
const BLOCK: usize = 2;
/// Greatest number of stored weights; above it, each weight is computed for both of its pixels.
const MAX_WEIGHTS: usize = 1 << 18;

/// Filters an image in the direct form.
///
/// A weight between two rows is computed once for both of its pixels, unless the circle is large.
///
/// # Complexity
/// `O(pixels * radius^2)`, with some rows of memory per thread in addition to the result.
#[must_use]
pub fn bilateral(image: &Grid, params: BilateralParams, wrap: Wrap) -> Grid {
    let (width, height, level) = (image.width, image.height, Level::new());
    let mut samples = vec![0.0; width * height];
    if width > 0 {
        let rows = strip_rows(height);
        samples.par_chunks_mut(width * rows).enumerate().for_each(|(strip, out)| {
            let mut window = Window::new(image, params, wrap);
            dispatch!(level, simd => window.strip(simd, (strip * rows) as i64, out));
        });
    }
    Grid { width, height, samples }
}

/// One pixel of the circle.
#[derive(Clone, Copy, Debug)]
struct Tap {
    /// Offset from the middle.
    offset: [i64; 2],
    /// Base-2 logarithm of the weight of the distance.
    weight: f32,
    /// Index of the first stored weight, of as many rows as lie between the pixels, and one more.
    stored: usize,
    /// Index in the rows of the window of the pixel for the first column.
    pixel: usize,
    /// Index of the row of weights that is read or written.
    row: usize,
}

/// The rows around a row of pixels, in one tile.
struct Window<'a> {
    image: &'a Grid,
    wrap: Wrap,
    radius: usize,
    /// Columns before and after the tile for which weights are stored.
    margin: usize,
    /// Factor of the square of a difference in an exponent of base 2.
    slope: f32,
    /// Index in `rows` of the row itself, for the first column.
    own: usize,
    /// Pixels whose weights were stored by an earlier row, those whose weights are only computed, and those whose weights are stored.
    taps: [Vec<Tap>; 3],
    /// Rows with `margin + radius` columns before and after the tile; row `y` of the image at index `y` modulo their count.
    rows: Vec<f32>,
    /// Weights between rows. For each tap, the weights of row `y` are at index `y` modulo the number of its rows.
    weights: Vec<f32>,
}

impl<'a> Window<'a> {
    fn new(image: &'a Grid, params: BilateralParams, wrap: Wrap) -> Self {
        let radius = params.radius();
        let r = radius as i64;
        let circle =
            (-r..=r).flat_map(|v| (-r..=r).map(move |u| [u, v])).filter(|[u, v]| u * u + v * v <= r * r);
        let tap = |[u, v]: [i64; 2]| Tap {
            offset: [u, v],
            weight: (-0.5 * LOG2_E * (u * u + v * v) as f64 / (params.sigma_d * params.sigma_d)) as f32,
            stored: 0,
            pixel: 0,
            row: 0,
        };
        let mut window = Self {
            image,
            wrap,
            radius,
            margin: 0,
            own: 0,
            slope: (-0.5 * LOG2_E / (params.sigma_r * params.sigma_r)) as f32,
            taps: [Vec::new(), circle.map(tap).collect(), Vec::new()],
            rows: Vec::new(),
            weights: Vec::new(),
        };
        window.share_weights();
        window.rows = vec![0.0; (2 * radius + 1) * window.row_pitch()];
        window
    }

    /// Makes space for the weights between rows, unless the circle is too large for that.
    fn share_weights(&mut self) {
        let mut taps = self.taps[1].clone();
        let margin = self.radius.next_multiple_of(LANES);
        let pitch = TILE + 2 * margin;
        let lengths =
            taps.iter().filter(|tap| tap.offset[1] > 0).map(|tap| (tap.offset[1] as usize + 1) * pitch);
        let count: usize = lengths.sum();
        if count > MAX_WEIGHTS {
            return;
        }
        self.margin = margin;
        self.weights = vec![0.0; count + LANES];
        // Vectors that are stored do not cross the lines of the cache.
        let mut next = self.weights.as_ptr().align_offset(4 * LANES).min(LANES);
        // A pixel and its opposite, which is in the opposite position of the list, share their weights.
        for k in 0..taps.len() / 2 {
            let last = taps.len() - 1 - k;
            (taps[k].stored, taps[last].stored) = (next, next);
            let rows = taps[last].offset[1] as usize;
            next += if rows > 0 { (rows + 1) * pitch } else { 0 };
        }
        for (kind, sign) in [-1, 0, 1].into_iter().enumerate() {
            self.taps[kind] = taps.iter().copied().filter(|tap| tap.offset[1].signum() == sign).collect();
        }
    }

    /// Samples from one row of pixels to the next.
    fn row_pitch(&self) -> usize {
        TILE + 2 * (self.margin + self.radius)
    }

    /// Filters the rows of `out`, the first of which is row `top` of the image.
    #[inline(always)]
    fn strip<S: Simd>(&mut self, simd: S, top: i64, out: &mut [f32]) {
        let (width, radius) = (self.image.width, self.radius as i64);
        let first = if self.margin > 0 { top - radius } else { top };
        for from in (0..width).step_by(TILE) {
            let tile = from..(from + TILE).min(width);
            let end = tile.len().next_multiple_of(BLOCK * LANES) + self.margin;
            let columns = end + self.margin + 2 * self.radius;
            for y in first - radius..first + radius {
                self.read(y, from, columns);
            }
            for y in first..top {
                self.read(y + radius, from, columns);
                self.place(y);
                self.store_weights(simd, 0..end + self.margin);
            }
            for (y, row) in (top..).zip(out.chunks_exact_mut(width)) {
                self.read(y + radius, from, columns);
                self.place(y);
                self.store_weights(simd, 0..self.margin);
                self.store_weights(simd, end..end + self.margin);
                self.filter(simd, &mut row[tile.clone()]);
            }
        }
    }

    /// Stores the weights of some columns of a row, counted from the first with weights.
    #[inline(always)]
    fn store_weights<S: Simd>(&mut self, simd: S, columns: Range<usize>) {
        let exp2 = Exp2::in_registers(simd);
        for at in columns.step_by(LANES) {
            let own = load(simd, &self.rows, self.own + at);
            for tap in &self.taps[2] {
                let change = load(simd, &self.rows, tap.pixel + at) - own;
                store(weight(simd, &exp2, change, tap.weight, self.slope), &mut self.weights, tap.row + at);
            }
        }
    }

    /// Filters a row, and stores the weights of its columns.
    #[inline(always)]
    fn filter<S: Simd>(&mut self, simd: S, out: &mut [f32]) {
        let [above, level, below] = &self.taps;
        let exp2 = Exp2::in_registers(simd);
        let (rows, stored) = (&self.rows[..], &mut self.weights[..]);
        for at in (0..out.len()).step_by(BLOCK * LANES) {
            let column = at + self.margin;
            let mut sums = Sums::new(simd, load_block(simd, rows, self.own + column));
            for tap in above {
                let pixels = load_block(simd, rows, tap.pixel + column);
                let weights = load_block(simd, stored, tap.row + at);
                sums.add(pixels, weights);
            }
            for tap in level {
                let pixels = load_block(simd, rows, tap.pixel + column);
                let weights = weights(simd, &exp2, pixels, sums.own, tap.weight, self.slope);
                sums.add(pixels, weights);
            }
            for tap in below {
                let pixels = load_block(simd, rows, tap.pixel + column);
                let weights = weights(simd, &exp2, pixels, sums.own, tap.weight, self.slope);
                let row = &mut stored[tap.row + column..tap.row + column + BLOCK * LANES];
                for (weights, row) in weights.iter().zip(row.chunks_exact_mut(LANES)) {
                    weights.store_slice(row);
                }
                sums.add(pixels, weights);
            }
            for (k, means) in sums.means().into_iter().enumerate() {
                store(means, out, (at + k * LANES).min(out.len()));
            }
        }
    }

    /// Reads columns of row `y` of the image, for the tile from column `from` on.
    fn read(&mut self, y: i64, from: usize, columns: usize) {
        let (pitch, before) = (self.row_pitch(), (self.margin + self.radius) as i64);
        let start = y.rem_euclid(2 * self.radius as i64 + 1) as usize * pitch;
        let out = &mut self.rows[start..start + columns];
        copy_continued(self.image.row(y, self.wrap), from as i64 - before, self.wrap, out);
    }

    /// Sets the indices of all pixels for row `y`.
    fn place(&mut self, y: i64) {
        let (row_pitch, pitch) = (self.row_pitch(), TILE + 2 * self.margin);
        let (radius, count) = (self.radius as i64, 2 * self.radius as i64 + 1);
        self.own = y.rem_euclid(count) as usize * row_pitch + self.radius;
        for (kind, taps) in self.taps.iter_mut().enumerate() {
            for tap in taps {
                let [u, v] = tap.offset;
                tap.pixel = (y + v).rem_euclid(count) as usize * row_pitch + (radius + u) as usize;
                // The weights that are read are those of the pixel in row `y + v`, from the first column of the tile on.
                let (row, column) = if kind == 0 { (y + v, self.margin as i64 + u) } else { (y, 0) };
                tap.row = tap.stored + row.rem_euclid(v.abs() + 1) as usize * pitch + column as usize;
            }
        }
    }
}

/// Sums over the circles around the pixels of a block.
struct Sums<S: Simd> {
    /// The pixels in the middle.
    own: [f32x16<S>; BLOCK],
    /// Weighted differences. A flat area stays exactly unchanged.
    changes: [f32x16<S>; BLOCK],
    weights: [f32x16<S>; BLOCK],
}

impl<S: Simd> Sums<S> {
    #[inline(always)]
    fn new(simd: S, own: [f32x16<S>; BLOCK]) -> Self {
        let zero = [f32x16::splat(simd, 0.0); BLOCK];
        Self { own, changes: zero, weights: zero }
    }

    #[inline(always)]
    fn add(&mut self, pixels: [f32x16<S>; BLOCK], weights: [f32x16<S>; BLOCK]) {
        for k in 0..BLOCK {
            self.changes[k] = weights[k].mul_add(pixels[k] - self.own[k], self.changes[k]);
            self.weights[k] += weights[k];
        }
    }

    #[inline(always)]
    fn means(&self) -> [f32x16<S>; BLOCK] {
        let mut means = self.own;
        for (k, mean) in means.iter_mut().enumerate() {
            *mean += self.changes[k] / self.weights[k];
        }
        means
    }
}

/// Weights of pixels, with the base-2 logarithm of the weight of their distance.
#[inline(always)]
fn weights<S: Simd>(
    simd: S,
    exp2: &Exp2<f32x16<S>>,
    pixels: [f32x16<S>; BLOCK],
    own: [f32x16<S>; BLOCK],
    distance: f32,
    slope: f32,
) -> [f32x16<S>; BLOCK] {
    let mut weights = pixels;
    for (x, own) in weights.iter_mut().zip(own) {
        *x = weight(simd, exp2, *x - own, distance, slope);
    }
    weights
}

/// Weight of a pixel with a difference, and the base-2 logarithm of the weight of its distance.
#[inline(always)]
fn weight<S: Simd>(
    simd: S,
    exp2: &Exp2<f32x16<S>>,
    change: f32x16<S>,
    distance: f32,
    slope: f32,
) -> f32x16<S> {
    exp2.of((change * change).mul_add(f32x16::splat(simd, slope), f32x16::splat(simd, distance)))
}

#[inline(always)]
fn load_block<S: Simd>(simd: S, row: &[f32], at: usize) -> [f32x16<S>; BLOCK] {
    let row = &row[at..at + BLOCK * LANES];
    let mut block = [f32x16::splat(simd, 0.0); BLOCK];
    for (vector, row) in block.iter_mut().zip(row.chunks_exact(LANES)) {
        *vector = f32x16::from_slice(simd, row);
    }
    block
}

params! {
    /// Smooths a texture and preserves its edges: each pixel becomes the mean of its neighbours, weighted by distance and similarity.
    ///
    /// The neighbourhood is a circle with a radius of two standard deviations. The defaults are for lightness from 0 to 100.
    ///
    /// # Source
    /// Tomasi and Manduchi, "Bilateral filtering for gray and color images" (ICCV 1998), as used by Picard, Tsingos and Faure
    /// (VRIPHYS 2008), section 4.2, without values. The deviations of 3 px and 4.25, those of a public implementation of the
    /// video abstraction that `DogFeatures` cites, are a choice.
    pub struct BilateralNodeParams {
        /// Standard deviation of the distance.
        sigma_d: f64 = 3.0, unit "px", range 0.1..=30.0;
        /// Standard deviation of the difference, in units of luminance.
        sigma_r: f64 = 4.25, unit "", range 0.01..=1000.0;
        /// Number of times that the filter is applied.
        passes: usize = 1, unit "", range 1..=10;
    }
}

ports! {
    pub struct BilateralPorts / BilateralIo {
        in {
            /// The luminance.
            luma: Value<Luma>,
        }
        out {
            /// The smoothed luminance.
            smooth: Value<Luma>,
        }
    }
}

/// The node over [`bilateral`].
#[derive(Debug)]
pub struct Bilateral;

impl Func for Bilateral {
    type Params = BilateralNodeParams;
    type Ports = BilateralPorts;
    const NAME: &'static str = "Bilateral";
    const VERSION: u32 = 2;

    fn eval(p: &BilateralNodeParams, _: &Build<'_>, mut io: BilateralIo<'_>) -> Result<Summary, Fault> {
        let widths = BilateralParams { sigma_d: p.sigma_d, sigma_r: p.sigma_r };
        let wrap = io.luma.surface.wrap;
        let holes = &io.luma.holes;
        let mut grid = io.luma.grid.clone();
        for _ in 0..p.passes {
            let image = if holes.is_empty() { grid } else { holes_as_outliers(&grid, holes) };
            grid = bilateral(&image, widths, wrap);
        }
        grid.samples.iter_mut().zip(holes).for_each(|(x, hole)| *x = if *hole { 0.0 } else { *x });
        io.smooth.set(Luma { grid, holes: holes.clone(), ..*io.luma });
        Ok(Summary::new())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    const DEFAULT: BilateralParams = BilateralParams { sigma_d: 3.0, sigma_r: 4.25 };

    /// The filter by its definition.
    fn naive(image: &Grid, params: BilateralParams, wrap: Wrap, x: i64, y: i64) -> f64 {
        let at = |x: i64, y: i64| f64::from(image.row(y, wrap)[wrap.index(x, image.width)]);
        let (r, own) = (params.radius() as i64, at(x, y));
        let (mut sum, mut weights) = (0.0, 0.0);
        for (u, v) in
            (-r..=r).flat_map(|u| (-r..=r).map(move |v| (u, v))).filter(|(u, v)| u * u + v * v <= r * r)
        {
            let distance = (u * u + v * v) as f64 / (params.sigma_d * params.sigma_d);
            let other = (at(x + u, y + v) - own) / params.sigma_r;
            let weight = (-0.5 * (distance + other * other)).exp();
            sum += weight * at(x + u, y + v);
            weights += weight;
        }
        sum / weights
    }

    #[test]
    fn every_pixel_is_its_defining_weighted_mean() {
        let mut rng = Rng::new(4);
        for (width, height) in [(1, 1), (3, 7), (5, 3), (16, 9), (65, 33), (45, 40)] {
            let image = Grid::from_fn(width, height, |_, _| rng.between(0.0, 100.0) as f32);
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                for params in [DEFAULT, BilateralParams { sigma_d: 1.2, sigma_r: 40.0 }] {
                    let out = bilateral(&image, params, wrap);
                    for (k, value) in out.samples.iter().enumerate() {
                        let right = naive(&image, params, wrap, (k % width) as i64, (k / width) as i64);
                        assert!((f64::from(*value) - right).abs() < 4e-5, "{wrap:?} {k}: {value} {right}");
                    }
                }
            }
        }
    }

    #[test]
    fn tiles_strips_and_large_circles_give_the_same_pixels() {
        let mut rng = Rng::new(6);
        for (width, height, sigma_d) in
            [(TILE + 70, 5, 2.0), (2, 150, 3.0), (TILE + 3, 3, 10.0), (40, 70, 10.0)]
        {
            let image = Grid::from_fn(width, height, |_, _| rng.between(0.0, 100.0) as f32);
            let params = BilateralParams { sigma_d, sigma_r: 30.0 };
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                let out = bilateral(&image, params, wrap);
                for (k, value) in out.samples.iter().enumerate().step_by(13) {
                    let right = naive(&image, params, wrap, (k % width) as i64, (k / width) as i64);
                    assert!((f64::from(*value) - right).abs() < 2e-4, "{wrap:?} {k}: {value} {right}");
                }
            }
        }
    }

    /// Result of OpenCV's `cv2.bilateralFilter(image, 13, 0.15, 3, borderType=cv2.BORDER_REPLICATE)` for
    /// `image[y, x] = (37 x + 11 x y + 5 y^2) % 29 / 32` of 9 x 7 pixels.
    const OPENCV: [f64; 63] = include!("../testdata/bilateral.in");

    #[test]
    fn the_filter_is_that_of_opencv() {
        let image = Grid::from_fn(9, 7, |x, y| ((37 * x + 11 * x * y + 5 * y * y) % 29) as f32 / 32.0);
        let out = bilateral(&image, BilateralParams { sigma_d: 3.0, sigma_r: 0.15 }, Wrap::Clamp);
        for (k, (ours, theirs)) in out.samples.iter().zip(OPENCV).enumerate() {
            assert!((f64::from(*ours) - theirs).abs() < 4e-7, "{k}: {ours} {theirs}");
        }
    }

    #[test]
    fn flat_parts_stay_and_a_high_step_stays_sharp() {
        let step = Grid::from_fn(40, 8, |x, _| if x < 20 { 20.0 } else { 80.0 });
        assert_eq!(bilateral(&step, DEFAULT, Wrap::Clamp), step);
        let low = Grid::from_fn(40, 8, |x, _| if x < 20 { 50.0 } else { 53.0 });
        let out = bilateral(&low, DEFAULT, Wrap::Clamp);
        assert!((51.0..52.0).contains(&out.samples[20]), "{}", out.samples[20]);
    }
}
