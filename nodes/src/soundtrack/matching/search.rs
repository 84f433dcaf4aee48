//! Search of a motion for all intervals that are similar to one.

use super::matches::MotionMatch;
use super::query::{Grid, Query, QueryError, QueryRules, Scratch};
use crate::core::computation::Monitor;
use crate::soundtrack::motion::MotionCurve;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Windows that one task compares.
const TASK: usize = 4096;

/// Calls `each` for all windows, in parallel, and collects what it finds, in order.
fn windows<T: Send>(
    curve: &MotionCurve,
    grids: &[Grid],
    monitor: &Monitor<'_>,
    each: impl Fn(usize, usize, &mut Scratch) -> Option<T> + Sync,
) -> Result<Vec<T>, QueryError> {
    let mut tasks = Vec::new();
    for (g, grid) in grids.iter().enumerate() {
        let starts = curve.frames() + 1 - grid.len;
        tasks.extend((0..starts).step_by(TASK).map(|from| (g, from, (from + TASK).min(starts))));
    }
    let (done, is_stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
    let of_task = |(g, from, to): &(usize, usize, usize)| {
        let (mut found, mut scratch) = (Vec::new(), Scratch::default());
        if !is_stopped.load(Ordering::Relaxed) {
            found.extend((*from..*to).filter_map(|start| each(*g, start, &mut scratch)));
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

/// A window in the order of its distance, or of what is known of it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Ranked {
    /// Bits of the squared distance or of a lower bound of it, which are in the order of the numbers.
    bound: u64,
    /// What the bound is: of some frames, of all frames, or the distance.
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

/// Frames that the first bound is taken of.
const COARSE: usize = 16;

/// The parts of a motion that are similar to a part of a motion, as [`most_similar`](super::overlap::most_similar) chooses among
/// [`find_matches`], in order of time.
///
/// Windows are looked at in the order of lower bounds of their distances, which are refined as far as needed: what overlaps a better match is never
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
    let grids: Vec<Grid> = query.lengths().into_iter().map(|len| Grid::new(len, query.frames)).collect();
    let most = query.limit * query.limit;
    let coarse = |g: usize, start: usize, scratch: &mut Scratch| {
        let grid = &grids[g];
        if !query.normalise(grid, start, scratch) {
            return None;
        }
        let bound = query.bound(grid, start, &scratch.normal, COARSE);
        (bound <= most).then(|| {
            let (start, len, grid) = (start as u32, grid.len as u32, g as u32);
            Reverse(Ranked { bound: bound.to_bits(), step: Step::Coarse, start, len, grid })
        })
    };
    let mut heap = BinaryHeap::from(windows(curve, &grids, monitor, coarse)?);
    let mut chosen: BTreeMap<u32, (u32, MotionMatch)> = BTreeMap::new();
    let mut scratch = Scratch::default();
    while let Some(Reverse(ranked)) = heap.pop() {
        let (start, end) = (ranked.start, ranked.start + ranked.len);
        let overlaps = chosen.range(..end).next_back().is_some_and(|(_, (other, _))| *other > start);
        if overlaps {
            continue;
        }
        let grid = &grids[ranked.grid as usize];
        let at = start as usize;
        let next = match ranked.step {
            Step::Exact => {
                chosen.insert(start, (end, query.found(grid, at, f64::from_bits(ranked.bound).sqrt())));
                continue;
            }
            Step::Coarse => {
                query.normalise(grid, at, &mut scratch);
                query.full_bound(grid, at, &mut scratch).map(|bound| (bound, Step::Full))
            }
            Step::Full => {
                query.normalise(grid, at, &mut scratch);
                query.distance(grid, at, &mut scratch).map(|d| (d * d, Step::Exact))
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

/// All windows of a motion whose similarity to a part of a motion reaches the threshold.
///
/// Windows of all lengths between the shortest and the longest are stretched to the length of the query. The similarity is `exp(-D / (sd
/// sqrt(n)))`, with the distance `D` of dynamic time warping, the number `n` of frames and the standard deviation `sd` of the query.
///
/// # Errors
/// Curves and queries that cannot be compared, and queries that are flat.
///
/// # Complexity
/// Frames times lengths; a window costs a few comparisons, unless it is nearly similar. Lower bounds leave nothing out.
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
    let grids: Vec<Grid> = query.lengths().into_iter().map(|len| Grid::new(len, query.frames)).collect();
    windows(curve, &grids, monitor, |g, start, scratch| {
        let grid = &grids[g];
        if !query.normalise(grid, start, scratch) {
            return None;
        }
        query.full_bound(grid, start, scratch)?;
        let distance = query.distance(grid, start, scratch)?;
        Some(query.found(grid, start, distance))
    })
}

#[cfg(test)]
mod tests;
