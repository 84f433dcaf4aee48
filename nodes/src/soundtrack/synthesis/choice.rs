//! Draws among candidates.

use super::rules::{SynthesisRules, WeightBias};

/// Candidates that match equally well.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Best {
    /// Ancestors in a row that match, with the node itself.
    pub ancestors: usize,
    /// Predecessors that match.
    pub predecessors: usize,
    /// The candidates, in increasing order.
    pub nodes: Vec<u32>,
}

impl Best {
    /// True if a stretch continues, or if there is more than one candidate.
    pub fn is_choice(&self) -> bool {
        self.predecessors > 0 || self.nodes.len() > 1
    }

    /// The number of nodes that match.
    pub fn quality(&self) -> usize {
        self.ancestors + self.predecessors
    }
}

/// True if candidates match too badly beside others: less than a share of their match.
pub fn is_discarded(wanted: &Best, others: &Best, percent: usize) -> bool {
    100 * wanted.quality() < percent * others.quality()
}

/// The probability that one of the wanted candidates is chosen. `wanted` and `others` are the sums of the weights of both kinds.
pub fn probability(rules: &SynthesisRules, weight: f64, wanted: f64, others: f64) -> f64 {
    let share = |a: f64, b: f64| {
        let (a, b) = (a * wanted, b * others);
        if a + b > 0.0 { a / (a + b) } else { 0.0 }
    };
    match rules.bias {
        WeightBias::Probability => {
            let chance = share(1.0, 1.0);
            chance + (1.0 - chance) * weight.abs()
        }
        WeightBias::Monotone if weight >= 0.0 => share(0.1 + 0.9 * weight, 0.1),
        WeightBias::Paper if weight >= 0.0 => share(weight, 0.1),
        // Of an exclusion, the wanted candidates are those that respect it.
        WeightBias::Monotone | WeightBias::Paper => share(0.1, 0.1 * (1.0 + weight)),
    }
}

/// Draws one of the nodes with chances in proportion to their weights, by a uniform number.
pub fn draw(nodes: &[u32], weight: impl Fn(u32) -> f64, uniform: f64) -> Option<u32> {
    let total: f64 = nodes.iter().map(|m| weight(*m)).sum();
    if total <= 0.0 || !total.is_finite() {
        return nodes.get((uniform * nodes.len() as f64) as usize).or(nodes.last()).copied();
    }
    let mut rest = uniform * total;
    for node in nodes {
        rest -= weight(*node);
        if rest < 0.0 {
            return Some(*node);
        }
    }
    nodes.last().copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Random;

    fn rules(bias: WeightBias) -> SynthesisRules {
        SynthesisRules { bias, ..SynthesisRules::default() }
    }

    #[test]
    fn weights_are_probabilities_beyond_chance() {
        let p = |weight, wanted, others| probability(&rules(WeightBias::Probability), weight, wanted, others);
        assert_eq!((p(0.0, 1.0, 3.0), p(1.0, 1.0, 3.0), p(0.5, 1.0, 3.0)), (0.25, 1.0, 0.625));
        assert_eq!((p(-1.0, 1.0, 3.0), p(-0.5, 2.0, 2.0)), (1.0, 0.75));
        let p = |weight| probability(&rules(WeightBias::Monotone), weight, 1.0, 1.0);
        assert!(p(0.0) == 0.5 && (p(1.0) - 10.0 / 11.0).abs() < 1e-12 && (p(-0.5) - 2.0 / 3.0).abs() < 1e-12);
        let p = |weight| probability(&rules(WeightBias::Paper), weight, 1.0, 1.0);
        assert!(p(0.0) == 0.0 && p(0.05) < 0.5 && (p(0.1) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn quality_at_the_limit_is_enough() {
        let best = |ancestors, predecessors| Best { ancestors, predecessors, nodes: vec![1] };
        assert!(!is_discarded(&best(5, 2), &best(7, 3), 70));
        assert!(is_discarded(&best(4, 2), &best(7, 3), 70));
        assert!(!is_discarded(&best(0, 0), &best(0, 0), 70));
    }

    #[test]
    fn draws_follow_their_weights() {
        let random = Random::new(1, "draws");
        let nodes = [3, 5, 8];
        let mut found = [0.0; 3];
        let n = 100_000;
        for k in 0..n {
            let drawn = draw(&nodes, |m| f64::from(m % 4 + 1), random.uniform(0, k, 0)).unwrap();
            found[nodes.iter().position(|m| *m == drawn).unwrap()] += 1.0 / n as f64;
        }
        for (found, expected) in found.iter().zip([4.0 / 7.0, 2.0 / 7.0, 1.0 / 7.0]) {
            assert!((found - expected).abs() < 0.006, "{found} {expected}");
        }
        assert_eq!(draw(&nodes, |_| 0.0, 0.99), Some(8));
        assert_eq!(draw(&[], |_| 1.0, 0.5), None);
    }
}
