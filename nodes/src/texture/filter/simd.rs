//! Vectors of sixteen pixels: loads and stores at the end of a row, and powers of two.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use std::f32::consts::LN_2;

/// Pixels of a vector.
pub(super) const LANES: usize = 16;
/// Pixels of four vectors.
pub(super) const BLOCK: usize = 4 * LANES;

/// Loads sixteen pixels of a row; zeros beyond its end.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, row: &[f32], at: usize) -> f32x16<S> {
    match row.get(at..at + LANES) {
        Some(full) => f32x16::from_slice(simd, full),
        None => {
            let mut part = [0.0; LANES];
            part.iter_mut().zip(row.get(at..).unwrap_or_default()).for_each(|(p, x)| *p = *x);
            f32x16::from_slice(simd, &part)
        }
    }
}

/// Stores sixteen pixels of a row, or those before its end.
#[inline(always)]
pub(super) fn store<S: Simd>(pixels: f32x16<S>, row: &mut [f32], at: usize) {
    match row.get_mut(at..at + LANES) {
        Some(full) => pixels.store_slice(full),
        None => {
            let mut part = [0.0; LANES];
            pixels.store_slice(&mut part);
            row.get_mut(at..).unwrap_or_default().iter_mut().zip(part).for_each(|(p, x)| *p = x);
        }
    }
}

/// Loads [`BLOCK`] pixels of a row; zeros beyond its end.
#[inline(always)]
pub(super) fn load_block<S: Simd>(simd: S, row: &[f32], at: usize) -> [f32x16<S>; 4] {
    match row.get(at..at + BLOCK) {
        Some(block) => std::array::from_fn(|k| f32x16::from_slice(simd, &block[k * LANES..(k + 1) * LANES])),
        None => std::array::from_fn(|k| load(simd, row, (at + k * LANES).min(row.len()))),
    }
}

#[inline(always)]
pub(super) fn store_block<S: Simd>(pixels: [f32x16<S>; 4], row: &mut [f32], at: usize) {
    match row.get_mut(at..at + BLOCK) {
        Some(block) => {
            for (pixels, out) in pixels.iter().zip(block.chunks_exact_mut(LANES)) {
                pixels.store_slice(out);
            }
        }
        None => {
            for (k, pixels) in pixels.into_iter().enumerate() {
                store(pixels, row, (at + k * LANES).min(row.len()));
            }
        }
    }
}

/// `2^x` of sixteen numbers up to 0, to 2 parts in 10^7; those below -126 become `2^-126`.
#[inline(always)]
pub(super) fn exp2<S: Simd>(simd: S, x: f32x16<S>) -> f32x16<S> {
    // Adding 1.5 * 2^23 rounds to an integer, which is then in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let x = x.max(f32x16::splat(simd, -126.0));
    let rounded = x + ROUND;
    let part = x - (rounded - ROUND);
    // Minimax fit of the relative error over -0.5 to 0.5, exact at 0.
    let mut y = f32x16::splat(simd, EXP2[5]);
    for k in (0..5).rev() {
        y = y.mul_add(part, f32x16::splat(simd, EXP2[k]));
    }
    // The integer is added to the exponent.
    (y.bitcast::<fearless_simd::i32x16<S>>() + (rounded.bitcast::<fearless_simd::i32x16<S>>() << 23))
        .bitcast()
}

/// Coefficients of [`exp2`].
const EXP2: [f32; 6] = [1.0, LN_2, 0.240_222_42, 0.055_507_34, 0.009_671_513, 0.001_326_472_7];

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn powers_of_two_are_within_4_parts_in_10_million() {
        let x: Vec<f32> = (0..16 * 900).map(|k| -(k as f32) * 0.01).collect();
        let mut out = vec![0.0; x.len()];
        dispatch!(Level::new(), simd => {
            for at in (0..x.len()).step_by(LANES) {
                store(exp2(simd, load(simd, &x, at)), &mut out, at);
            }
        });
        for (x, y) in x.iter().zip(out) {
            let right = f64::from(x.max(-126.0)).exp2();
            assert!((f64::from(y) / right - 1.0).abs() < 4e-7, "2^{x} = {y}");
        }
        dispatch!(Level::new(), simd => assert_eq!(exp2(simd, f32x16::splat(simd, 0.0))[0], 1.0));
    }
}
