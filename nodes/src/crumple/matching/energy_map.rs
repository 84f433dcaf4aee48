//! Histogram specification: from the energy of an event to an energy in the bank.

use super::histogram::{Binned, hazen, rank};
use crate::choices;

/// Comparison of distributions of energies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Rank among all energies.
    Ecdf,
    /// 20 equal bins of energy, as in the paper.
    Linear20,
    /// 20 equal bins of the logarithm of energy.
    Log20,
}

choices! { @param Mapping {
    /// Rank among all energies.
    Ecdf,
    /// 20 equal bins from the minimum to the maximum energy, as in the paper. The first contains nearly all energies.
    Linear20,
    /// 20 equal bins of the logarithm of energy.
    Log20,
} }

#[derive(Clone, Debug)]
enum Cdf {
    Ecdf(Vec<f64>),
    Binned(Box<Binned>),
}

impl Cdf {
    fn new(sorted: &[f64], mapping: Mapping) -> Self {
        match mapping {
            Mapping::Ecdf => Self::Ecdf(sorted.to_vec()),
            Mapping::Linear20 => Self::Binned(Box::new(Binned::new(sorted, false))),
            Mapping::Log20 => Self::Binned(Box::new(Binned::new(sorted, true))),
        }
    }

    fn rank(&self, energy: f64) -> f64 {
        match self {
            Self::Ecdf(sorted) => rank(sorted, energy),
            Self::Binned(binned) => binned.rank(energy),
        }
    }

    fn value(&self, p: f64) -> f64 {
        match self {
            Self::Ecdf(sorted) => hazen(sorted, p),
            Self::Binned(binned) => binned.value(p),
        }
    }
}

/// Maps the energies of events to those of a bank of the same rank.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3, with
/// [`Mapping::Linear20`]. Energies have a heavy tail, so the first of 20 equal bins contains nearly all. Ranks do not
/// depend on the distribution.
#[derive(Clone, Debug)]
pub struct EnergyMap {
    events: Cdf,
    bank: Cdf,
}

impl EnergyMap {
    /// Creates a map from sorted energies of events to those of a bank.
    #[must_use]
    pub fn new(events: &[f64], bank: &[f64], mapping: Mapping) -> Self {
        Self { events: Cdf::new(events, mapping), bank: Cdf::new(bank, mapping) }
    }

    /// Returns the fraction of weaker events, from 0 to 1.
    #[must_use]
    pub fn rank(&self, energy: f64) -> f64 {
        self.events.rank(energy)
    }

    /// Returns the energy in the bank at rank `p`.
    #[must_use]
    pub fn wanted(&self, p: f64) -> f64 {
        self.bank.value(p.clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests;
