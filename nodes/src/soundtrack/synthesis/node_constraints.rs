//! The constraints of one node of an output.

use super::rules::SynthesisRules;
use crate::soundtrack::score::SOFT;
use crate::soundtrack::score::{Constraint, Constraints, Overlap, WeightStream};
use crate::soundtrack::wavelet::TextureModel;

/// Constraints on a node of the output.
#[derive(Default)]
pub struct NodeConstraints {
    /// By layer.
    pub own: [Option<Constraint>; 2],
    /// Constraints on the node that is later by the look-ahead.
    pub later: [Option<Constraint>; 2],
    /// The look-ahead, nodes.
    pub distance: u32,
    /// The layer that is heard.
    pub lead: usize,
    /// The share of the first layer, if both are heard.
    pub share: Option<f64>,
    /// Sets that must not occur.
    pub forbidden: Vec<usize>,
}

impl NodeConstraints {
    /// Constraints of a node with an index from the beginning of the output. If sounds morph, two inclusions may hold.
    pub fn at(
        model: &TextureModel,
        constraints: &Constraints,
        weights: Option<WeightStream<'_>>,
        rules: &SynthesisRules,
        end: Option<f64>,
        level: usize,
        node: i64,
    ) -> Self {
        let morphs = rules.overlap.is_mixed();
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
pub fn layered([first, second]: [Constraint; 2]) -> ([Constraint; 2], f64) {
    let sum = first.weight + second.weight;
    let is_hard = sum >= SOFT;
    let weight = if is_hard { 1.0 } else { sum };
    let both = [first, second].map(|c| Constraint { weight, is_hard, ..c });
    match first.layer {
        0 => (both, first.weight / sum),
        _ => ([both[1], both[0]], second.weight / sum),
    }
}
