//! The synthesis of a texture, root by root.

use super::choice::{Best, draw, probability};
use super::classes::{Classes, source_value};
use super::output::{NONE, OutputTree};
use super::rules::{SynthesisCounts, SynthesisRules};
use super::step::{Step, predecessor};
use crate::core::random::Random;
use crate::impl_state;
use crate::soundtrack::score::{Constraint, Constraints, NodeSet, WeightStream};
use crate::soundtrack::wavelet::TextureModel;
use std::collections::VecDeque;
use std::sync::Arc;

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

impl Synthesizer {
    /// Begins at another root; what was made before becomes its history.
    pub fn go_to(&mut self, root: i64) {
        self.next = root;
    }

    /// Goes on where another texture of the same model is, with as much of its history as counts here; the nodes that were chosen lately are
    /// not taken over. Allocates nothing.
    pub fn follow(&mut self, other: &Self) {
        self.tree.take_history(&other.tree);
        self.approximation.copy_from_slice(&other.approximation);
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

    /// The leaf of the model that each leaf of the last root was copied from.
    #[must_use]
    pub fn leaves(&self) -> &[u32] {
        self.tree.levels.last().map_or(&[], |level| &level.picks[self.tree.history..])
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
        let node_of_output = (root << level) + node as i64;
        let NodeConstraints { own, later, distance, forbidden } =
            NodeConstraints::at(model, constraints, weights, rules, *end, level, node_of_output);
        // A fixed length would be heard as a rhythm.
        let longest = rules.max_run.map(|longest| {
            let share = SHORTEST_RUN + (1.0 - SHORTEST_RUN) * random.uniform(0, root as u64, 2);
            longest * share * model.tree.rate
        });
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
        let index = node_of_output as u64;
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

/// What holds for a node of the output.
#[derive(Default)]
struct NodeConstraints {
    own: Option<Constraint>,
    /// What holds later by the look-ahead, which is `distance` nodes.
    later: Option<Constraint>,
    distance: u32,
    /// Sets that must not occur.
    forbidden: Vec<usize>,
}

impl NodeConstraints {
    /// Those of a node with an index from the beginning of the output.
    fn at(
        model: &TextureModel,
        constraints: &Constraints,
        weights: Option<WeightStream<'_>>,
        rules: &SynthesisRules,
        end: Option<f64>,
        level: usize,
        node: i64,
    ) -> Self {
        let mut found = Self::default();
        if constraints.is_empty() && weights.is_none() {
            return found;
        }
        let span = model.tree.span(level) as i64;
        // The times of samples, as nearest to what a score says.
        let time = |sample: i64| sample as f64 / model.tree.rate;
        let samples = end.map(|end| (end * model.tree.rate) as i64);
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
        let from = (node * span).max(0);
        found.own = constraint(from, Some(&mut found.forbidden));
        found.distance = (rules.look_ahead * model.tree.rate / span as f64).round() as u32;
        let ahead = from + i64::from(found.distance) * span;
        if found.distance > 0 && samples.is_none_or(|samples| ahead < samples) {
            // A sound that is wanted already needs no preparation.
            found.later =
                constraint(ahead, None).filter(|later| found.own.is_none_or(|own| own.set != later.set));
        }
        found
    }
}

impl_state!(Recent { counts, order });
impl_state!(Synthesizer { next, tree, approximation, each recent, counts });

#[cfg(test)]
mod tests;
