//! Proposals of what might sound alike, for somebody to accept, move or reject.
//!
//! Both worlds are brought to a common scale by ranks, laid on each other by optimal transport, and a few moments that lie far apart
//! are proposed, those first that bring the worlds nearest.
//!
//! # Source
//! Cuturi, "Sinkhorn distances" (NIPS 2013), for the transport; Bonneel, Rabin, Peyre and Pfister, "Sliced and Radon Wasserstein
//! barycenters" (2015), for the score.

use rayon::prelude::*;
use std::ops::Range;

use super::fit::{FitError, Pair, Stiffness, fit};
use super::sliced::sliced_wasserstein;
use super::tps::{Warper, fold_share};
use super::transport::{clustered, squared, transported};
use super::windows::{add_causes, farthest, ranked, windows};

/// How proposals are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuggestParams {
    /// Units in a window: what a proposal marks.
    pub window: usize,
    /// Units from window to window.
    pub hop: usize,
    /// Most proposals.
    pub count: usize,
    /// lambda of the warp that scores them.
    pub lambda: f64,
    /// Most windows of either side that are laid on each other; more go into as many clusters.
    pub most: usize,
}

impl Default for SuggestParams {
    fn default() -> Self {
        Self { window: 24, hop: 12, count: 12, lambda: 1e3, most: 2000 }
    }
}

/// Units of the target and of the database that might sound alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// First unit of the target's window.
    pub target: usize,
    /// First unit of the database's window.
    pub database: usize,
    /// Other windows of the database to try, from other segments.
    pub alternatives: Vec<usize>,
    /// Share of the distance between the worlds that it takes away after those before it; the first one, silence, after all others.
    pub gain: f64,
}

/// What a part of the target's sound comes from, known exactly where it is synthetic.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cause {
    /// Its power in each unit of the target.
    pub power: Vec<f64>,
    /// For each segment of the database whether it comes from this alone, where that is known.
    pub segments: Vec<Option<bool>>,
}

/// Both worlds as a search sees them.
struct Worlds<'a> {
    target: &'a [f32],
    database: &'a [f32],
    d: usize,
    window: usize,
    lambda: f64,
    /// Some units of both, for scores.
    some: [Vec<f32>; 2],
}

impl Worlds<'_> {
    /// A pair of means for each proposal: within a window the two sides have nothing to do with each other, and slopes fitted to
    /// what one window holds by chance would throw everything else anywhere.
    fn means(&self, proposals: &[(usize, usize)]) -> Vec<Pair> {
        let mean = |x: &[f32], unit: usize| {
            let rows = x.get(unit * self.d..(unit + self.window) * self.d).unwrap_or_default();
            super::pairing::mean(rows.chunks_exact(self.d), self.d)
        };
        let pair = |(t, b): &(usize, usize)| Pair {
            from: mean(self.target, *t),
            to: mean(self.database, *b),
            weight: self.window as f64,
        };
        proposals.iter().map(pair).collect()
    }

    /// The pairs of units that somebody who accepts proposals gets.
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

    /// Distance of the warped target to the database, and the share of it that folds.
    fn score(&self, pairs: &[Pair]) -> Result<(f64, f64), FitError> {
        let [target, database] = &self.some;
        let (tps, _) = fit(pairs, self.d, Stiffness::Lambda(self.lambda))?;
        let mut warper = Warper::new(&tps);
        let mut warped = vec![0.0; target.len()];
        for (x, y) in target.chunks_exact(self.d).zip(warped.chunks_exact_mut(self.d)) {
            warper.warp(x, y);
        }
        let units: Vec<usize> = (0..target.len() / self.d).step_by(8).collect();
        Ok((sliced_wasserstein(&warped, database, self.d), fold_share(target, &tps, &units)))
    }
}

