//! Statistical models of sound textures: trees whose nodes are found by value.

use super::tree::{TreeError, WaveletTree};
use crate::choices;
use crate::core::item::Data;
use crate::core::random::Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The coefficients that thresholds are taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ThresholdScale {
    /// Those of all levels: one threshold.
    Global,
    /// Those of each level: a threshold for each.
    PerLevel,
}

choices! { @param ThresholdScale {
    /// Those of all levels: one threshold.
    Global,
    /// Those of each level: a threshold for each.
    PerLevel,
} }

/// How thresholds are found.
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
        Self { quantile: 0.25, threshold: None, scale: ThresholdScale::Global }
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
    /// By level, all nodes in order of their values in the first channel.
    order: Vec<Vec<u32>>,
}

/// What a file contains.
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
        let by_value = |level: usize| {
            // The sign is turned so that the order of the bits is that of the numbers.
            let key = |x: f32| {
                let bits = (x + 0.0).to_bits();
                if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
            };
            let values = tree.details[level].iter().step_by(tree.channels);
            let mut keys: Vec<u64> =
                values.enumerate().map(|(m, x)| u64::from(key(*x)) << 32 | m as u64).collect();
            keys.sort_unstable();
            keys.into_iter().map(|key| key as u32).collect()
        };
        // The leaves are copied with their parents and are never searched.
        let order = (0..tree.depth as usize - 1).into_par_iter().map(by_value).collect();
        Self { tree, thresholds, order }
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
