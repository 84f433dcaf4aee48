//! Vectors of sixteen pixels: loads and stores at the end of a row, and powers of two.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use std::f32::consts::LN_2;
use std::hint::black_box;

/// Pixels of a vector.
pub(super) const LANES: usize = 16;

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

/// Powers of two, with their constants in vectors.
pub(super) struct Exp2<V> {
    least: V,
    round: V,
    coefficients: [V; 6],
}

impl<V: Copy> Exp2<V> {
    /// Hides the constants from the compiler, which would read them from memory for each vector otherwise.
    #[inline(always)]
    pub(super) fn in_registers<S: Simd>(simd: S) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        Self::new(simd, black_box(EXP2))
    }

    #[inline(always)]
    fn new<S: Simd>(simd: S, [least, round, weights @ ..]: [f32; 8]) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        let [least, round] = [V::splat(simd, least), V::splat(simd, round)];
        let mut coefficients = [least; 6];
        for (vector, weight) in coefficients.iter_mut().zip(weights) {
            *vector = V::splat(simd, weight);
        }
        Self { least, round, coefficients }
    }

    /// `2^x` of numbers up to 0, to 2 parts in 10^7; those below -126 become `2^-126`.
    #[inline(always)]
    pub(super) fn of<S: Simd>(&self, x: V) -> V
    where
        V: SimdFloat<S, Element = f32>,
    {
        let x = x.max(self.least);
        let rounded = x + self.round;
        let part = x - (rounded - self.round);
        let [rest @ .., mut y] = self.coefficients;
        for coefficient in rest.into_iter().rev() {
            y = y.mul_add(part, coefficient);
        }
        // The integer is added to the exponent.
        V::from_bits(y.to_bits() + (rounded.to_bits() << 23))
    }
}

/// `2^x` of a single vector, as [`Exp2::of`].
#[inline(always)]
pub(super) fn exp2<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, x: V) -> V {
    Exp2::new(simd, EXP2).of(x)
}

/// Least exponent, rounding constant and coefficients of [`Exp2`].
///
/// Adding 1.5 * 2^23 rounds to an integer, which is then in the lowest bits. The coefficients are a minimax fit of the relative error
/// over -0.5 to 0.5, exact at 0.
const EXP2: [f32; 8] =
    [-126.0, 12_582_912.0, 1.0, LN_2, 0.240_222_42, 0.055_507_34, 0.009_671_513, 0.001_326_472_7];

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
