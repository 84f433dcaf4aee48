//! Proposals of what might sound alike, for somebody to accept, move or reject.
//!
//! Both worlds are brought to a common scale by ranks, laid on each other by optimal transport, and a few moments that lie far apart
//! are proposed, those first that bring the worlds nearest.
//!
//! # Source
//! Cuturi, "Sinkhorn distances" (NIPS 2013), for the transport; Bonneel, Rabin, Peyre and Pfister, "Sliced and Radon Wasserstein
//! barycenters" (2015), for the score.

use std::f64::consts::TAU;
use std::ops::Range;

use super::fit::{FitError, Pair, Stiffness, fit};
use super::tps::Warper;

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
    /// Most windows of either side; more are thinned out evenly.
    pub most: usize,
}

impl Default for SuggestParams {
    fn default() -> Self {
        Self { window: 24, hop: 12, count: 12, lambda: 1e3, most: 600 }
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
    /// Share of the distance between the worlds that it takes away after those before it.
    pub gain: f64,
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
    let count = all.len().min(p.most);
    (0..count).map(|k| all[k * all.len() / count.max(1)].clone()).collect()
}

/// The normal distribution's quantile, off by at most 5e-4: Abramowitz and Stegun, 26.2.23.
fn probit(p: f64) -> f64 {
    let tail = p.min(1.0 - p).max(1e-300);
    let t = (-2.0 * libm::log(tail)).sqrt();
    let x = t
        - (2.515_517 + t * (0.802_853 + t * 0.010_328))
            / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    if p < 0.5 { -x } else { x }
}

/// Each dimension by the normal quantile of its rank, ties at their middle: what no monotone distortion changes.
fn ranked(windows: &[Window], d: usize) -> Vec<Vec<f64>> {
    let n = windows.len();
    let mut out = vec![vec![0.0; d]; n];
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
                if let Some(x) = out[*k].get_mut(i) {
                    *x = middle;
                }
            }
            from = to;
        }
    }
    out
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// Where entropic optimal transport takes each point of `a` among those of `b`, all points alike.
fn transported(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<Vec<f64>> {
    const ROUNDS: usize = 300;
    let (n, m) = (a.len(), b.len());
    let cost: Vec<f64> = a.iter().flat_map(|x| b.iter().map(move |y| squared(x, y))).collect();
    let mut sorted = cost.clone();
    let middle = sorted.len() / 2;
    let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    let epsilon = (0.05 * median).max(1e-9);
    // Potentials over epsilon; sums of exponentials are taken from their largest, so that none is lost.
    let scaled: Vec<f64> = cost.iter().map(|c| -c / epsilon).collect();
    let (mut f, mut g) = (vec![0.0; n], vec![0.0; m]);
    let potential = |values: &mut dyn Iterator<Item = f64>, count: usize| {
        let values: Vec<f64> = values.collect();
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        -(largest + libm::log(values.iter().map(|v| libm::exp(v - largest)).sum::<f64>()))
            - libm::log(count as f64)
    };
    for _ in 0..ROUNDS {
        for (i, f) in f.iter_mut().enumerate() {
            *f = potential(&mut scaled[i * m..(i + 1) * m].iter().zip(&g).map(|(s, g)| s + g), n);
        }
        let before = g.clone();
        for (j, g) in g.iter_mut().enumerate() {
            *g = potential(&mut (0..n).map(|i| scaled[i * m + j] + f[i]), m);
        }
        let change = before.iter().zip(&g).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        if change < 1e-6 {
            break;
        }
    }
    (0..n)
        .map(|i| {
            let weights: Vec<f64> = (0..m).map(|j| libm::exp(scaled[i * m + j] + f[i] + g[j])).collect();
            let total: f64 = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
            (0..b[0].len())
                .map(|k| weights.iter().zip(b).map(|(w, y)| w * y[k]).sum::<f64>() / total)
                .collect()
        })
        .collect()
}

/// Points that lie far from each other, the quietest first; steady ones are preferred.
fn farthest(windows: &[Window], at: &[Vec<f64>], count: usize) -> Vec<usize> {
    let n = windows.len();
    let mean = windows.iter().map(|w| w.variance).sum::<f64>() / n.max(1) as f64;
    let steady = |k: usize| 1.0 / (1.0 + windows[k].variance / mean.max(1e-12));
    let loudness = |k: &usize| windows[*k].mean.first().copied().unwrap_or(0.0);
    let Some(first) = (0..n).min_by(|a, b| loudness(a).total_cmp(&loudness(b))) else { return Vec::new() };
    let mut chosen = vec![first];
    let mut nearest: Vec<f64> = (0..n).map(|k| squared(&at[k], &at[first])).collect();
    while chosen.len() < count.min(n) {
        let score = |k: &usize| nearest[*k] * steady(*k);
        let Some(next) = (0..n).max_by(|a, b| score(a).total_cmp(&score(b))) else { break };
        if nearest[next] == 0.0 {
            break;
        }
        chosen.push(next);
        nearest.iter_mut().enumerate().for_each(|(k, near)| *near = near.min(squared(&at[k], &at[next])));
    }
    chosen
}

/// Sliced Wasserstein distance of two clouds: root mean square over 64 directions of the distance between 199 quantiles of each.
///
/// # Shapes
/// `a` and `b`: `[n, d]`.
#[must_use]
pub fn sliced_wasserstein(a: &[f32], b: &[f32], d: usize) -> f64 {
    const DIRECTIONS: usize = 64;
    const QUANTILES: usize = 199;
    let quantiles = |x: &[f32], direction: &[f64]| -> Vec<f64> {
        let along = |row: &[f32]| row.iter().zip(direction).map(|(x, v)| f64::from(*x) * v).sum::<f64>();
        let mut all: Vec<f64> = x.chunks_exact(d).map(along).collect();
        all.sort_unstable_by(f64::total_cmp);
        let quantile = |q: usize| {
            let place = (q + 1) as f64 / (QUANTILES + 1) as f64 * all.len().saturating_sub(1) as f64;
            let (low, t) = (place as usize, place.fract());
            let at = |k: usize| all.get(k).or(all.last()).copied().unwrap_or(0.0);
            at(low) + t * (at(low + 1) - at(low))
        };
        (0..QUANTILES).map(quantile).collect()
    };
    let total: f64 = (0..DIRECTIONS)
        .map(|k| {
            let direction = direction(k, d);
            let pairs = quantiles(a, &direction).into_iter().zip(quantiles(b, &direction));
            pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / QUANTILES as f64
        })
        .sum();
    (total / DIRECTIONS as f64).sqrt()
}

/// Direction `k` of an even spread over the sphere: normal quantiles of a sequence whose steps are powers of one irrational number.
fn direction(k: usize, d: usize) -> Vec<f64> {
    // The root of x^(d + 1) = x + 1 spreads points evenly in d dimensions.
    let mut root = 1.5_f64;
    for _ in 0..40 {
        root = libm::pow(1.0 + root, 1.0 / (d + 1) as f64);
    }
    let v: Vec<f64> = (1..=d)
        .map(|i| probit(((k + 1) as f64 * libm::pow(root, -(i as f64))).fract().clamp(1e-6, 1.0 - 1e-6)))
        .collect();
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 { v.iter().map(|x| x / length).collect() } else { vec![libm::cos(TAU * k as f64); d] }
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
    fn pairs(&self, proposals: &[(usize, usize)]) -> Vec<Pair> {
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
    fn score(&self, proposals: &[(usize, usize)]) -> Result<(f64, f64), FitError> {
        let [target, database] = &self.some;
        let (tps, _) = fit(&self.pairs(proposals), self.d, Stiffness::Lambda(self.lambda))?;
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

/// Proposes correspondences, best first, until one more brings the worlds less than 1 % nearer. Nothing is applied.
///
/// # Shapes
/// `target` and `database`: `[units, d]`; `segments` are the gap-free stretches of the database.
///
/// # Errors
/// As [`fit`]: numbers that are not finite.
///
/// # Complexity
/// O(most^2) per round of transport, of which there are at most 300, and count^2 / 2 fits of up to count windows.
pub fn suggest(
    target: &[f32],
    database: &[f32],
    segments: &[Range<usize>],
    d: usize,
    p: &SuggestParams,
) -> Result<Vec<Proposal>, FitError> {
    let whole = 0..target.len() / d.max(1);
    let (ours, theirs) =
        (windows(target, std::slice::from_ref(&whole), d, p), windows(database, segments, d, p));
    if ours.is_empty() || theirs.is_empty() {
        return Ok(Vec::new());
    }
    let (from, to) = (ranked(&ours, d), ranked(&theirs, d));
    let goals = transported(&from, &to);
    let mut open: Vec<Proposal> = farthest(&ours, &from, p.count)
        .into_iter()
        .map(|k| {
            let mut near: Vec<usize> = (0..theirs.len()).collect();
            near.sort_by(|a, b| squared(&to[*a], &goals[k]).total_cmp(&squared(&to[*b], &goals[k])));
            let best = near[0];
            let mut used = vec![theirs[best].segment];
            let mut alternatives = Vec::new();
            for other in near {
                if alternatives.len() < 2 && !used.contains(&theirs[other].segment) {
                    used.push(theirs[other].segment);
                    alternatives.push(theirs[other].start);
                }
            }
            Proposal { target: ours[k].start, database: theirs[best].start, alternatives, gain: 0.0 }
        })
        .collect();
    let some = [thinned(target, d, 1500), thinned(database, d, 1500)];
    let worlds = Worlds { target, database, d, window: p.window, lambda: p.lambda, some };
    let mut listed: Vec<Proposal> = Vec::new();
    let start = worlds.score(&[])?.0;
    let (mut now, mut place) = (start, listed.len());
    // Silence is always offered first.
    while !open.is_empty() {
        let candidates = if place == 0 { 0..1 } else { 0..open.len() };
        let mut best: Option<(usize, f64, f64)> = None;
        for k in candidates {
            let with: Vec<(usize, usize)> =
                listed.iter().chain(std::iter::once(&open[k])).map(|p| (p.target, p.database)).collect();
            let (distance, folds) = worlds.score(&with)?;
            let score = distance + 0.1 * folds * start;
            if best.is_none_or(|(_, least, _)| score < least) {
                best = Some((k, score, distance));
            }
        }
        let Some((k, _, distance)) = best else { break };
        let gain = (now - distance) / start.max(f64::MIN_POSITIVE);
        if place > 1 && gain < 0.01 {
            break;
        }
        let proposal = open.remove(k);
        listed.push(Proposal { gain, ..proposal });
        (now, place) = (distance, listed.len());
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
        let found = suggest(&target, &database, &segments, 3, &p).unwrap();
        assert!(found.len() >= 3 && found.iter().all(|p| p.alternatives.len() == 1), "{found:?}");
        let quiet = found[0].target;
        assert!(target[3 * quiet] < -18.0, "silence is offered first");
        let left = [1e2, 1e3, 1e4].map(|lambda| {
            let some = [target.clone(), database.clone()];
            let worlds = Worlds { target: &target, database: &database, d: 3, window: 24, lambda, some };
            let with: Vec<_> = found.iter().map(|p| (p.target, p.database)).collect();
            worlds.score(&with).unwrap().0
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
        let of = |x: &[f32]| ranked(&windows(x, std::slice::from_ref(&(0..600)), 3, &p), 3);
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
        assert_eq!(suggest(&[0.0; 30], &[0.0; 300], std::slice::from_ref(&(0..100)), 3, &p), Ok(vec![]));
        let found = suggest(&[0.0; 300], &[1.0; 300], std::slice::from_ref(&(0..100)), 3, &p).unwrap();
        assert!(found.len() <= 1, "all alike: {found:?}");
    }
}
