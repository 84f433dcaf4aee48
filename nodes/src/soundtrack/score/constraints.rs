//! A score over a wavelet tree: the nodes that are wanted at each time.

use super::conflicts::Conflicts;
use super::curve::{MeanCurve, WeightCurve, contains};
use super::directive::{Directive, NEVER, SOFT};
use super::model::{DEFAULT_PAD, Outside, ScoreSource, ScoreTarget, SoundScore};
use super::padding::padded;
use super::source_set::SourceSet;
use crate::artefact::text::TextError;
use crate::soundtrack::wavelet::WaveletTree;
use std::collections::HashMap;

/// Shortest segment, samples.
const MIN_SEGMENT: f64 = 4.0;

/// Constraint on a node of the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constraint {
    /// The set of sounds.
    pub set: usize,
    /// The mean weight over the span of the node, not 0.
    pub weight: f64,
    /// True if the weight is 1 over the whole span.
    pub is_hard: bool,
    /// The layer of a morph, 0 or 1: targets of different sets that overlap have different layers, if two layers suffice.
    pub layer: usize,
}

/// The constraints of an interval that count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// The greatest inclusions of two sets, in order; the first of equals.
    inclusions: [Option<Constraint>; 2],
    /// The greatest exclusion.
    exclusion: Option<Constraint>,
}

impl Overlap {
    /// Adds one; a weight of 0 is none.
    pub fn add(&mut self, other: Constraint) {
        let is_greater =
            |best: Option<Constraint>| best.is_none_or(|best| other.weight.abs() > best.weight.abs());
        let is_same = |best: Option<Constraint>| best.is_some_and(|best| best.set == other.set);
        let [first, second] = self.inclusions;
        if other.weight < 0.0 && is_greater(self.exclusion) {
            self.exclusion = Some(other);
        } else if other.weight > 0.0 && is_greater(first) {
            self.inclusions = [Some(other), if is_same(first) { second } else { first }];
        } else if other.weight > 0.0 && !is_same(first) && is_greater(second) {
            self.inclusions[1] = Some(other);
        }
    }

    /// The constraint of the greatest weight; of equal ones an inclusion.
    #[must_use]
    pub fn greatest(&self) -> Option<Constraint> {
        let inclusion = self.inclusions[0];
        let is_greater = |exclusion: &Constraint| inclusion.is_none_or(|i| -exclusion.weight > i.weight);
        self.exclusion.filter(is_greater).or(inclusion)
    }

    /// The two inclusions that overlap, the greater one first, if no exclusion is greater.
    #[must_use]
    pub fn both(&self) -> Option<[Constraint; 2]> {
        let [first, second] = self.inclusions;
        Some([first.filter(|first| self.greatest() == Some(*first))?, second?])
    }
}

#[derive(Clone, Debug)]
struct Target {
    set: usize,
    layer: usize,
    curve: MeanCurve,
    from: f64,
    to: f64,
}

/// A score over a tree.
#[derive(Clone, Debug, Default)]
pub struct Constraints {
    /// The sets of sounds: first each sound alone, in the order of the score, then those that targets combine.
    pub sets: Vec<SourceSet>,
    /// In order of their starts.
    targets: Vec<Target>,
    /// The latest end of the targets up to each.
    latest: Vec<f64>,
}

impl Constraints {
    /// Finds the nodes of a score. With `morphs`, several sounds may have the weight 1 at a time.
    ///
    /// # Errors
    /// Sounds outside of their recordings, hard constraints that contradict each other, and those that leave nothing, with the location
    /// of the sound or target.
    pub fn new(score: &SoundScore, tree: &WaveletTree, morphs: bool) -> Result<Self, TextError> {
        let segments =
            score.sources.iter().map(|source| segments(source, tree)).collect::<Result<Vec<_>, _>>()?;
        let mut compiled = Self::default();
        let mut index = HashMap::new();
        let mut set = |sources: &[usize]| {
            *index.entry(sources.to_vec()).or_insert_with(|| {
                compiled.sets.push(SourceSet::new(sources, &segments, tree));
                compiled.sets.len() - 1
            })
        };
        // The first sets are the sounds themselves.
        for k in 0..score.sources.len() {
            set(&[k]);
        }
        let directive = |target: &ScoreTarget| Directive {
            set: set(&target.sources),
            curve: target.curve.clone(),
            location: target.location,
        };
        let mut all: Vec<Directive> = score.targets.iter().map(directive).collect();
        padded(&mut all, score.pad.unwrap_or(DEFAULT_PAD));
        let mut own: Vec<Vec<&WeightCurve>> = vec![Vec::new(); score.sources.len()];
        for target in &score.targets {
            for k in &target.sources {
                own.get_mut(*k).into_iter().for_each(|own| own.push(&target.curve));
            }
        }
        for (k, source) in score.sources.iter().enumerate().filter(|(_, s)| s.outside == Outside::Exclude) {
            let directive = |curve| Directive { set: k, curve, location: source.location };
            all.extend(outside(own[k].iter().copied()).map(directive));
        }
        Conflicts { score, sets: &compiled.sets, tree, morphs }.check(&all)?;
        let target = |one: Directive| {
            let (from, to) = one.curve.ends().unwrap_or_default();
            Target { set: one.set, layer: 0, curve: MeanCurve::new(&one.curve), from, to }
        };
        compiled.targets = all.into_iter().map(target).collect();
        compiled.targets.sort_by(|a, b| a.from.total_cmp(&b.from));
        layer(&mut compiled.targets);
        let mut latest = f64::NEG_INFINITY;
        compiled.latest = compiled
            .targets
            .iter()
            .map(|t| {
                latest = latest.max(t.to);
                latest
            })
            .collect();
        Ok(compiled)
    }

