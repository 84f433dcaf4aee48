//! Fragments of one motion that are similar to those of another.

use super::segmentation::derivative;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Rules of the comparison of fragments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FragmentRules {
    /// Number of the closest fragments.
    pub count: usize,
    /// Weight of the squared difference of the derivatives.
    pub derivative: f64,
    /// Weight of the difference of lengths.
    pub length: f64,
    /// True if the mean of each fragment is removed.
    pub is_relative: bool,
}

impl Default for FragmentRules {
    fn default() -> Self {
        Self { count: 5, derivative: 0.0, length: 0.1, is_relative: false }
    }
}

/// A fragment of the source and its distance from one of the target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The fragment of the source.
    pub fragment: usize,
    /// Its distance.
    pub distance: f64,
}

/// Greatest ratio of lengths.
const MAX_RATIO: f64 = 4.0;

/// A part of a motion at equal distances of `n` frames, with both ends.
fn stretched(x: &[f64], n: usize) -> Vec<f64> {
    let at = |j: usize| {
        let t = if n > 1 { j as f64 * (x.len() - 1) as f64 / (n - 1) as f64 } else { 0.0 };
        let k = (t as usize).min(x.len().saturating_sub(2));
        let next = x.get(k + 1).or(x.last()).copied().unwrap_or(0.0);
        let own = x.get(k).copied().unwrap_or(0.0);
        own + (t - k as f64) * (next - own)
    };
    (0..n).map(at).collect()
}

/// Standard deviation; 1 for a motion without any.
#[must_use]
pub fn deviation(x: &[f64]) -> f64 {
    let n = x.len().max(1) as f64;
    let mean = x.iter().sum::<f64>() / n;
    let sd = (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    if sd > 0.0 { sd } else { 1.0 }
}

/// The distance between two fragments: the root of the mean squared difference after the one of the source is stretched to the length of the
/// other, and a share of the logarithm of the ratio of their lengths. `scale` is the standard deviation of the target.
fn fragment_distance(source: &[f64], target: &[f64], scale: f64, rules: &FragmentRules) -> f64 {
    let n = target.len().max(1);
    let s = stretched(source, n);
    let shift =
        if rules.is_relative { (s.iter().sum::<f64>() - target.iter().sum::<f64>()) / n as f64 } else { 0.0 };
    let mut sum: f64 = s.iter().zip(target).map(|(s, t)| (t - s + shift).powi(2)).sum();
    if rules.derivative > 0.0 {
        let (ds, dt) = (derivative(&s), derivative(target));
        sum += rules.derivative * ds.iter().zip(&dt).map(|(s, t)| (t - s).powi(2)).sum::<f64>();
    }
    let ratio = (source.len().max(1) as f64 / n as f64).ln().abs();
    (sum / n as f64).sqrt() + rules.length * ratio * scale
}

/// The closest fragments of a source for each fragment of a target, the closest first; of equals the earlier. Fragments of more than four times
/// the length, or less than a quarter, count only if there are no others.
///
/// # Complexity
/// Frames of the target times fragments of the source.
///
/// # Source
/// Cardle et al., "Sound-by-Numbers" (SCA 2003), section 5.3, after Pullen and Bregler (SIGGRAPH 2002). The distance is a choice.
#[must_use]
pub fn candidates(
    source: (&[f64], &[usize]),
    target: (&[f64], &[usize]),
    rules: &FragmentRules,
) -> Vec<Vec<Candidate>> {
    let ((source, source_cuts), (target, target_cuts)) = (source, target);
    let scale = deviation(target);
    let of_target = |pair: &[usize]| {
        let own = target.get(pair[0]..pair[1]).unwrap_or_default();
        let of_source = |(fragment, pair): (usize, &[usize])| {
            let other = source.get(pair[0]..pair[1]).unwrap_or_default();
            let ratio = other.len().max(1) as f64 / own.len().max(1) as f64;
            let is_near = (1.0 / MAX_RATIO..=MAX_RATIO).contains(&ratio);
            (is_near, Candidate { fragment, distance: fragment_distance(other, own, scale, rules) })
        };
        let all: Vec<(bool, Candidate)> = source_cuts.windows(2).enumerate().map(of_source).collect();
        let any_near = all.iter().any(|(is_near, _)| *is_near);
        let mut best: Vec<Candidate> =
            all.into_iter().filter(|(near, _)| *near || !any_near).map(|(_, c)| c).collect();
        best.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.fragment.cmp(&b.fragment)));
        best.truncate(rules.count.max(1));
        best
    };
    target_cuts.par_windows(2).map(of_target).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretched_fragments_are_compared_with_their_ends() {
        assert_eq!(stretched(&[0.0, 1.0, 2.0], 5), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!((stretched(&[3.0], 2), stretched(&[1.0, 5.0], 1)), (vec![3.0, 3.0], vec![1.0]));
        let source: Vec<f64> = (0..60).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let target: Vec<f64> = source.iter().map(|x| x + 5.0).collect();
        let cuts = [0, 10, 30, 60];
        let plain = candidates((&source, &cuts), (&source, &cuts), &FragmentRules::default());
        for (k, list) in plain.iter().enumerate() {
            assert_eq!((list[0].fragment, list[0].distance), (k, 0.0));
            assert!(list.windows(2).all(|pair| pair[0].distance <= pair[1].distance) && list.len() <= 3);
        }
        let rules = FragmentRules { is_relative: true, ..FragmentRules::default() };
        let relative = candidates((&source, &cuts), (&target, &cuts), &rules);
        assert!(
            relative.iter().enumerate().all(|(k, list)| list[0].fragment == k && list[0].distance < 1e-9)
        );
    }

    #[test]
    fn lengths_count_and_extreme_ones_are_a_last_resort() {
        let flat = vec![0.0; 200];
        let list = candidates((&flat, &[0, 10, 30, 200]), (&flat, &[0, 20]), &FragmentRules::default());
        assert_eq!(list[0].iter().map(|c| c.fragment).collect::<Vec<_>>(), [1, 0]);
        let only = candidates((&flat, &[0, 200]), (&flat, &[0, 20]), &FragmentRules::default());
        assert_eq!(only[0].len(), 1);
    }
}
