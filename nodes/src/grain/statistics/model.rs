//! The model of patterns, and its fit.

use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::GrainDictionary;
use crate::grain::reduction::grain_features;
use crate::grain::synthesis::{GapRule, GrainStep, walk};
use crate::statistics::normal::{normal_share, standard_normal};
use crate::statistics::{Points, k_means, quantile};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Points of the envelope.
pub const ENVELOPE: usize = 64;
/// Largest number of quantiles of a distribution.
const QUANTILES: usize = 1024;

/// Statistics of the grains of some patterns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PatternModel {
    /// Sample rate, Hz.
    pub rate: f64,
    /// Digest of the dictionary.
    pub dictionary: String,
    /// Number of grains in the patterns.
    pub count: u64,
    /// Samples from the beginning of a grain to that of the next one: quantiles, rising.
    pub intervals: Vec<f64>,
    /// Mean level of the grains of each cluster relative to the envelope of their recordings, dB.
    pub cluster_levels: Vec<f64>,
    /// Level of a grain relative to that, dB: quantiles, rising.
    pub levels: Vec<f64>,
    /// Correlation of the levels of successive grains, relative to the envelope, in the patterns.
    pub correlation: f64,
    /// Correlation of successive normal variables that, with the chain of clusters, gives the levels this correlation, or at most one of 0.9
    /// within the clusters.
    pub persistence: f64,
    /// Grains of the patterns in each cluster.
    pub clusters: Vec<Vec<u32>>,
    /// Share of each cluster in the grains of the patterns: its probability as the first one.
    pub first: Vec<f64>,
    /// Probability of each cluster after each cluster, `[clusters, clusters]`.
    pub transitions: Vec<f64>,
    /// Mean power of a recording over its duration, with mean 1.
    pub envelope: Vec<f64>,
}

/// Reasons why a model cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A model of another dictionary.
    #[error(
        "the model belongs to another dictionary: its digest is {wanted}, that of the dictionary here {found}"
    )]
    Dictionary {
        /// Digest of the linked dictionary.
        found: String,
        /// Digest in the model.
        wanted: String,
    },
    /// Too few grains.
    #[error("the patterns have {found} grains one after the other; at least {MIN_GRAINS} are needed")]
    Few {
        /// The number found.
        found: usize,
    },
    /// Another version of the file.
    #[error("the model of patterns has version {found}; this reads version {wanted}: make it again")]
    Version {
        /// The version found.
        found: u32,
        /// The version that is read.
        wanted: u32,
    },
    /// A field that does not fit to the others, or is not finite.
    #[error("`{field}` of the model of patterns is damaged")]
    Damaged {
        /// Name of the field.
        field: &'static str,
    },
}

/// Fewest grains of a model.
const MIN_GRAINS: usize = 8;

/// Evenly spaced quantiles of values.
fn quantiles(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    if values.len() <= QUANTILES {
        return values;
    }
    (0..QUANTILES).map(|k| quantile(&values, k as f64 / (QUANTILES - 1) as f64)).collect()
}

/// Correlation of successive values.
pub fn lag_correlation(series: &[&[f64]]) -> f64 {
    let count: usize = series.iter().map(|x| x.len()).sum();
    let mean = series.iter().flat_map(|x| x.iter()).sum::<f64>() / count.max(1) as f64;
    let variance =
        series.iter().flat_map(|x| x.iter()).map(|x| (x - mean).powi(2)).sum::<f64>() / count.max(1) as f64;
    let pairs: Vec<f64> =
        series.iter().flat_map(|x| x.windows(2)).map(|w| (w[0] - mean) * (w[1] - mean)).collect();
    if variance <= 0.0 || pairs.is_empty() {
        return 0.0;
    }
    (pairs.iter().sum::<f64>() / pairs.len() as f64 / variance).clamp(-1.0, 1.0)
}

