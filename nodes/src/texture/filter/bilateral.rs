//! Bilateral filter: edge-preserving smoothing by weights of distance and similarity.
//!
//! `out(p) = sum_q w(q) L(q) / sum_q w(q)` over a circle around `p`, with
//! `w(q) = exp(-|q - p|^2 / (2 sigma_d^2)) exp(-(L(q) - L(p))^2 / (2 sigma_r^2))`.
//!
//! # Source
//! Tomasi and Manduchi, "Bilateral filtering for gray and color images" (ICCV 1998).

use super::masked::holes_as_outliers;
use super::rows::{map_rows, pad};
use super::simd::{LANES, exp2, load, store};
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::grid::{Grid, Wrap};
use crate::texture::maps::Luma;
use crate::{params, ports};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};
use std::f64::consts::LOG2_E;

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

/// One pixel of the circle.
#[derive(Clone, Copy, Debug)]
struct Tap {
    /// Offset in the padded image from the first corner of the square around the pixel.
    offset: usize,
    /// Base-2 logarithm of the weight of the distance.
    weight: f32,
}

/// Filters an image in the direct form.
///
/// # Complexity
/// `O(pixels * radius^2)`, with one more image of memory.
#[must_use]
pub fn bilateral(image: &Grid, params: BilateralParams, wrap: Wrap) -> Grid {
    let radius = params.radius();
    let padded = Padded::new(image, radius, wrap);
    let r = radius as i64;
    let circle = (-r..=r).flat_map(|v| (-r..=r).map(move |u| (u, v))).filter(|(u, v)| u * u + v * v <= r * r);
    let taps: Vec<Tap> = circle
        .map(|(u, v)| Tap {
            offset: (v + r) as usize * padded.pitch + (u + r) as usize,
            weight: (-0.5 * LOG2_E * (u * u + v * v) as f64 / (params.sigma_d * params.sigma_d)) as f32,
        })
        .collect();
    let slope = (-0.5 * LOG2_E / (params.sigma_r * params.sigma_r)) as f32;
    let (level, middle) = (Level::new(), radius * padded.pitch + radius);
    map_rows(
        image.width,
        image.height,
        || (),
        |(), y, out| {
            let rows = padded.samples.get(y * padded.pitch..).unwrap_or_default();
            dispatch!(level, simd => one_row(simd, rows, middle, &taps, slope, out));
        },
    )
}

/// An image with padding on all sides.
struct Padded {
    samples: Vec<f32>,
    /// Samples from one row to the next, with padding for full vectors at the end.
    pitch: usize,
}

impl Padded {
    fn new(image: &Grid, radius: usize, wrap: Wrap) -> Self {
        let pitch = image.width.next_multiple_of(LANES) + 2 * radius;
        let rows = map_rows(
            pitch,
            image.height + 2 * radius,
            || (),
            |(), y, line| {
                let row = image.row(y as i64 - radius as i64, wrap);
                line.iter_mut().skip(radius).zip(row).for_each(|(out, x)| *out = *x);
                pad(line, radius, image.width, wrap);
            },
        );
        Self { samples: rows.samples, pitch }
    }
}

#[inline(always)]
fn one_row<S: Simd>(simd: S, rows: &[f32], middle: usize, taps: &[Tap], slope: f32, out: &mut [f32]) {
    let slope = f32x16::splat(simd, slope);
    for at in (0..out.len()).step_by(LANES) {
        let own = load(simd, rows, at + middle);
        let (mut sum, mut weights) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 0.0));
        for tap in taps {
            // Differences are summed, so that a flat area stays exactly unchanged.
            let change = load(simd, rows, at + tap.offset) - own;
            let weight = exp2(simd, (change * change).mul_add(slope, f32x16::splat(simd, tap.weight)));
            sum = weight.mul_add(change, sum);
            weights += weight;
        }
        store(own + sum / weights, out, at);
    }
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
        for (width, height) in [(1, 1), (5, 3), (16, 9), (45, 40)] {
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
