//! A score over a wavelet tree: the nodes that are wanted at each time.

use super::curve::{MeanCurve, WeightCurve, contains};
use super::model::{DEFAULT_PAD, Outside, ScoreSource, SoundScore};
use crate::artefact::text::{Location, TextError};
use crate::soundtrack::wavelet::WaveletTree;
use std::collections::HashSet;

/// End of what has no end, s.
const NEVER: f64 = 1e12;
/// Greatest weight of a constraint that is not certain.
pub const SOFT: f64 = 0.99;
/// Steps of a ramp beside a certain constraint.
const RAMP_STEPS: usize = 8;
/// Share of the nodes of a level that must remain for all nodes with a part in an excluded sound to be left out.
const LEFT: usize = 20;
/// Shortest segment, samples.
const MIN_SEGMENT: f64 = 4.0;

/// Nodes of one level, as intervals in increasing order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeSet(Vec<(u32, u32)>);

impl NodeSet {
    /// The union of intervals.
    fn new(mut all: Vec<(u32, u32)>) -> Self {
        all.retain(|(from, to)| to > from);
        all.sort_unstable();
        let mut merged: Vec<(u32, u32)> = Vec::with_capacity(all.len());
        for (from, to) in all {
            match merged.last_mut() {
                Some(last) if from <= last.1 => last.1 = last.1.max(to),
                _ => merged.push((from, to)),
            }
        }
        Self(merged)
    }

    /// True if a node is one of them.
    ///
    /// # Complexity
    /// Logarithmic in the intervals.
    #[must_use]
    pub fn contains(&self, node: u32) -> bool {
        match self.0.as_slice() {
            [(from, to)] => (*from..*to).contains(&node),
            all => {
                let k = all.partition_point(|(from, _)| *from <= node);
                k > 0 && node < all[k - 1].1
            }
        }
    }

    /// The number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.iter().map(|(from, to)| (to - from) as usize).sum()
    }

    /// True if there is no node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// All nodes, in increasing order.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.0.iter().flat_map(|(from, to)| *from..*to)
    }
}

/// The nodes of one set of sounds, whose targets share a constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceSet {
    /// The sounds of the score.
    pub sources: Vec<usize>,
    /// By level, the nodes that overlap a segment, with all their ancestors.
    pub included: Vec<NodeSet>,
    /// By level, the nodes that an exclusion leaves out: those that overlap a segment, or at coarse levels at which hardly a node would
    /// remain, those within one.
    pub excluded: Vec<NodeSet>,
}

/// What holds for a node of the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constraint {
    /// The set of sounds.
    pub set: usize,
    /// The mean weight over the span of the node, not 0.
    pub weight: f64,
    /// True if the weight is 1 or -1 over the whole span.
    pub is_hard: bool,
}

