//! Scales of strengths.

use crate::choices;

choices! {
    /// Scale of a strength.
    pub enum Reference {
        /// Relative to a reference that the node states, so that inputs of any scale are about equally strong.
        Normalized,
        /// As the numbers of the input are.
        Absolute,
    }
}

impl Reference {
    /// Factor that brings a level to 1; 1 for absolute scales and for silence.
    #[must_use]
    pub fn unit(self, level: f64) -> f64 {
        match self {
            Self::Normalized if level > 0.0 && level.is_finite() => 1.0 / level,
            _ => 1.0,
        }
    }
}
