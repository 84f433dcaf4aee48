//! Proposals of moments that may sound alike, for a user to accept, move or reject.
//!
//! Both worlds are brought to a common scale by ranks, laid on each other by optimal transport, and a few moments that lie far apart
//! are proposed, those first that bring the worlds nearest.
//!
//! # Source
//! Cuturi, "Sinkhorn distances" (NIPS 2013), for the transport; Bonneel, Rabin, Peyre and Pfister, "Sliced and Radon Wasserstein
//! barycenters" (2015), for the score.

use rayon::prelude::*;
use std::ops::Range;

use super::params::{Cause, Silence, SuggestParams};
use super::sliced_wasserstein::sliced_wasserstein;
use super::transport::{clustered, transported};
use super::windows::{Window, add_causes, farthest_points, ranked, windows};
use crate::statistics::squared;
use crate::warp::correspondence::pairing;
use crate::warp::fit::{FitError, Stiffness, fit};
use crate::warp::spline::tps::Orientation;
use crate::warp::spline::{Pair, Warper};

/// Minimum share of the distance between target and database that one more proposal gains.
const MIN_GAIN: f64 = 0.01;

/// Units of the target and of the database that might sound alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// First unit of the target's window.
    pub target: usize,
    /// First unit of the database's window.
    pub database: usize,
    /// Other windows of the database to try, from other segments.
    pub alternatives: Vec<usize>,
    /// Share of the distance between the unwarped worlds that it takes away after those before it, at most all that there is:
    /// where those before it made the distance larger than that, only what it takes off that. The first as if it came last.
    pub gain: f64,
}

/// Target and database as a search uses them.
struct FeatureSpaces<'a> {
    target: &'a [f32],
    database: &'a [f32],
    d: usize,
    window: usize,
    lambda: f64,
    /// Some units of both, for scores.
    some: [Vec<f32>; 2],
}

impl FeatureSpaces<'_> {
    /// A pair of means for each proposal: within a window the two sides are unrelated, and slopes fitted to the random
    /// content of one window would displace everything else.
    fn means(&self, proposals: &[(usize, usize)]) -> Vec<Pair> {
        let mean = |x: &[f32], unit: usize| {
            let rows = x.get(unit * self.d..(unit + self.window) * self.d).unwrap_or_default();
            pairing::mean(rows.chunks_exact(self.d), self.d)
        };
        let pair = |(t, b): &(usize, usize)| Pair {
            from: mean(self.target, *t),
            to: mean(self.database, *b),
            weight: self.window as f64,
        };
        proposals.iter().map(pair).collect()
    }

    /// The pairs of units that result from accepted proposals.
    #[cfg(test)]
    fn units(&self, proposals: &[(usize, usize)]) -> Vec<Pair> {
        let row = |x: &[f32], unit: usize| {
            let row = x.get(unit * self.d..(unit + 1) * self.d).unwrap_or_default();
            row.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>()
        };
        let units = proposals.iter().flat_map(|(t, b)| (0..self.window).map(move |k| (t + k, b + k)));
        units
            .map(|(t, b)| Pair { from: row(self.target, t), to: row(self.database, b), weight: 1.0 })
            .collect()
    }

    /// Distance of the warped target to the database, and the share of the target with reversed orientation.
    fn score(&self, pairs: &[Pair]) -> Result<(f64, f64), FitError> {
        let [target, database] = &self.some;
        let (tps, _) = fit(pairs, self.d, Stiffness::Lambda(self.lambda))?;
        let mut warper = Warper::new(&tps);
        let mut warped = vec![0.0; target.len()];
        for (x, y) in target.chunks_exact(self.d).zip(warped.chunks_exact_mut(self.d)) {
            warper.warp(x, y);
        }
        let units: Vec<usize> = (0..target.len() / self.d).step_by(8).collect();
        Ok((
            sliced_wasserstein(&warped, database, self.d),
            1.0 - Orientation::new(target, &tps, &units).preserved,
        ))
    }
}

