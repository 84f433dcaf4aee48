//! The synthesis of a texture, root by root.

use super::choice::{Best, draw, is_discarded, probability};
use super::classes::{Classes, path, source_value};
use super::output::{NONE, OutputTree};
use super::rules::{PredecessorCount, SynthesisCounts, SynthesisRules};
use crate::core::random::Random;
use crate::impl_state;
use crate::soundtrack::score::{Constraint, Constraints, NodeSet, WeightStream};
use crate::soundtrack::wavelet::TextureModel;
use std::collections::VecDeque;
use std::sync::Arc;

/// Ancestors that count for the most similar node.
const APPROXIMATE_ANCESTORS: usize = 6;
/// Nodes of a set up to which each is looked at.
const FEW: usize = 64;

/// The longest stretch is drawn for each root, between this share of it and the whole.
const SHORTEST_RUN: f64 = 0.25;

/// Nodes that were chosen lately.
#[derive(Clone, Debug, Default)]
struct Recent {
    counts: Vec<u16>,
    order: VecDeque<u32>,
    limit: usize,
}

impl Recent {
    fn add(&mut self, node: u32) {
        if self.limit == 0 {
            return;
        }
        if self.order.len() == self.limit
            && let Some(old) = self.order.pop_front()
        {
            self.counts[old as usize] -= 1;
        }
        self.order.push_back(node);
        self.counts[node as usize] = self.counts[node as usize].saturating_add(1);
    }
}

/// A texture that grows root by root.
///
/// A root is chosen by its predecessors; below it, level by level and from left to right, the children of each node are those of the node of
/// the model whose ancestors and predecessors match most. The result is the same as level by level over the whole output, because a choice is
/// a function of what is above and to the left of it, and of random numbers of its own.
///
/// # Complexity
/// Linear in the candidates that match: a few for each node of a natural sound.
///
/// # Source
/// Cardle et al., "Sound-by-Numbers" (SCA 2003), sections 3 and 4.
#[derive(Clone, Debug)]
pub struct Synthesizer {
    model: Arc<TextureModel>,
    constraints: Arc<Constraints>,
    rules: SynthesisRules,
    random: Random,
    /// End of the output, s.
    end: Option<f64>,
    next: i64,
    tree: OutputTree,
    approximation: Vec<f32>,
    classes: Classes,
    recent: Vec<Recent>,
    has_masks: bool,
    /// What happened so far.
    pub counts: SynthesisCounts,
}

/// The recordings of the leaves of a root.
#[derive(Clone, Copy, Debug)]
pub struct RootPicks<'a> {
    /// The root.
    pub root: i64,
    /// The leaf of the model that each leaf was copied from.
    pub leaves: &'a [u32],
}

impl Synthesizer {
    /// Begins at another root; what was made before is the past of it.
    pub fn go_to(&mut self, root: i64) {
        self.next = root;
    }

    /// Takes over the past of another texture of the same model.
    pub fn take_past(&mut self, other: &Self) {
        self.tree.clone_from(&other.tree);
        self.approximation.clone_from(&other.approximation);
        self.next = other.next;
        self.counts = other.counts;
    }

    /// A texture before its first root, which is `first`; what is before 0 and after `end`, in s, has the constraints there.
    #[must_use]
    pub fn new(
        model: Arc<TextureModel>,
        constraints: Arc<Constraints>,
        rules: SynthesisRules,
        random: Random,
        first: i64,
        end: Option<f64>,
    ) -> Self {
        let tree = &model.tree;
        let (depth, channels) = (tree.depth as usize, tree.channels);
        let history = rules.predecessors.max(rules.root_predecessors).max(1);
        let recent = |level: usize| {
            let limit = (rules.memory * tree.rate / tree.span(level) as f64).ceil() as usize;
            let is_used = rules.repetition < 1.0;
            let counts = vec![0; if is_used { tree.nodes(level) } else { 0 }];
            Recent { counts, order: VecDeque::new(), limit: if is_used { limit } else { 0 } }
        };
        Self {
            tree: OutputTree::new(depth, channels, history),
            approximation: vec![0.0; channels],
            classes: Classes::new(depth, rules.candidates),
            recent: (0..depth.max(2) - 1).map(recent).collect(),
            has_masks: tree.sources.iter().any(|s| !s.wraps),
            constraints,
            rules,
            random,
            end,
            next: first,
            counts: SynthesisCounts::default(),
            model,
        }
    }

