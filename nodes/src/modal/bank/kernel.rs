//! The inner loop of the modal bank: vectors of sixteen modes, each run over a block of samples.
//!
//! A mode is a complex number that one multiplication rotates and shrinks in each sample. State and coefficients stay in
//! registers for a whole block. Up to four vectors run interleaved, to hide the latency of the multiplication.

use super::two_pole::TwoPole;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x4, f32x16};
use serde::{Deserialize, Serialize};

/// Modes in one vector.
pub(crate) const LANES: usize = 16;
/// Samples between two updates of the coefficients, and the maximum length of a block.
pub(crate) const GRID: usize = 64;

/// Coefficients and state of sixteen modes.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[repr(align(64))]
pub(crate) struct Lanes {
    /// Real part of one step, less 1.
    pub less_one: [f32; LANES],
    /// Imaginary part of one step.
    pub sin: [f32; LANES],
    /// Real part of the state.
    pub re: [f32; LANES],
    /// Imaginary part of the state; the output is the sum of these.
    pub im: [f32; LANES],
}

impl Lanes {
    /// Modes at rest.
    pub const SILENT: Self =
        Self { less_one: [0.0; LANES], sin: [0.0; LANES], re: [0.0; LANES], im: [0.0; LANES] };

    /// Returns states after some samples without a force, by repeated squaring of one step.
    #[inline(always)]
    pub fn after(&self, re: &[f32; LANES], im: &[f32; LANES], mut samples: usize) -> [[f32; LANES]; 2] {
        let (mut re, mut im) = (re.map(f64::from), im.map(f64::from));
        let (mut x, mut y) = (self.less_one.map(|x| 1.0 + f64::from(x)), self.sin.map(f64::from));
        while samples > 0 {
            for l in 0..LANES {
                let (a, b) = (re[l], im[l]);
                if samples & 1 == 1 {
                    (re[l], im[l]) = (a * x[l] - b * y[l], a * y[l] + b * x[l]);
                }
                (x[l], y[l]) = (x[l] * x[l] - y[l] * y[l], 2.0 * x[l] * y[l]);
            }
            samples >>= 1;
        }
        [re.map(|x| x as f32), im.map(|x| x as f32)]
    }

    /// Returns true if the squared magnitudes of all states lie between two numbers.
    #[inline(always)]
    pub fn all_within(&self, low: f32, high: f32) -> bool {
        let mut within = [false; LANES];
        for ((within, re), im) in within.iter_mut().zip(&self.re).zip(&self.im) {
            let size = re * re + im * im;
            *within = (size > low) & (size < high);
        }
        within == [true; LANES]
    }
}

/// Input gains of sixteen modes at one contact point.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[repr(align(64))]
pub(crate) struct InputGain {
    /// Change of the real part for a force of 1.
    pub re: [f32; LANES],
    /// Change of the imaginary part.
    pub im: [f32; LANES],
}

/// The forces of one block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forces<'a> {
    /// Samples of each contact point, `[points]`.
    pub samples: &'a [[f32; GRID]],
    /// The sample that is the first one to be computed.
    pub first: usize,
    /// Points with any force other than 0.
    pub active: &'a [usize],
    /// `[vectors, points]`.
    pub gains: &'a [InputGain],
}

/// Advances all modes by `sums.len()` samples under forces, and adds them to the sums.
///
/// Vectors that are not `awake` hold zeros and are skipped while there is no force, which changes no bit of the sums.
/// The order of summation is that of the vectors on every machine.
pub(crate) fn advance(
    level: Level,
    lanes: &mut [Lanes],
    awake: &[bool],
    forces: Forces<'_>,
    sums: &mut [[f32; LANES]],
) {
    dispatch!(level, simd => advance_simd(simd, lanes, awake, forces, sums));
}

#[inline(always)]
fn advance_simd<S: Simd>(
    simd: S,
    lanes: &mut [Lanes],
    awake: &[bool],
    forces: Forces<'_>,
    sums: &mut [[f32; LANES]],
) {
    // As many vectors at once as fit into the registers.
    match S::f32s::LEN {
        16.. => tiles::<S, 4>(simd, lanes, awake, forces, sums),
        8.. => tiles::<S, 2>(simd, lanes, awake, forces, sums),
        _ => tiles::<S, 1>(simd, lanes, awake, forces, sums),
    }
}

