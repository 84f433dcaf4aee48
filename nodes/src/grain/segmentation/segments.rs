//! Cuts of a recording into grains at the inflection points of its spectral flux.

use crate::choices;
use crate::core::fault::Reject;
use crate::feature::flux::reflected;
use crate::feature::{FluxFrames, ONSET_RISE, onsets, spectral_flux};
use serde::{Deserialize, Serialize};
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

choices! {
    /// Inflection points that become cuts.
    pub enum CutKind {
        /// All of them.
        Both,
        /// Inflection points on rising slopes of the flux.
        Rising,
        /// Inflection points on falling slopes of the flux.
        Falling,
    }
}

/// Rules of a segmentation; lengths in samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentRules {
    /// Sample rate, Hz.
    pub rate: f64,
    /// Frames of the spectral flux.
    pub frames: FluxFrames,
    /// Standard deviation of the Gaussian that smooths the flux, in frames.
    pub sigma: f64,
    /// Shortest grain.
    pub min: usize,
    /// Longest grain.
    pub max: usize,
    /// Inflection points that become cuts.
    pub kind: CutKind,
    /// Rise of the onset strength over its mean that makes an onset.
    pub onset_rise: f64,
}

impl CutKind {
    /// Returns true if an inflection point becomes a cut.
    pub(super) fn takes(self, inflection: &Inflection) -> bool {
        match self {
            Self::Both => true,
            Self::Rising => inflection.rising,
            Self::Falling => !inflection.rising,
        }
    }
}

impl SegmentRules {
    /// The defaults at a rate: grains of 300 to 3000 samples at 44.1 kHz.
    #[must_use]
    pub fn at_rate(rate: f64) -> Self {
        let samples = |n: f64| (n * rate / 44_100.0).round() as usize;
        Self {
            rate,
            frames: FluxFrames::at_rate(rate),
            sigma: 2.0,
            min: samples(300.0),
            max: samples(3000.0),
            kind: CutKind::Both,
            onset_rise: ONSET_RISE,
        }
    }
}

/// Checks that a segment longer than `longest` can be cut into two that are not shorter than `shortest`, both in seconds.
///
/// # Errors
/// F150 at `longest`.
pub(in crate::grain) fn check_lengths(shortest: f64, longest: f64) -> Result<(), Reject> {
    if longest >= 2.0 * shortest {
        return Ok(());
    }
    let message = format!("`longest` is {longest} s, less than twice `shortest`, which is {shortest} s");
    let help = "segments longer than `longest` are cut into two, neither shorter than `shortest`";
    Err(Reject::new("F150", message).at("longest").help(help))
}

/// An inflection point of the smoothed flux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inflection {
    /// Position in frames.
    pub position: f64,
    /// True where the curvature changes from positive to negative.
    pub rising: bool,
}

impl Inflection {
    /// The nearest sample; 0 before the first frame.
    pub(super) fn sample(&self, hop: usize) -> usize {
        ((self.position - 0.5) * hop.max(1) as f64).round().max(0.0) as usize
    }
}

/// The cuts of a recording, with the curves that they follow from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Segments {
    /// Rising sample indices; the first is 0 and the last is the length.
    pub cuts: Vec<usize>,
    /// Samples of onsets.
    pub onsets: Vec<usize>,
    /// Spectral flux.
    pub flux: Vec<f64>,
    /// Smoothed flux.
    pub smooth: Vec<f64>,
}

/// A Gaussian that is truncated at four standard deviations.
pub(super) struct Gaussian {
    weights: Vec<f64>,
    sum: f64,
}

impl Gaussian {
    /// A Gaussian of a standard deviation in items.
    pub(super) fn new(sigma: f64) -> Self {
        let radius = (4.0 * sigma.max(0.0) + 0.5) as i64;
        let distance = |i: i64| if i == 0 { 0.0 } else { i as f64 / sigma };
        let weights: Vec<f64> = (-radius..=radius).map(|i| (-0.5 * distance(i).powi(2)).exp()).collect();
        Self { sum: weights.iter().sum(), weights }
    }

    /// Items on either side of the middle.
    pub(super) fn radius(&self) -> i64 {
        (self.weights.len() / 2) as i64
    }

