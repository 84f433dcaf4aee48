//! The best grains for each part of each recording.

use super::bounds::{SEGMENT, SegmentBands};
use super::normaliser::Normaliser;
use super::patterns::{
    CorrelationPatterns, PATTERNS_VERSION, Pattern, Peak, stored_correlation, stored_gain,
};
use super::peaks::{GrainCorrelation, Scores, Transforms, segment_errors};
use super::transform::{Blocks, best_size};
use crate::core::computation::Partial;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::{Component, GrainRecording, GrainRecordings, Part};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

/// Peaks that are retained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retention {
    /// The best peaks in each interval, which is as long as a mean grain less half of its tapers.
    PerInterval(usize),
    /// The best peaks of each recording.
    Largest(usize),
}

/// Rules of a correlation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrelateRules {
    /// Peaks that are retained.
    pub retain: Retention,
    /// Smallest correlation of a peak.
    pub min: f64,
    /// Divide by the norm of the whole recording in place of that of each window.
    pub global: bool,
    /// Take peaks of the magnitude, with their sign.
    pub absolute: bool,
    /// Level below which a window has no correlation, dB relative to the peak of the recording.
    pub floor: f64,
    /// Correlate steady parts with transient grains and vice versa.
    pub cross_component: bool,
    /// Leave out transforms of blocks where the energies of bands of frequencies show that no peak is retained. The result is the same.
    pub prune: bool,
}

impl Default for CorrelateRules {
    fn default() -> Self {
        Self {
            retain: Retention::PerInterval(4),
            min: 0.05,
            global: false,
            absolute: false,
            floor: -70.0,
            cross_component: false,
            prune: true,
        }
    }
}

/// Outputs that are computed together: the correlation of a grain with them fits into the cache of a core.
const SECTION: usize = 1 << 18;
/// Grains between two reports of progress.
const GRAINS_AT_ONCE: usize = 256;
/// Difference of correlations below which both are recomputed in double precision.
const NEAR: f64 = 1e-5;

/// A peak before it is computed in double precision.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    slot: u32,
    t: u32,
    grain: u32,
    c: f32,
    error: f32,
}

/// Best correlations of each interval so far, from all threads.
struct Slots {
    interval: f64,
    per_slot: usize,
    best: Vec<Mutex<BinaryHeap<Reverse<u32>>>>,
    /// Bits of the smallest of the best, or of 0.
    least: Vec<AtomicU32>,
}

impl Slots {
    fn new(frames: usize, interval: f64, per_slot: usize) -> Self {
        let count = (frames as f64 / interval).floor() as usize + 1;
        Self {
            interval,
            per_slot: per_slot.max(1),
            best: (0..count).map(|_| Mutex::default()).collect(),
            least: (0..count).map(|_| AtomicU32::new(0)).collect(),
        }
    }

    fn slot(&self, t: usize) -> usize {
        ((t as f64 / self.interval) as usize).min(self.least.len() - 1)
    }

    /// Threshold that as many peaks of a slot exceed as are retained. It only rises.
    fn least(&self, slot: usize) -> f64 {
        f64::from(f32::from_bits(self.least[slot].load(Ordering::Relaxed)))
    }

    /// The smallest threshold of the slots of a range of samples.
    fn least_of(&self, range: Range<usize>) -> f64 {
        let slots = self.slot(range.start)..=self.slot(range.end.max(range.start + 1) - 1);
        slots.map(|slot| self.least(slot)).fold(f64::INFINITY, f64::min)
    }

    /// Adds a correlation, which is at least 0: bits of such numbers are ordered as they are.
    fn add(&self, slot: usize, c: f32) {
        let Ok(mut best) = self.best[slot].lock() else { return };
        best.push(Reverse(c.max(0.0).to_bits()));
        if best.len() > self.per_slot {
            best.pop();
        }
        if best.len() == self.per_slot
            && let Some(Reverse(bits)) = best.peek()
        {
            self.least[slot].fetch_max(*bits, Ordering::Relaxed);
        }
    }
}

/// A grain as it is correlated.
struct Shape {
    grain: u32,
    samples: Vec<f32>,
    norm: f64,
}

/// Grains that share the size of their transforms.
struct Bucket {
    size: usize,
    max_len: usize,
    shapes: Vec<Shape>,
}

