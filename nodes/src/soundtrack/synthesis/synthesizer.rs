//! The synthesis of a texture, root by root.

use super::choice::{Best, draw, probability};
use super::join_gains::JoinGains;
use super::layer::{Layer, Mixed};
use super::morph::Morph;
use super::node_constraints::NodeConstraints;
use super::output::NONE;
use super::rules::{SynthesisCounts, SynthesisRules, WeightBias};
use super::step::{Repetition, Step};
use crate::core::random::Random;
use crate::impl_state;
use crate::soundtrack::score::{Constraint, Constraints, NodeSet, WeightStream};
use crate::soundtrack::wavelet::{BorderKind, TextureModel};
use std::sync::Arc;

/// Maximum size of a set whose nodes are examined one by one.
const FEW: usize = 64;

/// The longest stretch is drawn for each root, between this share of it and the whole.
const SHORTEST_RUN: f64 = 0.25;

/// The set of a root in which two sounds are mixed.
const MIXTURE: u32 = NONE - 1;

/// Entities of the random numbers of omissions, after those of levels.
const OMISSIONS: u32 = 1 << 16;

/// A texture that grows root by root.
///
/// A root is chosen by its predecessors; below it, level by level and from left to right, the children of each node are those of the node of
/// the model whose ancestors and predecessors match most. The result is the same as level by level over the whole output, because a choice is
/// a function of what is above and to the left of it, and of random numbers of its own.
///
/// When two sounds overlap and morph, each is made in a layer of its own by the same random numbers, and the output is a mixture of both.
/// Each layer continues from its own choices, so no choice is matched with a mixture. Elsewhere both layers are the same.
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
    layers: Vec<Layer>,
    mixed: Option<Mixed>,
    joins: JoinGains,
    /// The sets of the constraints of the last root by layer; [`NONE`] without one, [`MIXTURE`] where two are mixed.
    sets: [u32; 2],
    /// The sets that must not occur in the last root, a bit each; of more than 64, some share one.
    forbidden: u64,
    has_masks: bool,
    /// Counts so far.
    pub counts: SynthesisCounts,
}

impl Synthesizer {
    /// Begins another root; the previous output becomes its history.
    pub fn go_to(&mut self, root: i64) {
        self.next = root;
    }

    /// Continues from another texture of the same model, with as much of its history as counts here; of the recent choices, the roots of the
    /// present round are taken over. Allocates nothing.
    pub fn follow(&mut self, other: &Self) {
        for (k, own) in self.layers.iter_mut().enumerate() {
            if let Some(other) = other.layers.get(k).or(other.layers.first()) {
                own.tree.take_history(&other.tree);
                own.approximation.copy_from_slice(&other.approximation);
                own.round.follow(&other.round);
            }
        }
        self.joins.follow(&other.joins);
        self.sets = other.sets;
        self.forbidden = other.forbidden;
        self.next = other.next;
        self.counts = other.counts;
    }