/// Correlation of successive normal variables for which their levels, by the quantiles, have the wanted correlation.
pub(super) fn persistence(levels: &[f64], wanted: f64) -> f64 {
    // Pairs of independent normal variables, the same for all trials.
    let mut rng = Rng::new(7);
    let pairs: Vec<[f64; 2]> = (0..20_000).map(|_| [(); 2].map(|()| standard_normal(&mut rng))).collect();
    let level = |z: f64| quantile(levels, normal_share(z));
    let correlation = |phi: f64| -> f64 {
        let rest = (1.0 - phi * phi).max(0.0).sqrt();
        let both: Vec<[f64; 2]> = pairs.iter().map(|[z, e]| [level(*z), level(phi * z + rest * e)]).collect();
        let mean = |k: usize| both.iter().map(|p| p[k]).sum::<f64>() / both.len() as f64;
        let means = [mean(0), mean(1)];
        let moment =
            |j: usize, k: usize| -> f64 { both.iter().map(|p| (p[j] - means[j]) * (p[k] - means[k])).sum() };
        moment(0, 1) / (moment(0, 0) * moment(1, 1)).sqrt().max(f64::MIN_POSITIVE)
    };
    let (mut low, mut high) = (-0.999, 0.999);
    for _ in 0..16 {
        let middle = 0.5 * (low + high);
        if correlation(middle) < wanted { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Greatest correlation of successive levels within clusters: slower changes would be those of one recording, and last for many.
const SLOWEST: f64 = 0.9;
/// Rounds in which the shares of clusters settle.
const CHAIN_ROUNDS: usize = 64;

/// Variance of the levels of the clusters of a chain, and covariance of successive ones.
fn chain_moments(first: &[f64], transitions: &[f64], levels: &[f64]) -> [f64; 2] {
    let n = first.len().max(1);
    let mut shares = first.to_vec();
    for _ in 0..CHAIN_ROUNDS {
        let mut next = vec![0.0; n];
        for (share, row) in shares.iter().zip(transitions.chunks(n)) {
            next.iter_mut().zip(row).for_each(|(next, p)| *next += share * p);
        }
        shares = next;
    }
    let mean: f64 = shares.iter().zip(levels).map(|(p, x)| p * x).sum();
    let variance = shares.iter().zip(levels).map(|(p, x)| p * (x - mean).powi(2)).sum();
    let expected = |row: &[f64]| row.iter().zip(levels).map(|(p, x)| p * (x - mean)).sum::<f64>();
    let rows = shares.iter().zip(levels).zip(transitions.chunks(n));
    [variance, rows.map(|((p, x), row)| p * (x - mean) * expected(row)).sum()]
}

/// Power of a step.
fn power(dictionary: &GrainDictionary, step: &GrainStep) -> f64 {
    let own = dictionary.grains.get(step.grain as usize).map_or(0.0, |grain| f64::from(grain.power));
    own * f64::from(step.gain).powi(2)
}

/// Grains over which a point of the envelope is averaged, so that it does not follow single ones.
const SMOOTHED_OVER: f64 = 20.0;

/// Mean power over the duration of a recording, with mean 1, smoothed.
fn envelope(walks: &[(&Pattern, Vec<GrainStep>)], dictionary: &GrainDictionary) -> Vec<f64> {
    let mut sums = vec![[0.0, 0.0]; ENVELOPE];
    for (pattern, steps) in walks {
        let mean = steps.iter().map(|s| power(dictionary, s)).sum::<f64>() / steps.len().max(1) as f64;
        for step in steps {
            let at = step.t.max(0) as f64 / pattern.frames.max(1) as f64;
            let bin = &mut sums[((at * ENVELOPE as f64) as usize).min(ENVELOPE - 1)];
            *bin = [bin[0] + power(dictionary, step) / mean.max(f64::MIN_POSITIVE), bin[1] + 1.0];
        }
    }
    let count: f64 = sums.iter().map(|s| s[1]).sum();
    let width = (ENVELOPE as f64 * SMOOTHED_OVER / count.max(1.0)).clamp(0.5, ENVELOPE as f64);
    let at = |k: usize| {
        let weighted = sums.iter().enumerate().map(|(j, s)| {
            let weight = (-0.5 * ((k as f64 - j as f64) / width).powi(2)).exp();
            [weight * s[0], weight * s[1]]
        });
        let [sum, weight] = weighted.fold([0.0, 0.0], |a, b| [a[0] + b[0], a[1] + b[1]]);
        if weight > 0.0 { sum / weight } else { 1.0 }
    };
    // A floor of -60 dB: levels are relative to it.
    let all: Vec<f64> = (0..ENVELOPE).map(|k| at(k).max(1e-6)).collect();
    let mean = all.iter().sum::<f64>() / ENVELOPE as f64;
    all.iter().map(|x| x / mean).collect()
}

/// Value of an envelope at a share of the duration, interpolated between the middles of its points.
#[must_use]
pub fn envelope_at(envelope: &[f64], share: f64) -> f64 {
    let last = envelope.len().saturating_sub(1);
    let at = (share * envelope.len() as f64 - 0.5).clamp(0.0, last as f64);
    let k = at as usize;
    let (x, y) =
        (envelope.get(k).copied().unwrap_or(1.0), envelope.get((k + 1).min(last)).copied().unwrap_or(1.0));
    x + (y - x) * (at - k as f64)
}

/// Fits a model to the walks through patterns.
///
/// The distributions of intervals and levels are those of the patterns. Levels are relative to the mean envelope of the recordings and to
/// the mean of their cluster, so that loud and soft clusters alternate as they do in the recordings. The grains of the dictionary are divided
/// into `clusters` by their spectra; clusters follow each other as in the patterns, with `smoothing` added to each count.
///
/// # Errors
/// Too few grains.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 6, which
/// names statistics of patterns as future work. Cario and Nelson, "Autoregressive to anything" (Operations Research Letters 19(2), 1996)
/// for correlated levels of any distribution.
pub fn fit(
    dictionary: &GrainDictionary,
    patterns: &[&Pattern],
    clusters: usize,
    smoothing: f64,
) -> Result<PatternModel, ModelError> {
    let walks: Vec<(&Pattern, Vec<GrainStep>)> =
        patterns.iter().map(|pattern| (*pattern, walk(pattern, dictionary, GapRule::Extend))).collect();
    let intervals: Vec<f64> = walks
        .iter()
        .flat_map(|(_, steps)| steps.windows(2))
        .map(|w| ((w[1].t - w[0].t) as f64).max(1.0))
        .collect();
    if intervals.len() < MIN_GRAINS {
        return Err(ModelError::Few { found: intervals.len() });
    }
    let envelope = envelope(&walks, dictionary);
    let level = |pattern: &Pattern, step: &GrainStep| {
        let share = step.t.max(0) as f64 / pattern.frames.max(1) as f64;
        10.0 * (power(dictionary, step).max(1e-15) / envelope_at(&envelope, share)).log10()
    };
    // The clusters are those of the dictionary, so that two models of it can be mixed.
    let every: Vec<usize> = (0..dictionary.len()).collect();
    let points = grain_features(dictionary, &every);
    let dims = points.first().map_or(1, |p| p.len());
    let points = Points { dims, at: points.into_iter().flatten().collect() };
    let (centres, of) = k_means(&points, clusters);
    let n = centres.len();
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); n];
    let mut counts = vec![0.0; n * n];
    let mut first = vec![0.0; n];
    let mut sums = vec![[0.0, 0.0]; n];
    let cluster = |step: &GrainStep| of.get(step.grain as usize).copied().unwrap_or(0);
    for (pattern, steps) in &walks {
        for step in steps {
            let sum = &mut sums[cluster(step)];
            *sum = [sum[0] + level(pattern, step), sum[1] + 1.0];
        }
    }
    let cluster_levels: Vec<f64> = sums.iter().map(|[sum, count]| sum / count.max(1.0)).collect();
    let totals: Vec<Vec<f64>> =
        walks.iter().map(|(p, steps)| steps.iter().map(|s| level(p, s)).collect()).collect();
    let correlation = lag_correlation(&totals.iter().map(Vec::as_slice).collect::<Vec<_>>());
    let of_walk = |((_, steps), levels): (&(&Pattern, Vec<GrainStep>), &Vec<f64>)| -> Vec<f64> {
        steps.iter().zip(levels).map(|(s, level)| level - cluster_levels[cluster(s)]).collect()
    };
    let levels = quantiles(walks.iter().zip(&totals).flat_map(of_walk).collect());
    for (_, steps) in &walks {
        let clusters: Vec<usize> = steps.iter().map(cluster).collect();
        clusters.windows(2).for_each(|w| counts[w[0] * n + w[1]] += 1.0);
        for (step, cluster) in steps.iter().zip(&clusters) {
            members[*cluster].push(step.grain);
            first[*cluster] += 1.0;
        }
    }
    for all in &mut members {
        all.sort_unstable();
        all.dedup();
    }
    // Clusters that no pattern has are not entered.
    let used: Vec<bool> = members.iter().map(|m| !m.is_empty()).collect();
    let normalised = |row: &[f64]| -> Vec<f64> {
        let smoothed = row.iter().zip(&used).map(|(x, used)| if *used { x + smoothing } else { 0.0 });
        let smoothed: Vec<f64> = smoothed.collect();
        let sum: f64 = smoothed.iter().sum();
        let even = used.iter().filter(|u| **u).count().max(1) as f64;
        let share = |(x, used): (&f64, &bool)| match (sum > 0.0, used) {
            (true, _) => x / sum,
            (false, true) => 1.0 / even,
            (false, false) => 0.0,
        };
        smoothed.iter().zip(&used).map(share).collect()
    };
    let total: f64 = first.iter().sum();
    let first: Vec<f64> = first.iter().map(|x| x / total.max(1.0)).collect();
    let transitions: Vec<f64> = counts.chunks(n).flat_map(normalised).collect();
    let [of_clusters, successive] = chain_moments(&first, &transitions, &cluster_levels);
    let mean = levels.iter().sum::<f64>() / levels.len().max(1) as f64;
    let residual = levels.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / levels.len().max(1) as f64;
    // What the chain of clusters does not explain of the correlation.
    let wanted = (correlation * (of_clusters + residual) - successive) / residual.max(f64::MIN_POSITIVE);
    let wanted = wanted.clamp(-SLOWEST, SLOWEST);
    Ok(PatternModel {
        rate: dictionary.rate,
        dictionary: dictionary.id(),
        count: walks.iter().map(|(_, steps)| steps.len() as u64).sum(),
        intervals: quantiles(intervals),
        persistence: persistence(&levels, wanted),
        correlation,
        cluster_levels,
        levels,
        clusters: members,
        first,
        transitions,
        envelope,
    })
}

impl PatternModel {
    /// Checks that the fields fit to each other.
    ///
    /// # Errors
    /// The first field that does not.
    pub fn validate(&self) -> Result<(), ModelError> {
        let n = self.clusters.len();
        let rises = |x: &[f64]| !x.is_empty() && x.iter().all(|x| x.is_finite()) && x.is_sorted();
        let enters_empty =
            |row: &[f64]| row.iter().zip(&self.clusters).any(|(p, c)| *p > 0.0 && c.is_empty());
        let are_chances = |x: &[f64]| x.iter().all(|x| (0.0..=1.0).contains(x)) && !enters_empty(x);
        let checks = [
            ("rate", self.rate.is_finite() && self.rate >= 1.0),
            ("intervals", rises(&self.intervals) && self.intervals[0] >= 1.0),
            ("levels", rises(&self.levels)),
            (
                "cluster_levels",
                self.cluster_levels.len() == n && self.cluster_levels.iter().all(|x| x.is_finite()),
            ),
            ("correlation", self.correlation.abs() <= 1.0),
            ("persistence", self.persistence.abs() <= 1.0),
            ("first", n > 0 && self.first.len() == n && are_chances(&self.first)),
            (
                "transitions",
                self.transitions.len() == n * n && self.transitions.chunks(n.max(1)).all(are_chances),
            ),
            (
                "envelope",
                self.envelope.len() == ENVELOPE && self.envelope.iter().all(|x| x.is_finite() && *x >= 0.0),
            ),
        ];
        let damaged = checks.into_iter().find(|(_, holds)| !holds);
        damaged.map_or(Ok(()), |(field, _)| Err(ModelError::Damaged { field }))
    }

    /// Checks that the model belongs to a dictionary.
    ///
    /// # Errors
    /// When it is of another one, or names grains that it does not have.
    pub fn check_dictionary(&self, dictionary: &GrainDictionary) -> Result<(), ModelError> {
        let found = dictionary.id();
        if found != self.dictionary {
            return Err(ModelError::Dictionary { found, wanted: self.dictionary.clone() });
        }
        if self.clusters.iter().flatten().any(|grain| *grain as usize >= dictionary.len()) {
            return Err(ModelError::Damaged { field: "clusters" });
        }
        Ok(())
    }

    /// Figures for the summary of a run.
    #[must_use]
    pub fn figures(&self) -> Summary {
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
        vec![
            ("grains", (self.count as usize).into()),
            ("mean_interval_s", (mean(&self.intervals) / self.rate).into()),
            ("correlation", self.correlation.into()),
            ("clusters", self.clusters.iter().filter(|c| !c.is_empty()).count().into()),
        ]
    }
}

impl Data for PatternModel {
    const NAME: &'static str = "model of patterns";
    const FILES: bool = true;

    fn file(&self) -> Option<Vec<u8>> {
        self.to_bytes().ok()
    }

    fn trial(rng: &mut Rng) -> Self {
        let dictionary = crate::grain::trial_dictionary();
        let patterns = CorrelationPatterns::trial(rng);
        let all: Vec<&Pattern> = patterns.patterns.iter().collect();
        let steps = || (0..20).map(|k| k as f64);
        fit(&dictionary, &all, 4, 0.1).unwrap_or_else(|_| Self {
            rate: dictionary.rate,
            dictionary: dictionary.id(),
            count: 20,
            intervals: steps().map(|k| 40.0 + 10.0 * k).collect(),
            cluster_levels: vec![-40.0],
            levels: steps().map(|k| k - 10.0).collect(),
            correlation: 0.0,
            persistence: 0.0,
            clusters: vec![vec![0, 1]],
            first: vec![1.0],
            transitions: vec![1.0],
            envelope: vec![1.0; ENVELOPE],
        })
    }
}