fn buckets(shapes: Vec<Shape>) -> Vec<Bucket> {
    let mut buckets: Vec<Bucket> = Vec::new();
    for shape in shapes {
        let size = best_size(shape.samples.len());
        let bucket = match buckets.iter().position(|b| b.size == size) {
            Some(k) => &mut buckets[k],
            None => {
                buckets.push(Bucket { size, max_len: 0, shapes: Vec::new() });
                let last = buckets.len() - 1;
                &mut buckets[last]
            }
        };
        bucket.max_len = bucket.max_len.max(shape.samples.len());
        bucket.shapes.push(shape);
    }
    buckets
}

/// Progress of a correlation: products of outputs and grains.
struct Progress<'a> {
    done: f64,
    total: f64,
    stop: &'a dyn Fn(f64) -> bool,
}

impl Progress<'_> {
    fn add(&mut self, work: f64) -> bool {
        self.done += work;
        (self.stop)((self.done / self.total.max(1.0)).min(1.0))
    }
}

/// Candidates of all grains of one bucket in one recording; `None` if it was stopped.
fn search(
    x: &[f32],
    bucket: &Bucket,
    normaliser: &Normaliser,
    slots: &Slots,
    rules: &CorrelateRules,
    progress: &mut Progress<'_>,
) -> Option<Vec<Candidate>> {
    let mut all = Vec::new();
    for start in (0..x.len()).step_by(SECTION) {
        let end = (start + SECTION).min(x.len());
        // Peaks near the ends of a section are compared with those beyond.
        let first = start.saturating_sub(2 * bucket.max_len);
        let last = (end + 2 * bucket.max_len).min(x.len());
        let samples = &x[first..(last + bucket.max_len - 1).min(x.len())];
        let outputs = last - first;
        let blocks = Blocks::new(samples, outputs, bucket.max_len, bucket.size);
        let bounds: Option<Vec<Vec<f32>>> = rules.prune.then(|| {
            let bands = SegmentBands::new(samples, outputs, bucket.max_len);
            let errors = segment_errors(&blocks, outputs);
            let of_shape = |buffers: &mut _, shape: &Shape| {
                bands.bounds(&shape.samples, shape.norm, normaliser, first, &errors, buffers)
            };
            bucket.shapes.par_iter().map_init(|| bands.buffers(), of_shape).collect()
        });
        // Grains that may correlate best come first: they raise the least correlation that is retained.
        let mut order: Vec<usize> = (0..bucket.shapes.len()).collect();
        if let Some(bounds) = &bounds {
            let total: Vec<f32> = bounds.iter().map(|of| of.iter().sum()).collect();
            order.sort_by(|a, b| total[*b].total_cmp(&total[*a]));
        }
        for shapes in order.chunks(GRAINS_AT_ONCE) {
            let found: Vec<Vec<Candidate>> = shapes
                .par_iter()
                .map_init(
                    || (blocks.buffers(), Vec::new(), Scores::default()),
                    |(buffers, y, scores), shape| {
                        let bounds = bounds.as_ref().map_or(&[][..], |bounds| &bounds[*shape]);
                        let shape = &bucket.shapes[*shape];
                        let len = shape.samples.len();
                        if len > x.len() || shape.norm <= 0.0 {
                            return Vec::new();
                        }
                        blocks.transform(&shape.samples, buffers);
                        // Only whole windows count.
                        y.resize(outputs.min((x.len() - len + 1).saturating_sub(first)), 0.0);
                        let mut correlation = GrainCorrelation::new(
                            y,
                            first,
                            (len, shape.norm),
                            normaliser,
                            rules.absolute,
                            Some(Transforms { blocks: &blocks, buffers, bounds }),
                            scores,
                        );
                        candidates(&mut correlation, start..end, shape.grain, slots, rules)
                    },
                )
                .collect();
            all.extend(found.into_iter().flatten());
            if progress.add((end - start) as f64 * shapes.len() as f64) {
                return None;
            }
        }
    }
    Some(all)
}

/// Peaks of one grain that may be among the best of their intervals.
fn candidates(
    correlation: &mut GrainCorrelation<'_>,
    section: Range<usize>,
    grain: u32,
    slots: &Slots,
    rules: &CorrelateRules,
) -> Vec<Candidate> {
    let mut found = Vec::new();
    let least = |range: Range<usize>| (slots.least_of(range) - NEAR).max(rules.min);
    let apart = correlation.len / 2;
    correlation.taken(section, apart, least, |correlation, t, c| {
        let (slot, error) = (slots.slot(t), correlation.error(t) + NEAR);
        slots.add(slot, (c - error) as f32);
        found.push(Candidate { slot: slot as u32, t: t as u32, grain, c: c as f32, error: error as f32 });
    });
    found
}