    /// The index of the root that [`Self::advance`] makes next.
    #[must_use]
    pub fn next_root(&self) -> i64 {
        self.next
    }

    /// The approximation of the last root by channel.
    #[must_use]
    pub fn approximation(&self) -> &[f32] {
        &self.approximation
    }

    /// The details of a level of the last root by node and channel.
    #[must_use]
    pub fn details(&self, level: usize) -> &[f32] {
        self.tree.current(level)
    }

    /// Where the leaves of the last root come from.
    #[must_use]
    pub fn picks(&self) -> RootPicks<'_> {
        let leaves = self.tree.levels.last().map_or(&[][..], |level| &level.picks[self.tree.history..]);
        RootPicks { root: self.next - 1, leaves }
    }

    /// Makes the next root and all below it, with weights of sounds beside the score.
    pub fn advance(&mut self, weights: Option<WeightStream<'_>>) {
        let root = self.next;
        self.next += 1;
        self.tree.advance();
        self.classes.clear();
        let depth = self.model.tree.depth as usize;
        let pick = self.choose(weights, root, 0, 0, true);
        let channels = self.approximation.len();
        let k = pick as usize * channels;
        self.approximation.copy_from_slice(&self.model.tree.approximation[k..k + channels]);
        self.copy(0, 0, pick);
        for level in 0..depth.saturating_sub(1) {
            for node in 0..1 << level {
                let pick = self.choose(weights, root, level, node, false);
                self.recent[level].add(pick);
                self.copy(level + 1, 2 * node, 2 * pick);
                self.copy(level + 1, 2 * node + 1, 2 * pick + 1);
            }
        }
        self.counts.capped += std::mem::take(&mut self.classes.capped);
    }

    /// Copies a node of the model.
    fn copy(&mut self, level: usize, node: usize, pick: u32) {
        let before = self.tree.pick(level, node as isize - 1);
        let goes_on = before != NONE && predecessor(&self.model, level, pick, 1) == Some(before);
        self.tree.set(level, node, source_value(&self.model, level, pick), pick, goes_on);
    }

    /// Chooses the node of the model whose children become those of a node; with `is_root`, the root itself.
    fn choose(
        &mut self,
        weights: Option<WeightStream<'_>>,
        root: i64,
        level: usize,
        node: usize,
        is_root: bool,
    ) -> u32 {
        let Self { model, constraints, rules, random, end, tree, classes, recent, counts, has_masks, .. } =
            self;
        let mut forbidden = Vec::new();
        let (mut own, mut later, mut distance) = (None, None, 0);
        if !constraints.is_empty() || weights.is_some() {
            let span = model.tree.span(level) as i64;
            // The times of samples, as nearest to what a score says.
            let time = |sample: i64| sample as f64 / model.tree.rate;
            let samples = end.map(|end| (end * model.tree.rate) as i64);
            let from = (((root << level) + node as i64) * span).max(0);
            // What follows the end has the constraints of the end; a stream of weights goes on by itself.
            let in_score = |from: i64| samples.map_or(from, |samples| from.min((samples - span).max(0)));
            let constraint = |from: i64, mut forbidden: Option<&mut Vec<usize>>| {
                let scored = in_score(from);
                let found = constraints.at(time(scored), time(scored + span), forbidden.as_deref_mut());
                match weights {
                    Some(weights) => weights.at(time(from), time(from + span), found, forbidden),
                    None => found,
                }
            };
            own = constraint(from, Some(&mut forbidden));
            distance = (rules.look_ahead * model.tree.rate / span as f64).round() as u32;
            let ahead = from + i64::from(distance) * span;
            if distance > 0 && samples.is_none_or(|samples| ahead < samples) {
                later = constraint(ahead, None);
            }
        }
        // A fixed length would be heard as a rhythm.
        let longest = rules.max_run.map(|longest| {
            let share = SHORTEST_RUN + (1.0 - SHORTEST_RUN) * random.uniform(0, root as u64, 2);
            longest * share * model.tree.rate
        });
        // A sound that is wanted already needs no preparation.
        let later = later.filter(|later: &Constraint| own.is_none_or(|own: Constraint| own.set != later.set));
        let step = Step {
            longest,
            model,
            constraints,
            rules,
            tree,
            level,
            node,
            is_root,
            forbidden: &forbidden,
            has_masks: *has_masks,
        };
        counts.steps += 1;
        let index = ((root << level) + node as i64) as u64;
        let entity = if is_root { 0 } else { level as u32 + 1 };
        let uniform = |lane| random.uniform(entity, index, lane);
        let weight = |m: u32| match rules.repetition < 1.0 && !is_root {
            true => rules.repetition.powi(i32::from(recent[level].counts[m as usize])),
            false => 1.0,
        };
        let complete = step.depth();
        let pick = |best: Best, counts: &mut SynthesisCounts| {
            counts.candidates += best.nodes.len() as u64;
            counts.partial += u64::from(best.ancestors < complete);
            draw(&best.nodes, weight, uniform(0))
        };
        let approximate = |set: Option<&NodeSet>, counts: &mut SynthesisCounts| {
            counts.approximate += 1;
            step.most_similar(set).unwrap_or(0)
        };
        let Some(main) = own.or(later) else {
            let picked = step.best(classes, None, 0, |_| true).and_then(|best| pick(best, counts));
            return picked.unwrap_or_else(|| approximate(None, counts));
        };
        let condition = |constraint: Option<Constraint>, node: Option<u32>| match (constraint, node) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(c), Some(node)) => {
                let set = &step.constraints.sets[c.set];
                if c.weight > 0.0 {
                    set.included[level].contains(node)
                } else {
                    !set.excluded[level].contains(node)
                }
            }
        };
        let is_now = |m: u32| condition(own, Some(m));
        let is_prepared = |m: u32| is_now(m) && condition(later, step.successor(m, distance));
        let both = own.is_some() && later.is_some();
        if let Some(own) = own.filter(|c| c.is_hard) {
            let set = &step.constraints.sets[own.set].included[level];
            let few = (set.len() <= FEW).then_some(set);
            let mut best = step.best(classes, few, 0, is_now);
            if both && let Some(now) = &best {
                let prepared = step.best(classes, few, now.quality(), is_prepared);
                counts.unprepared += u64::from(prepared.is_none());
                best = prepared.or(best);
            }
            return best
                .and_then(|best| pick(best, counts))
                .unwrap_or_else(|| approximate(Some(set), counts));
        }
        let mut pair = step.pair(classes, is_prepared);
        if pair.wanted.is_none() && both {
            counts.unprepared += 1;
            pair = step.pair(classes, is_now);
        }
        counts.discarded += u64::from(pair.is_discarded);
        let picked = match (pair.wanted, pair.others) {
            (None, None) => None,
            (Some(best), None) | (None, Some(best)) => pick(best, counts),
            (Some(wanted), Some(others)) => {
                let total = |best: &Best| best.nodes.iter().map(|m| weight(*m)).sum();
                let p = probability(rules, main.weight, total(&wanted), total(&others));
                // One draw for all nodes below a root: a stretch is of one kind as far as the weights are the same.
                let is_wanted = random.uniform(0, root as u64, 1) < p;
                pick(if is_wanted { wanted } else { others }, counts)
            }
        };
        picked.unwrap_or_else(|| approximate(None, counts))
    }
}

