//! Motions cut where they turn.

use crate::choices;
use crate::dsp::{Band, Butterworth, zero_phase};

choices! {
    /// Points at which a motion is cut.
    pub enum SegmentVariant {
        /// Sign changes of its derivative: continuous sound through steady motion.
        FirstDerivative,
        /// Sign changes of its second derivative: continuous sound where the motion turns.
        SecondDerivative,
    }
}

/// Rules of the cuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentRules {
    /// Points at which a motion is cut.
    pub variant: SegmentVariant,
    /// Cutoff of the low-pass filter, Hz; at most 0.4 of the rate is used.
    pub cutoff: f64,
    /// Derivatives below this share of the greatest count as 0.
    pub dead_band: f64,
    /// Shortest fragment, s.
    pub shortest: f64,
}

impl Default for SegmentRules {
    fn default() -> Self {
        Self { variant: SegmentVariant::FirstDerivative, cutoff: 4.0, dead_band: 1e-3, shortest: 0.1 }
    }
}

/// A motion without its fast components and without delay.
///
/// # Source
/// Pullen and Bregler, "Motion capture assisted animation" (SIGGRAPH 2002), which Cardle et al. follow; a Butterworth filter of order 4 is a choice.
#[must_use]
pub fn smoothed(x: &[f64], rate: f64, cutoff: f64) -> Vec<f64> {
    let design = Butterworth::design(Band::LowPass, 4, cutoff.min(0.4 * rate), rate);
    design.map_or_else(|_| x.to_vec(), |design| zero_phase(&design, x))
}

/// Central differences; one-sided at the ends.
#[must_use]
pub fn derivative(x: &[f64]) -> Vec<f64> {
    let n = x.len();
    let difference = |k: usize| {
        let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
        if b > a { (x[b] - x[a]) / (b - a) as f64 } else { 0.0 }
    };
    (0..n).map(difference).collect()
}

/// The frames at which a smoothed motion is cut, with the first, and with its length at the end.
///
/// A cut is where the derivative changes its sign, or where it begins to be 0 for as long as the shortest fragment. Fragments that are shorter
/// become part of their shorter neighbour.
///
/// # Complexity
/// Linear, and quadratic in the number of fragments that are too short in the worst case.
///
/// # Source
/// Cardle et al., "Sound-by-Numbers" (SCA 2003), section 5.3.
#[must_use]
pub fn cuts(x: &[f64], rate: f64, rules: &SegmentRules) -> Vec<usize> {
    let n = x.len();
    if n < 2 {
        return vec![0, n];
    }
    let first = derivative(x);
    let d = match rules.variant {
        SegmentVariant::FirstDerivative => first,
        SegmentVariant::SecondDerivative => derivative(&first),
    };
    // Rounding errors of a constant motion are no motion.
    let scale = x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let greatest = d.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
    let least = (rules.dead_band * greatest).max(1e-9 * scale).max(f64::MIN_POSITIVE);
    let shortest = ((rules.shortest * rate).round() as usize).max(1);
    let (mut all, mut sign, mut flat) = (vec![0], 0.0, None);
    for (k, d) in d.iter().enumerate() {
        if d.abs() < least {
            flat.get_or_insert(k);
            continue;
        }
        let now = d.signum();
        let rest = flat.take().filter(|from| k - from >= shortest);
        match rest {
            Some(from) if sign != 0.0 => all.push(from),
            _ if sign != 0.0 && now != sign => all.push(k),
            _ => {}
        }
        sign = now;
    }
    if let Some(from) = flat.filter(|from| n - from >= shortest && sign != 0.0) {
        all.push(from);
    }
    all.push(n);
    all.dedup();
    merge(&mut all, shortest);
    all
}

/// Joins fragments that are shorter than `shortest` with their shorter neighbours, the shortest first.
fn merge(cuts: &mut Vec<usize>, shortest: usize) {
    loop {
        let length = |k: usize| cuts[k + 1] - cuts[k];
        let fragments = cuts.len() - 1;
        let Some(k) = (0..fragments).filter(|k| length(*k) < shortest).min_by_key(|k| length(*k)) else {
            return;
        };
        if fragments == 1 {
            return;
        }
        let left = k.checked_sub(1).map(length);
        let right = (k + 1 < fragments).then(|| length(k + 1));
        let joins_left = match (left, right) {
            (Some(left), Some(right)) => left <= right,
            (Some(_), None) => true,
            _ => false,
        };
        cuts.remove(if joins_left { k } else { k + 1 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(f: f64) -> Vec<f64> {
        (0..600).map(|k| (std::f64::consts::TAU * f * f64::from(k) / 60.0).sin()).collect()
    }

    #[test]
    fn a_sine_is_cut_at_its_extrema_or_at_its_zeros() {
        let f = 0.7;
        for (variant, first) in
            [(SegmentVariant::FirstDerivative, 0.25), (SegmentVariant::SecondDerivative, 0.5)]
        {
            let rules = SegmentRules { variant, ..SegmentRules::default() };
            let found = cuts(&smoothed(&sine(f), 60.0, 4.0), 60.0, &rules);
            let inner: Vec<usize> =
                found[1..found.len() - 1].iter().copied().filter(|k| (12..588).contains(k)).collect();
            assert!((found.len() as i64 - 2 - 14).abs() <= 1, "{variant:?}: {found:?}");
            for (k, cut) in inner.iter().enumerate() {
                let expected = 60.0 * (first + 0.5 * k as f64) / f;
                assert!((*cut as f64 - expected).abs() <= 1.5, "{variant:?} {cut} {expected}");
            }
        }
    }

    #[test]
    fn rest_begins_with_one_cut_and_noise_below_the_band_has_none() {
        let x: Vec<f64> = (0..300)
            .map(|k| match k {
                0..100 => f64::from(k),
                100..200 => 100.0,
                _ => 100.0 + f64::from(k - 200),
            })
            .collect();
        let found = cuts(&x, 60.0, &SegmentRules::default());
        assert!(found.len() == 3 && (99..=101).contains(&found[1]), "{found:?}");
        assert_eq!(cuts(&[3.0; 100], 60.0, &SegmentRules::default()), [0, 100]);
        assert_eq!(
            (cuts(&[], 60.0, &SegmentRules::default()), cuts(&[1.0], 60.0, &SegmentRules::default())),
            (vec![0, 0], vec![0, 1])
        );
    }

    #[test]
    fn short_fragments_join_their_shorter_neighbour() {
        let mut all = vec![0, 20, 22, 30, 60];
        merge(&mut all, 6);
        assert_eq!(all, [0, 20, 30, 60]);
        let mut all = vec![0, 3, 60, 62];
        merge(&mut all, 6);
        assert_eq!(all, [0, 62]);
    }
}
