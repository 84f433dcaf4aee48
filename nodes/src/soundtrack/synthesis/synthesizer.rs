//! The synthesis of a texture, root by root.

use super::choice::{Best, draw, probability};
use super::classes::{Classes, source_value};
use super::morph::{Morph, OverlapMode};
use super::output::{NONE, OutputTree};
use super::rules::{SynthesisCounts, SynthesisRules};
use super::step::{Step, predecessor};
use crate::core::random::Random;
use crate::impl_state;
use crate::soundtrack::score::constraints::SOFT;
use crate::soundtrack::score::{Constraint, Constraints, NodeSet, Overlap, WeightStream};
use crate::soundtrack::wavelet::TextureModel;
use std::collections::VecDeque;
use std::ops::Range;
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

/// One layer of an output. With [`OverlapMode::Winner`] there is one; otherwise there are two, which differ where two sounds overlap.
#[derive(Clone, Debug)]
struct Layer {
    tree: OutputTree,
    approximation: Vec<f32>,
    classes: Classes,
    recent: Vec<Recent>,
}

impl Layer {
    fn new(model: &TextureModel, rules: &SynthesisRules) -> Self {
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
        }
    }

    /// Copies a node of the model.
    fn copy(&mut self, model: &TextureModel, level: usize, node: usize, pick: u32) {
        let before = self.tree.pick(level, node as isize - 1);
        let goes_on = before != NONE && predecessor(model, level, pick, 1) == Some(before);
        self.tree.set(level, node, source_value(model, level, pick), pick, goes_on);
    }

    /// The children of a node, or the root itself.
    fn values(&self, level: usize, nodes: Range<usize>) -> &[f32] {
        let channels = self.approximation.len();
        &self.tree.current(level)[nodes.start * channels..nodes.end * channels]
    }
}

/// The last root, mixed of both layers.
#[derive(Clone, Debug)]
struct Mixed {
    morph: Morph,
    details: Vec<Vec<f32>>,
    approximation: Vec<f32>,
    leaves: Vec<u32>,
}

impl Mixed {
    fn new(morph: Morph, model: &TextureModel) -> Self {
        let (depth, channels) = (model.tree.depth as usize, model.tree.channels);
        Self {
            morph,
            details: (0..depth).map(|level| vec![0.0; channels << level]).collect(),
            approximation: vec![0.0; channels],
            leaves: vec![0; 1 << depth.saturating_sub(1)],
        }
    }

    /// Mixes nodes of both layers.
    fn fill(&mut self, layers: &[Layer], wanted: &NodeConstraints, level: usize, nodes: Range<usize>) {
        let channels = self.approximation.len();
        let [first, second] = layers else { return };
        let own = nodes.start * channels..nodes.end * channels;
        let (a, b) = (first.values(level, nodes.clone()), second.values(level, nodes.clone()));
        let (lead, mixture) = match (wanted.share, wanted.own) {
            (Some(share), [Some(a), Some(b)]) => {
                let lead = usize::from(share < 0.5);
                (&layers[lead], Some(self.morph.mixture(level, [a.set, b.set], share)))
            }
            _ => (&layers[wanted.lead], None),
        };
        let values = self.details[level][own].iter_mut();
        match mixture {
            Some(mixture) => values.zip(a.iter().zip(b)).for_each(|(out, (a, b))| *out = mixture.mix(*a, *b)),
            None => values.zip(a).for_each(|(out, a)| *out = *a),
        }
        if level + 1 == self.details.len() {
            for node in nodes {
                self.leaves[node] = lead.tree.pick(level, node as isize);
            }
        }
    }
}

