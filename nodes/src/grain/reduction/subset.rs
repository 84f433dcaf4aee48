//! Grains under a budget of memory.

use super::clusters::{Reduced, renumbered};
use crate::grain::correlation::{CorrelationPatterns, Pattern, Peak};
use crate::grain::dictionary::GrainDictionary;
use crate::grain::synthesis::{GapRule, walk};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Greatest signal-to-noise ratio that counts, dB, as in segmental signal-to-noise ratios.
const BEST_RATIO: f64 = 35.0;

/// Signal-to-noise ratio, in dB, of a passage in which a grain explains the share `c^2` of the energy.
fn ratio_of(c: f64) -> f64 {
    (-10.0 * (1.0 - c * c).max(1e-30).log10()).min(BEST_RATIO)
}

/// A passage of a recording, with the grains that can play it.
struct Slot {
    /// Samples of the passage.
    len: f64,
    /// Grains and the signal-to-noise ratio of each, dB; the best first.
    candidates: Vec<(u32, f64)>,
}

/// The passages of the grains of a walk, and the grains that begin within half a grain of each.
fn slots_of(pattern: &Pattern, dictionary: &GrainDictionary) -> Vec<Slot> {
    let begins = |t: i64| pattern.peaks.partition_point(|peak| i64::from(peak.t) < t);
    let slot = |step: &crate::grain::synthesis::GrainStep| {
        let len = dictionary.grains.get(step.grain as usize).map_or(1, |g| i64::from(g.len));
        let near = begins(step.t - len / 2)..begins(step.t + len / 2 + 1);
        let near = pattern.peaks.get(near).unwrap_or_default();
        let mut candidates: Vec<(u32, f64)> =
            near.iter().map(|peak| (peak.grain, ratio_of(peak.correlation.into()))).collect();
        candidates.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        candidates.dedup_by_key(|c| c.0);
        candidates.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        Slot { len: len as f64, candidates }
    };
    walk(pattern, dictionary, GapRule::Extend).iter().map(slot).collect()
}

/// A grain that may be added, by its gain for its bytes.
#[derive(PartialEq)]
struct Offer {
    value: f64,
    grain: usize,
}

impl Eq for Offer {}

impl Ord for Offer {
    fn cmp(&self, other: &Self) -> Ordering {
        self.value.total_cmp(&other.value).then(other.grain.cmp(&self.grain))
    }
}

impl PartialOrd for Offer {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Bytes of the retained grains of each run.
struct Bytes<'a> {
    dictionary: &'a GrainDictionary,
    margin: usize,
    /// Grains of each run in order of time.
    of_run: Vec<Vec<usize>>,
    of_runs: Vec<usize>,
}

impl<'a> Bytes<'a> {
    fn new(dictionary: &'a GrainDictionary, margin: usize) -> Self {
        let of_run = dictionary.grains_of_runs();
        let of_runs = vec![0; of_run.len()];
        Self { dictionary, margin, of_run, of_runs }
    }

    /// Bytes of a run if one more grain is retained.
    fn with(&self, retained: &[bool], grain: usize) -> usize {
        let index = self.dictionary.grains[grain].run as usize;
        let all = self.of_run[index].iter().copied().filter(|k| retained[*k] || *k == grain);
        self.dictionary.bytes_of(index, all, self.margin)
    }

    /// Bytes that a grain adds.
    fn added(&self, retained: &[bool], grain: usize) -> usize {
        self.with(retained, grain) - self.of_runs[self.dictionary.grains[grain].run as usize]
    }
}

