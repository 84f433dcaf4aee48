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
use super::tps::Warper;
use super::transport::{Points, clustered, squared, transported};

/// Most windows of either side; more are thinned out evenly before anything else.
const MOST_WINDOWS: usize = 20_000;
/// Distance of two windows whose causes have nothing in common, where ranks spread by 1.
const CAUSE: f64 = 2.0;

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

/// A stretch of units with the mean and the spread of its features.
#[derive(Clone, Debug)]
struct Window {
    start: usize,
    segment: usize,
    mean: Vec<f64>,
    variance: f64,
}

fn windows(features: &[f32], segments: &[Range<usize>], d: usize, p: &SuggestParams) -> Vec<Window> {
    let mut all = Vec::new();
    for (segment, units) in segments.iter().enumerate() {
        for start in units.clone().step_by(p.hop.max(1)).take_while(|start| start + p.window <= units.end) {
            let rows = features.get(start * d..(start + p.window) * d).unwrap_or_default();
            let mut mean = vec![0.0; d];
            let mut square = 0.0;
            for row in rows.chunks_exact(d) {
                for (m, x) in mean.iter_mut().zip(row) {
                    *m += f64::from(*x) / p.window as f64;
                    square += f64::from(*x).powi(2) / p.window as f64;
                }
            }
            let variance = (square - mean.iter().map(|m| m * m).sum::<f64>()).max(0.0);
            all.push(Window { start, segment, mean, variance });
        }
    }
    let count = all.len().min(MOST_WINDOWS);
    (0..count).map(|k| all[k * all.len() / count.max(1)].clone()).collect()
}

/// The normal distribution's quantile, off by at most 5e-4: Abramowitz and Stegun, 26.2.23.
pub(super) fn probit(p: f64) -> f64 {
    let tail = p.min(1.0 - p).max(1e-300);
    let t = (-2.0 * libm::log(tail)).sqrt();
    let x = t
        - (2.515_517 + t * (0.802_853 + t * 0.010_328))
            / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    if p < 0.5 { -x } else { x }
}

/// Each dimension by the normal quantile of its rank, ties at their middle: what no monotone distortion changes.
fn ranked(windows: &[Window], d: usize, causes: usize) -> Points {
    let (n, dims) = (windows.len(), d + causes);
    let mut out = Points { dims, at: vec![0.0; n * dims] };
    for i in 0..d {
        let value = |k: usize| windows[k].mean[i];
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| value(*a).total_cmp(&value(*b)));
        let mut from = 0;
        while from < n {
            let mut to = from + 1;
            while to < n && value(order[to]) == value(order[from]) {
                to += 1;
            }
            let middle = probit((from + to) as f64 / (2 * n) as f64);
            for k in &order[from..to] {
                if let Some(x) = out.at.get_mut(k * dims + i) {
                    *x = middle;
                }
            }
            from = to;
        }
    }
    out
}

/// Adds the shares of causes to windows of both sides; segments whose cause nobody knows lie in the middle of the target's.
fn add_causes(
    causes: &[Cause],
    d: usize,
    window: usize,
    ours: (&[Window], &mut Points),
    theirs: (&[Window], &mut Points),
) {
    let power = |cause: &Cause, start: usize| -> f64 { cause.power.iter().skip(start).take(window).sum() };
    let most: f64 = causes.iter().flat_map(|cause| &cause.power).fold(0.0, |most, x| most.max(*x));
    for (c, cause) in causes.iter().enumerate() {
        let dims = ours.1.dims;
        let mut sum = 0.0;
        for (w, at) in ours.0.iter().zip(ours.1.at.chunks_exact_mut(dims)) {
            let all: f64 = causes.iter().map(|cause| power(cause, w.start)).sum();
            // What is 100 dB below the loudest unit has no cause.
            let share = if all > 1e-10 * most * window as f64 { power(cause, w.start) / all } else { 0.0 };
            sum += share;
            at[d + c] = CAUSE * share;
        }
        let mean = sum / ours.0.len().max(1) as f64;
        for (w, at) in theirs.0.iter().zip(theirs.1.at.chunks_exact_mut(dims)) {
            let known = cause.segments.get(w.segment).copied().flatten();
            at[d + c] = CAUSE * known.map_or(mean, |of_this| f64::from(u8::from(of_this)));
        }
    }
}

