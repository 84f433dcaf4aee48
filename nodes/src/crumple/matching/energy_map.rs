//! From the energy of an event to a recorded sample: histogram specification.

use super::histogram::{Binned, hazen, rank};
use crate::choices;

/// How distributions of energies are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Rank among all energies.
    Ecdf,
    /// 20 equal bins of energy, as in the paper.
    Linear20,
    /// 20 equal bins of its logarithm.
    Log20,
}

choices! { @param Mapping {
    /// The rank of an energy among all.
    Ecdf,
    /// 20 equal bins between the least and the greatest energy: the paper. Nearly all energies fall into the first.
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

/// Maps the energies of one take onto those of a bank: the same rank, then the sample of nearest energy.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3, with
/// [`Mapping::Linear20`]. Energies are heavy-tailed, so that nearly all fall into the first of 20 equal bins; ranks do not mind.
#[derive(Clone, Debug)]
pub struct EnergyMap {
    events: Cdf,
    bank: Cdf,
}

impl EnergyMap {
    /// A map from sorted energies of events onto those of a bank.
    #[must_use]
    pub fn new(events: &[f64], bank: &[f64], mapping: Mapping) -> Self {
        Self { events: Cdf::new(events, mapping), bank: Cdf::new(bank, mapping) }
    }

    /// Share of events that are weaker, 0 to 1.
    #[must_use]
    pub fn rank(&self, energy: f64) -> f64 {
        self.events.rank(energy)
    }

    /// Energy in the bank at a rank.
    #[must_use]
    pub fn wanted(&self, p: f64) -> f64 {
        self.bank.value(p.clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests;