fn subsampled(x: &[f32], d: usize, most: usize) -> Vec<f32> {
    let units = x.len() / d;
    let some = units.min(most);
    (0..some).flat_map(|k| x[k * units / some * d..][..d].iter().copied()).collect()
}

/// The nearest of some windows, and up to two more from other segments.
fn proposed(target: &Window, database_windows: &[Window], far: impl Fn(usize) -> f64) -> Proposal {
    let far: Vec<f64> = (0..database_windows.len()).map(far).collect();
    let mut near: Vec<usize> = (0..database_windows.len()).collect();
    near.sort_by(|a, b| far[*a].total_cmp(&far[*b]));
    let mut used: Vec<usize> = Vec::new();
    near.retain(|j| {
        let other = used.len() < 3 && !used.contains(&database_windows[*j].segment);
        if other {
            used.push(database_windows[*j].segment);
        }
        other
    });
    let mut starts = near.into_iter().map(|j| database_windows[j].start);
    let database = starts.next().unwrap_or(0);
    Proposal { target: target.start, database, alternatives: starts.collect(), gain: 0.0 }
}

/// Removes silence, and windows that become silent half-way, from both sides. Returns the proposal for silence, if both
/// have any.
///
/// Digital silence has no colour, so its ranks are arbitrary; it corresponds to the quietest windows, or to none.
fn split_silence(
    target_windows: &mut Vec<Window>,
    database_windows: &mut Vec<Window>,
    silence: Silence,
) -> Option<Proposal> {
    let (silent, mut sounding): (Vec<_>, Vec<_>) =
        target_windows.drain(..).partition(|w| w.loudness() <= silence.target);
    sounding.retain(|w| w.min_loudness > silence.target);
    *target_windows = sounding;
    let quietest = silent.iter().min_by(|a, b| a.loudness().total_cmp(&b.loudness()))?;
    let levels = || database_windows.iter().map(Window::loudness);
    let (low, high) = (levels().fold(f64::INFINITY, f64::min), levels().fold(f64::NEG_INFINITY, f64::max));
    let most = (high - silence.below).min(low + silence.within);
    let (quiet, sounding): (Vec<_>, Vec<_>) = database_windows.drain(..).partition(|w| w.loudness() <= most);
    *database_windows = sounding;
    (!quiet.is_empty()).then(|| proposed(quietest, &quiet, |j| quiet[j].loudness()))
}

/// Windows of the target with the windows at their transported positions, the quietest first, and true for silence.
fn candidates(
    (target, database): (&[f32], &[f32]),
    segments: &[Range<usize>],
    d: usize,
    p: &SuggestParams,
    causes: &[Cause],
) -> (Vec<Proposal>, bool) {
    let whole = 0..target.len() / d.max(1);
    let (mut target_windows, mut database_windows) =
        (windows(target, std::slice::from_ref(&whole), d, p), windows(database, segments, d, p));
    let quiet =
        p.silence.and_then(|silence| split_silence(&mut target_windows, &mut database_windows, silence));
    let silent = quiet.is_some();
    let mut all = Vec::from_iter(quiet);
    if target_windows.is_empty() || database_windows.is_empty() {
        return (all, silent);
    }
    let (mut from, mut to) =
        (ranked(&target_windows, d, causes.len()), ranked(&database_windows, d, causes.len()));
    [&mut from, &mut to].into_iter().for_each(|side| side.scale_dim(0, p.level));
    add_causes(causes, d, p.window, (&target_windows, &mut from), (&database_windows, &mut to));
    let chosen = farthest_points(&target_windows, &from, p.count - all.len().min(p.count));
    let from = clustered(from, p.most);
    let goals = transported(&from, &clustered(to.clone(), p.most));
    all.extend(chosen.into_iter().map(|k| {
        let goal = goals.row(from.of.get(k).copied().unwrap_or(0));
        proposed(&target_windows[k], &database_windows, |j| squared(to.row(j), goal))
    }));
    (all, silent)
}