#[derive(Clone, Debug)]
struct Target {
    set: usize,
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

fn wrong(location: Location, message: String) -> TextError {
    TextError::new(location, message)
}

impl Constraints {
    /// Finds the nodes of a score.
    ///
    /// # Errors
    /// Sounds outside of their recordings, certain constraints that contradict each other, and those that leave nothing, with the location
    /// of the sound or target.
    pub fn new(score: &SoundScore, tree: &WaveletTree) -> Result<Self, TextError> {
        let segments =
            score.sources.iter().map(|source| segments(source, tree)).collect::<Result<Vec<_>, _>>()?;
        let mut compiled = Self::default();
        // The first sets are the sounds themselves.
        for k in 0..score.sources.len() {
            compiled.set(&[k], &segments, tree);
        }
        let mut all: Vec<(usize, usize, WeightCurve)> = Vec::new();
        for (k, target) in score.targets.iter().enumerate() {
            let set = compiled.set(&target.sources, &segments, tree);
            all.push((k, set, target.curve.clone()));
        }
        padded(&mut all, score.pad.unwrap_or(DEFAULT_PAD));
        let conflicts = Conflicts { score, targets: &all };
        conflicts.check(&compiled, tree)?;
        for (k, source) in score.sources.iter().enumerate() {
            if source.outside == Outside::Exclude {
                let set = compiled.set(&[k], &segments, tree);
                let own = score.targets.iter().filter(|t| t.sources.contains(&k));
                all.extend(outside(own.map(|t| &t.curve)).map(|curve| (usize::MAX, set, curve)));
            }
        }
        let target = |(_, set, curve): (usize, usize, WeightCurve)| {
            let curve = MeanCurve::new(&curve);
            let (from, to) = curve.ends();
            Target { set, curve, from, to }
        };
        compiled.targets = all.into_iter().map(target).collect();
        compiled.targets.sort_by(|a, b| a.from.total_cmp(&b.from));
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

    /// The index of a set of sounds, which is added if it is new.
    fn set(&mut self, sources: &[usize], segments: &[Vec<(u64, u64)>], tree: &WaveletTree) -> usize {
        if let Some(k) = self.sets.iter().position(|set| set.sources == sources) {
            return k;
        }
        let own: Vec<(u64, u64)> =
            sources.iter().filter_map(|k| segments.get(*k)).flatten().copied().collect();
        let depth = tree.depth as usize;
        let nodes = |level: usize, is_whole: bool| {
            let span = tree.span(level) as u64;
            let interval = |(from, to): &(u64, u64)| match is_whole {
                false => ((from / span) as u32, to.div_ceil(span) as u32),
                true => (from.div_ceil(span) as u32, (to / span) as u32),
            };
            NodeSet::new(own.iter().map(interval).collect())
        };
        let included: Vec<NodeSet> = (0..depth).map(|level| nodes(level, false)).collect();
        let excluded = |level: usize| {
            let left = tree.nodes(level).saturating_sub(included[level].len());
            let is_enough = left >= (tree.nodes(level) / LEFT).max(2);
            if is_enough || level + 2 >= depth { included[level].clone() } else { nodes(level, true) }
        };
        let excluded = (0..depth).map(excluded).collect();
        self.sets.push(SourceSet { sources: sources.to_vec(), included, excluded });
        self.sets.len() - 1
    }

    /// True if nothing is constrained.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.targets.is_empty()
    }

    /// The constraint of a node that covers an interval of the output, in s: that of the greatest weight. The sets that must not occur at all
    /// are added to `forbidden`.
    ///
    /// # Complexity
    /// Logarithmic in the targets, linear in those that overlap the interval.
    pub fn at(&self, from: f64, to: f64, mut forbidden: Option<&mut Vec<usize>>) -> Option<Constraint> {
        let mut best = None;
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
            best = greater(best, Constraint { set: target.set, weight, is_hard });
        }
        best
    }
}

/// The constraint of the greater weight, the first of equals; a weight of 0 is none.
fn greater(best: Option<Constraint>, other: Constraint) -> Option<Constraint> {
    let is_greater = other.weight != 0.0 && best.is_none_or(|best| other.weight.abs() > best.weight.abs());
    if is_greater { Some(other) } else { best }
}

/// Weights of the sounds of a score that come as a stream: item `k` holds from `k / rate` to `(k + 1) / rate`.
#[derive(Clone, Copy, Debug)]
pub struct WeightStream<'a> {
    /// Items per second.
    pub rate: f64,
    /// Index of the first item.
    pub first: i64,
    /// Number of sounds.
    pub width: usize,
    /// Weights by item and sound; the last item holds on.
    pub items: &'a [f32],
}

impl WeightStream<'_> {
    /// The constraint of an interval, in s, or `best` if its weight is greater, as [`Constraints::at`].
    pub fn at(
        &self,
        from: f64,
        to: f64,
        mut best: Option<Constraint>,
        mut forbidden: Option<&mut Vec<usize>>,
    ) -> Option<Constraint> {
        let count = (self.items.len() / self.width.max(1)) as i64;
        if count == 0 {
            return best;
        }
        let (a, b) = (from * self.rate - self.first as f64, to * self.rate - self.first as f64);
        let (start, end) = ((a + 1e-6).floor() as i64, (b - 1e-6).ceil() as i64);
        for sound in 0..self.width {
            let (mut sum, mut is_one, mut is_minus_one) = (0.0, true, true);
            for k in start..end.max(start + 1) {
                let index = k.clamp(0, count - 1) as usize * self.width + sound;
                let x =
                    self.items.get(index).copied().filter(|x| x.is_finite()).unwrap_or(0.0).clamp(-1.0, 1.0);
                let share = (b.min((k + 1) as f64) - a.max(k as f64)).max(0.0);
                sum += share * f64::from(x);
                is_one &= x == 1.0;
                is_minus_one &= x == -1.0;
            }
            if is_minus_one && let Some(forbidden) = forbidden.as_mut() {
                forbidden.push(sound);
                continue;
            }
            let weight = if is_one { 1.0 } else { (sum / (b - a).max(1e-12)).clamp(-SOFT, SOFT) };
            best = greater(best, Constraint { set: sound, weight, is_hard: is_one });
        }
        best
    }
}

