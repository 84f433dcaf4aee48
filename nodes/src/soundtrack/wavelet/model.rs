//! Statistical models of sound textures: trees whose nodes are found by value.

use super::envelope::Envelopes;
use super::tree::{TreeError, WaveletTree};
use crate::choices;
use crate::core::item::Data;
use crate::core::random::Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

choices! {
    /// The coefficients that thresholds are taken from.
    #[derive(Serialize, Deserialize)]
    pub enum ThresholdScale {
        /// All coefficients: one threshold.
        Global,
        /// The coefficients of each level: a threshold for each.
        PerLevel,
    }
}

/// Rules by which thresholds are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThresholdRules {
    /// Share of the coefficients below half of the threshold.
    pub quantile: f64,
    /// The threshold itself, in place of the quantile.
    pub threshold: Option<f64>,
    /// The coefficients that are compared.
    pub scale: ThresholdScale,
}

impl Default for ThresholdRules {
    fn default() -> Self {
        Self { quantile: 0.002, threshold: None, scale: ThresholdScale::Global }
    }
}

/// A tree with the thresholds below which coefficients are similar, and an index of its nodes by value.
///
/// The threshold is twice the quantile of the magnitudes of all details that are not 0; nodes are similar if no channel differs by more.
///
/// # Source
/// Cardle et al., "Sound-by-Numbers" (SCA 2003), section 3. The quantile is a choice of other implementations of the method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct TextureModel {
    /// The tree.
    pub tree: WaveletTree,
    /// The threshold of each level.
    pub thresholds: Vec<f32>,
    /// By level, all nodes in order of their values in the first channel, without [redundant](Self::is_redundant) ones.
    order: Vec<Vec<u32>>,
    /// By level, true for redundant nodes; empty if there is none.
    redundant: Vec<Vec<bool>>,
    /// The levels of the roots by octave.
    pub envelopes: Envelopes,
}

/// Content of a file.
#[derive(Serialize, Deserialize)]
struct Stored {
    tree: WaveletTree,
    thresholds: Vec<f32>,
}

impl From<TextureModel> for Stored {
    fn from(model: TextureModel) -> Self {
        Self { tree: model.tree, thresholds: model.thresholds }
    }
}

impl TryFrom<Stored> for TextureModel {
    type Error = TreeError;

    fn try_from(stored: Stored) -> Result<Self, TreeError> {
        stored.tree.validate()?;
        let is_threshold = |t: &f32| t.is_finite() && *t >= 0.0;
        if stored.thresholds.len() != stored.tree.depth as usize
            || !stored.thresholds.iter().all(is_threshold)
        {
            return Err(TreeError::Field("thresholds"));
        }
        Ok(Self::indexed(stored.tree, stored.thresholds))
    }
}

/// The quantile of magnitudes that are not 0; 0 if all are.
fn quantile(values: impl Iterator<Item = f32>, share: f64) -> f32 {
    let mut all: Vec<f32> = values.map(f32::abs).filter(|x| *x > 0.0).collect();
    if all.is_empty() {
        return 0.0;
    }
    let k = (share * (all.len() - 1) as f64).round() as usize;
    *all.select_nth_unstable_by(k, f32::total_cmp).1
}

/// By level but for the leaves, the nodes that are 0 with all below them and precede such a node in their recording; empty if there is none.
fn redundant(tree: &WaveletTree) -> Vec<Vec<bool>> {
    let levels = tree.depth as usize;
    let is_zero = |level: usize, m: usize| {
        tree.details[level][m * tree.channels..(m + 1) * tree.channels].iter().all(|x| *x == 0.0)
    };
    let mut silent: Vec<bool> = (0..tree.nodes(levels - 1)).map(|m| is_zero(levels - 1, m)).collect();
    let mut all = Vec::with_capacity(levels - 1);
    for level in (0..levels - 1).rev() {
        silent =
            (0..tree.nodes(level)).map(|m| silent[2 * m] && silent[2 * m + 1] && is_zero(level, m)).collect();
        let mut nodes: Vec<bool> = silent.windows(2).map(|pair| pair[0] && pair[1]).chain([false]).collect();
        // The last node of a recording is not followed by the next recording.
        for source in &tree.sources {
            nodes[(((source.first + source.roots) as usize) << level) - 1] = false;
        }
        all.push(nodes);
    }
    all.reverse();
    if all.iter().flatten().any(|is| *is) { all } else { Vec::new() }
}

impl TextureModel {
    /// Makes a model of a tree.
    ///
    /// # Complexity
    /// `N log N` for `N` nodes; memory of two trees.
    #[must_use]
    pub fn new(tree: WaveletTree, rules: &ThresholdRules) -> Self {
        let depth = tree.depth as usize;
        let of = |level: usize| 2.0 * quantile(tree.details[level].iter().copied(), rules.quantile);
        let thresholds = match (rules.threshold, rules.scale) {
            (Some(threshold), _) => vec![threshold as f32; depth],
            (None, ThresholdScale::PerLevel) => (0..depth).map(of).collect(),
            (None, ThresholdScale::Global) => {
                vec![2.0 * quantile(tree.details.iter().flatten().copied(), rules.quantile); depth]
            }
        };
        Self::indexed(tree, thresholds)
    }

