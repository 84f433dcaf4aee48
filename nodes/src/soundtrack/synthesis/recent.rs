//! Nodes of a model that were chosen lately.

use crate::impl_state;
use crate::soundtrack::wavelet::TextureModel;
use std::collections::VecDeque;

/// The weight of a root for each time that it was heard in the last round.
const ROOT_FACTOR: f64 = 0.01;
/// The weight of the roots of a class of loudness for each root of it that was heard beyond its share of the last round.
const CLASS_FACTOR: f64 = 0.1;

/// Nodes that were chosen lately.
#[derive(Clone, Debug, Default)]
pub struct Recent {
    /// Number of times that each node was chosen; empty if it does not matter.
    pub counts: Vec<u16>,
    order: VecDeque<u32>,
    limit: usize,
}

impl_state!(Recent { counts, order });

impl Recent {
    /// Creates the empty history of `nodes` nodes, in which the last `limit` choices count.
    pub fn new(nodes: usize, limit: usize) -> Self {
        let counts = vec![0; if limit > 0 { nodes } else { 0 }];
        Self { counts, order: VecDeque::with_capacity(limit), limit }
    }

    /// Continues with the choices of another texture of the same model and limit. Allocates nothing.
    pub fn follow(&mut self, other: &Self) {
        self.counts.copy_from_slice(&other.counts);
        self.order.clear();
        self.order.extend(&other.order);
    }

    /// Removes all.
    fn clear(&mut self) {
        self.counts.fill(0);
        self.order.clear();
    }

    /// Number of times that a node was chosen.
    fn count(&self, node: u32) -> f64 {
        self.counts.get(node as usize).copied().unwrap_or(0).into()
    }

    /// Adds one, and removes the oldest if there are too many.
    pub fn add(&mut self, node: u32) {
        if self.limit == 0 {
            return;
        }
        if self.order.len() == self.limit
            && let Some(old) = self.order.pop_front()
        {
            self.counts[old as usize] = self.counts[old as usize].saturating_sub(1);
        }
        self.order.push_back(node);
        self.counts[node as usize] = self.counts[node as usize].saturating_add(1);
    }
}

/// The roots that were heard in the last round: as many as the model has, by halves of roots.
///
/// Roots that were heard less often than others are preferred, and so are those of the classes of loudness that were heard less often than in the
/// recordings; where other sounds are wanted or forbidden, another round begins. So a minute has the statistics of a recording, however few of its roots are loud.
#[derive(Clone, Debug, Default)]
pub struct Round {
    roots: Recent,
    classes: Recent,
}

impl_state!(Round { roots, classes });

impl Round {
    /// Creates an empty round.
    pub fn new(model: &TextureModel) -> Self {
        let (roots, classes) = (model.tree.roots(), model.envelopes.loudness_shares().len());
        Self { roots: Recent::new(roots, 2 * roots), classes: Recent::new(classes, 2 * roots) }
    }

    /// Continues with the round of another texture of the same model. Allocates nothing.
    pub fn follow(&mut self, other: &Self) {
        self.roots.follow(&other.roots);
        self.classes.follow(&other.classes);
    }

    /// Adds half of a root.
    pub fn add(&mut self, model: &TextureModel, root: u32) {
        self.roots.add(root);
        self.classes.add(model.envelopes.loudness(root));
    }

    /// Begins another round. Allocates nothing.
    pub fn clear(&mut self) {
        self.roots.clear();
        self.classes.clear();
    }

    /// The logarithm of the preference for a root among those that match equally well: 0 for one that was not heard and whose class was heard by its share.
    pub fn preference(&self, model: &TextureModel, root: u32) -> f64 {
        let class = model.envelopes.loudness(root);
        let share = model.envelopes.loudness_shares().get(class as usize).copied().unwrap_or(0.0);
        let excess = self.classes.count(class) - share * self.classes.order.len() as f64;
        0.5 * (self.roots.count(root) * libm::log(ROOT_FACTOR) + excess * libm::log(CLASS_FACTOR))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::soundtrack::wavelet::{ThresholdRules, TreeRecording, TreeRules, WaveletTree};

    /// A model of a recording whose roots rise by 1 dB each.
    fn rising(roots: usize) -> TextureModel {
        let mut rng = Rng::new(5);
        let channels = vec![(0..roots * 1024 + 960).map(|_| rng.between(-1.0, 1.0) as f32).collect()];
        let recording = TreeRecording { name: "rising".into(), content: String::new(), channels };
        let rules = TreeRules { block: Some(1024.5 / 48e3), ..TreeRules::default() };
        let mut tree = WaveletTree::analyse(48e3, &[recording], &rules).unwrap();
        assert_eq!(tree.roots(), roots);
        for (level, details) in tree.details.iter_mut().enumerate() {
            let of = |k: usize| 0.01 * 10_f32.powf((k >> level) as f32 / 20.0);
            details.iter_mut().enumerate().for_each(|(k, x)| *x = of(k));
        }
        TextureModel::new(tree, &ThresholdRules::default())
    }

    #[test]
    fn the_oldest_choices_are_forgotten() {
        let mut recent = Recent::new(4, 3);
        [0, 1, 1, 2, 3].into_iter().for_each(|node| recent.add(node));
        assert_eq!(recent.counts, [0, 1, 1, 1]);
        recent.clear();
        assert_eq!((recent.counts, recent.order.len()), (vec![0; 4], 0));
        let mut none = Recent::new(4, 0);
        none.add(2);
        assert_eq!(none.count(2), 0.0);
    }

    #[test]
    fn what_was_heard_less_often_is_preferred() {
        let model = rising(7);
        let mut round = Round::new(&model);
        assert_eq!(round.preference(&model, 0), 0.0);
        [0, 0, 1].into_iter().for_each(|root| round.add(&model, root));
        // One class, so that it always has its share.
        assert_eq!(model.envelopes.loudness_shares().len(), 1);
        let factors = [0, 1, 2].map(|root| round.preference(&model, root).exp());
        assert!((factors[0] - 0.01).abs() < 1e-12 && (factors[1] - 0.1).abs() < 1e-12, "{factors:?}");
        assert!((factors[2] - 1.0).abs() < 1e-12, "{factors:?}");
        let mut other = Round::new(&model);
        other.follow(&round);
        assert_eq!(other.preference(&model, 1), round.preference(&model, 1));
        round.clear();
        assert_eq!(round.preference(&model, 0), 0.0);
    }

    #[test]
    fn a_class_of_loudness_that_was_heard_less_than_its_share_is_preferred() {
        let model = rising(24);
        let (envelopes, shares) = (&model.envelopes, model.envelopes.loudness_shares());
        assert!(
            shares.len() == 3 && shares.iter().all(|share| (share - 1.0 / 3.0).abs() < 1e-9),
            "{shares:?}"
        );
        assert_eq!([0, 7, 8, 15, 16, 23].map(|root| envelopes.loudness(root)), [0, 0, 1, 1, 2, 2]);
        let mut round = Round::new(&model);
        [0, 0].into_iter().for_each(|root| round.add(&model, root));
        // Of one root two thirds are beyond the share of its class, and a third is missing in the others.
        let expected = [0.1_f64.powf(2.0 / 3.0), 0.1_f64.powf(-1.0 / 3.0)];
        for (root, expected) in [(1, expected[0]), (23, expected[1])] {
            let factor = round.preference(&model, root).exp();
            assert!((factor / expected - 1.0).abs() < 1e-9, "{root} {factor} {expected}");
        }
    }
}
