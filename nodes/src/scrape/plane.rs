//! Maps laid out for reading between pixels: four by four neighbours without a question about borders.

use crate::texture::{Grid, Wrap};

/// How a map is read between its pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interp {
    /// Straight lines between neighbours.
    Linear,
    /// Cubic through the pixels.
    Catmull,
    /// Cubic B-spline: smoothest, and softens what is near the finest that a map holds.
    Bspline3,
}

impl Interp {
    /// Weights of the pixels at -1, 0, 1 and 2 for a place `t` between 0 and 1.
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
}

/// Pixels kept beyond the low and the high border.
const PAD: [usize; 2] = [3, 4];

/// A map of `C` numbers per pixel with its surroundings.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane<const C: usize> {
    /// Pixels after which it repeats; of a clamped one, its size.
    period: [i64; 2],
    clamped: bool,
    stride: usize,
    data: Vec<f32>,
}

impl<const C: usize> Plane<C> {
    /// Lays out maps of one size. `along` gives, per map, whether it is a change along x or along y: such a one turns its
    /// sign in a mirror, and is zero where nothing changes beyond a clamped border.
    #[must_use]
    pub fn new(maps: [&Grid; C], along: [[bool; 2]; C], wrap: Wrap) -> Self {
        let size = maps.first().map_or([1; 2], |map| [map.width.max(1), map.height.max(1)]);
        let [w, h] = if wrap == Wrap::Mirror { size.map(|n| 2 * n) } else { size };
        let stride = w + PAD[0] + PAD[1];
        let mut data = Vec::with_capacity(stride * (h + PAD[0] + PAD[1]) * C);
        for y in -(PAD[0] as i64)..(h + PAD[1]) as i64 {
            for x in -(PAD[0] as i64)..(w + PAD[1]) as i64 {
                let place = [x, y];
                let at = [0, 1].map(|k| wrap.place(place[k], size[k]));
                let turn = [0, 1].map(|k| turn(place[k], size[k], wrap));
                for (map, along) in maps.iter().zip(along) {
                    let sign: f32 = (0..2).map(|k| if along[k] { turn[k] } else { 1.0 }).product();
                    let pixel = map.samples.get(at[1] * map.width + at[0]).copied().unwrap_or_default();
                    data.push(sign * pixel);
                }
            }
        }
        Self { period: [w as i64, h as i64], clamped: wrap == Wrap::Clamp, stride, data }
    }

    /// A pixel `whole` and the way beyond it, brought into the map.
    #[inline(always)]
    fn inside(&self, axis: usize, whole: i64, part: f32) -> (usize, f32) {
        let n = self.period[axis];
        if (0..n).contains(&whole) {
            return ((whole + PAD[0] as i64 - 1) as usize, part);
        }
        let (whole, part) = if !self.clamped {
            (whole.rem_euclid(n), part)
        } else if whole < -2 {
            (-2, 0.0)
        } else if whole > n + 1 {
            (n + 1, 0.0)
        } else {
            (whole, part)
        };
        ((whole + PAD[0] as i64 - 1) as usize, part)
    }

    /// The four rows of four pixels around a place, and how far it is beyond the second of them.
    #[inline(always)]
    fn around<const N: usize>(&self, base: [i64; 2], x: f32, y: f32) -> ([&[f32; N]; 4], f32, f32) {
        let (fx, fy) = (x.floor(), y.floor());
        let (i, tx) = self.inside(0, base[0] + fx as i64, x - fx);
        let (j, ty) = self.inside(1, base[1] + fy as i64, y - fy);
        let at = (j * self.stride + i) * C;
        let row = |k: usize| {
            let at = at + k * self.stride * C;
            self.data.get(at..at + N).and_then(|row| <&[f32; N]>::try_from(row).ok()).unwrap_or(&[0.0; N])
        };
        ([row(0), row(1), row(2), row(3)], tx, ty)
    }
}

/// What becomes of a change along an axis at a pixel beyond the border.
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

#[inline(always)]
fn dot(a: [f32; 4], b: [f32; 4]) -> f32 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
}