/// The segments of a sound, in samples from the first root on.
fn segments(source: &ScoreSource, tree: &WaveletTree) -> Result<Vec<(u64, u64)>, TextError> {
    let wrong = |message: String| Err(wrong(source.location, message));
    let found = tree.find(source.recording.as_deref().unwrap_or_default()).and_then(|k| tree.sources.get(k));
    let Some(recording) = found else {
        let names: Vec<&str> = tree.sources.iter().map(|s| s.name.as_str()).collect();
        let wanted = source.recording.as_deref().unwrap_or_default();
        return wrong(format!("there is no recording {wanted:?}; recordings are {}", names.join(", ")));
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

/// Adds soft ramps beside weights of 1 and -1 at the ends of curves, as far as there is no other target.
fn padded(all: &mut [(usize, usize, WeightCurve)], pad: f64) {
    if pad <= 0.0 {
        return;
    }
    let ends = |curve: &WeightCurve| Some((curve.points.first()?.0, curve.points.last()?.0));
    let mut order: Vec<(f64, f64, usize)> =
        all.iter().enumerate().filter_map(|(k, (_, _, c))| ends(c).map(|(a, b)| (a, b, k))).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Free time before each start and after each end, with what overlaps it.
    let mut free = vec![(0.0_f64, 0.0_f64); all.len()];
    let mut latest = f64::NEG_INFINITY;
    for (from, to, k) in &order {
        free[*k].0 = (from - latest).min(*from).clamp(0.0, pad);
        latest = latest.max(*to);
    }
    // The two latest ends of the targets up to each.
    let mut running = Vec::with_capacity(order.len());
    let mut top = [(f64::NEG_INFINITY, usize::MAX); 2];
    for (_, to, k) in &order {
        if *to > top[0].0 {
            top = [(*to, *k), top[0]];
        } else if *to > top[1].0 {
            top[1] = (*to, *k);
        }
        running.push(top);
    }
    for (_, to, k) in &order {
        let next = order.partition_point(|(from, _, _)| from < to);
        let overlap = next
            .checked_sub(1)
            .map(|n| running[n])
            .is_some_and(|top| top.iter().any(|(end, other)| other != k && *other != usize::MAX && end > to));
        let gap = order.get(next).map_or(pad, |(from, _, _)| from - to);
        free[*k].1 = if overlap { 0.0 } else { gap.clamp(0.0, pad) };
    }
    for ((_, _, curve), (before, after)) in all.iter_mut().zip(free) {
        let ramp = |at: f64, length: f64, weight: f64| -> Vec<(f64, f64)> {
            let point = |k: usize| {
                let x = k as f64 / RAMP_STEPS as f64;
                (at + length * (x - 1.0), weight * SOFT * 0.5 * (1.0 - (std::f64::consts::PI * x).cos()))
            };
            (0..=RAMP_STEPS).map(point).collect()
        };
        let (Some(first), Some(last)) = (curve.points.first().copied(), curve.points.last().copied()) else {
            continue;
        };
        if first.1.abs() == 1.0 && before > 0.0 {
            curve.points.splice(0..0, ramp(first.0, before, first.1));
        }
        if last.1.abs() == 1.0 && after > 0.0 {
            let mirrored = ramp(0.0, after, last.1).into_iter().rev().map(|(t, w)| (last.0 - t, w));
            curve.points.extend(mirrored);
        }
    }
}

/// Exclusions of a sound before, between and after its targets.
fn outside<'a>(own: impl Iterator<Item = &'a WeightCurve>) -> impl Iterator<Item = WeightCurve> {
    let ends = |curve: &WeightCurve| Some((curve.points.first()?.0, curve.points.last()?.0));
    let mut spans: Vec<(f64, f64)> = own.filter_map(ends).collect();
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut gaps, mut end) = (Vec::new(), 0.0_f64);
    for (from, to) in spans {
        gaps.push((end, from));
        end = end.max(to);
    }
    gaps.push((end, NEVER));
    gaps.into_iter().filter(|(from, to)| to > from).map(|(from, to)| WeightCurve::constant(from, to, -1.0))
}