/// A texture that grows root by root.
///
/// A root is chosen by its predecessors; below it, level by level and from left to right, the children of each node are those of the node of
/// the model whose ancestors and predecessors match most. The result is the same as level by level over the whole output, because a choice is
/// a function of what is above and to the left of it, and of random numbers of its own.
///
/// Where two sounds overlap and morph, each is made in a layer of its own by the same random numbers, and the output is a mixture of both. Each
/// layer goes on with what it has, so no choice is matched with a mixture. Elsewhere both layers are the same.
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
        for (k, own) in self.layers.iter_mut().enumerate() {
            if let Some(other) = other.layers.get(k).or(other.layers.first()) {
                own.tree.take_history(&other.tree);
                own.approximation.copy_from_slice(&other.approximation);
            }
        }
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
        let morphs = rules.overlap != OverlapMode::Winner;
        let morph = || Morph::new(rules.overlap, &model, &constraints.sets);
        Self {
            layers: vec![Layer::new(&model, &rules); if morphs { 2 } else { 1 }],
            mixed: morphs.then(|| Mixed::new(morph(), &model)),
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

    /// The details of a level of the last root by node and channel.
    #[must_use]
    pub fn details(&self, level: usize) -> &[f32] {
        self.mixed.as_ref().map_or_else(|| self.layers[0].tree.current(level), |mixed| &mixed.details[level])
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
        }
        let depth = self.model.tree.depth as usize;
        let wanted = self.wanted(weights, root, 0, 0);
        let picks = self.picks(&wanted, root, 0, 0, true);
        for (layer, pick) in self.layers.iter_mut().zip(picks) {
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
        for layer in &mut self.layers {
            self.counts.capped += std::mem::take(&mut layer.classes.capped);
        }
    }

    fn wanted(
        &self,
        weights: Option<WeightStream<'_>>,
        root: i64,
        level: usize,
        node: usize,
    ) -> NodeConstraints {
        let node = (root << level) + node as i64;
        let Self { model, constraints, rules, end, mixed, .. } = self;
        NodeConstraints::at(model, constraints, weights, rules, *end, level, node, mixed.is_some())
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
        let Layer { tree, classes, recent, .. } = &mut layers[layer];
        let (own, later, distance) = (wanted.own[layer], wanted.later[layer], wanted.distance);
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
            forbidden: &wanted.forbidden,
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

/// What holds for a node of the output.
#[derive(Default)]
struct NodeConstraints {
    /// By layer.
    own: [Option<Constraint>; 2],
    /// What holds later by the look-ahead, which is `distance` nodes.
    later: [Option<Constraint>; 2],
    distance: u32,
    /// The layer that is heard.
    lead: usize,
    /// If both are heard, the share of the first.
    share: Option<f64>,
    /// Sets that must not occur.
    forbidden: Vec<usize>,
}

impl NodeConstraints {
    /// Those of a node with an index from the beginning of the output.
    #[allow(clippy::too_many_arguments)]
    fn at(
        model: &TextureModel,
        constraints: &Constraints,
        weights: Option<WeightStream<'_>>,
        rules: &SynthesisRules,
        end: Option<f64>,
        level: usize,
        node: i64,
        morphs: bool,
    ) -> Self {
        let mut wanted = Self::default();
        if constraints.is_empty() && weights.is_none() {
            return wanted;
        }
        let span = model.tree.span(level) as i64;
        // The times of samples, as nearest to what a score says.
        let time = |sample: i64| sample as f64 / model.tree.rate;
        let samples = end.map(|end| (end * model.tree.rate) as i64);
        // What follows the end has the constraints of the end; a stream of weights goes on by itself.
        let in_score = |from: i64| samples.map_or(from, |samples| from.min((samples - span).max(0)));
        let overlap = |from: i64, mut forbidden: Option<&mut Vec<usize>>| {
            let scored = in_score(from);
            let mut found = constraints.at(time(scored), time(scored + span), forbidden.as_deref_mut());
            if let Some(weights) = weights {
                weights.add(time(from), time(from + span), &mut found, forbidden);
            }
            found
        };
        let from = (node * span).max(0);
        wanted.distance = (rules.look_ahead * model.tree.rate / span as f64).round() as u32;
        let ahead = from + i64::from(wanted.distance) * span;
        let now = overlap(from, Some(&mut wanted.forbidden));
        let is_prepared = wanted.distance > 0 && samples.is_none_or(|samples| ahead < samples);
        let later = if is_prepared { overlap(ahead, None) } else { Overlap::default() };
        wanted.own = match now.both().filter(|_| morphs) {
            Some(both) => {
                let (own, share) = layered(both);
                wanted.share = Some(share);
                own.map(Some)
            }
            None => {
                let greatest = now.greatest();
                wanted.lead = greatest.filter(|_| morphs).map_or(0, |c| c.layer);
                [greatest; 2]
            }
        };
        let later = match later.both().filter(|_| wanted.share.is_some()) {
            Some(both) => layered(both).0.map(Some),
            None => [later.greatest(); 2],
        };
        for (out, (own, later)) in wanted.later.iter_mut().zip(wanted.own.iter().zip(later)) {
            // A sound that is wanted already needs no preparation.
            *out = later.filter(|later| own.is_none_or(|own| own.set != later.set));
        }
        wanted
    }
}

/// Two inclusions by layer, and the share of the first layer. In its layer each has the weight of both.
pub(super) fn layered([first, second]: [Constraint; 2]) -> ([Constraint; 2], f64) {
    let sum = first.weight + second.weight;
    let is_hard = sum >= SOFT;
    let weight = if is_hard { 1.0 } else { sum };
    let both = [first, second].map(|c| Constraint { weight, is_hard, ..c });
    match first.layer {
        0 => (both, first.weight / sum),
        _ => ([both[1], both[0]], second.weight / sum),
    }
}

impl_state!(Recent { counts, order });
impl_state!(Layer { tree, approximation, each recent });
impl_state!(Synthesizer { next, each layers, counts });

#[cfg(test)]
mod tests;