/// The rows weighted and added.
#[inline(always)]
fn blend<const N: usize>(rows: [&[f32; N]; 4], w: [f32; 4]) -> [f32; N] {
    let mut sum = [0.0; N];
    for k in 0..N {
        sum[k] = (w[0] * rows[0][k] + w[1] * rows[1][k]) + (w[2] * rows[2][k] + w[3] * rows[3][k]);
    }
    sum
}

impl Plane<1> {
    /// The value at `(x, y)` pixels from pixel `base`.
    #[inline(always)]
    #[must_use]
    pub fn value(&self, interp: Interp, base: [i64; 2], x: f32, y: f32) -> f32 {
        let (rows, tx, ty) = self.around::<4>(base, x, y);
        dot(blend(rows, interp.weights(ty)), interp.weights(tx))
    }

    /// Its gradient there, per pixel: the derivative of the same surface.
    #[inline(always)]
    #[must_use]
    pub fn gradient(&self, interp: Interp, base: [i64; 2], x: f32, y: f32) -> [f32; 2] {
        let (rows, tx, ty) = self.around::<4>(base, x, y);
        let along = blend(rows, interp.weights(ty));
        let across = blend(rows, interp.slopes(ty));
        [dot(along, interp.slopes(tx)), dot(across, interp.weights(tx))]
    }
}

impl Plane<2> {
    /// The inner product of both numbers at a place with a direction.
    #[inline(always)]
    #[must_use]
    pub fn along(&self, interp: Interp, base: [i64; 2], x: f32, y: f32, t: [f32; 2]) -> f32 {
        let (rows, tx, ty) = self.around::<8>(base, x, y);
        let sum = blend(rows, interp.weights(ty));
        let w = interp.weights(tx);
        let part = |k: usize| w[k] * (t[0] * sum[2 * k] + t[1] * sum[2 * k + 1]);
        (part(0) + part(1)) + (part(2) + part(3))
    }
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
            let plane = Plane::<1>::new([&ramp], [[false; 2]], Wrap::Clamp);
            let value = |x: f32, y: f32| plane.value(interp, [0, 0], x, y);
            assert!((value(3.3, 2.6) - (6.6 - 7.8)).abs() < 1e-5);
            assert!((value(-50.0, 2.0) - value(-9.0, 2.0)).abs() < 1e-5);
            assert!((value(900.0, 2.0) - 8.0).abs() < 1e-5, "{}", value(900.0, 2.0));
            let [gx, gy] = plane.gradient(interp, [1, 1], 2.3, 1.6);
            assert!((gx - 2.0).abs() < 1e-5 && (gy + 3.0).abs() < 1e-5);
            let repeat = Plane::<1>::new([&ramp], [[false; 2]], Wrap::Repeat);
            let at = |i: i64, j: i64| repeat.value(interp, [i, j], 0.4, 0.7);
            assert_eq!(at(1, 2), at(1 + 8 * 5, 2 - 6 * 7));
            let mirror = Plane::<1>::new([&ramp], [[false; 2]], Wrap::Mirror);
            let [left, right] = [-2.3, 1.3].map(|x| mirror.value(interp, [0, 0], x, 2.0));
            assert!((left - right).abs() < 1e-5, "about -0.5");
        }
    }

    #[test]
    fn changes_turn_in_a_mirror_and_vanish_beyond_a_clamped_border() {
        let one = Grid::from_fn(4, 4, |_, _| 1.0);
        let maps = |wrap| Plane::<2>::new([&one, &one], [[true, false], [false, true]], wrap);
        let at = |plane: &Plane<2>, x: f32, t| plane.along(Interp::Linear, [0, 0], x, 1.0, t);
        let mirror = maps(Wrap::Mirror);
        assert_eq!([-2.0, 1.0, 5.0, 9.0].map(|x| at(&mirror, x, [1.0, 0.0])), [-1.0, 1.0, -1.0, 1.0]);
        assert_eq!(at(&mirror, -2.0, [0.0, 1.0]), 1.0);
        let clamp = maps(Wrap::Clamp);
        assert_eq!([-3.0, 2.0, 70.0].map(|x| at(&clamp, x, [1.0, 0.0])), [0.0, 1.0, 0.0]);
        assert_eq!(at(&clamp, 70.0, [0.0, 1.0]), 1.0);
    }
}