    /// Weighted mean around item `k` of a sequence, including items beyond its ends.
    pub(super) fn mean(&self, k: i64, item: impl Fn(i64) -> f64) -> f64 {
        (k - self.radius()..).zip(&self.weights).map(|(i, w)| w * item(i)).sum::<f64>() / self.sum
    }
}

/// Smooths a sequence with a Gaussian that is truncated at four standard deviations; ends are reflected.
#[must_use]
pub fn smooth(x: &[f64], sigma: f64) -> Vec<f64> {
    let (gaussian, n) = (Gaussian::new(sigma), x.len() as i64);
    (0..n).map(|k| gaussian.mean(k, |i| x[reflected(i, Some(n)) as usize])).collect()
}

/// Finds inflection points, item by item.
///
/// Second differences below 1e-9 have no sign; a run of them between two signs has its inflection in the middle.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct InflectionFinder {
    /// The latest item with a sign, and its second difference.
    pub(super) latest: Option<(i64, f64)>,
}

impl InflectionFinder {
    /// Takes item `k` with its neighbours.
    pub(super) fn next(&mut self, k: i64, [before, at, after]: [f64; 3]) -> Option<Inflection> {
        const FLAT: f64 = 1e-9;
        let curvature = after - 2.0 * at + before;
        if curvature.abs() < FLAT {
            return None;
        }
        let (j, earlier) = self.latest.replace((k, curvature))?;
        let position =
            if k == j + 1 { j as f64 + earlier / (earlier - curvature) } else { 0.5 * (j + k) as f64 };
        (earlier * curvature < 0.0).then_some(Inflection { position, rising: earlier > 0.0 })
    }
}

/// Returns the inflection points of a smooth sequence, rising in position.
///
/// Second differences below 1e-9 have no sign; a run of them between two signs has its inflection in the middle.
#[must_use]
pub fn inflections(s: &[f64]) -> Vec<Inflection> {
    let mut finder = InflectionFinder::default();
    s.windows(3).zip(1..).filter_map(|(s, k)| finder.next(k, [s[0], s[1], s[2]])).collect()
}

/// A part of a smoothed flux.
#[derive(Clone, Copy, Debug)]
pub(super) struct SmoothFlux<'a> {
    /// Index of the first item.
    pub(super) first: i64,
    /// The items.
    pub(super) items: &'a [f64],
}

impl SmoothFlux<'_> {
    /// An item, or the nearest one of the part.
    fn item(&self, k: i64) -> f64 {
        self.items[(k - self.first).clamp(0, self.items.len() as i64 - 1) as usize]
    }

    /// Absolute slope at a frame, by central differences.
    pub(super) fn slope(&self, position: f64) -> f64 {
        let central = |k: i64| 0.5 * (self.item(k + 1) - self.item(k - 1));
        let (k, part) = (position.floor() as i64, position - position.floor());
        ((1.0 - part) * central(k) + part * central(k + 1)).abs()
    }

    /// The sample at which a segment is cut: the steepest of the frames from `low` to `high`, or of equal ones that nearest `middle`.
    pub(super) fn steepest(&self, [low, high]: [usize; 2], middle: usize, hop: usize) -> Option<usize> {
        // Frames whose time (k - 1/2) hop lies in the interval.
        let frames = (low.div_ceil(hop)..).take_while(|k| k * hop <= high + hop / 2);
        let candidates =
            frames.map(|k| (k * hop).saturating_sub(hop / 2)).filter(|t| (low..=high).contains(t));
        candidates.max_by(|a, b| {
            let value = |t: usize| self.slope(t as f64 / hop as f64 + 0.5);
            let (x, y) = (value(*a), value(*b));
            let order = if (x - y).abs() <= 1e-12 { Ordering::Equal } else { x.total_cmp(&y) };
            order.then_with(|| middle.abs_diff(*b).cmp(&middle.abs_diff(*a)))
        })
    }
}

/// A segment in the order in which short ones are joined: the shortest first, then the earliest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Short {
    len: usize,
    start: usize,
    end: usize,
}

