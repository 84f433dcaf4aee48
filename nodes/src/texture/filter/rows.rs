//! Parallel loops over the rows of a grid, and the continuation of a row.

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

/// Rows that a task of a filter computes from rows above and below as well: enough to outweigh those, few enough for all threads.
pub(super) fn strip_rows(height: usize) -> usize {
    height.div_ceil(4 * rayon::current_num_threads()).next_multiple_of(8).max(64)
}

/// Copies pixels of a continued row, from column `from` on.
pub(super) fn copy_continued(row: &[f32], from: i64, wrap: Wrap, out: &mut [f32]) {
    let before = from.saturating_neg().clamp(0, out.len() as i64) as usize;
    let rest = row.get(from.max(0) as usize..).unwrap_or_default();
    let inside = rest.len().min(out.len() - before);
    out[before..before + inside].copy_from_slice(&rest[..inside]);
    for k in (0..before).chain(before + inside..out.len()) {
        out[k] = row[wrap.index(from + k as i64, row.len())];
    }
}
