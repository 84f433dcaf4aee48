//! Maps laid out for reading between pixels: four by four neighbours without tests for borders.

use crate::core::fault::Reject;
use crate::scrape::force::segment::{CELL, Cell};
use crate::texture::{Grid, Surface, Wrap};

/// Interpolation between the pixels of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interp {
    /// Straight lines between neighbours.
    Linear,
    /// Cubic through the pixels.
    Catmull,
    /// Cubic B-spline: smoothest, and softens the finest details of a map.
    Bspline3,
}

impl Interp {
    /// Weights of the pixels at -1, 0, 1 and 2 for a position `t` between 0 and 1.
    #[inline(always)]
    #[must_use]
    pub fn weights(self, t: f32) -> [f32; 4] {
        match self {
            Self::Linear => [0.0, 1.0 - t, t, 0.0],
            Self::Catmull => {
                let r = 1.0 - t;
                [
                    -0.5 * t * r * r,
                    1.0 - t * t * (2.5 - 1.5 * t),
                    1.0 - r * r * (2.5 - 1.5 * r),
                    -0.5 * r * t * t,
                ]
            }
            Self::Bspline3 => {
                let r = 1.0 - t;
                let sixth = 1.0 / 6.0;
                [
                    sixth * r * r * r,
                    sixth * (4.0 - t * t * (6.0 - 3.0 * t)),
                    sixth * (4.0 - r * r * (6.0 - 3.0 * r)),
                    sixth * t * t * t,
                ]
            }
        }
    }

    /// Their derivatives, per pixel.
    #[inline(always)]
    #[must_use]
    pub fn slopes(self, t: f32) -> [f32; 4] {
        match self {
            Self::Linear => [0.0, -1.0, 1.0, 0.0],
            Self::Catmull => {
                let r = 1.0 - t;
                [-0.5 * r * (r - 2.0 * t), t * (4.5 * t - 5.0), r * (5.0 - 4.5 * r), 0.5 * t * (t - 2.0 * r)]
            }
            Self::Bspline3 => {
                let r = 1.0 - t;
                [-0.5 * r * r, t * (1.5 * t - 2.0), r * (2.0 - 1.5 * r), 0.5 * t * t]
            }
        }
    }

    /// The weights of several positions.
    #[inline(always)]
    fn all_weights<const L: usize>(self, t: &Lanes<L>) -> [Lanes<L>; 4] {
        match self {
            Self::Linear => each(t, |t| Self::Linear.weights(t)),
            Self::Catmull => each(t, |t| Self::Catmull.weights(t)),
            Self::Bspline3 => each(t, |t| Self::Bspline3.weights(t)),
        }
    }

    /// Their derivatives.
    #[inline(always)]
    fn all_slopes<const L: usize>(self, t: &Lanes<L>) -> [Lanes<L>; 4] {
        match self {
            Self::Linear => each(t, |t| Self::Linear.slopes(t)),
            Self::Catmull => each(t, |t| Self::Catmull.slopes(t)),
            Self::Bspline3 => each(t, |t| Self::Bspline3.slopes(t)),
        }
    }
}

#[inline(always)]
fn each<const L: usize>(t: &Lanes<L>, weights: impl Fn(f32) -> [f32; 4]) -> [Lanes<L>; 4] {
    let mut all = [[0.0; L]; 4];
    for l in 0..L {
        let w = weights(t[l]);
        for k in 0..4 {
            all[k][l] = w[k];
        }
    }
    all
}

/// Pixels of padding beyond the low and the high border.
const PAD: [usize; 2] = [3, 4];

/// A map of `C` numbers per pixel with its surroundings.
#[derive(Clone, Debug, PartialEq)]
pub struct PaddedMap<const C: usize> {
    /// Pixels after which it repeats; of a clamped one, its size.
    period: [i64; 2],
    clamped: bool,
    stride: usize,
    data: Vec<[f32; C]>,
}

/// Number of positions that are read at once.
pub const LANES: usize = 16;

/// One number for each of `L` positions.
pub type Lanes<const L: usize = LANES> = [f32; L];

/// Pixels around the positions on one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Patch<const C: usize> {
    /// Four rows of four pixels.
    rows: [[[f32; C]; 4]; 4],
    /// 1 where a position counts, 0 beyond a clamped border.
    free: [f32; 2],
}