/// Returns true if a target has silence for which nothing is proposed.
pub(super) fn leaves_out_silence(found: &[Proposal], target: &[f32], d: usize, p: &SuggestParams) -> bool {
    let Some(silence) = p.silence else { return false };
    let whole = 0..target.len() / d.max(1);
    let mut silent = windows(target, std::slice::from_ref(&whole), d, p);
    silent.retain(|w| w.loudness() <= silence.target);
    !silent.is_empty() && !found.iter().any(|p| silent.iter().any(|w| w.start == p.target))
}

/// Proposes correspondences, best first, until one more brings the worlds less than 1 % nearer, or all of them
/// with `all`. Nothing is applied.
///
/// # Shapes
/// `target` and `database`: `[units, d]`; `segments` are the gap-free stretches of the database.
///
/// # Errors
/// As [`fit`]: numbers that are not finite.
///
/// # Complexity
/// O(most^2) per round of transport, of which there are at most 300, and count^2 / 2 fits of up to count nodes.
pub fn suggest(
    target: &[f32],
    database: &[f32],
    segments: &[Range<usize>],
    d: usize,
    p: &SuggestParams,
    causes: &[Cause],
) -> Result<Vec<Proposal>, FitError> {
    if let Some(pair) = target.iter().chain(database).position(|x| !x.is_finite()) {
        let message = "its features are not finite".to_owned();
        return Err(FitError::Pair { pair: pair / d.max(1), message });
    }
    let (mut open, silent) = candidates((target, database), segments, d, p, causes);
    if open.is_empty() {
        return Ok(open);
    }
    // Silence that is left out is not to be brought nearer to anything either.
    let left_out = p.silence.filter(|_| !silent);
    let least = left_out.map_or(f64::NEG_INFINITY, |silence| silence.target);
    let sounding = target.chunks_exact(d.max(1)).filter(|x| x.first().is_some_and(|x| f64::from(*x) > least));
    let sounding: Vec<f32> = sounding.flatten().copied().collect();
    let rows = |s: &Range<usize>| database.get(s.start * d..s.end * d).unwrap_or_default();
    let database_windows: Vec<f32> = segments.iter().flat_map(rows).copied().collect();
    let some = [subsampled(&sounding, d, 1500), subsampled(&database_windows, d, 1500)];
    let spaces = FeatureSpaces { target, database, d, window: p.window, lambda: p.lambda, some };
    let mut listed: Vec<Proposal> = Vec::new();
    let start = spaces.score(&[])?.0;
    // A proposal that only compensates for a distance caused by others has gained nothing.
    let gain = |before: f64, after: f64| (before.min(start) - after) / start.max(f64::MIN_POSITIVE);
    let mut now = start;
    while !open.is_empty() {
        // The quietest is always offered first.
        let tried = if listed.is_empty() { 1 } else { open.len() };
        let score = |proposal: &Proposal| {
            let all = listed.iter().chain(std::iter::once(proposal));
            let with: Vec<(usize, usize)> = all.map(|p| (p.target, p.database)).collect();
            let (distance, folds) = spaces.score(&spaces.means(&with))?;
            Ok((distance + 0.1 * folds * start, distance))
        };
        let scores: Vec<(f64, f64)> = open[..tried].par_iter().map(score).collect::<Result<_, FitError>>()?;
        let best = scores.iter().enumerate().min_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let Some((k, (_, distance))) = best else { break };
        if !p.all && listed.len() > 1 && now - distance < MIN_GAIN * start {
            break;
        }
        let proposal = open.remove(k);
        listed.push(Proposal { gain: gain(now, *distance), ..proposal });
        now = *distance;
    }
    // One alone only shifts everything: what it is worth shows once the others are there.
    if let [first, others @ ..] = &mut listed[..]
        && !others.is_empty()
    {
        let others: Vec<(usize, usize)> = others.iter().map(|p| (p.target, p.database)).collect();
        first.gain = gain(spaces.score(&spaces.means(&others))?.0, now);
    }
    Ok(listed)
}

#[cfg(test)]
mod tests;