    /// A texture before its first root, `first`; the constraints at 0 hold before it, and those at `end`, in s, hold after it.
    #[must_use]
    pub fn new(
        model: Arc<TextureModel>,
        constraints: Arc<Constraints>,
        rules: SynthesisRules,
        random: Random,
        first: i64,
        end: Option<f64>,
    ) -> Self {
        let morphs = rules.overlap.is_mixed();
        let morph = || Morph::new(rules.overlap, &model, &constraints.sets);
        Self {
            layers: (0..if morphs { 2 } else { 1 }).map(|_| Layer::new(&model, &rules)).collect(),
            mixed: morphs.then(|| Mixed::new(morph(), &model)),
            joins: JoinGains::new(&model, rules.join_gain),
            sets: [NONE; 2],
            forbidden: 0,
            has_masks: model.tree.sources.iter().any(|s| !s.wraps),
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
        self.mixed.as_ref().map_or(&self.layers[0].approximation, |mixed| &mixed.approximation)
    }

    /// The details of a level of the last root by node and channel, as in the recordings.
    #[must_use]
    pub fn details(&self, level: usize) -> &[f32] {
        self.mixed.as_ref().map_or_else(|| self.layers[0].tree.current(level), |mixed| &mixed.details[level])
    }

    /// Applies gains to the details of a level of the last root, of one channel, so that they continue the levels before it.
    pub fn join(&self, level: usize, details: &mut [f32]) {
        self.joins.apply(self.model.tree.depth as usize, level, details);
    }

    /// The leaf of the model that each leaf of the last root was copied from; of a mixture, that of the greater share.
    #[must_use]
    pub fn leaves(&self) -> &[u32] {
        let tree = &self.layers[0].tree;
        let own = || tree.levels.last().map_or(&[][..], |level| &level.picks[tree.history..]);
        self.mixed.as_ref().map_or_else(own, |mixed| &mixed.leaves)
    }

    /// Makes the next root and all below it, with weights of sounds beside the score.
    pub fn advance(&mut self, weights: Option<WeightStream<'_>>) {
        let root = self.next;
        self.next += 1;
        for layer in &mut self.layers {
            layer.tree.advance();
            layer.classes.clear();
            layer.remaining.clear();
        }
        let depth = self.model.tree.depth as usize;
        let wanted = self.wanted(weights, root, 0, 0);
        let sets = match wanted.share {
            Some(_) => [MIXTURE; 2],
            None => wanted.own.map(|own| own.map_or(NONE, |c| c.set as u32)),
        };
        let forbidden = wanted.forbidden.iter().fold(0, |bits, set| bits | 1 << (set % 64));
        let goes_on = sets == self.sets && sets[0] != MIXTURE;
        if (sets, forbidden) != (self.sets, self.forbidden) {
            self.layers.iter_mut().for_each(|layer| layer.round.clear());
        }
        (self.sets, self.forbidden) = (sets, forbidden);
        let picks = self.picks(&wanted, root, 0, 0, true);
        for (layer, pick) in self.layers.iter_mut().zip(picks) {
            layer.recent_roots.add(pick);
            let channels = layer.approximation.len();
            let k = pick as usize * channels;
            layer.approximation.copy_from_slice(&self.model.tree.approximation[k..k + channels]);
            layer.copy(&self.model, 0, 0, pick);
        }
        if let Some(mixed) = &mut self.mixed {
            mixed.fill(&self.layers, &wanted, 0, 0..1);
            let share = wanted.share.unwrap_or(1.0 - wanted.lead as f64) as f32;
            for (k, out) in mixed.approximation.iter_mut().enumerate() {
                let [a, b] = [0, 1].map(|layer: usize| self.layers[layer].approximation[k]);
                *out = share * a + (1.0 - share) * b;
            }
        }
        for level in 0..depth.saturating_sub(1) {
            for node in 0..1 << level {
                let wanted = self.wanted(weights, root, level, node);
                let picks = self.picks(&wanted, root, level, node, false);
                for (layer, pick) in self.layers.iter_mut().zip(picks) {
                    layer.recent[level].add(pick);
                    layer.copy(&self.model, level + 1, 2 * node, 2 * pick);
                    layer.copy(&self.model, level + 1, 2 * node + 1, 2 * pick + 1);
                }
                if let Some(mixed) = &mut self.mixed {
                    mixed.fill(&self.layers, &wanted, level + 1, 2 * node..2 * node + 2);
                }
            }
        }
        let tree = &self.layers[0].tree;
        let join = tree.root_of_leaf(-1).zip(tree.root_of_leaf(0)).filter(|_| goes_on);
        self.joins.advance(&self.model, join);
        for layer in &mut self.layers {
            layer.end_root(&self.model);
            self.counts.capped += std::mem::take(&mut layer.classes.capped);
        }
    }

    /// The candidates for a node of the last root, as if it had no constraint: those with the most ancestors that match, and of these those
    /// with the most predecessors that match. `None` for a leaf, or if nothing matches.
    pub fn candidates(&mut self, level: usize, node: usize) -> Option<(Vec<u32>, Best)> {
        let root = self.next - 1;
        let Self { model, constraints, rules, random, layers, has_masks, .. } = self;
        let Layer { tree, classes, .. } = layers.first_mut()?;
        if level + 2 > model.tree.depth as usize || node >= 1 << level {
            return None;
        }
        let longest = longest_run(model, rules, random, root, tree.root_of_leaf(-1));
        let (is_root, forbidden, has_masks) = (false, &[][..], *has_masks);
        let step = Step {
            longest,
            model,
            constraints,
            rules,
            tree,
            level,
            node,
            is_root,
            forbidden,
            has_masks,
            first: &[],
            repetition: Repetition { counts: &[], factor: 1.0, random, entity: 0, index: 0 },
        };
        let best = step.best(classes, None, 0, |_| true)?;
        let all = classes.get(model, tree, level, node, best.ancestors).to_vec();
        Some((all, best))
    }

    /// The node of the model that a node of the last root was copied from.
    #[must_use]
    pub fn pick(&self, level: usize, node: usize) -> u32 {
        self.layers[0].tree.pick(level, node as isize)
    }

    /// The first channel of a node, by its index from the beginning of the output, if it is of the last root or of the history before it.
    #[must_use]
    pub fn value(&self, level: usize, node: i64) -> Option<f32> {
        let tree = &self.layers.first()?.tree;
        let own = (node - ((self.next - 1) << level)) as isize;
        let is_there = own < 1 << level && tree.pick(level, own) != NONE;
        is_there.then(|| tree.value(level, own).first().copied())?
    }

    fn wanted(
        &self,
        weights: Option<WeightStream<'_>>,
        root: i64,
        level: usize,
        node: usize,
    ) -> NodeConstraints {
        let node = (root << level) + node as i64;
        NodeConstraints::at(&self.model, &self.constraints, weights, &self.rules, self.end, level, node)
    }

    /// The nodes of the model whose children become those of a node, by layer; with `is_root`, the root itself.
    fn picks(
        &mut self,
        wanted: &NodeConstraints,
        root: i64,
        level: usize,
        node: usize,
        is_root: bool,
    ) -> [u32; 2] {
        if wanted.share.is_some() {
            return [0, 1].map(|layer| self.choose(layer, wanted, root, level, node, is_root));
        }
        [self.choose(wanted.lead, wanted, root, level, node, is_root); 2]
    }

    /// Chooses a node for a layer.
    fn choose(
        &mut self,
        layer: usize,
        wanted: &NodeConstraints,
        root: i64,
        level: usize,
        node: usize,
        is_root: bool,
    ) -> u32 {
        let Self { model, constraints, rules, random, layers, counts, has_masks, .. } = self;
        let Layer { tree, classes, recent, recent_roots, round, remaining, first, .. } = &mut layers[layer];
        remaining.children(level, node, first);
        let (own, later, distance) = (wanted.own[layer], wanted.later[layer], wanted.distance);
        let longest = longest_run(model, rules, random, root, tree.root_of_leaf(-1));
        let index = ((root << level) + node as i64) as u64;
        let entity = if is_root { 0 } else { level as u32 + 1 };
        let recent = if is_root { recent_roots } else { &recent[level] };
        let step = Step {
            longest,
            model,
            constraints,
            rules,
            tree,
            level,
            node,
            is_root,
            forbidden: &wanted.forbidden,
            has_masks: *has_masks,
            first,
            repetition: Repetition {
                counts: &recent.counts,
                factor: rules.repetition,
                random,
                entity: entity + OMISSIONS,
                index,
            },
        };
        counts.steps += 1;
        let uniform = |lane| random.uniform(entity, index, lane);
        let weight = |m: u32| step.continuity(m);
        let complete = step.depth();
        let mut pick = |best: Best, counts: &mut SynthesisCounts| {
            if !is_root {
                remaining.set(level, node, &best.nodes);
            }
            counts.candidates += best.nodes.len() as u64;
            counts.partial += u64::from(best.ancestors < complete);
            // Below blocks, what matches is a part of one.
            if !is_root && level > 0 {
                return draw(&best.nodes, weight, uniform(0));
            }
            let preferences = || best.nodes.iter().map(|m| round.preference(model, *m));
            let greatest = preferences().fold(f64::NEG_INFINITY, f64::max);
            let preferred = |m: u32| weight(m) * libm::exp(round.preference(model, m) - greatest);
            draw(&best.nodes, preferred, uniform(0))
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
                match c.weight > 0.0 {
                    is_inclusion if !c.is_hard => set.centred[level].contains(node) == is_inclusion,
                    true => set.included[level].contains(node),
                    false => !set.excluded[level].contains(node),
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
                let [of_wanted, of_others] = match rules.bias {
                    WeightBias::Probability => step.shares(main),
                    WeightBias::Monotone | WeightBias::Paper => [total(&wanted), total(&others)],
                };
                let p = probability(rules, main.weight, of_wanted, of_others);
                // One draw for all nodes below a root: a stretch is of one kind as far as the weights are the same.
                let is_wanted = random.uniform(0, root as u64, 1) < p;
                pick(if is_wanted { wanted } else { others }, counts)
            }
        };
        picked.unwrap_or_else(|| approximate(None, counts))
    }
}

/// The longest stretch below a root, samples; `before` is the root of the leaf before it. A fixed length would be heard as a rhythm. Where three
/// roots fit, more than half of all stretches are shorter than two; where two fit, they are anyway. Parts that are loud above 8 kHz continue as
/// long as permitted, so that few joins are audible.
///
/// A recording with enough borders before loud ones is joined mostly at borders of roots, where levels are compared: joins within roots would modulate it.
/// In others it would be joined at their few loud borders too often.
fn longest_run(
    model: &TextureModel,
    rules: &SynthesisRules,
    random: &Random,
    root: i64,
    before: Option<u32>,
) -> Option<f64> {
    let longest = rules.max_run? * model.tree.rate;
    if before.is_some_and(|before| model.envelopes.borders(before)[1].kind == BorderKind::Loud) {
        return Some(longest);
    }
    let (uniform, span) = (random.uniform(0, root as u64, 2), model.tree.span(0) as f64);
    let draw = if longest < 3.0 * span { uniform } else { libm::pow(uniform, 1.75) };
    let avoids = |before| model.envelopes.avoids_loud_borders(model.tree.source_of(before));
    let joins_roots = longest >= 2.0 * span && before.is_some_and(avoids);
    let shortest = (SHORTEST_RUN * longest).max(if joins_roots { span } else { 0.0 });
    Some(shortest + (longest - shortest) * draw)
}

impl_state!(Synthesizer { next, each layers, joins, sets, forbidden, counts });

#[cfg(test)]
mod tests;
