//! Parallel loops over the rows of a grid, and the padding of a row.

use crate::texture::grid::{Grid, Wrap};
use rayon::prelude::*;

/// Rows of one task: enough to outweigh its overhead, few enough to stay in the cache.
const STRIP: usize = 32;

/// Computes a grid row by row, in parallel; `state` makes the scratch space of one task.
pub(super) fn map_rows<T>(
    width: usize,
    height: usize,
    state: impl Fn() -> T + Sync,
    row: impl Fn(&mut T, usize, &mut [f32]) + Sync,
) -> Grid {
    let mut samples = vec![0.0; width * height];
    if width > 0 {
        samples.par_chunks_mut(width * STRIP).enumerate().for_each(|(strip, rows)| {
            let mut state = state();
            for (k, out) in rows.chunks_exact_mut(width).enumerate() {
                row(&mut state, strip * STRIP + k, out);
            }
        });
    }
    Grid { width, height, samples }
}

/// Computes two grids row by row, as [`map_rows`].
pub(super) fn map_row_pairs<T>(
    width: usize,
    height: usize,
    state: impl Fn() -> T + Sync,
    row: impl Fn(&mut T, usize, &mut [f32], &mut [f32]) + Sync,
) -> [Grid; 2] {
    let (mut first, mut second) = (vec![0.0; width * height], vec![0.0; width * height]);
    if width > 0 {
        let strips = first.par_chunks_mut(width * STRIP).zip(second.par_chunks_mut(width * STRIP));
        strips.enumerate().for_each(|(strip, (a, b))| {
            let mut state = state();
            for (k, (a, b)) in a.chunks_exact_mut(width).zip(b.chunks_exact_mut(width)).enumerate() {
                row(&mut state, strip * STRIP + k, a, b);
            }
        });
    }
    [first, second].map(|samples| Grid { width, height, samples })
}

/// Fills the `radius` samples before and after a row of `width` pixels by its continuation.
pub(super) fn pad(line: &mut [f32], radius: usize, width: usize, wrap: Wrap) {
    for t in 0..radius {
        let before = line[radius + wrap.index(t as i64 - radius as i64, width)];
        line[t] = before;
        let after = line[radius + wrap.index((width + t) as i64, width)];
        line[radius + width + t] = after;
    }
}
