//! The inner loop of the exact programme: one target against all units.
//!
//! Plain loops over short tiles, which the compiler turns into vectors of whatever width the machine has. No fused multiplication
//! is used, every operation is rounded as IEEE 754 requires and a minimum is the same in any order, so that the bits do
//! not depend on the machine.

use fearless_simd::{Level, dispatch};

/// Units that are treated together: their sums stay in the nearest cache.
const TILE: usize = 256;
/// Minima that are computed in parallel.
const LANES: usize = 16;
/// Units whose predecessors are stored in one word of bits.
pub(super) const WORD: usize = 64;

/// One target, and the cost of a jump to any unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target<'a> {
    /// Features of the units, `[dims, count]`.
    pub columns: &'a [f32],
    /// Units.
    pub count: usize,
    /// Features of the target, `[dims]`.
    pub features: &'a [f32],
    /// Least cost before it.
    pub least: f32,
    /// Cost of a jump.
    pub switch: f32,
    /// Maximum cost of a distance.
    pub cap: f32,
}

/// Computes the costs of all units, over the least cost of the target before; returns the least of them.
///
/// # Shapes
/// `before[k]`: cost, before this target, of the unit that unit `k` follows.
pub(super) fn step(level: Level, target: Target<'_>, before: &[f32], out: &mut [f32]) -> f32 {
    dispatch!(level, simd => {
        let _ = simd;
        tiles(target, before, out)
    })
}

#[inline(always)]
fn tiles(target: Target<'_>, before: &[f32], out: &mut [f32]) -> f32 {
    let mut lowest = [f32::INFINITY; LANES];
    let mut at = 0;
    for (out, before) in out.chunks_mut(TILE).zip(before.chunks(TILE)) {
        out.fill(0.0);
        for (column, &feature) in target.columns.chunks_exact(target.count).zip(target.features) {
            let column = column.get(at..at + out.len()).unwrap_or_default();
            for (sum, &x) in out.iter_mut().zip(column) {
                *sum += (x - feature) * (x - feature);
            }
        }
        for (out, &before) in out.iter_mut().zip(before) {
            *out = minimum(out.sqrt(), target.cap) + minimum(before - target.least, target.switch);
        }
        gather(out, &mut lowest);
        at += out.len();
    }
    lowest.into_iter().fold(f32::INFINITY, minimum)
}

/// The lesser of two numbers that are not NaN; unlike `f32::min` one instruction.
#[inline(always)]
fn minimum(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn gather(values: &[f32], lowest: &mut [f32; LANES]) {
    let mut chunks = values.chunks_exact(LANES);
    for chunk in &mut chunks {
        for (lowest, &x) in lowest.iter_mut().zip(chunk) {
            *lowest = minimum(x, *lowest);
        }
    }
    for (lowest, &x) in lowest.iter_mut().zip(chunks.remainder()) {
        *lowest = minimum(x, *lowest);
    }
}

/// The least of a row.
pub(super) fn row_minimum(level: Level, values: &[f32]) -> f32 {
    dispatch!(level, simd => {
        let _ = simd;
        let mut lowest = [f32::INFINITY; LANES];
        gather(values, &mut lowest);
        lowest.into_iter().fold(f32::INFINITY, minimum)
    })
}

/// The first place of a value in a row; 0 where it is not.
pub(super) fn first(level: Level, values: &[f32], value: f32) -> usize {
    dispatch!(level, simd => {
        let _ = simd;
        first_position(values, value)
    })
}

#[inline(always)]
fn first_position(values: &[f32], value: f32) -> usize {
    for (tile, values) in values.chunks(TILE).enumerate() {
        // Counting has no branch in it; the few values of one tile are then looked at one by one.
        if values.iter().map(|&x| u32::from(x == value)).sum::<u32>() > 0 {
            return tile * TILE + values.iter().position(|&x| x == value).unwrap_or(0);
        }
    }
    0
}

/// Number of costs that exceed the least by the price of a jump at most.
pub(super) fn count_within(level: Level, costs: &[f32], least: f32, switch: f32) -> usize {
    dispatch!(level, simd => {
        let _ = simd;
        let within = |costs: &[f32]| costs.iter().map(|&x| u32::from(x - least <= switch)).sum::<u32>();
        costs.chunks(TILE).map(within).sum::<u32>() as usize
    })
}

/// Marks the units that are reached at most as expensively from the unit that they follow as by a jump.
pub(super) fn runs(level: Level, before: &[f32], lowest: f32, switch: f32, bits: &mut [u64]) {
    dispatch!(level, simd => {
        let _ = simd;
        words(before, lowest, switch, bits);
    });
}

#[inline(always)]
fn words(before: &[f32], lowest: f32, switch: f32, bits: &mut [u64]) {
    for (word, before) in bits.iter_mut().zip(before.chunks(WORD)) {
        *word = 0;
        for (k, &x) in before.iter().enumerate() {
            *word |= u64::from(x - lowest <= switch) << k;
        }
    }
}