fn thinned(x: &[f32], d: usize, most: usize) -> Vec<f32> {
    let units = x.len() / d;
    let some = units.min(most);
    (0..some).flat_map(|k| x[k * units / some * d..][..d].iter().copied()).collect()
}

/// Windows of the target with what lies where transport takes them.
fn candidates(
    (target, database): (&[f32], &[f32]),
    segments: &[Range<usize>],
    d: usize,
    p: &SuggestParams,
    causes: &[Cause],
) -> Vec<Proposal> {
    let whole = 0..target.len() / d.max(1);
    let (ours, theirs) =
        (windows(target, std::slice::from_ref(&whole), d, p), windows(database, segments, d, p));
    if ours.is_empty() || theirs.is_empty() {
        return Vec::new();
    }
    let (mut from, mut to) = (ranked(&ours, d, causes.len()), ranked(&theirs, d, causes.len()));
    add_causes(causes, d, p.window, (&ours, &mut from), (&theirs, &mut to));
    let chosen = farthest(&ours, &from, p.count);
    let from = clustered(from, p.most);
    let goals = transported(&from, &clustered(to.clone(), p.most));
    let proposal = |k: usize| {
        let goal = goals.row(from.of.get(k).copied().unwrap_or(0));
        let far: Vec<f64> = (0..theirs.len()).map(|j| squared(to.row(j), goal)).collect();
        let mut near: Vec<usize> = (0..theirs.len()).collect();
        near.sort_by(|a, b| far[*a].total_cmp(&far[*b]));
        let mut used: Vec<usize> = Vec::new();
        near.retain(|j| {
            let other = used.len() < 3 && !used.contains(&theirs[*j].segment);
            if other {
                used.push(theirs[*j].segment);
            }
            other
        });
        let mut starts = near.into_iter().map(|j| theirs[j].start);
        let database = starts.next().unwrap_or(0);
        Proposal { target: ours[k].start, database, alternatives: starts.collect(), gain: 0.0 }
    };
    chosen.into_iter().map(proposal).collect()
}

/// Proposes correspondences, best first, until one more brings the worlds less than 1 % nearer. Nothing is applied.
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
    let mut open = candidates((target, database), segments, d, p, causes);
    let some = [thinned(target, d, 1500), thinned(database, d, 1500)];
    let worlds = Worlds { target, database, d, window: p.window, lambda: p.lambda, some };
    let mut listed: Vec<Proposal> = Vec::new();
    let start = worlds.score(&[])?.0;
    let mut now = start;
    while !open.is_empty() {
        // Silence is always offered first.
        let tried = if listed.is_empty() { 1 } else { open.len() };
        let score = |proposal: &Proposal| {
            let all = listed.iter().chain(std::iter::once(proposal));
            let with: Vec<(usize, usize)> = all.map(|p| (p.target, p.database)).collect();
            let (distance, folds) = worlds.score(&worlds.means(&with))?;
            Ok((distance + 0.1 * folds * start, distance))
        };
        let scores: Vec<(f64, f64)> = open[..tried].par_iter().map(score).collect::<Result<_, FitError>>()?;
        let best = scores.iter().enumerate().min_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let Some((k, (_, distance))) = best else { break };
        let gain = (now - distance) / start.max(f64::MIN_POSITIVE);
        if listed.len() > 1 && gain < 0.01 {
            break;
        }
        let proposal = open.remove(k);
        listed.push(Proposal { gain, ..proposal });
        now = *distance;
    }
    // Silence alone only shifts everything: what it is worth shows once the others are there.
    if let [first, others @ ..] = &mut listed[..]
        && !others.is_empty()
    {
        let others: Vec<(usize, usize)> = others.iter().map(|p| (p.target, p.database)).collect();
        let gain = (worlds.score(&worlds.means(&others))?.0 - now) / start.max(f64::MIN_POSITIVE);
        first.gain = gain.clamp(-1.0, 1.0);
    }
    Ok(listed)
}

#[cfg(test)]
mod tests;