/// Correlation in double precision: the greatest at `t` and beside it.
fn exact(
    x: &[f32],
    g: &[f32],
    norm: f64,
    t: usize,
    rules: &CorrelateRules,
    normaliser: &Normaliser,
) -> (usize, f64) {
    let at = |t: usize| -> Option<f64> {
        let window = x.get(t..t + g.len())?;
        let dot: f64 = window.iter().zip(g).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
        Some(dot / (norm * normaliser.norm(t, g.len())?))
    };
    let value = |c: f64| if rules.absolute { c.abs() } else { c };
    let near = [t, t.saturating_sub(1), t + 1].into_iter().filter_map(|t| at(t).map(|c| (t, c)));
    near.max_by(|a, b| value(a.1).total_cmp(&value(b.1)).then(b.0.cmp(&a.0))).unwrap_or((t, 0.0))
}

/// The best peaks of each slot.
fn select(
    mut candidates: Vec<Candidate>,
    x: &[f32],
    dictionary: &GrainDictionary,
    slots: &Slots,
    normaliser: &Normaliser,
    rules: &CorrelateRules,
) -> Vec<Peak> {
    candidates.retain(|c| f64::from(c.c + c.error) >= slots.least(c.slot as usize));
    candidates.sort_by_key(|c| (c.slot, c.grain, c.t));
    let of_slot: Vec<&[Candidate]> = candidates.chunk_by(|a, b| a.slot == b.slot).collect();
    let peaks = |group: &&[Candidate]| {
        let mut exact_peaks: Vec<(f64, u32, u32, bool)> = Vec::with_capacity(group.len());
        for same in group.chunk_by(|a, b| a.grain == b.grain) {
            let Some(grain) = dictionary.grains.get(same[0].grain as usize) else { continue };
            let g = dictionary.windowed(grain);
            let norm = g.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
            for c in same {
                let (t, value) = exact(x, &g, norm, c.t as usize, rules, normaliser);
                exact_peaks.push((value.abs(), c.grain, t as u32, value < 0.0));
            }
        }
        exact_peaks.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        exact_peaks.dedup_by_key(|p| (p.1, p.2));
        exact_peaks.truncate(slots.per_slot);
        exact_peaks
            .into_iter()
            .filter(|p| p.0 >= rules.min)
            .map(|(c, grain, t, negative)| {
                let (found, at) = (&dictionary.grains[grain as usize], t as usize);
                let window = dictionary.window(found);
                let gain = f64::from(found.gain);
                let samples = x.get(at..at + found.window_len()).unwrap_or_default();
                let power = gain * gain * Normaliser::weighted_power(samples, window);
                let gain = (power / f64::from(found.power).max(1e-30)).sqrt();
                Peak { t, grain, correlation: stored_correlation(c), gain: stored_gain(gain), negative }
            })
            .collect::<Vec<Peak>>()
    };
    of_slot.par_iter().flat_map_iter(peaks).collect()
}

/// Memory of [`correlate`] beside its inputs, in bytes, known before it begins.
#[must_use]
pub fn memory(dictionary: &GrainDictionary, longest: usize, threads: usize) -> usize {
    let max_len = dictionary.grains.iter().map(|g| g.window_len()).max().unwrap_or(0);
    let outputs = SECTION.min(longest) + 4 * max_len;
    let size = best_size(max_len);
    let grains: usize = dictionary.grains.iter().map(|g| 4 * g.window_len()).sum();
    let bounds = dictionary.grains.len() * 4 * outputs.div_ceil(SEGMENT);
    bounds
        + Blocks::bytes(outputs, max_len, size)
        + threads * (9 * outputs + 24 * size)
        + 8 * longest
        + grains
}

/// The patterns of the first parts, if an interrupted computation stored them.
fn resumed(parts: &[(&GrainRecording, &Part)], partial: &dyn Partial) -> Vec<Pattern> {
    let found: Option<Vec<Pattern>> = partial.load().and_then(|bytes| postcard::from_bytes(&bytes).ok());
    let fits = |(pattern, (recording, part)): (&Pattern, &(&GrainRecording, &Part))| {
        let same = pattern.name == recording.name && pattern.component == part.component;
        same && pattern.frames == recording.len() as u64
    };
    let is_of = |all: &Vec<Pattern>| all.len() <= parts.len() && all.iter().zip(parts).all(fits);
    found.filter(is_of).unwrap_or_default()
}

