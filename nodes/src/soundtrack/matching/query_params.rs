//! The parameters of a query.

use super::pattern::{Normalisation, QueryRules};
use crate::params;

params! {
    /// A part of a motion, and how others are compared with it.
    pub struct QueryParams {
        /// Start of the query.
        from: f64, unit "s", range 0.0..=86_400.0;
        /// End of the query.
        to: f64, unit "s", range 0.0..=86_400.0;
        /// Least similarity of a match.
        threshold: f64 = 0.7, unit "", range 0.001..=1.0;
        /// Shortest match, as a factor of the query.
        shortest: f64 = 0.5, unit "", range 0.05..=1.0;
        /// Longest match, as a factor of the query.
        longest: f64 = 2.0, unit "", range 1.0..=20.0;
        /// Deviation from a uniform change of tempo, as a share of the query.
        radius: f64 = 0.1, unit "", range 0.0..=1.0;
        /// Normalisation of motions before they are compared.
        normalisation: Normalisation = Normalisation::Offset;
    }
}

impl QueryParams {
    /// Start and end, s.
    #[must_use]
    pub fn interval(&self) -> (f64, f64) {
        (self.from, self.to)
    }

    /// The rules of a search for all matches of nine lengths.
    #[must_use]
    pub fn rules(&self) -> QueryRules {
        let Self { threshold, shortest, longest, radius, normalisation, .. } = *self;
        QueryRules { shortest, longest, threshold, radius, normalisation, ..QueryRules::default() }
    }

    /// Parameters of a trial, for motions of eight seconds and more.
    pub(super) fn for_trial(self, rng: &mut crate::core::random::Rng) -> Self {
        let from = rng.between(0.0, 3.0);
        let (to, threshold) = (from + rng.between(0.5, 2.0), rng.between(0.3, 0.9));
        Self { from, to, threshold, shortest: 0.5, longest: 2.0, radius: 0.1, ..self }
    }
}
