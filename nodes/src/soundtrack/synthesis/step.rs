//! The match of one node.

use super::choice::{Best, is_discarded};
use super::classes::{Classes, are_similar, matches, path, source_value};
use super::output::{NONE, OutputTree};
use super::rules::{MatchCount, MatchCriterion, SynthesisRules};
use crate::core::random::Random;
use crate::soundtrack::score::{Constraint, Constraints, NodeSet};
use crate::soundtrack::wavelet::{BorderKind, TextureModel};

/// Ancestors that count for the most similar node.
pub const APPROXIMATE_ANCESTORS: usize = 6;

/// The best candidates of two kinds, without those that match much worse than the other kind.
#[derive(Default)]
pub struct Pair {
    pub wanted: Option<Best>,
    pub others: Option<Best>,
    /// True if wanted candidates may exist and match too badly.
    pub is_discarded: bool,
}

/// The node of a model that is `distance` before another one in its recording.
pub fn predecessor(model: &TextureModel, level: usize, node: u32, distance: u32) -> Option<u32> {
    let source = model.tree.sources.get(model.tree.source_of(node >> level))?;
    let (first, nodes) = (source.first << level, source.roots << level);
    match (node - first).checked_sub(distance) {
        Some(own) => Some(first + own),
        None if source.wraps && distance <= nodes => Some(node + nodes - distance),
        None => None,
    }
}

/// Recent choices, which are left out by chance.
#[derive(Clone, Copy)]
pub struct Repetition<'a> {
    /// Number of times that each node was chosen; empty if it does not matter.
    pub counts: &'a [u16],
    /// Probability that a node remains, for each time.
    pub factor: f64,
    /// Random numbers for the nodes of the output.
    pub random: &'a Random,
    /// Level of the node of the output, for random numbers.
    pub entity: u32,
    /// Number of the node in its level.
    pub index: u64,
}

impl Repetition<'_> {
    /// True if a candidate is left out.
    fn omits(&self, candidate: u32) -> bool {
        let times = self.counts.get(candidate as usize).copied().unwrap_or(0);
        times > 0 && self.random.uniform(self.entity, self.index, candidate) >= self.factor.powi(times.into())
    }
}

/// The limits that hold for candidates.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Limits {
    /// True if recent choices are left out by chance.
    repeats: bool,
    /// True if roots are joined only at borders of the same class.
    alike: bool,
    /// True if stretches have a maximum length.
    run: bool,
}

/// One node of the output that is to be matched.
pub struct Step<'a> {
    pub model: &'a TextureModel,
    pub constraints: &'a Constraints,
    pub rules: &'a SynthesisRules,
    pub tree: &'a OutputTree,
    pub level: usize,
    pub node: usize,
    /// True for a root itself, and not its children.
    pub is_root: bool,
    /// Sets that must not occur.
    pub forbidden: &'a [usize],
    /// True if some nodes of the model are never chosen.
    pub has_masks: bool,
    /// Longest stretch of a recording, samples.
    pub longest: Option<f64>,
    /// Candidates that are examined before all others.
    pub first: &'a [u32],
    /// Recent choices.
    pub repetition: Repetition<'a>,
}