/// Points that lie far from each other, the quietest first; steady ones are preferred.
fn farthest(windows: &[Window], at: &Points, count: usize) -> Vec<usize> {
    let n = windows.len();
    let mean = windows.iter().map(|w| w.variance).sum::<f64>() / n.max(1) as f64;
    let steady = |k: usize| 1.0 / (1.0 + windows[k].variance / mean.max(1e-12));
    let loudness = |k: &usize| windows[*k].mean.first().copied().unwrap_or(0.0);
    let Some(first) = (0..n).min_by(|a, b| loudness(a).total_cmp(&loudness(b))) else { return Vec::new() };
    let mut chosen = vec![first];
    let mut nearest: Vec<f64> = (0..n).map(|k| squared(at.row(k), at.row(first))).collect();
    while chosen.len() < count.min(n) {
        let score = |k: &usize| nearest[*k] * steady(*k);
        let Some(next) = (0..n).max_by(|a, b| score(a).total_cmp(&score(b))) else { break };
        if nearest[next] == 0.0 {
            break;
        }
        chosen.push(next);
        nearest
            .iter_mut()
            .enumerate()
            .for_each(|(k, near)| *near = near.min(squared(at.row(k), at.row(next))));
    }
    chosen
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
        let units = target.chunks_exact(self.d).step_by(8);
        let (folds, count) =
            units.fold((0, 0), |(f, n), x| (f + usize::from(warper.determinant(x) <= 0.0), n + 1));
        Ok((
            sliced_wasserstein(&warped, database, self.d),
            f64::from(folds as u32) / f64::from(count.max(1) as u32),
        ))
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
mod tests {
    use super::*;

    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(state: &mut u64) -> f64 {
        probit(random(state).clamp(1e-9, 1.0 - 1e-9))
    }

    /// Gestures: features that go smoothly from one of some states to the next, with rests.
    fn gestures(units: usize, seed: u64) -> Vec<f32> {
        let mut state = seed;
        let states: Vec<[f64; 3]> =
            [[-22.0, 0.0, 0.0], [-12.0, 3.0, 1.0], [-8.0, -4.0, 0.5], [-3.0, 1.0, -2.0], [-6.0, 6.0, 2.0]]
                .to_vec();
        let (mut at, mut goal, mut left) = (states[0], states[0], 0);
        let mut out = Vec::with_capacity(3 * units);
        for _ in 0..units {
            if left == 0 {
                let near = states[(random(&mut state) * 5.0) as usize];
                goal = near.map(|x| x + 1.2 * normal(&mut state));
                left = 40 + (random(&mut state) * 120.0) as usize;
            }
            left -= 1;
            for (a, g) in at.iter_mut().zip(goal) {
                *a += 0.06 * (g - *a);
                out.push((*a + 0.15 * normal(&mut state)) as f32);
            }
        }
        out
    }

    fn distorted(x: &[f32], law: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<f32> {
        x.chunks_exact(3).flat_map(|x| law([x[0], x[1], x[2]].map(f64::from)).map(|y| y as f32)).collect()
    }

    /// Share of the distance above that of a perfect alignment which proposals take away, at the best of three stiffnesses.
    fn removed(law: impl Fn([f64; 3]) -> [f64; 3]) -> f64 {
        // Two takes of the same gestures: even a perfect alignment leaves some distance.
        let (target, other) = (gestures(2000, 1), gestures(2000, 2));
        let database = distorted(&other, &law);
        let floor = sliced_wasserstein(&distorted(&target, &law), &database, 3);
        let before = sliced_wasserstein(&target, &database, 3);
        let segments = [0..1000, 1000..2000];
        let p = SuggestParams { most: 160, ..SuggestParams::default() };
        let found = suggest(&target, &database, &segments, 3, &p, &[]).unwrap();
        assert!(found.len() >= 3 && found.iter().all(|p| p.alternatives.len() == 1), "{found:?}");
        let quiet = found[0].target;
        assert!(target[3 * quiet] < -18.0, "silence is offered first");
        let left = [1e2, 1e3, 1e4].map(|lambda| {
            let some = [target.clone(), database.clone()];
            let worlds = Worlds { target: &target, database: &database, d: 3, window: 24, lambda, some };
            let with: Vec<_> = found.iter().map(|p| (p.target, p.database)).collect();
            worlds.score(&worlds.units(&with)).unwrap().0
        });
        let after = left.into_iter().fold(f64::INFINITY, f64::min);
        println!("{} proposals: {before:.2} -> {after:.2}, floor {floor:.2}", found.len());
        (before - after) / (before - floor)
    }

    #[test]
    fn proposals_undo_most_of_a_planted_nonlinear_distortion() {
        let share = removed(|[x, y, z]| {
            [1.1 * x + 5.0 + 0.05 * y * y, 0.8 * y - 1.5 + 0.8 * (0.3 * x).sin(), z + 0.2 * y]
        });
        assert!(share >= 0.75, "{share}");
    }

    #[test]
    fn proposals_undo_nearly_all_of_a_distortion_dimension_by_dimension() {
        let share = removed(|[x, y, z]| {
            [x + 6.0 + 2.0 * (0.2 * x).tanh(), 1.4 * y + 2.0, 0.5 * z + 0.02 * z.powi(3) - 1.0]
        });
        assert!(share >= 0.85, "{share}");
    }

    #[test]
    fn ranks_are_what_no_monotone_distortion_changes() {
        let x = gestures(600, 4);
        let p = SuggestParams { window: 1, hop: 5, ..SuggestParams::default() };
        let of = |x: &[f32]| ranked(&windows(x, std::slice::from_ref(&(0..600)), 3, &p), 3, 0);
        assert_eq!(of(&x), of(&distorted(&x, |x| x.map(|x| 3.0 * x + 0.01 * x.powi(3)))));
        assert!(
            probit(0.5).abs() < 5e-4
                && (probit(0.975) - 1.959_964).abs() < 5e-4
                && (probit(0.001) + 3.090_232).abs() < 5e-4
        );
    }

    #[test]
    fn the_distance_of_shifted_clouds_is_the_shift_along_the_mean_direction() {
        let x = gestures(400, 3);
        let moved = distorted(&x, |[x, y, z]| [x + 3.0, y, z]);
        assert_eq!(sliced_wasserstein(&x, &x, 3), 0.0);
        // The mean square of one coordinate of a direction is 1/3.
        assert!((sliced_wasserstein(&x, &moved, 3) / 3.0_f64.sqrt() - 1.0).abs() < 0.1);
    }

    #[test]
    fn nothing_is_proposed_where_there_is_no_window() {
        let p = SuggestParams::default();
        assert_eq!(suggest(&[0.0; 30], &[0.0; 300], std::slice::from_ref(&(0..100)), 3, &p, &[]), Ok(vec![]));
        let found = suggest(&[0.0; 300], &[1.0; 300], std::slice::from_ref(&(0..100)), 3, &p, &[]).unwrap();
        assert!(found.len() <= 1, "all alike: {found:?}");
    }

    /// Distance that some proposals leave, by their means and by their units, over that without any.
    fn left(target: &[f32], database: &[f32], lambda: f64, found: &[Proposal]) -> [f64; 2] {
        let some = [target.to_vec(), database.to_vec()];
        let worlds = Worlds { target, database, d: 3, window: 24, lambda, some };
        let with: Vec<_> = found.iter().map(|p| (p.target, p.database)).collect();
        let start = worlds.score(&[]).unwrap().0;
        [worlds.means(&with), worlds.units(&with)].map(|pairs| worlds.score(&pairs).unwrap().0 / start)
    }

    #[test]
    fn a_short_take_has_no_gain_beyond_what_there_is_to_gain() {
        let mut wild = 0.0_f64;
        for seed in 1..6 {
            // A third of a second of target: some five windows, nearly on a line.
            let target = gestures(84, seed);
            let database = distorted(&gestures(600, 9), |[x, y, z]| [1.2 * x + 6.0, y, z + 1.0]);
            let p = SuggestParams { lambda: 100.0, ..SuggestParams::default() };
            let found = suggest(&target, &database, &[0..300, 300..600], 3, &p, &[]).unwrap();
            let gains: Vec<f64> = found.iter().map(|p| p.gain).collect();
            assert!(gains.iter().all(|gain| (-1.0..=1.0).contains(gain)), "{seed}: {gains:?}");
            let all = left(&target, &database, 100.0, &found);
            assert!(all[0] < 1.0, "{seed}: {all:?}");
            wild = wild.max(left(&target, &database, 100.0, &found[..1])[1]);
        }
        assert!(wild > 1.5, "slopes within the only window throw everything anywhere: {wild}");
    }

    #[test]
    fn clusters_stand_for_many_windows() {
        let law = |[x, y, z]: [f64; 3]| [x + 6.0, 1.4 * y, 0.5 * z];
        let (target, other) = (gestures(3000, 1), distorted(&gestures(3000, 2), law));
        let after = |most: usize| {
            let p = SuggestParams { most, ..SuggestParams::default() };
            let found = suggest(&target, &other, &[0..1500, 1500..3000], 3, &p, &[]).unwrap();
            left(&target, &other, 1e3, &found)[0]
        };
        let (all, few) = (after(2000), after(60));
        assert!(all < 0.4 && few < 1.25 * all, "{all} {few}");
    }

    #[test]
    fn causes_keep_what_sounds_alike_apart() {
        // Two causes that sound the same: only their shares tell which recording belongs to which.
        let target = gestures(1200, 3);
        let database = gestures(1200, 4);
        let loud = |of: bool| (0..1200).map(|k| f64::from(u8::from((k / 300 % 2 == 0) == of))).collect();
        let causes = [true, false].map(|of| Cause { power: loud(of), segments: vec![Some(of), Some(!of)] });
        let segments = [0..600, 600..1200];
        let p = SuggestParams { most: 400, ..SuggestParams::default() };
        let right = |causes: &[Cause]| {
            let all = candidates((&target, &database), &segments, 3, &p, causes);
            let whole = all.iter().filter(|p| p.target % 300 <= 276);
            let (right, count) = whole.fold((0, 0), |(right, count), p| {
                let of = p.target / 300 % 2 == 0;
                (right + usize::from((p.database < 600) == of), count + 1)
            });
            right as f64 / f64::from(count)
        };
        assert!(right(&causes) > 0.95, "{}", right(&causes));
        assert!(right(&[]) < 0.9, "{}", right(&[]));
        let unknown = causes.clone().map(|cause| Cause { segments: vec![None, None], ..cause });
        assert!(right(&unknown) < 0.9, "no recording is known to be of a cause");
    }
}