/// Chooses the most useful grains of patterns under a budget in bytes, as counted by [`GrainDictionary::bytes`]: in each step the grain
/// that raises the signal-to-noise ratio of the passages most for its bytes, until none fits.
///
/// The budget is never exceeded. Patterns for which `chosen` is false do not count.
///
/// # Complexity
/// O(grains log grains) steps; each recounts the bytes of one run.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 5.1: grains
/// under a budget. The greedy choice is that of Nemhauser, Wolsey and Fisher, "An analysis of approximations for maximizing submodular set
/// functions" (Mathematical Programming 14, 1978), by value for bytes.
#[must_use]
pub fn retained_grains(
    dictionary: &GrainDictionary,
    patterns: &CorrelationPatterns,
    chosen: &dyn Fn(&Pattern) -> bool,
    budget: usize,
    margin: usize,
) -> Vec<bool> {
    let slots: Vec<Slot> =
        patterns.patterns.iter().filter(|p| chosen(p)).flat_map(|p| slots_of(p, dictionary)).collect();
    let mut of_grain: Vec<Vec<(usize, f64)>> = vec![Vec::new(); dictionary.len()];
    for (k, slot) in slots.iter().enumerate() {
        slot.candidates.iter().for_each(|(grain, ratio)| of_grain[*grain as usize].push((k, *ratio)));
    }
    let mut best = vec![0.0_f64; slots.len()];
    let mut retained = vec![false; dictionary.len()];
    let mut bytes = Bytes::new(dictionary, margin);
    let offer = |grain: usize, best: &[f64], retained: &[bool], bytes: &Bytes<'_>| {
        let gain: f64 = of_grain[grain].iter().map(|(k, r)| slots[*k].len * (r - best[*k]).max(0.0)).sum();
        Offer { value: gain / bytes.added(retained, grain).max(1) as f64, grain }
    };
    let mut heap: BinaryHeap<Offer> =
        (0..dictionary.len()).map(|k| offer(k, &best, &retained, &bytes)).collect();
    let mut spent = 0;
    while let Some(top) = heap.pop() {
        if retained[top.grain] {
            continue;
        }
        let now = offer(top.grain, &best, &retained, &bytes);
        if now.value <= 0.0 {
            continue;
        }
        if heap.peek().is_some_and(|next| now < *next) && now.value < top.value {
            heap.push(now);
            continue;
        }
        let added = bytes.added(&retained, top.grain);
        if spent + added > budget {
            // A smaller one may fit yet.
            continue;
        }
        let run = dictionary.grains[top.grain].run as usize;
        bytes.of_runs[run] = bytes.with(&retained, top.grain);
        retained[top.grain] = true;
        spent += added;
        of_grain[top.grain].iter().for_each(|(k, r)| best[*k] = best[*k].max(*r));
        // The neighbours cost less now: they share what lies around the cut.
        let all = &bytes.of_run[run];
        let at = all.iter().position(|k| *k == top.grain).unwrap_or(0);
        for near in all[at.saturating_sub(1)..(at + 2).min(all.len())].iter().filter(|k| !retained[**k]) {
            heap.push(offer(*near, &best, &retained, &bytes));
        }
    }
    retained
}

/// The retained grains, with up to `margin` samples around each, and the patterns without the others: passages of grains that are left out
/// fall to the next peak.
#[must_use]
pub fn reduced(
    dictionary: &GrainDictionary,
    patterns: &CorrelationPatterns,
    retained: &[bool],
    margin: usize,
) -> Reduced {
    let index = renumbered(retained);
    Reduced::new(dictionary.subset(retained, margin), patterns, |_, pattern| {
        let peak = |peak: &Peak| Some(Peak { grain: (*index.get(peak.grain as usize)?)?, ..*peak });
        pattern.peaks.iter().filter_map(peak).collect()
    })
}

/// Bytes of the grains for which `retained` is true.
pub(super) fn retained_bytes(dictionary: &GrainDictionary, retained: &[bool], margin: usize) -> usize {
    let of_run = |(run, all): (usize, Vec<usize>)| {
        dictionary.bytes_of(run, all.into_iter().filter(|k| retained[*k]), margin)
    };
    dictionary.grains_of_runs().into_iter().enumerate().map(of_run).sum()
}

#[cfg(test)]
mod tests;
