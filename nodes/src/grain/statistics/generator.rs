//! Patterns that are drawn from models.

use super::model::{PatternModel, envelope_at};
use crate::dsp::db_to_linear;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::synthesis::GrainStep;
use crate::statistics::normal::{normal_quantile, normal_share};
use crate::statistics::quantile;
use serde::{Deserialize, Serialize};

/// Greatest factor by which a grain is made louder or softer than it was recorded.
const MAX_LEVELLING: f64 = 4.0;
/// Grains that do not follow themselves.
const AVOIDED: usize = 2;

/// Rules by which grains are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneratorRules {
    /// Factor on the number of grains in a time.
    pub density: f64,
    /// Factor on the amplitude.
    pub gain: f64,
    /// Share of the second model, 0 to 1.
    pub blend: f64,
}

impl Default for GeneratorRules {
    fn default() -> Self {
        Self { density: 1.0, gain: 1.0, blend: 0.0 }
    }
}

/// One drawn grain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneratedGrain {
    /// The grain, when its window begins, and its amplitude.
    pub step: GrainStep,
    /// Its cluster.
    pub cluster: usize,
    /// Its level relative to the mean of its cluster, dB.
    pub residual: f64,
    /// Samples to the next grain, before `density`.
    pub interval: f64,
}

/// Draws grains one by one from a model, or from a mixture of two.
///
/// Intervals and levels have the distributions of the model. Levels of successive grains are correlated as in the model, and clusters follow
/// each other with its probabilities. Between two models quantiles are interpolated, and the probabilities of clusters mixed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Generator {
    /// Number of grains so far.
    index: u64,
    /// Start of the next grain, samples.
    time: f64,
    /// Normal variable of the last level.
    normal: f64,
    cluster: Option<u32>,
    recent: [Option<u32>; AVOIDED],
}

/// The index in which a share of the sum of chances is reached.
fn drawn(chances: &[f64], share: f64) -> usize {
    let mut left = share * chances.iter().sum::<f64>();
    let found = chances.iter().position(|chance| {
        left -= chance;
        left < 0.0
    });
    // Rounding may leave the sum just short: the last one that has a chance.
    found.or_else(|| chances.iter().rposition(|chance| *chance > 0.0)).unwrap_or(0)
}

impl Generator {
    /// Start of the next grain, samples.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Number of grains so far.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.index
    }

    /// Draws the next grain; `random` returns uniform variables of an index and a lane.
    ///
    /// # Complexity
    /// O(clusters + grains of a cluster).
    pub fn next(
        &mut self,
        models: [&PatternModel; 2],
        dictionary: &GrainDictionary,
        rules: &GeneratorRules,
        random: impl Fn(u64, u32) -> f64,
    ) -> GeneratedGrain {
        let blend = rules.blend.clamp(0.0, 1.0);
        let uniform = |lane: u32| random(self.index, lane);
        let between = |values: [&[f64]; 2], share: f64| {
            let [a, b] = values.map(|values| quantile(values, share));
            a + blend * (b - a)
        };
        let interval = between([&models[0].intervals, &models[1].intervals], uniform(0));
        let persistence = models[0].persistence + blend * (models[1].persistence - models[0].persistence);
        let fresh = normal_quantile(uniform(1).clamp(1e-12, 1.0 - 1e-12));
        self.normal = if self.index == 0 {
            fresh
        } else {
            persistence * self.normal + (1.0 - persistence * persistence).max(0.0).sqrt() * fresh
        };
        // Each grain comes from one of both models: over many, their probabilities are mixed.
        let model = models[usize::from(uniform(2) < blend)];
        let n = model.clusters.len();
        let row = self.cluster.map(|c| c as usize).and_then(|c| model.transitions.get(c * n..(c + 1) * n));
        let cluster = drawn(row.unwrap_or(&model.first), uniform(3));
        let residual = between([&models[0].levels, &models[1].levels], normal_share(self.normal));
        let level = residual + model.cluster_levels.get(cluster).copied().unwrap_or(0.0);
        let members = model.clusters.get(cluster).map_or(&[][..], Vec::as_slice);
        let start = ((uniform(4) * members.len() as f64) as usize).min(members.len().saturating_sub(1));
        let avoided = if members.len() > AVOIDED { AVOIDED } else { members.len().saturating_sub(1) };
        let is_new = |grain: &u32| !self.recent.iter().take(avoided).any(|r| *r == Some(*grain));
        // From a random one on, the first that is as loud as wanted within the levelling, or else the nearest to it.
        let own =
            |grain: u32| dictionary.grains.get(grain as usize).map_or(0.0, |g| f64::from(g.power)).sqrt();
        let wanted = db_to_linear(level);
        let factor = |grain: u32| wanted / own(grain).max(1e-9);
        let far = |grain: u32| factor(grain).ln().abs();
        let candidates = members.iter().cycle().skip(start).take(members.len()).copied();
        let new = || candidates.clone().filter(|grain| is_new(grain));
        let grain = new()
            .find(|grain| far(*grain) <= MAX_LEVELLING.ln())
            .or_else(|| new().min_by(|a, b| far(*a).total_cmp(&far(*b))))
            .or_else(|| members.first().copied())
            .unwrap_or(0);
        let factor = factor(grain).clamp(1.0 / MAX_LEVELLING, MAX_LEVELLING);
        let step = GrainStep { grain, t: self.time.round() as i64, gain: (factor * rules.gain) as f32 };
        self.time += (interval / rules.density.max(1e-3)).max(1.0);
        self.index += 1;
        self.cluster = Some(cluster as u32);
        self.recent.rotate_right(1);
        self.recent[0] = Some(grain);
        GeneratedGrain { step, cluster, residual, interval }
    }
}

/// The grains of a sound of some samples, with the envelope of the recordings if `shaped`.
#[must_use]
pub fn generated(
    models: [&PatternModel; 2],
    dictionary: &GrainDictionary,
    rules: &GeneratorRules,
    frames: u64,
    shaped: bool,
    random: impl Fn(u64, u32) -> f64,
) -> Vec<GrainStep> {
    let (mut generator, mut steps) = (Generator::default(), Vec::new());
    while generator.time() < frames as f64 {
        let mut step = generator.next(models, dictionary, rules, &random).step;
        if shaped {
            let share = step.t as f64 / frames as f64;
            let [a, b] = models.map(|model| envelope_at(&model.envelope, share));
            step.gain *= (a + rules.blend * (b - a)).max(0.0).sqrt() as f32;
        }
        let len = dictionary.grains.get(step.grain as usize).map_or(0, |grain| grain.window_len());
        if step.t as u64 + len as u64 > frames {
            break;
        }
        steps.push(step);
    }
    steps
}

#[cfg(test)]
mod tests;