#[inline(always)]
fn tiles<S: Simd, const U: usize>(
    simd: S,
    lanes: &mut [Lanes],
    awake: &[bool],
    forces: Forces<'_>,
    sums: &mut [[f32; LANES]],
) {
    let Forces { samples, first, active, gains } = forces;
    let points = samples.len().max(1);
    let mut gains = gains.chunks(U * points);
    for (lanes, awake) in lanes.chunks_mut(U).zip(awake.chunks(U)) {
        let gains = gains.next().unwrap_or_default();
        if active.is_empty() && !awake.contains(&true) {
            continue;
        }
        match <&mut [Lanes; U]>::try_from(&mut *lanes) {
            Ok(lanes) => tile(simd, lanes, samples, first, active, gains, sums),
            Err(_) => {
                for (lane, gains) in lanes.chunks_exact_mut(1).zip(gains.chunks(points)) {
                    if let Ok(lane) = <&mut [Lanes; 1]>::try_from(lane) {
                        tile(simd, lane, samples, first, active, gains, sums);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn tile<S: Simd, const U: usize>(
    simd: S,
    lanes: &mut [Lanes; U],
    samples: &[[f32; GRID]],
    first: usize,
    active: &[usize],
    gains: &[InputGain],
    sums: &mut [[f32; LANES]],
) {
    match *active {
        [] => recur(
            simd,
            lanes,
            sums,
            #[inline(always)]
            |_, _, _, _| {},
        ),
        [point] => {
            let (Some(force), true) = (samples.get(point), gains.len() == U * samples.len()) else { return };
            let gain: [_; U] = std::array::from_fn(|u| {
                let InputGain { re, im } = &gains[u * samples.len() + point];
                (load(simd, re), load(simd, im))
            });
            recur(
                simd,
                lanes,
                sums,
                #[inline(always)]
                |t, u, re, im| {
                    let force = f32x16::splat(simd, force[(first + t) % GRID]);
                    *re = gain[u].0.mul_add(force, *re);
                    *im = gain[u].1.mul_add(force, *im);
                },
            );
        }
        _ => recur(
            simd,
            lanes,
            sums,
            #[inline(always)]
            |t, u, re, im| {
                for &point in active {
                    let (Some(force), Some(gain)) =
                        (samples.get(point), gains.get(u * samples.len() + point))
                    else {
                        return;
                    };
                    let force = f32x16::splat(simd, force[(first + t) % GRID]);
                    *re = load(simd, &gain.re).mul_add(force, *re);
                    *im = load(simd, &gain.im).mul_add(force, *im);
                }
            },
        ),
    }
}

#[inline(always)]
fn load<S: Simd>(simd: S, x: &[f32; LANES]) -> f32x16<S> {
    f32x16::simd_from(simd, *x)
}

/// The recursion: `z <- z + z (w - 1)`, then the force, for `U` vectors over all samples.
#[inline(always)]
fn recur<S: Simd, const U: usize>(
    simd: S,
    lanes: &mut [Lanes; U],
    sums: &mut [[f32; LANES]],
    add_force: impl Fn(usize, usize, &mut f32x16<S>, &mut f32x16<S>),
) {
    let less_one: [_; U] = std::array::from_fn(|u| load(simd, &lanes[u].less_one));
    let sin: [_; U] = std::array::from_fn(|u| load(simd, &lanes[u].sin));
    let mut re: [_; U] = std::array::from_fn(|u| load(simd, &lanes[u].re));
    let mut im: [_; U] = std::array::from_fn(|u| load(simd, &lanes[u].im));
    for (t, sums) in sums.iter_mut().enumerate() {
        let mut sum = load(simd, sums);
        for u in 0..U {
            let (x, y) = (re[u], im[u]);
            re[u] = (-sin[u]).mul_add(y, less_one[u].mul_add(x, x));
            im[u] = sin[u].mul_add(x, less_one[u].mul_add(y, y));
            add_force(t, u, &mut re[u], &mut im[u]);
            sum += im[u];
        }
        sum.store_slice(sums);
    }
    for u in 0..U {
        re[u].store_slice(&mut lanes[u].re);
        im[u].store_slice(&mut lanes[u].im);
    }
}

/// The part of a grid interval that is computed by two poles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    /// True if it begins at the grid point, from the states of the modes.
    pub begins: bool,
    /// True if it ends at the next one: the states of the modes are those there.
    pub ends: bool,
}

/// Advances all modes by `sums.len()` samples without a force, and adds them to the sums: those that fit by two poles, others by their states.
pub(crate) fn advance_freely(
    level: Level,
    lanes: &mut [Lanes],
    two_poles: &mut [TwoPole],
    awake: &[bool],
    part: Part,
    sums: &mut [[f32; LANES]],
) {
    dispatch!(level, simd => freely(simd, lanes, two_poles, awake, part, sums));
}

#[inline(always)]
fn freely<S: Simd>(
    simd: S,
    lanes: &mut [Lanes],
    two_poles: &mut [TwoPole],
    awake: &[bool],
    part: Part,
    sums: &mut [[f32; LANES]],
) {
    match S::f32s::LEN {
        16.. => free_tiles::<S, 4>(simd, lanes, two_poles, awake, part, sums),
        8.. => free_tiles::<S, 2>(simd, lanes, two_poles, awake, part, sums),
        _ => free_tiles::<S, 1>(simd, lanes, two_poles, awake, part, sums),
    }
}

#[inline(always)]
fn free_tiles<S: Simd, const U: usize>(
    simd: S,
    lanes: &mut [Lanes],
    two_poles: &mut [TwoPole],
    awake: &[bool],
    part: Part,
    sums: &mut [[f32; LANES]],
) {
    let all = lanes.chunks_mut(U).zip(two_poles.chunks_mut(U)).zip(awake.chunks(U));
    for ((lanes, two_poles), _) in all.filter(|(_, awake)| awake.contains(&true)) {
        let fit = two_poles.iter().filter(|x| x.fits).count();
        match (<&mut [Lanes; U]>::try_from(&mut *lanes), <&mut [TwoPole; U]>::try_from(&mut *two_poles)) {
            (Ok(lanes), Ok(two_poles)) if fit == U => recur_freely(simd, lanes, two_poles, part, sums),
            (Ok(lanes), _) if fit == 0 => tile(simd, lanes, &[], 0, &[], &[], sums),
            _ => {
                for (lanes, two_pole) in lanes.iter_mut().zip(two_poles) {
                    let lanes = std::array::from_mut(lanes);
                    if two_pole.fits {
                        recur_freely(simd, lanes, std::array::from_mut(two_pole), part, sums);
                    } else {
                        tile(simd, lanes, &[], 0, &[], &[], sums);
                    }
                }
            }
        }
    }
}

/// The recursion of two poles, for `U` vectors over all samples.
#[inline(always)]
fn recur_freely<S: Simd, const U: usize>(
    simd: S,
    lanes: &mut [Lanes; U],
    two_poles: &mut [TwoPole; U],
    part: Part,
    sums: &mut [[f32; LANES]],
) {
    let double: [_; U] = std::array::from_fn(|u| load(simd, &two_poles[u].double));
    let minus_power: [_; U] = std::array::from_fn(|u| load(simd, &two_poles[u].minus_power));
    let (mut next, mut last): ([_; U], [_; U]);
    if part.begins {
        last = std::array::from_fn(|u| load(simd, &lanes[u].im));
        next = std::array::from_fn(|u| {
            let less = load(simd, &lanes[u].less_one).mul_add(last[u], last[u]);
            load(simd, &lanes[u].sin).mul_add(load(simd, &lanes[u].re), less)
        });
    } else {
        next = std::array::from_fn(|u| load(simd, &two_poles[u].next));
        last = std::array::from_fn(|u| load(simd, &two_poles[u].last));
    }
    for sums in sums {
        let mut sum = load(simd, sums);
        for u in 0..U {
            let y = next[u];
            next[u] = double[u].mul_add(y, minus_power[u] * last[u]);
            last[u] = y;
            sum += y;
        }
        sum.store_slice(sums);
    }
    for u in 0..U {
        if part.ends {
            let (x, y) = (load(simd, &lanes[u].re), load(simd, &lanes[u].im));
            let (re, im) = (load(simd, &two_poles[u].hop_re), load(simd, &two_poles[u].hop_im));
            (-im).mul_add(y, re * x).store_slice(&mut lanes[u].re);
            im.mul_add(x, re * y).store_slice(&mut lanes[u].im);
        } else {
            next[u].store_slice(&mut two_poles[u].next);
            last[u].store_slice(&mut two_poles[u].last);
        }
    }
}

/// Sums the lanes of each sample, always in the same order.
pub(crate) fn sum_lanes(level: Level, sums: &[[f32; LANES]], out: &mut [f32]) {
    dispatch!(level, simd => {
        let (fours, rest) = sums.as_chunks::<4>();
        let (now, later) = out.split_at_mut((4 * fours.len()).min(out.len()));
        for (sums, out) in fours.iter().zip(now.chunks_exact_mut(4)) {
            four(simd, sums).store_slice(out);
        }
        for (sums, out) in rest.iter().zip(later) {
            *out = load(simd, sums).reduce_sum();
        }
    });
}

/// Sums of the lanes of four samples, by a transposition.
#[inline(always)]
fn four<S: Simd>(simd: S, [a, b, c, d]: &[[f32; LANES]; 4]) -> f32x4<S> {
    let (ab, cd) = (pair(quarter(simd, a), quarter(simd, b)), pair(quarter(simd, c), quarter(simd, d)));
    pair(ab, cd)
}

/// Sixteen lanes folded twice, as `reduce_sum` does.
#[inline(always)]
fn quarter<S: Simd>(simd: S, lanes: &[f32; LANES]) -> f32x4<S> {
    let (quarters, _) = lanes.as_chunks::<4>();
    let at = |k: usize| f32x4::simd_from(simd, quarters[k]);
    (at(0) + at(2)) + (at(1) + at(3))
}

/// Sums of adjacent lanes.
#[inline(always)]
fn pair<S: Simd>(a: f32x4<S>, b: f32x4<S>) -> f32x4<S> {
    a.unzip_low(b) + a.unzip_high(b)
}
