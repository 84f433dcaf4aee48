//! Intervals of a motion that match a query.

use crate::core::item::Data;
use crate::core::random::Rng;
use crate::plot::{Chart, Line};
use serde::{Deserialize, Serialize};

/// An interval that matches.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionMatch {
    /// Its start, s.
    pub from: f64,
    /// Its end, s.
    pub to: f64,
    /// Similarity, from 0 to 1.
    pub similarity: f64,
}

/// The matches of a query, in order of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionMatches {
    /// Start and end of the query, s.
    pub query: (f64, f64),
    /// The least similarity of a match.
    pub threshold: f64,
    /// The matches.
    pub matches: Vec<MotionMatch>,
}

/// The weight of a match: `weight ((s - threshold) / (1 - threshold) proportion + 1 - proportion)`.
///
/// # Source
/// Cardle et al., "Sound-by-Numbers" (SCA 2003), section 5.2.
#[must_use]
pub fn match_weight(weight: f64, similarity: f64, threshold: f64, proportion: f64) -> f64 {
    let relative = if threshold < 1.0 { (similarity - threshold) / (1.0 - threshold) } else { 1.0 };
    (weight * (relative * proportion + 1.0 - proportion)).clamp(-1.0, 1.0)
}

impl Data for MotionMatches {
    const NAME: &'static str = "motion matches";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let mut from = 0.0;
        let mut one = || {
            from += rng.between(0.05, 0.2);
            MotionMatch { from, to: from + 0.05, similarity: rng.between(0.7, 1.0) }
        };
        let matches = vec![one(), one(), one()];
        Self { query: (matches[0].from, matches[0].to), threshold: 0.7, matches }
    }

    fn plot(&self) -> Option<String> {
        let corner =
            |m: &MotionMatch| [[m.from, 0.0], [m.from, m.similarity], [m.to, m.similarity], [m.to, 0.0]];
        let points: Vec<[f64; 2]> = self.matches.iter().flat_map(corner).collect();
        let (from, to) = self.query;
        let query = Line::new("query", vec![[from, self.threshold], [to, self.threshold]]);
        let lines = vec![Line::new("matches", points), query];
        (!self.matches.is_empty())
            .then(|| Chart::of("matches", ("time, s", false), ("similarity", false), lines).draw())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_follow_the_formula() {
        for (weight, s, threshold, proportion, expected) in [
            (0.8, 1.0, 0.6, 0.5, 0.8),
            (0.8, 0.6, 0.6, 0.5, 0.4),
            (0.8, 0.8, 0.6, 0.5, 0.6),
            (0.8, 0.7, 0.6, 0.0, 0.8),
            (0.8, 0.6, 0.6, 1.0, 0.0),
            (-0.5, 1.0, 0.7, 1.0, -0.5),
            (0.3, 1.0, 1.0, 1.0, 0.3),
        ] {
            assert!((match_weight(weight, s, threshold, proportion) - expected).abs() < 1e-12);
        }
    }
}
