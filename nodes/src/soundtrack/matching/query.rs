//! Search of a motion for all intervals that are similar to one.

use super::dtw::{distance, envelope, outside};
use super::matches::MotionMatch;
use crate::choices;
use crate::core::computation::Monitor;
use crate::soundtrack::motion::{CurveError, MotionCurve};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use thiserror::Error;

/// What is removed from a motion before it is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Normalisation {
    /// Its mean.
    Offset,
    /// Nothing.
    None,
    /// Its mean and its standard deviation.
    ZScore,
}

choices! { @param Normalisation {
    /// Its mean.
    Offset,
    /// Nothing.
    None,
    /// Its mean and its standard deviation.
    ZScore,
} }

/// Rules of a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QueryRules {
    /// Shortest interval, as a factor of the query.
    pub shortest: f64,
    /// Longest interval, as a factor of the query.
    pub longest: f64,
    /// Least similarity.
    pub threshold: f64,
    /// Deviation from a uniform change of tempo, as a share of the query.
    pub radius: f64,
    /// What is removed.
    pub normalisation: Normalisation,
    /// Try every length, and not only those with the ratio of a fourth of an octave.
    pub exhaustive: bool,
}

impl Default for QueryRules {
    fn default() -> Self {
        Self {
            shortest: 0.5,
            longest: 2.0,
            threshold: 0.7,
            radius: 0.1,
            normalisation: Normalisation::Offset,
            exhaustive: false,
        }
    }
}

/// The reason why a query is impossible.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum QueryError {
    /// A curve is wrong.
    #[error("{0}")]
    Curve(#[from] CurveError),
    /// Other channels.
    #[error("the query has {query} channels, the motion {motion}")]
    Channels {
        /// Those of the query.
        query: usize,
        /// Those of the motion.
        motion: usize,
    },
    /// Other rates.
    #[error("the query has {query} frames a second, the motion {motion}")]
    Rates {
        /// That of the query.
        query: f64,
        /// That of the motion.
        motion: f64,
    },
    /// Outside of its curve, or too short.
    #[error(
        "the query is from {from} s to {to} s, and the curve ends at {end:.3} s; at least {MIN_FRAMES} frames are needed"
    )]
    Interval {
        /// Its start.
        from: f64,
        /// Its end.
        to: f64,
        /// End of the curve.
        end: f64,
    },
    /// It does not move.
    #[error("the motion from {from} s to {to} s is flat: nothing can be said to be similar to it")]
    Flat {
        /// Its start.
        from: f64,
        /// Its end.
        to: f64,
    },
    /// It was stopped.
    #[error("stopped")]
    Stopped,
}

/// The least number of frames of a query.
const MIN_FRAMES: usize = 4;
/// Windows that one task compares.
const TASK: usize = 4096;

/// The frames of a window at the times of the frames of the query.
#[derive(Clone, Debug)]
struct Grid {
    len: usize,
    points: Vec<(usize, f32)>,
}

impl Grid {
    fn new(len: usize, frames: usize) -> Self {
        let point = |j: usize| {
            let at = j as f64 * (len - 1) as f64 / (frames - 1) as f64;
            let k = (at as usize).min(len.saturating_sub(2));
            (k, (at - k as f64) as f32)
        };
        Self { len, points: (0..frames).map(point).collect() }
    }
}

/// A query, ready for comparisons.
struct Query<'a> {
    curve: &'a MotionCurve,
    rules: QueryRules,
    frames: usize,
    values: Vec<f32>,
    envelope: Vec<[f32; 2]>,
    /// Frames in the order in which windows differ most.
    order: Vec<usize>,
    radius: usize,
    /// Standard deviation of the query.
    deviation: f64,
    /// Distance at the threshold.
    limit: f64,
    /// Sums of values and of squares before each frame, by channel.
    sums: Vec<[f64; 2]>,
    /// Frames in gaps before each frame.
    gaps: Vec<u32>,
}

/// Mean and factor that normalise a channel.
fn normaliser(rule: Normalisation, sums: [f64; 2], n: f64) -> (f32, f32) {
    let mean = sums[0] / n;
    let deviation = (sums[1] / n - mean * mean).max(0.0).sqrt();
    match rule {
        Normalisation::None => (0.0, 1.0),
        Normalisation::Offset => (mean as f32, 1.0),
        Normalisation::ZScore => (mean as f32, if deviation > 1e-9 { (1.0 / deviation) as f32 } else { 0.0 }),
    }
}

