//! Clusters of similar grains, each replaced by its leader.

use super::similarity::SimilarPair;
use crate::grain::correlation::{CorrelationPatterns, Pattern, Peak, stored_correlation, stored_gain};
use crate::grain::dictionary::GrainDictionary;

/// The grain that replaces another, with its shift and gain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Substitute {
    /// Index of the grain that replaces it; its own if it is the leader of its cluster.
    pub grain: u32,
    /// Samples by which the window of that grain begins later.
    pub lag: i32,
    /// Factor on that grain, with its sign, for the least error.
    pub gain: f32,
    /// Normalised cross-correlation of both at the lag, without the sign.
    pub correlation: f32,
}

/// Correlation that counts as 1: copies at any gain.
const IDENTICAL: f64 = 1.0 - 1e-6;

/// Finds the leader of each grain: grains that patterns use most come first, and each joins the leader that correlates most with it, by at
/// least `merge`, or leads a cluster of its own. A `merge` of 1 joins scaled copies only.
///
/// `norms` are those of the grains, `pairs` as of [`similar_pairs`](super::similar_pairs).
///
/// The error of each substitution is `sqrt(1 - c^2)` of the norm of the grain, with `c` the correlation.
///
/// # Complexity
/// O(grains log grains + pairs).
#[must_use]
pub fn substitutes(
    norms: &[f64],
    pairs: &[SimilarPair],
    patterns: &CorrelationPatterns,
    merge: f64,
) -> Vec<Substitute> {
    let mut uses = vec![0_u32; norms.len()];
    for peak in patterns.patterns.iter().flat_map(|pattern| &pattern.peaks) {
        if let Some(uses) = uses.get_mut(peak.grain as usize) {
            *uses += 1;
        }
    }
    let mut order: Vec<u32> = (0..norms.len() as u32).collect();
    order.sort_by(|a, b| {
        let (a_norm, b_norm) = (norms[*a as usize], norms[*b as usize]);
        uses[*b as usize].cmp(&uses[*a as usize]).then(b_norm.total_cmp(&a_norm)).then(a.cmp(b))
    });
    let mut similar: Vec<Vec<(u32, i32, f32)>> = vec![Vec::new(); norms.len()];
    for SimilarPair { grains: [a, b], lag, correlation } in pairs {
        similar[*a as usize].push((*b, *lag, *correlation));
        similar[*b as usize].push((*a, -lag, *correlation));
    }
    let limit = merge.min(IDENTICAL) as f32;
    let own = |grain: u32| Substitute { grain, lag: 0, gain: 1.0, correlation: 1.0 };
    let mut all: Vec<Option<Substitute>> = vec![None; norms.len()];
    for grain in order {
        let leads = |other: u32| all[other as usize].is_some_and(|s| s.grain == other);
        let good = similar[grain as usize].iter().filter(|(other, _, c)| c.abs() >= limit && leads(*other));
        let best = good.max_by(|x, y| x.2.abs().total_cmp(&y.2.abs()).then(y.0.cmp(&x.0)));
        let substitute = best.map(|(leader, lag, c)| Substitute {
            grain: *leader,
            lag: *lag,
            gain: (f64::from(*c) * norms[grain as usize] / norms[*leader as usize].max(f64::MIN_POSITIVE))
                as f32,
            correlation: c.abs(),
        });
        all[grain as usize] = Some(substitute.unwrap_or_else(|| own(grain)));
    }
    all.into_iter().enumerate().map(|(k, s)| s.unwrap_or_else(|| own(k as u32))).collect()
}

/// A dictionary of fewer grains, and the patterns over it.
#[derive(Clone, Debug, PartialEq)]
pub struct Reduced {
    /// The grains that are left.
    pub dictionary: GrainDictionary,
    /// The patterns.
    pub patterns: CorrelationPatterns,
}

