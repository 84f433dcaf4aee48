//! Windows of target and database on a common scale: ranks of their features, shares of their causes.

use std::ops::Range;

use super::normal_quantile::probit;
use super::params::{Cause, SuggestParams};
use crate::statistics::{Points, squared};

/// Maximum number of windows of either side; more are thinned out evenly first.
const MAX_WINDOWS: usize = 20_000;
/// Distance of two windows without common causes, relative to a spread of ranks of 1.
const CAUSE_DISTANCE: f64 = 2.0;

/// A stretch of units with the mean and the spread of its features.
#[derive(Clone, Debug)]
pub(super) struct Window {
    pub start: usize,
    pub segment: usize,
    mean: Vec<f64>,
    variance: f64,
    /// Minimum of the first feature.
    pub min_loudness: f64,
}

impl Window {
    /// Mean of the first feature, that of loudness.
    pub fn loudness(&self) -> f64 {
        self.mean.first().copied().unwrap_or(0.0)
    }
}

/// Windows of all segments, at most [`MAX_WINDOWS`].
pub(super) fn windows(
    features: &[f32],
    segments: &[Range<usize>],
    d: usize,
    p: &SuggestParams,
) -> Vec<Window> {
    let mut all = Vec::new();
    for (segment, units) in segments.iter().enumerate() {
        for start in units.clone().step_by(p.hop.max(1)).take_while(|start| start + p.window <= units.end) {
            let rows = features.get(start * d..(start + p.window) * d).unwrap_or_default();
            let mut mean = vec![0.0; d];
            let (mut square, mut min_loudness) = (0.0, f64::INFINITY);
            for row in rows.chunks_exact(d) {
                min_loudness = row.first().map_or(min_loudness, |x| min_loudness.min(f64::from(*x)));
                for (m, x) in mean.iter_mut().zip(row) {
                    *m += f64::from(*x) / p.window as f64;
                    square += f64::from(*x).powi(2) / p.window as f64;
                }
            }
            let variance = (square - mean.iter().map(|m| m * m).sum::<f64>()).max(0.0);
            all.push(Window { start, segment, mean, variance, min_loudness });
        }
    }
    let count = all.len().min(MAX_WINDOWS);
    (0..count).map(|k| all[k * all.len() / count.max(1)].clone()).collect()
}

/// Each dimension by the normal quantile of its rank, ties at their middle; no monotone distortion changes it.
pub(super) fn ranked(windows: &[Window], d: usize, causes: usize) -> Points {
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

/// Adds the shares of causes to windows of both sides; segments of unknown cause lie in the middle of the target's.
pub(super) fn add_causes(
    causes: &[Cause],
    d: usize,
    window: usize,
    target_windows: (&[Window], &mut Points),
    database_windows: (&[Window], &mut Points),
) {
    let power = |cause: &Cause, start: usize| -> f64 { cause.power.iter().skip(start).take(window).sum() };
    let most: f64 = causes.iter().flat_map(|cause| &cause.power).fold(0.0, |most, x| most.max(*x));
    for (c, cause) in causes.iter().enumerate() {
        let dims = target_windows.1.dims;
        let mut sum = 0.0;
        for (w, at) in target_windows.0.iter().zip(target_windows.1.at.chunks_exact_mut(dims)) {
            let all: f64 = causes.iter().map(|cause| power(cause, w.start)).sum();
            // A unit 100 dB below the loudest one has no cause.
            let share = if all > 1e-10 * most * window as f64 { power(cause, w.start) / all } else { 0.0 };
            sum += share;
            at[d + c] = CAUSE_DISTANCE * share;
        }
        let mean = sum / target_windows.0.len().max(1) as f64;
        for (w, at) in database_windows.0.iter().zip(database_windows.1.at.chunks_exact_mut(dims)) {
            let known = cause.segments.get(w.segment).copied().flatten();
            at[d + c] = CAUSE_DISTANCE * known.map_or(mean, |of_this| f64::from(u8::from(of_this)));
        }
    }
}

/// Points that lie far from each other, the quietest first; steady ones are preferred.
pub(super) fn farthest_points(windows: &[Window], at: &Points, count: usize) -> Vec<usize> {
    let n = windows.len();
    let mean = windows.iter().map(|w| w.variance).sum::<f64>() / n.max(1) as f64;
    let steady = |k: usize| 1.0 / (1.0 + windows[k].variance / mean.max(1e-12));
    let Some(first) = (0..n).min_by(|a, b| windows[*a].loudness().total_cmp(&windows[*b].loudness())) else {
        return Vec::new();
    };
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