    fn indexed(tree: WaveletTree, thresholds: Vec<f32>) -> Self {
        let redundant = redundant(&tree);
        let by_value = |level: usize| {
            // The sign is turned so that the order of the bits is that of the numbers.
            let key = |x: f32| {
                let bits = (x + 0.0).to_bits();
                if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
            };
            let values = tree.details[level].iter().step_by(tree.channels).enumerate();
            let is_left_out = |m: usize| redundant.get(level).is_some_and(|nodes| nodes[m]);
            let mut keys: Vec<u64> = values
                .filter(|(m, _)| !is_left_out(*m))
                .map(|(m, x)| u64::from(key(*x)) << 32 | m as u64)
                .collect();
            keys.sort_unstable();
            keys.into_iter().map(|key| key as u32).collect()
        };
        // The leaves are copied with their parents and are never searched.
        let order = (0..tree.depth as usize - 1).into_par_iter().map(by_value).collect();
        Self { envelopes: Envelopes::new(&tree), tree, thresholds, order, redundant }
    }

    /// True if a node and all below it are 0, and the next node and all below that too: the last node represents all of a digital silence. Nodes
    /// below a redundant node are redundant.
    #[must_use]
    pub fn is_redundant(&self, level: usize, node: u32) -> bool {
        self.redundant.get(level).is_some_and(|nodes| nodes.get(node as usize).copied().unwrap_or(false))
    }

    /// The nodes of a level whose value in the first channel is similar to `value`.
    ///
    /// # Complexity
    /// Logarithmic in the nodes.
    #[must_use]
    pub fn similar(&self, level: usize, value: f32) -> &[u32] {
        let (Some(order), Some(values), threshold) =
            (self.order.get(level), self.tree.details.get(level), self.thresholds[level])
        else {
            return &[];
        };
        let at = |m: &u32| values[*m as usize * self.tree.channels];
        // As the comparison of two nodes, in the same precision.
        let from = order.partition_point(|m| at(m) < value && (at(m) - value).abs() > threshold);
        let to = order.partition_point(|m| at(m) <= value || (at(m) - value).abs() <= threshold);
        &order[from..to]
    }
}

impl Data for TextureModel {
    const NAME: &'static str = "texture model";
    const FILES: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        Self::new(WaveletTree::trial(rng), &ThresholdRules::default())
    }

    fn file(&self) -> Option<Vec<u8>> {
        self.to_bytes().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn similar_nodes_are_those_within_the_threshold() {
        let model = TextureModel::trial(&mut Rng::new(4));
        let (level, channels) = (3, model.tree.channels);
        let (values, threshold) = (&model.tree.details[level], model.thresholds[level]);
        for m in 0..model.tree.nodes(level) {
            let value = values[m * channels];
            let mut found = model.similar(level, value).to_vec();
            found.sort_unstable();
            let is_similar = |k: &usize| (values[k * channels] - value).abs() <= threshold;
            let expected: Vec<u32> =
                (0..model.tree.nodes(level)).filter(is_similar).map(|k| k as u32).collect();
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn the_last_node_of_silence_stands_for_all() {
        let mut tree = WaveletTree::trial(&mut Rng::new(4));
        let (leaves, channels) = (tree.depth as usize - 1, tree.channels);
        // Silence from node 1 to node 3 of level 2, which is in the first recording.
        for level in 2..=leaves {
            let nodes = 1 << (level - 2)..4 << (level - 2);
            tree.details[level][nodes.start * channels..nodes.end * channels].fill(0.0);
        }
        let model = TextureModel::new(tree, &ThresholdRules::default());
        for level in 2..leaves {
            let last = (4 << (level - 2)) - 1;
            for m in 0..model.tree.nodes(level) as u32 {
                let expected = m >= 1 << (level - 2) && m < last;
                assert_eq!(model.is_redundant(level, m), expected, "{level} {m}");
                let parent = level > 2 && model.is_redundant(level - 1, m / 2);
                assert!(!parent || model.is_redundant(level, m));
            }
            let zeros = model.similar(level, 0.0);
            assert!(zeros.contains(&last) && !zeros.contains(&(last - 1)));
        }
    }

    #[test]
    fn thresholds_are_twice_a_quantile_of_what_is_not_zero() {
        let mut tree = WaveletTree::trial(&mut Rng::new(4));
        for (l, level) in tree.details.iter_mut().enumerate() {
            level.iter_mut().for_each(|x| *x = 0.0);
            level[..4].copy_from_slice(&[1.0, -2.0, 3.0, -4.0].map(|x| x * (l + 1) as f32));
        }
        let thresholds = |scale, threshold| {
            let rules = ThresholdRules { quantile: 0.34, threshold, scale };
            TextureModel::new(tree.clone(), &rules).thresholds
        };
        assert_eq!(thresholds(ThresholdScale::PerLevel, None)[..3], [4.0, 8.0, 12.0]);
        assert_eq!(thresholds(ThresholdScale::Global, Some(0.5))[0], 0.5);
        let global = thresholds(ThresholdScale::Global, None);
        assert!(global.iter().all(|t| *t == global[0]) && global[0] > 4.0, "{global:?}");
    }

    #[test]
    fn a_model_is_restored_from_what_it_stores() {
        let model = TextureModel::trial(&mut Rng::new(4));
        let text = serde_json::to_string(&model).unwrap();
        assert_eq!(serde_json::from_str::<TextureModel>(&text).unwrap(), model);
        let wrong = text.replace("\"channels\":", "\"channels\":9,\"_\":");
        assert!(serde_json::from_str::<TextureModel>(&wrong).is_err());
    }
}
