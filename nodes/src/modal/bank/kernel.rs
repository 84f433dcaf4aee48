//! The inner loop of the modal bank: sixteen modes to a vector, and a stretch of samples before the next vectors.
//!
//! A mode is a complex number that one multiplication turns and shrinks in each sample. State and coefficients stay in
//! registers for a whole stretch, and four vectors of modes are under way at once, for the result of a multiplication is late.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x4, f32x16};
use serde::{Deserialize, Serialize};

/// Modes in one vector.
pub(crate) const LANES: usize = 16;
/// Samples from one change of coefficients to the next, and the longest stretch.
pub(crate) const GRID: usize = 64;

/// Sixteen modes: what turns them, and where they are.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[repr(align(64))]
pub(crate) struct Lanes {
    /// Real part of one step, less 1.
    pub less_one: [f32; LANES],
    /// Imaginary part of one step.
    pub sin: [f32; LANES],
    /// State.
    pub re: [f32; LANES],
    /// State; the sum of these is what is heard.
    pub im: [f32; LANES],
}

impl Lanes {
    /// Modes that do nothing.
    pub const SILENT: Self =
        Self { less_one: [0.0; LANES], sin: [0.0; LANES], re: [0.0; LANES], im: [0.0; LANES] };

    /// Whether the squares of the sizes of all states lie between two numbers.
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

/// What a force does to sixteen modes.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Push {
    /// Change of the real part for a force of 1.
    pub re: [f32; LANES],
    /// Change of the imaginary part.
    pub im: [f32; LANES],
}

/// The forces of one stretch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forces<'a> {
    /// `[points]`, of which the first `samples` of each hold.
    pub samples: &'a [[f32; GRID]],
    /// Points whose force is not zero throughout.
    pub active: &'a [usize],
    /// `[vectors, points]`.
    pub pushes: &'a [Push],
}

/// Moves all modes on by `sums.len()` samples, under forces, and adds them to the sums.
///
/// Vectors that are not `awake` hold zeros and are passed over where there is no force, which changes no bit of the sums.
/// The sums are taken in the order of the vectors, whatever the machine.
pub(crate) fn advance(
    level: Level,
    lanes: &mut [Lanes],
    awake: &[bool],
    forces: Forces<'_>,
    sums: &mut [[f32; LANES]],
) {
    dispatch!(level, simd => on(simd, lanes, awake, forces, sums));
}

#[inline(always)]
fn on<S: Simd>(simd: S, lanes: &mut [Lanes], awake: &[bool], forces: Forces<'_>, sums: &mut [[f32; LANES]]) {
    // As many vectors at once as fit into the registers together.
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
    let Forces { samples, active, pushes } = forces;
    let points = samples.len().max(1);
    let mut pushes = pushes.chunks(U * points);
    for (lanes, awake) in lanes.chunks_mut(U).zip(awake.chunks(U)) {
        let pushes = pushes.next().unwrap_or_default();
        if active.is_empty() && !awake.contains(&true) {
            continue;
        }
        match <&mut [Lanes; U]>::try_from(&mut *lanes) {
            Ok(lanes) => tile(simd, lanes, samples, active, pushes, sums),
            Err(_) => {
                for (lane, pushes) in lanes.chunks_exact_mut(1).zip(pushes.chunks(points)) {
                    if let Ok(lane) = <&mut [Lanes; 1]>::try_from(lane) {
                        tile(simd, lane, samples, active, pushes, sums);
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
    active: &[usize],
    pushes: &[Push],
    sums: &mut [[f32; LANES]],
) {
    match *active {
        [] => turn(
            simd,
            lanes,
            sums,
            #[inline(always)]
            |_, _, _, _| {},
        ),
        [point] => {
            let (Some(force), true) = (samples.get(point), pushes.len() == U * samples.len()) else { return };
            let push: [_; U] = std::array::from_fn(|u| {
                let Push { re, im } = &pushes[u * samples.len() + point];
                (load(simd, re), load(simd, im))
            });
            turn(
                simd,
                lanes,
                sums,
                #[inline(always)]
                |t, u, re, im| {
                    let force = f32x16::splat(simd, force[t % GRID]);
                    *re = push[u].0.mul_add(force, *re);
                    *im = push[u].1.mul_add(force, *im);
                },
            );
        }
        _ => turn(
            simd,
            lanes,
            sums,
            #[inline(always)]
            |t, u, re, im| {
                for &point in active {
                    let (Some(force), Some(push)) =
                        (samples.get(point), pushes.get(u * samples.len() + point))
                    else {
                        return;
                    };
                    let force = f32x16::splat(simd, force[t % GRID]);
                    *re = load(simd, &push.re).mul_add(force, *re);
                    *im = load(simd, &push.im).mul_add(force, *im);
                }
            },
        ),
    }
}

#[inline(always)]
fn load<S: Simd>(simd: S, x: &[f32; LANES]) -> f32x16<S> {
    f32x16::simd_from(simd, *x)
}

/// The recursion itself: `z <- z + z (w - 1)`, then the force, for `U` vectors over all samples.
#[inline(always)]
fn turn<S: Simd, const U: usize>(
    simd: S,
    lanes: &mut [Lanes; U],
    sums: &mut [[f32; LANES]],
    push: impl Fn(usize, usize, &mut f32x16<S>, &mut f32x16<S>),
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
            push(t, u, &mut re[u], &mut im[u]);
            sum += im[u];
        }
        sum.store_slice(sums);
    }
    for u in 0..U {
        re[u].store_slice(&mut lanes[u].re);
        im[u].store_slice(&mut lanes[u].im);
    }
}

/// Adds up the lanes of each sample, always in the same order.
pub(crate) fn collect(level: Level, sums: &[[f32; LANES]], out: &mut [f32]) {
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

/// The sums of the lanes of four samples: what is left of each is turned into columns and added at once.
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

/// Sums of neighbours.
#[inline(always)]
fn pair<S: Simd>(a: f32x4<S>, b: f32x4<S>) -> f32x4<S> {
    a.unzip_low(b) + a.unzip_high(b)
}