impl<'a> Query<'a> {
    fn new(
        curve: &'a MotionCurve,
        source: &MotionCurve,
        (from, to): (f64, f64),
        rules: QueryRules,
    ) -> Result<Self, QueryError> {
        curve.validate()?;
        source.validate()?;
        let channels = curve.channels;
        if source.channels != channels {
            return Err(QueryError::Channels { query: source.channels, motion: channels });
        }
        if (source.rate - curve.rate).abs() > 1e-6 {
            return Err(QueryError::Rates { query: source.rate, motion: curve.rate });
        }
        let (start, end) = ((from * source.rate).round(), (to * source.rate).round());
        let fits = start >= 0.0 && end - start >= MIN_FRAMES as f64 && end <= source.frames() as f64;
        if !fits {
            return Err(QueryError::Interval { from, to, end: source.seconds() });
        }
        let (start, end) = (start as usize, end as usize);
        let frames = end - start;
        let mut values = source.values[start * channels..end * channels].to_vec();
        let mut variance = 0.0;
        for c in 0..channels {
            let of =
                |x: &[f32]| x.iter().skip(c).step_by(channels).map(|x| f64::from(*x)).collect::<Vec<f64>>();
            let own = of(&values);
            let sums = [own.iter().sum(), own.iter().map(|x| x * x).sum()];
            let (mean, factor) = normaliser(rules.normalisation, sums, frames as f64);
            values.iter_mut().skip(c).step_by(channels).for_each(|x| *x = (*x - mean) * factor);
            let own = of(&values);
            let mean = own.iter().sum::<f64>() / frames as f64;
            variance += own.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / frames as f64;
        }
        let deviation = variance.sqrt();
        let scale =
            source.values[start * channels..end * channels].iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        if deviation <= 1e-7 * f64::from(scale).max(1e-30) {
            return Err(QueryError::Flat { from, to });
        }
        let radius = (rules.radius * frames as f64).round() as usize;
        let envelope = envelope(&values, channels, radius);
        let far = |j: usize| -> f64 {
            envelope[j * channels..(j + 1) * channels].iter().map(|e| outside(0.0, *e)).sum()
        };
        let mut order: Vec<usize> = (1..frames - 1).collect();
        order.sort_by(|a, b| far(*b).total_cmp(&far(*a)).then(a.cmp(b)));
        let mut sums = vec![[0.0; 2]; channels];
        for (k, x) in curve.values.iter().enumerate() {
            let [sum, squares] = sums[k];
            sums.push([sum + f64::from(*x), squares + f64::from(*x).powi(2)]);
        }
        let mut gaps = vec![0; curve.frames() + 1];
        for (from, to) in &curve.gaps {
            gaps.iter_mut().skip(from + 1).take(to - from).for_each(|g| *g = 1);
        }
        let mut total = 0;
        gaps.iter_mut().for_each(|g| {
            total += *g;
            *g = total;
        });
        let limit = -rules.threshold.max(1e-12).ln() * deviation * (frames as f64).sqrt();
        Ok(Self { curve, rules, frames, values, envelope, order, radius, deviation, limit, sums, gaps })
    }

    /// The lengths of windows, in frames.
    fn lengths(&self) -> Vec<usize> {
        let (n, most) = (self.frames as f64, self.curve.frames());
        let (short, long) = (self.rules.shortest * n, self.rules.longest * n);
        let mut all: Vec<usize> = if self.rules.exhaustive {
            (short.ceil() as usize..=long.floor() as usize).collect()
        } else {
            let steps = (4.0 * (long / short).log2()).round().max(0.0) as usize;
            (0..=steps).map(|k| (short * 2_f64.powf(k as f64 / 4.0)).round() as usize).collect()
        };
        all.retain(|len| (2..=most).contains(len));
        all.dedup();
        all
    }

    /// Finds the normalisation of each channel of a window; returns false if the window has a gap.
    fn normalise(&self, grid: &Grid, start: usize, scratch: &mut Scratch) -> bool {
        let channels = self.curve.channels;
        scratch.normal.clear();
        scratch.normal.extend((0..channels).map(|c| {
            let (a, b) = (self.sums[start * channels + c], self.sums[(start + grid.len) * channels + c]);
            normaliser(self.rules.normalisation, [b[0] - a[0], b[1] - a[1]], grid.len as f64)
        }));
        self.gaps[start + grid.len] == self.gaps[start]
    }

    /// A number of a window that is stretched to the query and normalised.
    #[inline]
    fn value(&self, grid: &Grid, start: usize, normal: &[(f32, f32)], j: usize, c: usize) -> f32 {
        let (k, t) = grid.points[j];
        let at = (start + k) * self.curve.channels + c;
        let (a, b) = (self.curve.values[at], self.curve.values[at + self.curve.channels]);
        let (mean, factor) = normal[c];
        (a + t * (b - a) - mean) * factor
    }