impl Step<'_> {
    /// The greatest number of ancestors that can match.
    pub fn depth(&self) -> usize {
        if self.is_root { 1 } else { self.level + 1 }
    }

    /// The shares of the time of the recordings that a constraint wants and that it does not want, without what must not occur.
    pub fn shares(&self, wanted: Constraint) -> [f64; 2] {
        let finest = self.model.tree.depth as usize - 1;
        let sets = &self.constraints.sets;
        let excluded = NodeSet::union(self.forbidden.iter().map(|set| &sets[*set].excluded[finest]));
        let all = self.model.tree.nodes(finest).saturating_sub(excluded.len()).max(1) as f64;
        let sounds = &sets[wanted.set].centred[finest];
        let own =
            if excluded.is_empty() { sounds.len() } else { sounds.without(&excluded).len() } as f64 / all;
        if wanted.weight > 0.0 { [own, 1.0 - own] } else { [1.0 - own, own] }
    }

    /// The node that is `distance` after another one in its recording.
    pub fn successor(&self, node: u32, distance: u32) -> Option<u32> {
        let source = self.model.tree.sources.get(self.model.tree.source_of(node >> self.level))?;
        node.checked_add(distance).filter(|m| *m < (source.first + source.roots) << self.level)
    }

    fn is_allowed(&self, candidate: u32) -> bool {
        let level = self.level;
        let is_masked = self.has_masks && self.model.tree.is_masked(level, candidate);
        let excluded = |set: &usize| self.constraints.sets[*set].excluded[level].contains(candidate);
        !is_masked && !self.model.is_redundant(level, candidate) && !self.forbidden.iter().any(excluded)
    }

    /// True if a candidate would continue a stretch of its recording beyond the longest, or so far that it has to end where it is loud.
    fn is_too_long(&self, candidate: u32) -> bool {
        let Some(longest) = self.longest else { return false };
        let (level, node, count) =
            if self.is_root { (0, 0, 1) } else { (self.level + 1, 2 * self.node as isize, 2) };
        let before = self.tree.pick(level, node - 1);
        let first = candidate * count;
        if before == NONE || predecessor(self.model, level, first, 1) != Some(before) {
            return false;
        }
        let nodes = self.tree.run(level, node - 1) + count;
        let length = f64::from(nodes) * self.model.tree.span(level) as f64;
        length > longest || self.level == 0 && self.ends_loud(length)
    }

    /// True if a stretch that continues at the end of the last leaf, to a length in samples, has to end at the next border of roots, which is loud.
    fn ends_loud(&self, length: f64) -> bool {
        let is_before = |root: u32| self.model.envelopes.borders(root)[1].kind == BorderKind::BeforeLoud;
        let next = length + self.model.tree.span(0) as f64;
        self.rules.max_run.is_some_and(|longest| next > longest * self.model.tree.rate)
            && self.tree.root_of_leaf(-1).is_some_and(is_before)
    }

    /// The predecessors of a candidate that match.
    fn predecessors(&self, candidate: u32) -> usize {
        let k = self.predecessor_limit();
        let threshold = self.model.thresholds[self.level];
        let is_similar = |j: &usize| {
            let node = self.node as isize - *j as isize;
            if self.tree.pick(self.level, node) == NONE {
                return false;
            }
            predecessor(self.model, self.level, candidate, *j as u32).is_some_and(|m| {
                let (a, b) = (source_value(self.model, self.level, m), self.tree.value(self.level, node));
                are_similar(a, b, threshold)
            })
        };
        match self.rules.count {
            MatchCount::Consecutive => (1..=k).take_while(is_similar).count(),
            MatchCount::Total => (1..=k).filter(is_similar).count(),
        }
    }

    /// True if a candidate continues its recording, or begins at a border of the class at which the root of the last leaf ends. Roots begin at borders
    /// of a class as often as they end there: each is chosen as often as any, as without this limit.
    fn is_alike(&self, candidate: u32) -> bool {
        let borders = |root: u32| self.model.envelopes.borders(root);
        self.tree.root_of_leaf(-1).is_none_or(|before| {
            predecessor(self.model, 0, candidate, 1) == Some(before)
                || borders(before)[1] == borders(candidate)[0]
        })
    }

    /// The best of the candidates that a condition admits, without those that continue for too long if there are others. `few` has all nodes that
    /// the condition admits, if they are few.
    pub fn best(
        &self,
        classes: &mut Classes,
        few: Option<&NodeSet>,
        beside: usize,
        is_admitted: impl Fn(u32) -> bool,
    ) -> Option<Best> {
        let admits = |m: u32| is_admitted(m) && self.is_allowed(m);
        let is_enough = |best: &Best| 100 * best.quality() >= self.rules.percent() * beside;
        self.limits().find_map(|limits| {
            let best = self.best_of(classes, few, beside, |m| admits(m) && self.is_within(m, limits));
            best.filter(|best| is_enough(best) && (self.is_choice(best) || !limits.alike))
        })
    }

    /// True if candidates for a root are a choice. The root whose children follow may be the only one that matches it.
    fn is_choice(&self, best: &Best) -> bool {
        !self.is_root || best.is_choice()
    }

    /// Sets of limits to try in turn, the strictest first, until one leaves a candidate.
    fn limits(&self) -> impl Iterator<Item = Limits> {
        let (repeats, run) = (!self.repetition.counts.is_empty(), self.rules.max_run.is_some());
        let alike = run && self.level == 0;
        let all = [(repeats, alike, run), (repeats, false, run), (false, false, run), (false, false, false)]
            .map(|(repeats, alike, run)| Limits { repeats, alike, run });
        (0..all.len()).filter(move |k| *k == 0 || all[*k] != all[k - 1]).map(move |k| all[k])
    }

    /// True if a candidate is within the limits that hold.
    fn is_within(&self, candidate: u32, limits: Limits) -> bool {
        let exceeds = limits.run && self.is_too_long(candidate)
            || limits.alike && !self.is_alike(candidate)
            || limits.repeats && self.repetition.omits(candidate);
        !exceeds
    }

    fn best_of(
        &self,
        classes: &mut Classes,
        few: Option<&NodeSet>,
        beside: usize,
        is_admitted: impl Fn(u32) -> bool,
    ) -> Option<Best> {
        if self.is_root {
            let roots = (0..self.model.tree.roots() as u32).filter(|m| is_admitted(*m)).collect();
            return self.of_roots(roots);
        }
        let first = self.deepest(&mut self.first.iter().copied().filter(|m| is_admitted(*m)));
        if first.is_some() {
            return first;
        }
        if let Some(set) = few {
            return self.deepest(&mut set.iter().filter(|m| is_admitted(*m)));
        }
        for a in self.classes() {
            if 100 * (a + self.predecessor_limit()) < self.rules.percent() * beside {
                break;
            }
            let list = classes.get(self.model, self.tree, self.level, self.node, a);
            let nodes: Vec<u32> = list.iter().copied().filter(|m| is_admitted(*m)).collect();
            if !nodes.is_empty() {
                return self.with_predecessors(a, nodes);
            }
        }
        self.deepest(&mut self.others().iter().copied().filter(|m| is_admitted(*m)))
    }

    /// The numbers of ancestors for which candidates are found from those of the parent, from the greatest on. A node all of whose ancestors are similar
    /// has most in any count.
    fn classes(&self) -> impl Iterator<Item = usize> {
        let last = match (self.rules.criterion, self.rules.count) {
            (MatchCriterion::PerCoefficient, MatchCount::Consecutive) => 1,
            (MatchCriterion::PerCoefficient, MatchCount::Total) => self.level + 1,
            (MatchCriterion::RunningMean, _) => self.level + 2,
        };
        (last..=self.level + 1).rev()
    }

    /// The candidates that have to be compared if [classes](Self::classes) have none.
    fn others(&self) -> &[u32] {
        match (self.rules.criterion, self.rules.count) {
            (MatchCriterion::PerCoefficient, MatchCount::Consecutive) => &[],
            _ => self.model.similar(self.level, self.tree.value(self.level, self.node as isize)[0]),
        }
    }

    /// Number of ancestors of a candidate that are similar, with the node itself; 0 if the node itself is not.
    fn ancestors(&self, candidate: u32) -> usize {
        let up = 0..=self.level;
        match (self.rules.criterion, self.rules.count) {
            (MatchCriterion::PerCoefficient, MatchCount::Consecutive) => {
                path(self.model, self.tree, self.level, self.node, candidate)
            }
            (MatchCriterion::PerCoefficient, MatchCount::Total) => {
                let is_similar = |up: usize| {
                    matches(self.model, self.tree, self.level - up, self.node >> up, candidate >> up)
                };
                if is_similar(0) { up.filter(|up| is_similar(*up)).count() } else { 0 }
            }
            (MatchCriterion::RunningMean, count) => {
                let mut sum = 0.0;
                let mut is_similar = |up: &usize| {
                    let level = self.level - up;
                    let difference = self.distance(level, candidate >> up, (self.node >> up) as isize);
                    // Relative to the threshold, which may be 0.
                    sum += if difference > 0.0 {
                        difference / f64::from(self.model.thresholds[level])
                    } else {
                        0.0
                    };
                    sum <= 0.5 * (up + 1) as f64
                };
                match count {
                    MatchCount::Consecutive => up.take_while(is_similar).count(),
                    MatchCount::Total if is_similar(&0) => 1 + (1..=self.level).filter(is_similar).count(),
                    MatchCount::Total => 0,
                }
            }
        }
    }

    /// Returns the candidates with the most similar ancestors, and of these the ones with the most predecessors.
    fn deepest(&self, candidates: &mut dyn Iterator<Item = u32>) -> Option<Best> {
        let mut found: (usize, Vec<u32>) = (1, Vec::new());
        for m in candidates {
            let depth = self.ancestors(m);
            if depth > found.0 {
                found = (depth, vec![m]);
            } else if depth == found.0 {
                found.1.push(m);
            }
        }
        self.with_predecessors(found.0, found.1)
    }

    /// The best of the candidates that are wanted, and of all others, without those that continue for too long if there are others.
    pub fn pair(&self, classes: &mut Classes, is_wanted: impl Fn(u32) -> bool) -> Pair {
        let mut pair = Pair::default();
        for limits in self.limits() {
            let found =
                self.pair_of(classes, &is_wanted, |m| self.is_allowed(m) && self.is_within(m, limits));
            // A draw is between candidates within the same limits.
            let is_choice = |kind: &Option<Best>| kind.as_ref().is_some_and(|best| self.is_choice(best));
            if limits.alike && !(is_choice(&found.wanted) && is_choice(&found.others)) {
                continue;
            }
            pair.wanted = pair.wanted.or(found.wanted);
            pair.others = pair.others.or(found.others);
            // Either kind repeats itself rather than be left out.
            let kinds = usize::from(pair.wanted.is_some()) + usize::from(pair.others.is_some());
            if kinds > usize::from(limits.repeats) {
                break;
            }
        }
        pair.is_discarded = pair.wanted.is_none() && pair.others.is_some();
        pair
    }

    /// The search ends at the depth at which the kind that is not found yet would match too badly.
    fn pair_of(
        &self,
        classes: &mut Classes,
        is_wanted: impl Fn(u32) -> bool,
        is_admitted: impl Fn(u32) -> bool,
    ) -> Pair {
        let mut pair = Pair::default();
        let split = |list: &mut dyn Iterator<Item = u32>, pair: &Pair| {
            let mut nodes = [Vec::new(), Vec::new()];
            for m in list {
                let kind = usize::from(!is_wanted(m));
                let is_open = if kind == 0 { pair.wanted.is_none() } else { pair.others.is_none() };
                if is_open && is_admitted(m) {
                    nodes[kind].push(m);
                }
            }
            nodes
        };
        if self.is_root {
            // A root has no ancestors that could match better or worse.
            let [wanted, others] = split(&mut (0..self.model.tree.roots() as u32), &pair);
            pair.wanted = self.of_roots(wanted);
            pair.others = self.of_roots(others);
            return pair;
        }
        let percent = self.rules.percent();
        let [wanted, others] = split(&mut self.first.iter().copied(), &pair);
        pair.wanted = self.deepest(&mut wanted.into_iter());
        pair.others = self.deepest(&mut others.into_iter());
        for a in self.classes() {
            if pair.wanted.is_some() && pair.others.is_some() {
                break;
            }
            let found = pair.wanted.as_ref().or(pair.others.as_ref()).map_or(0, Best::quality);
            if 100 * (a + self.predecessor_limit()) < percent * found {
                break;
            }
            let list = classes.get(self.model, self.tree, self.level, self.node, a);
            let [wanted, others] = split(&mut list.iter().copied(), &pair);
            pair.wanted = pair.wanted.or_else(|| self.with_predecessors(a, wanted));
            pair.others = pair.others.or_else(|| self.with_predecessors(a, others));
        }
        let [wanted, others] = split(&mut self.others().iter().copied(), &pair);
        pair.wanted = pair.wanted.or_else(|| self.deepest(&mut wanted.into_iter()));
        pair.others = pair.others.or_else(|| self.deepest(&mut others.into_iter()));
        if let (Some(wanted), Some(others)) = (&pair.wanted, &pair.others) {
            if is_discarded(wanted, others, percent) {
                pair.wanted = None;
            } else if is_discarded(others, wanted, percent) {
                pair.others = None;
            }
        }
        pair.is_discarded = pair.wanted.is_none() && pair.others.is_some();
        pair
    }

    /// The greatest number of predecessors that can match.
    fn predecessor_limit(&self) -> usize {
        if self.level == 0 { self.rules.root_predecessors } else { self.rules.predecessors }
    }

    /// Returns the roots that may be chosen: all of them by their [continuity](Self::continuity), or those with the most predecessors that match.
    fn of_roots(&self, nodes: Vec<u32>) -> Option<Best> {
        match self.rules.continuity {
            Some(_) => (!nodes.is_empty()).then_some(Best { ancestors: 1, predecessors: 0, nodes }),
            None => self.with_predecessors(1, nodes),
        }
    }

    /// Continuity of the levels from the root before this one to a candidate root, from 0 to 1. It compares the levels of what precedes the
    /// candidate in its recording with those of the root before: about 1 within the difference that the rules state, and little beyond it.
    pub fn continuity(&self, root: u32) -> f64 {
        let (Some(scale), true) = (self.rules.continuity, self.is_root) else { return 1.0 };
        match (self.tree.pick(0, -1), predecessor(self.model, 0, root, 1)) {
            (NONE, _) => 1.0,
            (before, Some(own)) => {
                let difference = self.model.envelopes.relative_difference(before, own) / scale;
                1.0 / (1.0 + difference.powi(8))
            }
            // What precedes a recording is not known.
            (_, None) => 0.0,
        }
    }

    /// Returns the candidates with the most predecessors that match.
    fn with_predecessors(&self, ancestors: usize, nodes: Vec<u32>) -> Option<Best> {
        let mut best = Best { ancestors, predecessors: 0, nodes: Vec::new() };
        for m in nodes {
            let predecessors = self.predecessors(m);
            if predecessors > best.predecessors {
                best.predecessors = predecessors;
                best.nodes.clear();
            }
            if predecessors == best.predecessors {
                best.nodes.push(m);
            }
        }
        best.nodes.sort_unstable();
        (!best.nodes.is_empty()).then_some(best)
    }

    /// The node whose ancestors and predecessors differ least, of a set or of all; the first of equals. What must not occur is chosen only if
    /// nothing else is left at a coarse level.
    pub fn most_similar(&self, set: Option<&NodeSet>) -> Option<u32> {
        let all = || 0..self.model.tree.nodes(self.level) as u32;
        let closest = |nodes: &mut dyn Iterator<Item = u32>| {
            let mut best: Option<(f64, u32)> = None;
            for m in nodes {
                let difference = self.difference(m);
                if best.is_none_or(|(least, _)| difference < least) {
                    best = Some((difference, m));
                }
            }
            best.map(|(_, m)| m)
        };
        let of = |is_admitted: &dyn Fn(u32) -> bool| match set {
            Some(set) => closest(&mut set.iter().filter(|m| is_admitted(*m))),
            None => closest(&mut all().filter(|m| is_admitted(*m))),
        };
        let limited =
            self.limits().find_map(|limits| of(&|m| self.is_allowed(m) && self.is_within(m, limits)));
        limited.or_else(|| of(&|_| true))
    }

    /// The greatest difference of a node of the model and one of the output, over channels.
    fn distance(&self, level: usize, candidate: u32, node: isize) -> f64 {
        let pairs = source_value(self.model, level, candidate).iter().zip(self.tree.value(level, node));
        f64::from(pairs.fold(0.0_f32, |max, (a, b)| max.max((a - b).abs())))
    }

    fn difference(&self, candidate: u32) -> f64 {
        let level = self.level;
        let mut sum = 0.0;
        if !self.is_root {
            for up in 0..APPROXIMATE_ANCESTORS.min(level + 1) {
                sum += self.distance(level - up, candidate >> up, (self.node >> up) as isize);
            }
        }
        for j in 1..=self.rules.predecessors {
            let node = self.node as isize - j as isize;
            if self.tree.pick(level, node) == NONE {
                break;
            }
            // What precedes a recording is silence.
            sum += match predecessor(self.model, level, candidate, j as u32) {
                Some(m) => self.distance(level, m, node),
                None => {
                    self.tree.value(level, node).iter().fold(0.0_f64, |max, x| max.max(f64::from(x.abs())))
                }
            };
        }
        sum
    }
}