/// Finds the occurrences of the grains of a dictionary in recordings: peaks of the normalised cross-correlation
///
/// `C(t) = sum_n x[t + n] g[n] / (|g| |x[t .. t + L]|)`,
///
/// at least half a grain apart for each grain. The best of all grains in each interval, or in each recording, are retained. The result does
/// not depend on the number of threads. `stop` receives the share of the work that is done, and returns true to stop: then the result is
/// `None`. Finished patterns are passed to `partial`, and the search continues after those that it contains.
///
/// # Complexity
/// At most one inverse transform for each grain and each block of a recording; [`memory`] states the memory. Peaks are compared over sections of
/// 262,144 samples and two grains beyond.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), sections 3.3 and 5.1.
#[must_use]
pub fn correlate(
    recordings: &GrainRecordings,
    dictionary: &GrainDictionary,
    rules: &CorrelateRules,
    stop: &dyn Fn(f64) -> bool,
    partial: &dyn Partial,
) -> Option<CorrelationPatterns> {
    let parts: Vec<(&GrainRecording, &Part)> =
        recordings.recordings.iter().flat_map(|r| r.parts.iter().map(move |part| (r, part))).collect();
    let fits = |component: Component, grain: &crate::grain::Grain| {
        rules.cross_component || dictionary.source(grain).is_some_and(|s| s.component == component)
    };
    let work = |(recording, part): &(&GrainRecording, &Part)| {
        recording.len() as f64 * dictionary.grains.iter().filter(|g| fits(part.component, g)).count() as f64
    };
    let mut progress = Progress { done: 0.0, total: parts.iter().map(work).sum(), stop };
    let interval = {
        let share = dictionary.grains.iter().map(|g| f64::from(g.taper[0] + g.taper[1])).sum::<f64>()
            / dictionary.grains.iter().map(|g| g.window_len() as f64).sum::<f64>().max(1.0);
        (dictionary.mean_len() * (1.0 - 0.5 * share)).max(1.0)
    };
    let mut by_component: Vec<(Component, Vec<Bucket>)> = Vec::new();
    let mut patterns = resumed(&parts, partial);
    progress.done = parts.iter().take(patterns.len()).map(work).sum();
    for (recording, part) in parts.into_iter().skip(patterns.len()) {
        if !by_component.iter().any(|(c, _)| *c == part.component) {
            let grains = dictionary.grains.iter().enumerate().filter(|(_, g)| fits(part.component, g));
            let shapes = grains.map(|(k, g)| {
                let samples = dictionary.windowed(g);
                let norm = samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
                Shape { grain: k as u32, samples, norm }
            });
            by_component.push((part.component, buckets(shapes.collect())));
        }
        let all = by_component.iter().find(|(c, _)| *c == part.component).map(|(_, b)| b.as_slice());
        let x = part.mono();
        let normaliser = Normaliser::new(&x, rules.floor, rules.global);
        let slots = match rules.retain {
            Retention::PerInterval(count) => Slots::new(x.len(), interval, count),
            Retention::Largest(0) => Slots::new(
                x.len(),
                f64::MAX,
                8 * (x.len() as f64 / dictionary.mean_len().max(1.0)).ceil() as usize,
            ),
            Retention::Largest(count) => Slots::new(x.len(), f64::MAX, count),
        };
        let mut candidates = Vec::new();
        for bucket in all.unwrap_or_default() {
            let Some(found) = search(&x, bucket, &normaliser, &slots, rules, &mut progress) else {
                partial.offer(&|| postcard::to_allocvec(&patterns).ok());
                return None;
            };
            candidates.extend(found);
        }
        let mut pattern = Pattern {
            name: recording.name.clone(),
            licence: recording.licence.clone(),
            tags: recording.tags.clone(),
            kind: recording.kind,
            component: part.component,
            speed: recording.speed,
            frames: x.len() as u64,
            is_sequence: false,
            peaks: select(candidates, &x, dictionary, &slots, &normaliser, rules),
        };
        pattern.sort();
        patterns.push(pattern);
        partial.offer(&|| postcard::to_allocvec(&patterns).ok());
    }
    Some(CorrelationPatterns {
        version: PATTERNS_VERSION,
        rate: dictionary.rate,
        dictionary: dictionary.id(),
        patterns,
    })
}

#[cfg(test)]
mod tests;