/// Removes cuts until no segment is shorter than `min`: in each step that cut of the shortest segment at which the slope is smaller, or the later one.
///
/// # Complexity
/// O(n log n) for n cuts.
pub(super) fn join_short(len: usize, cuts: &[(usize, f64)], min: usize) -> Vec<usize> {
    let n = cuts.len();
    // Positions with both ends; `before` and `after` are a linked list over them.
    let at = |k: usize| if k == 0 { 0 } else { cuts.get(k - 1).map_or(len, |cut| cut.0) };
    let (mut before, mut after): (Vec<usize>, Vec<usize>) =
        ((0..n + 2).map(|k| k.saturating_sub(1)).collect(), (1..n + 3).collect());
    let mut heap: BinaryHeap<Reverse<(Short, usize, usize)>> = BinaryHeap::new();
    let short = |j: usize, k: usize| (Short { len: at(k) - at(j), start: at(j), end: at(k) }, j, k);
    for k in 0..=n {
        heap.push(Reverse(short(k, k + 1)));
    }
    let mut removed = vec![false; n + 2];
    while let Some(Reverse((segment, j, k))) = heap.pop() {
        if removed[j] || removed[k] || after[j] != k {
            continue;
        }
        if segment.len >= min {
            break;
        }
        let inner = |cut: usize| cut > 0 && cut <= n;
        let cut = match (inner(j), inner(k)) {
            (false, false) => break,
            (true, false) => j,
            (false, true) => k,
            (true, true) => match cuts[j - 1].1.total_cmp(&cuts[k - 1].1) {
                Ordering::Less => j,
                Ordering::Equal | Ordering::Greater => k,
            },
        };
        removed[cut] = true;
        let (left, right) = (before[cut], after[cut]);
        (after[left], before[right]) = (right, left);
        heap.push(Reverse(short(left, right)));
    }
    (1..=n).filter(|k| !removed[*k]).map(at).collect()
}

/// Cuts a recording of `len` samples whose smoothed flux is `s`.
#[must_use]
pub fn cuts(s: &[f64], len: usize, rules: &SegmentRules) -> Vec<usize> {
    if s.is_empty() {
        return vec![0, len];
    }
    let s = SmoothFlux { first: 0, items: s };
    let candidates = inflections(s.items).into_iter().filter(|i| rules.kind.takes(i));
    let mut found: Vec<(usize, f64)> = candidates
        .map(|i| (i.sample(rules.frames.hop), s.slope(i.position)))
        .filter(|(at, _)| *at > 0 && *at < len)
        .collect();
    found.dedup_by_key(|cut| cut.0);
    let mut all = vec![0];
    for end in join_short(len, &found, rules.min.max(1)).into_iter().chain([len]) {
        let start = all.last().copied().unwrap_or(0);
        split_long(s, [start, end], rules, &mut all);
        all.push(end);
    }
    all.dedup();
    all
}

/// Adds the cuts within a segment that is longer than `max`: at the steepest frame, or of equal ones at that nearest the middle.
pub(super) fn split_long(
    s: SmoothFlux<'_>,
    segment: [usize; 2],
    rules: &SegmentRules,
    cuts: &mut Vec<usize>,
) {
    let mut pending = vec![segment];
    let mut found = Vec::new();
    while let Some([start, end]) = pending.pop() {
        if end - start <= rules.max.max(2) {
            continue;
        }
        let middle = start + (end - start) / 2;
        let between = [start + rules.min, end.saturating_sub(rules.min)];
        let cut = s.steepest(between, middle, rules.frames.hop.max(1)).unwrap_or(middle);
        found.push(cut);
        pending.extend([[start, cut], [cut, end]]);
    }
    found.sort_unstable();
    cuts.extend(found);
}

/// Cuts a recording into grains at inflection points of its smoothed spectral flux, with lengths from `min` to `max`.
///
/// Segments shorter than `min` are joined by removing the cut at the smaller slope of the flux of the shortest one, repeatedly. Segments longer
/// than `max` are cut where the flux is steepest. A recording shorter than `min` is one grain.
///
/// # Complexity
/// One transform a hop, and O(n log n) for n inflection points.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 3.2; the paper
/// gives the range of lengths, the rule is of this project.
#[must_use]
pub fn segment(x: &[f32], rules: &SegmentRules) -> Segments {
    let flux = spectral_flux(x, rules.frames);
    let smooth = smooth(&flux, rules.sigma);
    Segments {
        cuts: if x.is_empty() { Vec::new() } else { cuts(&smooth, x.len(), rules) },
        onsets: onsets(x, rules.frames, rules.rate, rules.onset_rise),
        flux,
        smooth,
    }
}

#[cfg(test)]
mod tests;