    /// True if nothing is constrained.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.targets.is_empty()
    }

    /// The constraints of a node that covers an interval of the output, in s. The sets that must not occur at all are added to `forbidden`.
    ///
    /// # Complexity
    /// Logarithmic in the targets, linear in those that overlap the interval.
    pub fn at(&self, from: f64, to: f64, mut forbidden: Option<&mut Vec<usize>>) -> Overlap {
        let mut found = Overlap::default();
        let first = self.latest.partition_point(|end| *end <= from);
        for target in self.targets.get(first..).unwrap_or_default() {
            if target.from >= to {
                break;
            }
            if target.to <= from {
                continue;
            }
            if contains(target.curve.exclusions(), from, to)
                && let Some(forbidden) = forbidden.as_mut()
            {
                forbidden.push(target.set);
                continue;
            }
            let is_hard = contains(target.curve.inclusions(), from, to);
            let weight = if is_hard { 1.0 } else { target.curve.mean(from, to).clamp(-SOFT, SOFT) };
            found.add(Constraint { set: target.set, weight, is_hard, layer: target.layer });
        }
        found
    }
}

/// Assigns layers to targets, in order of their starts: a layer whose targets have ended or are of the same set, or else the one that ends first.
fn layer(targets: &mut [Target]) {
    let mut last = [(f64::NEG_INFINITY, usize::MAX); 2];
    for target in targets {
        let is_free = |k: &usize| last[*k].0 <= target.from || last[*k].1 == target.set;
        let same = (0..2).find(|k| last[*k].1 == target.set && last[*k].0 >= target.from);
        let free = same.or_else(|| (0..2).find(is_free));
        target.layer = free.unwrap_or(usize::from(last[1].0 < last[0].0));
        let (end, set) = &mut last[target.layer];
        (*end, *set) = (end.max(target.to), target.set);
    }
}

/// The segments of a sound, in samples from the first root on.
fn segments(source: &ScoreSource, tree: &WaveletTree) -> Result<Vec<(u64, u64)>, TextError> {
    let wrong = |message: String| Err(TextError::new(source.location, message));
    let found = tree.find(source.recording.as_deref().unwrap_or_default());
    let recording = match found.map(|k| &tree.sources[k]) {
        Ok(recording) => recording,
        Err(e) => return wrong(e.to_string()),
    };
    let available = recording.frames.min(u64::from(recording.roots) << tree.depth);
    let offset = u64::from(recording.first) << tree.depth;
    let mut all = Vec::with_capacity(source.segments.len());
    for (from, to) in &source.segments {
        let whole = recording.frames as f64 / tree.rate;
        if *to > whole + 0.5 / tree.rate {
            return wrong(format!(
                "{:?} has the segment ({from}, {to}), and {:?} ends at {whole:.3} s",
                source.name, recording.name
            ));
        }
        let (a, b) = (from * tree.rate, to * tree.rate);
        if b - a < MIN_SEGMENT {
            return wrong(format!(
                "{:?} has the segment ({from}, {to}), which is {:.1} samples long; at least {MIN_SEGMENT} are needed",
                source.name,
                b - a
            ));
        }
        let (a, b) = (a.round() as u64, (b.round() as u64).min(available));
        if a + MIN_SEGMENT as u64 > b {
            return wrong(format!(
                "{:?} has the segment ({from}, {to}), and the tree of {:?} ends at {:.3} s; give the WaveletTree `fit: PadReflect`, or a \
                 shorter `block`",
                source.name,
                recording.name,
                available as f64 / tree.rate
            ));
        }
        all.push((offset + a, offset + b));
    }
    Ok(all)
}

/// Exclusions of a sound before, between and after its targets.
fn outside<'a>(own: impl Iterator<Item = &'a WeightCurve>) -> impl Iterator<Item = WeightCurve> {
    let mut spans: Vec<(f64, f64)> = own.filter_map(WeightCurve::ends).collect();
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut gaps, mut end) = (Vec::new(), 0.0_f64);
    for (from, to) in spans {
        gaps.push((end, from));
        end = end.max(to);
    }
    gaps.push((end, NEVER));
    gaps.into_iter().filter(|(from, to)| to > from).map(|(from, to)| WeightCurve::constant(from, to, -1.0))
}

#[cfg(test)]
mod tests;