impl<const C: usize> PaddedMap<C> {
    /// Lays out maps of one size. `along` states, per map, whether it is a change along x or along y: such a map turns
    /// its sign in a mirror, and is zero where nothing changes beyond a clamped border.
    #[must_use]
    pub fn new(maps: [&Grid; C], along: [[bool; 2]; C], wrap: Wrap) -> Self {
        let size = maps.first().map_or([1; 2], |map| [map.width.max(1), map.height.max(1)]);
        let [w, h] = if wrap == Wrap::Mirror { size.map(|n| 2 * n) } else { size };
        let stride = w + PAD[0] + PAD[1];
        let mut data = Vec::with_capacity(stride * (h + PAD[0] + PAD[1]));
        for y in -(PAD[0] as i64)..(h + PAD[1]) as i64 {
            for x in -(PAD[0] as i64)..(w + PAD[1]) as i64 {
                let position = [x, y];
                let at = [0, 1].map(|k| wrap.index(position[k], size[k]));
                let turn = [0, 1].map(|k| turn(position[k], size[k], wrap));
                data.push(std::array::from_fn(|c| {
                    let sign: f32 = (0..2).map(|k| if along[c][k] { turn[k] } else { 1.0 }).product();
                    let pixel = maps[c].samples.get(at[1] * maps[c].width + at[0]);
                    sign * pixel.copied().unwrap_or_default()
                }));
            }
        }
        Self { period: [w as i64, h as i64], clamped: wrap == Wrap::Clamp, stride, data }
    }

    /// A pixel index mapped into the map, and true if the fraction beyond it counts.
    #[inline(always)]
    fn inside(&self, axis: usize, whole: i64) -> (usize, f32) {
        let n = self.period[axis];
        let (whole, free) = if (0..n).contains(&whole) {
            (whole, 1.0)
        } else if !self.clamped {
            (whole.rem_euclid(n), 1.0)
        } else if whole < -2 {
            (-2, 0.0)
        } else if whole > n + 1 {
            (n + 1, 0.0)
        } else {
            (whole, 1.0)
        };
        ((whole + PAD[0] as i64 - 1) as usize, free)
    }

    /// Returns the pixels around the positions on a pixel.
    #[inline(always)]
    fn patch(&self, pixel: [i64; 2]) -> Patch<C> {
        let ((i, x), (j, y)) = (self.inside(0, pixel[0]), self.inside(1, pixel[1]));
        let at = j * self.stride + i;
        let row = |k: usize| {
            let at = at + k * self.stride;
            self.data.get(at..at + 4).and_then(|row| row.try_into().ok()).unwrap_or([[0.0; C]; 4])
        };
        Patch { rows: [row(0), row(1), row(2), row(3)], free: [x, y] }
    }

    /// Reads `D` numbers at the positions `[from, to)`, in pixels from pixel `base`.
    ///
    /// # Complexity
    /// Places one after the other on the same pixel are read together.
    #[inline(always)]
    pub fn read<const D: usize>(
        &self,
        base: [i64; 2],
        [x, y]: [&Cell; 2],
        [from, to]: [usize; 2],
        out: &mut [Cell; D],
        reading: impl Fn(&Patch<C>, &[Lanes; 2]) -> [Lanes; D],
    ) {
        let mut whole = [[0_i32; CELL]; 2];
        for n in 0..CELL {
            whole[0][n] = split(x[n]).0;
            whole[1][n] = split(y[n]).0;
        }
        let [wx, wy] = &whole;
        let (mut n, to) = (from, to.min(CELL));
        while n < to {
            let same = |k: &usize| (wx[*k], wy[*k]) == (wx[n], wy[n]);
            let end = (n + 1..to).take_while(same).last().map_or(n + 1, |k| k + 1);
            let patch = self.patch([base[0] + i64::from(wx[n]), base[1] + i64::from(wy[n])]);
            let pixel = [wx[n] as f32, wy[n] as f32];
            while n < end {
                // Whole lanes, some of which may lie on other pixels and are left alone.
                let first = n.min(CELL - LANES);
                let last = end.min(first + LANES);
                let mut part = [[0.0; LANES]; 2];
                for l in 0..LANES {
                    part[0][l] = patch.free[0] * (x[first + l] - pixel[0]);
                    part[1][l] = patch.free[1] * (y[first + l] - pixel[1]);
                }
                let made = reading(&patch, &part);
                for (out, made) in out.iter_mut().zip(&made) {
                    out[n..last].copy_from_slice(&made[n - first..last - first]);
                }
                n = last;
            }
        }
    }

