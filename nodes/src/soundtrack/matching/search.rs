//! Search of a motion for all intervals that are similar to one.

use super::matches::MotionMatch;
use super::pattern::{COARSE, Grid, QueryError, QueryRules, Scratch};
use super::query::{BLOCK, Query};
use crate::core::computation::Monitor;
use crate::soundtrack::motion::MotionCurve;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

/// Windows that one task compares.
const TASK: usize = 4096;

/// Calls `each` for all windows whose squared distance may not exceed `most`, in parallel, and collects what it finds, in order.
fn windows<T: Send>(
    query: &Query<'_>,
    grids: &[Grid],
    monitor: &Monitor<'_>,
    most: impl Fn() -> f64 + Sync,
    each: impl Fn(usize, usize, &mut Scratch) -> Option<T> + Sync,
) -> Result<Vec<T>, QueryError> {
    let mut tasks = Vec::new();
    for (g, grid) in grids.iter().enumerate() {
        let starts = query.windows.starts(grid);
        tasks.extend((0..starts).step_by(TASK).map(|from| (g, from, (from + TASK).min(starts))));
    }
    let (done, is_stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
    let of_task = |(g, from, to): &(usize, usize, usize)| {
        let (mut found, mut scratch) = (Vec::new(), Scratch::default());
        if !is_stopped.load(Ordering::Relaxed) {
            for block in (*from..*to).step_by(BLOCK) {
                let count = BLOCK.min(to - block);
                if query.block_bound(&grids[*g], block, count, &mut scratch, most()) <= most() {
                    found.extend((block..block + count).filter_map(|start| each(*g, start, &mut scratch)));
                }
            }
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            if monitor(count as f64 / tasks.len() as f64) {
                is_stopped.store(true, Ordering::Relaxed);
            }
        }
        found
    };
    let found: Vec<T> = tasks.par_iter().flat_map_iter(of_task).collect();
    if is_stopped.into_inner() { Err(QueryError::Stopped) } else { Ok(found) }
}

/// A window in the order of its distance, or of a bound of it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Ranked {
    /// Bits of the squared distance or of a lower bound of it, which are in the order of the numbers.
    bound: u64,
    /// Kind of the bound: over some frames, over all frames, or the distance itself.
    step: Step,
    start: u32,
    len: u32,
    grid: u32,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Step {
    Coarse,
    Full,
    Exact,
}

/// The parts of a motion that are similar to a part of a motion, as [`most_similar`](super::overlap::most_similar) chooses among
/// [`find_matches`], in order of time.
///
/// Windows are examined in the order of lower bounds of their distances, which are refined when needed: what overlaps a better match is never
/// compared.
///
/// # Errors
/// As [`find_matches`].
///
/// # Complexity
/// Frames times lengths, with a constant of a few comparisons.
pub fn best_matches(
    curve: &MotionCurve,
    source: &MotionCurve,
    interval: (f64, f64),
    rules: QueryRules,
    monitor: &Monitor<'_>,
) -> Result<Vec<MotionMatch>, QueryError> {
    let query = Query::new(curve, source, interval, rules)?;
    let grids = query.grids();
    let most = query.pattern.most;
    if rules.count == Some(1) {
        return Ok(best_match(&query, &grids, monitor)?.into_iter().collect());
    }
    let count = rules.count.unwrap_or(usize::MAX);
    let coarse = |g: usize, start: usize, scratch: &mut Scratch| {
        let grid = &grids[g];
        if !query.windows.normalise(grid, start, scratch) {
            return None;
        }
        let bound =
            query.pattern.bound(grid, query.windows.window(grid, start), &scratch.normal, COARSE, most);
        (bound <= most).then(|| {
            let (start, len, grid) = (start as u32, grid.len as u32, g as u32);
            Reverse(Ranked { bound: bound.to_bits(), step: Step::Coarse, start, len, grid })
        })
    };
    let mut heap = BinaryHeap::from(windows(&query, &grids, monitor, || most, coarse)?);
    let mut chosen: BTreeMap<u32, (u32, MotionMatch)> = BTreeMap::new();
    let mut scratch = Scratch::default();
    while let Some(Reverse(ranked)) = heap.pop().filter(|_| chosen.len() < count) {
        let (start, end) = (ranked.start, ranked.start + ranked.len);
        let overlaps = chosen.range(..end).next_back().is_some_and(|(_, (other, _))| *other > start);
        if overlaps {
            continue;
        }
        let grid = &grids[ranked.grid as usize];
        let at = start as usize;
        let next = match ranked.step {
            Step::Exact => {
                chosen.insert(start, (end, query.found(grid, at, f64::from_bits(ranked.bound))));
                continue;
            }
            Step::Coarse => {
                query.windows.normalise(grid, at, &mut scratch);
                query
                    .pattern
                    .full_bound(grid, query.windows.window(grid, at), &mut scratch, most)
                    .map(|bound| (bound, Step::Full))
            }
            Step::Full => {
                query.windows.normalise(grid, at, &mut scratch);
                query.pattern.write(grid, query.windows.window(grid, at), &mut scratch);
                query.distance(&mut scratch, most).map(|squared| (squared, Step::Exact))
            }
        };
        if let Some((bound, step)) = next {
            // The bound of all frames can be smaller by rounding.
            let bound = bound.to_bits().max(if step == Step::Exact { 0 } else { ranked.bound });
            heap.push(Reverse(Ranked { bound, step, ..ranked }));
        }
    }
    Ok(chosen.into_values().map(|(_, found)| found).collect())
}

/// Windows that are compared first to find a good one, and windows that are examined for each of them.
const FIRST: (usize, usize) = (64, 256);

/// The most similar window; of equal windows the earlier, then the shorter one.
///
/// A window that is good bounds the search from the beginning, and each better one bounds it more.
fn best_match(
    query: &Query<'_>,
    grids: &[Grid],
    monitor: &Monitor<'_>,
) -> Result<Option<MotionMatch>, QueryError> {
    // Bits of the least squared distance so far, which are in the order of the numbers.
    let least = AtomicU64::new(query.pattern.most.to_bits());
    let most = || f64::from_bits(least.load(Ordering::Relaxed));
    let compare = |g: usize, start: usize, scratch: &mut Scratch| {
        let (grid, window) = (&grids[g], query.windows.window(&grids[g], start));
        query.pattern.full_bound(grid, window, scratch, most())?;
        let squared = query.distance(scratch, most())?;
        least.fetch_min(squared.to_bits(), Ordering::Relaxed);
        Some((squared.to_bits(), start, grids[g].len, g))
    };
    let mut scratch = Scratch::default();
    let all: usize = grids.iter().map(|grid| query.windows.starts(grid)).sum();
    let stride = all.div_ceil(FIRST.0 * FIRST.1).max(1);
    let mut first = Vec::new();
    for (g, grid) in grids.iter().enumerate() {
        for start in (0..query.windows.starts(grid)).step_by(stride) {
            if query.windows.normalise(grid, start, &mut scratch) {
                let bound = query.pattern.bound(
                    grid,
                    query.windows.window(grid, start),
                    &scratch.normal,
                    COARSE,
                    query.pattern.most,
                );
                first.push((bound.to_bits(), g, start));
            }
        }
    }
    first.sort_unstable();
    for (_, g, start) in first.into_iter().take(FIRST.0) {
        query.windows.normalise(&grids[g], start, &mut scratch);
        compare(g, start, &mut scratch);
    }
    let found = windows(query, grids, monitor, most, |g, start, scratch| {
        if query.windows.normalise(&grids[g], start, scratch) { compare(g, start, scratch) } else { None }
    })?;
    let best = found.into_iter().min();
    Ok(best.map(|(squared, start, _, g)| query.found(&grids[g], start, f64::from_bits(squared))))
}

/// All windows of a motion whose similarity to a part of a motion reaches the threshold.
///
/// Windows of all lengths between the shortest and the longest are stretched to the length of the query. The similarity is `exp(-D / (sd
/// sqrt(n)))`, with the distance `D` of dynamic time warping, the number `n` of frames and the standard deviation `sd` of the query.
///
/// # Errors
/// Curves and queries that cannot be compared, and queries that are flat.
///
/// # Complexity
/// Frames times lengths; a window costs a few comparisons, unless it is nearly similar. Lower bounds leave nothing out; with a `tolerance` windows
/// may be left out by their piecewise means too.
///
/// # Source
/// Cardle et al., "Sound-by-Numbers" (SCA 2003), section 5.2. Keogh and Ratanamahatana, "Exact indexing of dynamic time warping" (KAIS 7, 2005),
/// for the bounds.
pub fn find_matches(
    curve: &MotionCurve,
    source: &MotionCurve,
    interval: (f64, f64),
    rules: QueryRules,
    monitor: &Monitor<'_>,
) -> Result<Vec<MotionMatch>, QueryError> {
    let query = Query::new(curve, source, interval, rules)?;
    let grids = query.grids();
    windows(
        &query,
        &grids,
        monitor,
        || query.pattern.most,
        |g, start, scratch| {
            let grid = &grids[g];
            if !query.windows.normalise(grid, start, scratch) {
                return None;
            }
            query.pattern.full_bound(grid, query.windows.window(grid, start), scratch, query.pattern.most)?;
            let squared = query.distance(scratch, query.pattern.most)?;
            Some(query.found(grid, start, squared))
        },
    )
}

#[cfg(test)]
mod tests;
