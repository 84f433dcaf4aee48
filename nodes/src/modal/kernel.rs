//! The inner loop of the modal bank: sixteen modes to a vector, and a stretch of samples before the next vectors.
//!
//! A mode is a complex number that one multiplication turns and shrinks in each sample. State and coefficients stay in
//! registers for a whole stretch, and four vectors of modes are under way at once, for the result of a multiplication is late.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};

/// Modes in one vector.
pub(crate) const LANES: usize = 16;
/// Samples from one change of coefficients to the next, and the longest stretch.
pub(crate) const GRID: usize = 64;

/// Sixteen modes: what turns them, and where they are.
#[derive(Clone, Copy, Debug)]
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
        for (sums, out) in sums.iter().zip(out.iter_mut()) {
            *out = load(simd, sums).reduce_sum();
        }
    });
}
