//! The ratio of Young's modulus to density, from the frequencies of an object of known shape.

use super::scan::maximum_within;

/// Half of the searched range of `ln sqrt(E/rho)`.
const RANGE: f64 = 1.2;
/// Step of the search.
const STEP: f64 = 0.002;
/// Distance in `ln f` beyond which a pair counts little.
const WIDTH: f64 = 0.01;
/// Tuning constant of the biweight.
const CUTOFF: f64 = 4.685;

/// A mode of a recording with the mode of the shape that it matches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchedMode {
    /// Index of the measured frequency.
    pub measured: usize,
    /// Index of the computed frequency.
    pub computed: usize,
    /// `ln(measured / computed)` after scaling.
    pub difference: f64,
}

/// Result of [`elastic_ratio`].
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticRatio {
    /// `E/rho` relative to that of the computed frequencies.
    pub factor: f64,
    /// Poisson's ratio of the best set of computed frequencies.
    pub poisson: f64,
    /// Share of the total weight that matches, 0 to 1.
    pub score: f64,
    /// Score of the best other peak relative to this one: near 1 the ratio is ambiguous.
    pub second: f64,
    /// Matched modes.
    pub pairs: Vec<MatchedMode>,
}

/// Tukey's biweight as a score from 0 to 1.
fn score(x: f64) -> f64 {
    let t = 1.0 - (x / CUTOFF).powi(2);
    if t > 0.0 { t * t * t } else { 0.0 }
}

/// Index of the nearest of sorted values.
fn nearest(sorted: &[f64], x: f64) -> Option<usize> {
    let after = sorted.partition_point(|s| *s < x);
    let near = [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|k| *k < sorted.len());
    near.min_by(|a, b| (sorted[*a] - x).abs().total_cmp(&(sorted[*b] - x).abs()))
}

/// Finds the scale of computed frequencies at which most measured ones have a partner, over sets for several Poisson's ratios.
///
/// Frequencies scale with `sqrt(E/rho)`; `E` and `rho` themselves have no effect on them. `measured` are frequencies in Hz with weights.
/// `None` without frequencies above 0.
///
/// # Complexity
/// O(1200 n log m) for n measured and m computed frequencies, for each Poisson's ratio.
#[must_use]
pub fn elastic_ratio(measured: &[[f64; 2]], computed: &[(f64, Vec<f64>)]) -> Option<ElasticRatio> {
    let logs: Vec<(usize, f64, f64)> = (measured.iter().enumerate())
        .filter(|(_, [f, w])| *f > 0.0 && f.is_finite() && *w > 0.0)
        .map(|(k, [f, w])| (k, libm::log(*f), *w))
        .collect();
    let total: f64 = logs.iter().map(|(.., w)| w).sum();
    let mut best: Option<ElasticRatio> = None;
    for (poisson, frequencies) in computed {
        let mut order: Vec<usize> = (0..frequencies.len()).filter(|k| frequencies[*k] > 0.0).collect();
        order.sort_by(|a, b| frequencies[*a].total_cmp(&frequencies[*b]));
        let sorted: Vec<f64> = order.iter().map(|k| libm::log(frequencies[*k])).collect();
        if sorted.is_empty() || logs.is_empty() {
            continue;
        }
        let difference =
            |log: f64, delta: f64| nearest(&sorted, log - delta).map(|k| (k, log - sorted[k] - delta));
        let fit = |delta: f64| -> f64 {
            let each =
                logs.iter().filter_map(|(_, log, w)| Some(w * score(difference(*log, delta)?.1 / WIDTH)));
            each.sum::<f64>() / total
        };
        let steps = (RANGE / STEP) as i32;
        let scores: Vec<f64> = (-steps..=steps).map(|k| fit(f64::from(k) * STEP)).collect();
        let peak = (0..scores.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b])).unwrap_or(0);
        let at = |k: usize| (k as f64 - f64::from(steps)) * STEP;
        let delta = maximum_within(at(peak) - STEP, at(peak) + STEP, fit);
        let found = fit(delta);
        if best.as_ref().is_some_and(|b| b.score >= found) {
            continue;
        }
        let apart = |k: &usize| k.abs_diff(peak) as f64 * STEP > 2.0 * CUTOFF * WIDTH;
        let second =
            (0..scores.len()).filter(apart).map(|k| scores[k]).fold(0.0, f64::max) / found.max(1e-12);
        let pairs = logs.iter().filter_map(|(measured, log, _)| {
            let (k, difference) = difference(*log, delta)?;
            let matched = MatchedMode { measured: *measured, computed: order[k], difference };
            (difference.abs() < CUTOFF * WIDTH).then_some(matched)
        });
        best = Some(ElasticRatio {
            factor: libm::exp(2.0 * delta),
            poisson: *poisson,
            score: found,
            second,
            pairs: pairs.collect(),
        });
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn scaled_frequencies_give_their_scale_despite_errors_and_strangers() {
        let mut rng = Rng::new(4);
        let model: Vec<f64> = (0..25).map(|_| rng.between(5.5, 9.0).exp()).collect();
        let other: Vec<f64> = (0..25).map(|_| rng.between(5.5, 9.0).exp()).collect();
        let scale = 0.71_f64;
        let mut measured: Vec<[f64; 2]> =
            model[..15].iter().map(|f| [f * scale * (1.0 + rng.between(-0.003, 0.003)), 1.0]).collect();
        measured.extend((0..4).map(|_| [rng.between(5.5, 9.0).exp(), 1.0]));
        let found = elastic_ratio(&measured, &[(0.2, other), (0.3, model)]).unwrap();
        assert!((found.factor / (scale * scale) - 1.0).abs() < 0.01, "{found:?}");
        assert!(found.poisson == 0.3 && found.second < 0.9 && found.score > 0.7, "{found:?}");
        assert!(found.pairs.iter().filter(|p| p.measured == p.computed).count() >= 13, "{found:?}");
    }

    #[test]
    fn nothing_to_match_gives_none() {
        assert!(elastic_ratio(&[], &[(0.3, vec![100.0])]).is_none());
        assert!(elastic_ratio(&[[100.0, 1.0]], &[(0.3, vec![])]).is_none());
        assert!(elastic_ratio(&[[f64::NAN, 1.0]], &[(0.3, vec![100.0])]).is_none());
    }
}