/// The best candidates of two kinds, without those that match much worse than the other kind.
#[derive(Default)]
struct Pair {
    wanted: Option<Best>,
    others: Option<Best>,
    /// True if wanted candidates may exist and match too badly.
    is_discarded: bool,
}

/// The node of a model that is `distance` before another one in its recording.
fn predecessor(model: &TextureModel, level: usize, node: u32, distance: u32) -> Option<u32> {
    let source = model.tree.sources.get(model.tree.source_of(node >> level))?;
    let (first, nodes) = (source.first << level, source.roots << level);
    match (node - first).checked_sub(distance) {
        Some(own) => Some(first + own),
        None if source.wraps && distance <= nodes => Some(node + nodes - distance),
        None => None,
    }
}

/// One node of the output that is to be matched.
struct Step<'a> {
    model: &'a TextureModel,
    constraints: &'a Constraints,
    rules: &'a SynthesisRules,
    tree: &'a OutputTree,
    level: usize,
    node: usize,
    is_root: bool,
    /// Sets that must not occur.
    forbidden: &'a [usize],
    has_masks: bool,
    /// Longest stretch of a recording, samples.
    longest: Option<f64>,
}

impl Step<'_> {
    /// The greatest number of ancestors that can match.
    fn depth(&self) -> usize {
        if self.is_root { 1 } else { self.level + 1 }
    }

    /// The node that is `distance` after another one in its recording.
    fn successor(&self, node: u32, distance: u32) -> Option<u32> {
        let source = self.model.tree.sources.get(self.model.tree.source_of(node >> self.level))?;
        node.checked_add(distance).filter(|m| *m < (source.first + source.roots) << self.level)
    }

    fn is_allowed(&self, candidate: u32) -> bool {
        let level = self.level;
        let is_masked = self.has_masks && self.model.tree.is_masked(level, candidate);
        let excluded = |set: &usize| self.constraints.sets[*set].excluded[level].contains(candidate);
        !is_masked && !self.model.is_redundant(level, candidate) && !self.forbidden.iter().any(excluded)
    }

    /// True if a candidate would go on with a stretch of its recording beyond the longest.
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
        f64::from(nodes) * self.model.tree.span(level) as f64 > longest
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
                super::classes::are_similar(a, b, threshold)
            })
        };
        match self.rules.count {
            PredecessorCount::Consecutive => (1..=k).take_while(is_similar).count(),
            PredecessorCount::Total => (1..=k).filter(is_similar).count(),
        }
    }

    /// The best of the candidates that a condition admits, without those that go on for too long if there are others. `few` has all nodes that
    /// the condition admits, if they are few.
    fn best(
        &self,
        classes: &mut Classes,
        few: Option<&NodeSet>,
        beside: usize,
        is_admitted: impl Fn(u32) -> bool,
    ) -> Option<Best> {
        let admits = |m: u32| is_admitted(m) && self.is_allowed(m);
        let is_enough = |best: &Best| 100 * best.quality() >= self.percent() * beside;
        let limited = self.best_of(classes, few, beside, |m| admits(m) && !self.is_too_long(m));
        limited.filter(is_enough).or_else(|| {
            self.rules.max_run?;
            self.best_of(classes, few, beside, admits).filter(is_enough)
        })
    }

    /// The share of a match that others must reach, in percent.
    fn percent(&self) -> usize {
        (100.0 * self.rules.quality).round() as usize
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
            return self.with_predecessors(1, roots);
        }
        if let Some(set) = few {
            let mut found: (usize, Vec<u32>) = (1, Vec::new());
            for m in set.iter().filter(|m| is_admitted(*m)) {
                let depth = path(self.model, self.tree, self.level, self.node, m);
                if depth > found.0 {
                    found = (depth, vec![m]);
                } else if depth == found.0 {
                    found.1.push(m);
                }
            }
            return self.with_predecessors(found.0, found.1);
        }
        for a in (1..=self.level + 1).rev() {
            if 100 * (a + self.predecessor_limit()) < self.percent() * beside {
                break;
            }
            let list = classes.get(self.model, self.tree, self.level, self.node, a);
            let nodes: Vec<u32> = list.iter().copied().filter(|m| is_admitted(*m)).collect();
            if !nodes.is_empty() {
                return self.with_predecessors(a, nodes);
            }
        }
        None
    }

    /// The best of the candidates that are wanted, and of all others, without those that go on for too long if there are others.
    fn pair(&self, classes: &mut Classes, is_wanted: impl Fn(u32) -> bool) -> Pair {
        let pair = self.pair_of(classes, &is_wanted, |m| self.is_allowed(m) && !self.is_too_long(m));
        if pair.wanted.is_some() || pair.others.is_some() || self.rules.max_run.is_none() {
            return pair;
        }
        self.pair_of(classes, &is_wanted, |m| self.is_allowed(m))
    }

    /// The search ends at the depth from which on the kind that is not found yet would match too badly.
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
            pair.wanted = self.with_predecessors(1, wanted);
            pair.others = self.with_predecessors(1, others);
            return pair;
        }
        let percent = self.percent();
        for a in (1..=self.level + 1).rev() {
            let found = pair.wanted.as_ref().or(pair.others.as_ref()).map_or(0, Best::quality);
            if 100 * (a + self.predecessor_limit()) < percent * found {
                break;
            }
            let list = classes.get(self.model, self.tree, self.level, self.node, a);
            let [wanted, others] = split(&mut list.iter().copied(), &pair);
            pair.wanted = pair.wanted.or_else(|| self.with_predecessors(a, wanted));
            pair.others = pair.others.or_else(|| self.with_predecessors(a, others));
            if pair.wanted.is_some() && pair.others.is_some() {
                break;
            }
        }
        if let (Some(wanted), Some(others)) = (&pair.wanted, &pair.others) {
            if is_discarded(wanted, others, self.rules.quality) {
                pair.wanted = None;
            } else if is_discarded(others, wanted, self.rules.quality) {
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

    /// Of candidates, those with the most predecessors that match.
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
    fn most_similar(&self, set: Option<&NodeSet>) -> Option<u32> {
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
        of(&|m| self.is_allowed(m) && !self.is_too_long(m))
            .or_else(|| of(&|m| self.is_allowed(m)))
            .or_else(|| of(&|_| true))
    }

    fn difference(&self, candidate: u32) -> f64 {
        let between = |level: usize, m: u32, node: isize| -> f64 {
            let pairs = source_value(self.model, level, m).iter().zip(self.tree.value(level, node));
            f64::from(pairs.fold(0.0_f32, |max, (a, b)| max.max((a - b).abs())))
        };
        let level = self.level;
        let mut sum = 0.0;
        if !self.is_root {
            for up in 0..APPROXIMATE_ANCESTORS.min(level + 1) {
                sum += between(level - up, candidate >> up, (self.node >> up) as isize);
            }
        }
        for j in 1..=self.rules.predecessors {
            let node = self.node as isize - j as isize;
            if self.tree.pick(level, node) == NONE {
                break;
            }
            // What precedes a recording is silence.
            sum += match predecessor(self.model, level, candidate, j as u32) {
                Some(m) => between(level, m, node),
                None => {
                    self.tree.value(level, node).iter().fold(0.0_f64, |max, x| max.max(f64::from(x.abs())))
                }
            };
        }
        sum
    }
}

impl_state!(Recent { counts, order });
impl_state!(Synthesizer { next, tree, approximation, each recent, counts });

#[cfg(test)]
mod tests;