    /// Reads at one position `(x, y)` pixels from pixel `base`.
    #[inline(always)]
    #[must_use]
    pub fn at<const D: usize>(
        &self,
        base: [i64; 2],
        [x, y]: [f32; 2],
        reading: impl Fn(&Patch<C>, &[Lanes<1>; 2]) -> [Lanes<1>; D],
    ) -> [f32; D] {
        let ((fx, tx), (fy, ty)) = (split(x), split(y));
        let patch = self.patch([base[0] + i64::from(fx), base[1] + i64::from(fy)]);
        reading(&patch, &[[patch.free[0] * tx], [patch.free[1] * ty]]).map(|x| x[0])
    }
}

impl<const C: usize> Patch<C> {
    /// The numbers at positions on the pixel.
    #[inline(always)]
    #[must_use]
    pub fn values<const L: usize>(&self, interp: Interp, [x, y]: &[Lanes<L>; 2]) -> [Lanes<L>; C] {
        let (x, y) = (interp.all_weights(x), interp.all_weights(y));
        let mut all = [[0.0; L]; C];
        for (c, all) in all.iter_mut().enumerate() {
            *all = self.weighted(c, &x, &y);
        }
        all
    }

    /// Number `c` of the pixels, weighted along x and along y.
    #[inline(always)]
    fn weighted<const L: usize>(&self, c: usize, x: &[Lanes<L>; 4], y: &[Lanes<L>; 4]) -> Lanes<L> {
        let mut sum = [0.0; L];
        for l in 0..L {
            let column = |i: usize| {
                let p = |j: usize| y[j][l] * self.rows[j][i][c];
                (p(0) + p(1)) + (p(2) + p(3))
            };
            let p = |i: usize| x[i][l] * column(i);
            sum[l] = (p(0) + p(1)) + (p(2) + p(3));
        }
        sum
    }
}

impl Patch<1> {
    /// The gradient at positions on the pixel, per pixel: the derivative of the same surface.
    #[inline(always)]
    #[must_use]
    pub fn gradient<const L: usize>(&self, interp: Interp, [x, y]: &[Lanes<L>; 2]) -> [Lanes<L>; 2] {
        let along = self.weighted(0, &interp.all_slopes(x), &interp.all_weights(y));
        let across = self.weighted(0, &interp.all_weights(x), &interp.all_slopes(y));
        [along, across]
    }
}

/// The whole number at or below a position, and the fraction beyond it; without `floor`, often a call.
///
/// Beyond the range of an `i32`, where nothing is read, it wraps: a piece shorter than a sample is evaluated far beyond its end.
#[inline(always)]
fn split(x: f32) -> (i32, f32) {
    let toward_zero = x as i32;
    let whole = toward_zero.wrapping_sub(i32::from(toward_zero as f32 > x));
    (whole, x - whole as f32)
}

/// Sign of a change along an axis at a pixel beyond the border.
fn turn(at: i64, len: usize, wrap: Wrap) -> f32 {
    let n = len as i64;
    match wrap {
        Wrap::Repeat => 1.0,
        Wrap::Mirror if at.rem_euclid(2 * n) < n => 1.0,
        Wrap::Mirror => -1.0,
        Wrap::Clamp if (0..n).contains(&at) => 1.0,
        Wrap::Clamp => 0.0,
    }
}

impl PaddedMap<1> {
    /// The value at `(x, y)` pixels from pixel `base`.
    #[inline(always)]
    #[must_use]
    pub fn value(&self, interp: Interp, base: [i64; 2], x: f32, y: f32) -> f32 {
        let [value] = self.at(base, [x, y], |patch, t| patch.values(interp, t));
        value
    }
}