    /// A lower bound of the squared distance of a window, from its ends and `points` more frames. It stops above the threshold.
    ///
    /// The ends are matched with the ends of the query, and every other frame with one within the radius.
    fn bound(&self, grid: &Grid, start: usize, normal: &[(f32, f32)], points: usize) -> f64 {
        let (channels, most) = (self.curve.channels, self.limit * self.limit);
        let mut bound = 0.0;
        for j in [0, self.frames - 1] {
            for c in 0..channels {
                let x = self.value(grid, start, normal, j, c);
                bound += f64::from(x - self.values[j * channels + c]).powi(2);
            }
        }
        for j in self.order.iter().take(points) {
            if bound > most {
                break;
            }
            for c in 0..channels {
                let x = self.value(grid, start, normal, *j, c);
                bound += outside(x, self.envelope[j * channels + c]);
            }
        }
        bound
    }

    /// Writes a window and returns a better lower bound of its squared distance, if it does not exceed the threshold.
    fn full_bound(&self, grid: &Grid, start: usize, scratch: &mut Scratch) -> Option<f64> {
        let (channels, most) = (self.curve.channels, self.limit * self.limit);
        let own = self.bound(grid, start, &scratch.normal, usize::MAX);
        if own > most {
            return None;
        }
        scratch.window.clear();
        for j in 0..self.frames {
            for c in 0..channels {
                let x = self.value(grid, start, &scratch.normal, j, c);
                scratch.window.push(x);
            }
        }
        let other = envelope(&scratch.window, channels, self.radius);
        let other: f64 = other.iter().zip(&self.values).map(|(e, x)| outside(*x, *e)).sum();
        (other <= most).then_some(own.max(other))
    }

    /// The distance of a window, if it does not exceed the threshold.
    fn distance(&self, grid: &Grid, start: usize, scratch: &mut Scratch) -> Option<f64> {
        if !self.normalise(grid, start, scratch) {
            return None;
        }
        self.full_bound(grid, start, scratch)?;
        distance(&self.values, &scratch.window, self.curve.channels, self.radius, self.limit)
    }

    fn found(&self, grid: &Grid, start: usize, distance: f64) -> MotionMatch {
        let similarity = (-distance / (self.frames as f64).sqrt() / self.deviation).exp();
        let at = |k: usize| k as f64 / self.curve.rate;
        MotionMatch { from: at(start), to: at(start + grid.len), similarity }
    }
}

/// Buffers of one comparison.
#[derive(Default)]
struct Scratch {
    /// Mean and factor of each channel.
    normal: Vec<(f32, f32)>,
    window: Vec<f32>,
}

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

/// The parts of a motion that are similar to a part of a motion, as [`without_overlap`] chooses among [`find_matches`], the most similar first, in
/// order of time.
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
            Step::Full => query.distance(grid, at, &mut scratch).map(|d| (d * d, Step::Exact)),
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
        let d = query.distance(&grids[g], start, scratch)?;
        Some(query.found(&grids[g], start, d))
    })
}

/// Of matches, those that do not overlap, in order of time: the most similar first, of equals the earlier and then the shorter; or with `optimal`
/// those whose similarities have the greatest sum.
#[must_use]
pub fn without_overlap(mut all: Vec<MotionMatch>, optimal: bool) -> Vec<MotionMatch> {
    let mut chosen: Vec<MotionMatch> = Vec::new();
    if optimal {
        all.sort_by(|a, b| a.to.total_cmp(&b.to).then(a.from.total_cmp(&b.from)));
        // The best sum of the matches up to each, and the number of those that end before one begins.
        let mut sums = vec![0.0];
        let before: Vec<usize> =
            all.iter().map(|m| all.partition_point(|other| other.to <= m.from + 1e-9)).collect();
        for (k, m) in all.iter().enumerate() {
            let with = m.similarity + sums[before[k]];
            sums.push(with.max(sums[k]));
        }
        let mut k = all.len();
        while k > 0 {
            if sums[k] > sums[k - 1] {
                chosen.push(all[k - 1]);
                k = before[k - 1];
            } else {
                k -= 1;
            }
        }
    } else {
        all.sort_by(|a, b| {
            let length = |m: &MotionMatch| m.to - m.from;
            b.similarity
                .total_cmp(&a.similarity)
                .then(a.from.total_cmp(&b.from))
                .then(length(a).total_cmp(&length(b)))
        });
        for m in all {
            let k = chosen.partition_point(|other| other.from < m.from);
            let is_free = chosen.get(k).is_none_or(|next| next.from >= m.to - 1e-9)
                && k.checked_sub(1).is_none_or(|k| chosen[k].to <= m.from + 1e-9);
            if is_free {
                chosen.insert(k, m);
            }
        }
    }
    chosen.sort_by(|a, b| a.from.total_cmp(&b.from));
    chosen
}

#[cfg(test)]
mod tests;