impl Reduced {
    /// Patterns with other peaks over a smaller dictionary.
    pub(super) fn new(
        dictionary: GrainDictionary,
        patterns: &CorrelationPatterns,
        peaks: impl Fn(&GrainDictionary, &Pattern) -> Vec<Peak>,
    ) -> Self {
        let rewritten = |pattern: &Pattern| {
            let mut new = Pattern { peaks: peaks(&dictionary, pattern), ..pattern.clone() };
            new.sort();
            new
        };
        let patterns = CorrelationPatterns {
            dictionary: dictionary.id(),
            patterns: patterns.patterns.iter().map(rewritten).collect(),
            ..*patterns
        };
        Self { dictionary, patterns }
    }
}

/// New index of each retained grain.
pub(super) fn renumbered(retained: &[bool]) -> Vec<Option<u32>> {
    let mut next = 0;
    let number = |is_retained: &bool| {
        is_retained.then(|| {
            next += 1;
            next - 1
        })
    };
    retained.iter().map(number).collect()
}

/// Removes all but the best of the peaks of one grain that lie within half of it.
fn without_doubles(peaks: Vec<Peak>, dictionary: &GrainDictionary) -> Vec<Peak> {
    let mut order: Vec<usize> = (0..peaks.len()).collect();
    order.sort_by_key(|k| (peaks[*k].grain, peaks[*k].t));
    let mut dropped = vec![false; order.len()];
    for same in order.chunk_by(|a, b| peaks[*a].grain == peaks[*b].grain) {
        let grain = dictionary.grains.get(peaks[same[0]].grain as usize);
        let apart = grain.map_or(1, |g| g.window_len() as u32 / 2).max(1);
        let mut last: Option<usize> = None;
        for k in same {
            let near = last.filter(|l| peaks[*k].t - peaks[*l].t < apart);
            match near {
                Some(l) if peaks[*k].correlation <= peaks[l].correlation => dropped[*k] = true,
                Some(l) => (dropped[l], last) = (true, Some(*k)),
                None => last = Some(*k),
            }
        }
    }
    peaks.into_iter().zip(dropped).filter(|(_, dropped)| !dropped).map(|(peak, _)| peak).collect()
}

/// Replaces each grain by its leader, in the dictionary, which retains `margin` samples around each leader, and in the patterns.
///
/// Patterns of another dictionary are not valid here: check them before.
#[must_use]
pub fn merged(
    dictionary: &GrainDictionary,
    patterns: &CorrelationPatterns,
    substitutes: &[Substitute],
    margin: usize,
) -> Reduced {
    let retained: Vec<bool> = substitutes.iter().enumerate().map(|(k, s)| s.grain as usize == k).collect();
    let reduced =
        if retained.iter().all(|r| *r) { dictionary.clone() } else { dictionary.subset(&retained, margin) };
    let index = renumbered(&retained);
    let replaced = |dictionary: &GrainDictionary, pattern: &Pattern, peak: &Peak| {
        let substitute = substitutes.get(peak.grain as usize)?;
        let grain = (*index.get(substitute.grain as usize)?)?;
        if substitute.grain == peak.grain {
            return Some(Peak { grain, ..*peak });
        }
        let last = pattern.frames as i64 - dictionary.grains.get(grain as usize)?.window_len() as i64;
        let gain = f64::from(peak.gain) * f64::from(substitute.gain.abs());
        let t = (i64::from(peak.t) + i64::from(substitute.lag)).min(last).max(0) as u32;
        (last >= 0).then(|| Peak {
            t,
            grain,
            correlation: stored_correlation(f64::from(peak.correlation * substitute.correlation)),
            gain: stored_gain(gain),
            negative: peak.negative != (substitute.gain < 0.0),
        })
    };
    Reduced::new(reduced, patterns, |dictionary, pattern| {
        let peaks = pattern.peaks.iter().filter_map(|peak| replaced(dictionary, pattern, peak)).collect();
        // The grains of a sequence are all played.
        if pattern.is_sequence { peaks } else { without_doubles(peaks, dictionary) }
    })
}

#[cfg(test)]
mod tests;