/// Checks that a grid has the samples and the density that it claims.
pub(in crate::scrape) fn check_grid(
    field: &'static str,
    grid: &Grid,
    surface: &Surface,
) -> Result<(), Reject> {
    let problem = if grid.width == 0 || grid.samples.len() != grid.width.saturating_mul(grid.height) {
        format!("`{field}` has {} numbers for {} x {} pixels", grid.samples.len(), grid.width, grid.height)
    } else if !grid.samples.iter().all(|x| x.abs() < 1e9) {
        format!("`{field}` holds numbers beyond 1e9 or none at all")
    } else if !surface.density.iter().all(|d| (1e-3..1e9).contains(d)) {
        format!("`{field}` has {:?} pixels per metre; 0.001 to 1e9 can be read", surface.density)
    } else {
        return Ok(());
    };
    Err(Reject::new("F128", problem).at(field))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Interp; 3] = [Interp::Linear, Interp::Catmull, Interp::Bspline3];

    #[test]
    fn weights_add_up_to_one_and_slopes_are_their_derivatives() {
        for interp in ALL {
            for k in 1..20 {
                let t = k as f32 / 20.0;
                assert!((interp.weights(t).iter().sum::<f32>() - 1.0).abs() < 1e-6);
                let (low, high) = (interp.weights(t - 0.005), interp.weights(t + 0.005));
                for (k, slope) in interp.slopes(t).into_iter().enumerate() {
                    assert!(((high[k] - low[k]) / 0.01 - slope).abs() < 2e-3, "{interp:?} {t} {k}");
                }
            }
        }
    }

    #[test]
    fn a_ramp_is_read_exactly_and_borders_go_on_as_said() {
        let ramp = Grid::from_fn(8, 6, |x, y| 2.0 * x as f32 - 3.0 * y as f32);
        for interp in ALL {
            let padded = PaddedMap::<1>::new([&ramp], [[false; 2]], Wrap::Clamp);
            let value = |x: f32, y: f32| padded.value(interp, [0, 0], x, y);
            assert!((value(3.3, 2.6) - (6.6 - 7.8)).abs() < 1e-5);
            assert!((value(-50.0, 2.0) - value(-9.0, 2.0)).abs() < 1e-5);
            assert!((value(900.0, 2.0) - 8.0).abs() < 1e-5, "{}", value(900.0, 2.0));
            let [gx, gy] = padded.at([1, 1], [2.3, 1.6], |patch, t| patch.gradient(interp, t));
            assert!((gx - 2.0).abs() < 1e-5 && (gy + 3.0).abs() < 1e-5);
            let repeat = PaddedMap::<1>::new([&ramp], [[false; 2]], Wrap::Repeat);
            let at = |i: i64, j: i64| repeat.value(interp, [i, j], 0.4, 0.7);
            assert_eq!(at(1, 2), at(1 + 8 * 5, 2 - 6 * 7));
            let mirror = PaddedMap::<1>::new([&ramp], [[false; 2]], Wrap::Mirror);
            let [left, right] = [-2.3, 1.3].map(|x| mirror.value(interp, [0, 0], x, 2.0));
            assert!((left - right).abs() < 1e-5, "about -0.5");
        }
    }

    #[test]
    fn changes_turn_in_a_mirror_and_vanish_beyond_a_clamped_border() {
        let one = Grid::from_fn(4, 4, |_, _| 1.0);
        let maps = |wrap| PaddedMap::<2>::new([&one, &one], [[true, false], [false, true]], wrap);
        let at = |padded: &PaddedMap<2>, x: f32, t: [f32; 2]| {
            let both = padded.at([0, 0], [x, 1.0], |patch, t| patch.values(Interp::Linear, t));
            both[0] * t[0] + both[1] * t[1]
        };
        let mirror = maps(Wrap::Mirror);
        assert_eq!([-2.0, 1.0, 5.0, 9.0].map(|x| at(&mirror, x, [1.0, 0.0])), [-1.0, 1.0, -1.0, 1.0]);
        assert_eq!(at(&mirror, -2.0, [0.0, 1.0]), 1.0);
        let clamp = maps(Wrap::Clamp);
        assert_eq!([-3.0, 2.0, 70.0].map(|x| at(&clamp, x, [1.0, 0.0])), [0.0, 1.0, 0.0]);
        assert_eq!(at(&clamp, 70.0, [0.0, 1.0]), 1.0);
    }

    #[test]
    fn a_line_of_places_is_read_as_each_of_them_is() {
        let noise = Grid::from_fn(7, 5, |x, y| ((x * 31 + y * 17) % 11) as f32);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let padded = PaddedMap::<1>::new([&noise], [[false; 2]], wrap);
            for (dx, dy) in [(0.01, 0.003), (-0.2, 0.31), (1.7, -0.9), (0.0, 0.0)] {
                let x: Cell = std::array::from_fn(|n| 3.3 + dx * n as f32);
                let y: Cell = std::array::from_fn(|n| 1.9 + dy * n as f32);
                let mut out = [[9.0; CELL]];
                let read = |patch: &Patch<1>, t: &_| patch.values(Interp::Bspline3, t);
                padded.read([4, -3], [&x, &y], [5, 61], &mut out, read);
                for n in 0..CELL {
                    let want = padded.value(Interp::Bspline3, [4, -3], x[n], y[n]);
                    assert_eq!(out[0][n], if (5..61).contains(&n) { want } else { 9.0 }, "{wrap:?} {dx} {n}");
                }
            }
        }
    }
}