/// Certain constraints that cannot hold together.
struct Conflicts<'a> {
    score: &'a SoundScore,
    targets: &'a [(usize, usize, WeightCurve)],
}

/// A certain constraint: its times, its set and its target.
#[derive(Clone, Copy)]
struct Certain {
    from: f64,
    to: f64,
    set: usize,
    target: usize,
}

impl Conflicts<'_> {
    fn certain(&self, weight: f64) -> Vec<Certain> {
        let of = |(target, set, curve): &(usize, usize, WeightCurve)| {
            let (target, set) = (*target, *set);
            curve.plateaus(weight).into_iter().map(move |(from, to)| Certain { from, to, set, target })
        };
        let mut all: Vec<Certain> = self.targets.iter().flat_map(of).collect();
        all.sort_by(|a, b| a.from.total_cmp(&b.from));
        all
    }

    fn location(&self, target: usize) -> Location {
        self.score.targets.get(target).map(|t| t.location).unwrap_or_default()
    }

    fn check(&self, compiled: &Constraints, tree: &WaveletTree) -> Result<(), TextError> {
        let names =
            |set: usize| compiled.sets.get(set).map(|s| self.score.names(&s.sources)).unwrap_or_default();
        let inclusions = self.certain(1.0);
        let mut last: Option<Certain> = None;
        for one in &inclusions {
            if let Some(last) = last.filter(|last| one.from < last.to && one.set != last.set) {
                return Err(wrong(
                    self.location(one.target),
                    format!(
                        "{} is certain from {} s to {} s, where {} is certain too ({}); one output cannot be both: give one of them a weight \
                         below 1",
                        names(one.set),
                        one.from,
                        one.to.min(last.to),
                        names(last.set),
                        self.location(last.target)
                    ),
                ));
            }
            last = Some(last.filter(|last| last.to > one.to).unwrap_or(*one));
        }
        // Each combination of certain constraints that occurs must leave something.
        let exclusions = self.certain(-1.0);
        let mut times: Vec<f64> = inclusions.iter().chain(&exclusions).flat_map(|c| [c.from, c.to]).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let level = (tree.depth as usize).saturating_sub(2);
        let mut found = HashSet::new();
        let (mut next, mut active): ([usize; 2], [Vec<Certain>; 2]) = ([0; 2], [Vec::new(), Vec::new()]);
        for pair in times.windows(2) {
            for (k, all) in [&inclusions, &exclusions].into_iter().enumerate() {
                while let Some(one) = all.get(next[k]).filter(|one| one.from <= pair[0]) {
                    active[k].push(*one);
                    next[k] += 1;
                }
                active[k].retain(|one| one.to > pair[0]);
            }
            let Some(example) = active[1].first() else { continue };
            let mut out: Vec<usize> = active[1].iter().map(|c| c.set).collect();
            out.sort_unstable();
            out.dedup();
            let include = active[0].first().map(|c| c.set);
            if !found.insert((include, out.clone())) {
                continue;
            }
            let is_left = |node: u32| {
                !tree.is_masked(level, node)
                    && out.iter().all(|set| !compiled.sets[*set].excluded[level].contains(node))
            };
            let remains = match include {
                Some(set) => compiled.sets[set].included[level].iter().any(is_left),
                None => (0..tree.nodes(level) as u32).any(is_left),
            };
            if remains {
                continue;
            }
            let excluded: Vec<String> = out.iter().map(|set| names(*set)).collect();
            let what = match include {
                Some(set) => format!("{} is certain, and excluded by {}", names(set), excluded.join(" and ")),
                None => format!("{} are excluded, and nothing else is left", excluded.join(" and ")),
            };
            return Err(wrong(
                self.location(active[0].first().unwrap_or(example).target),
                format!("impossible from {} s to {} s: {what}", pair[0], pair[1]),
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
