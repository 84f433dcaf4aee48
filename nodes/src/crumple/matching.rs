//! From the energy of an event to a recorded sample: histogram specification.

use super::CrumpleBank;
use super::histogram::{Binned, hazen, rank};
use crate::impl_state;

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

/// Logarithm of an energy that may be 0.
fn log(energy: f64) -> f64 {
    energy.max(f64::MIN_POSITIVE).ln()
}

/// Samples of a bank by energy.
#[derive(Clone, Debug)]
pub struct Nearest {
    logs: Vec<f64>,
    last: Option<usize>,
}
impl_state!(Nearest { last });

impl Nearest {
    /// Over a bank's sorted energies.
    #[must_use]
    pub fn new(bank: &CrumpleBank) -> Self {
        Self { logs: bank.energies.iter().map(|e| log(*e)).collect(), last: None }
    }

    /// The range of the `k` samples whose energies are nearest to `energy`, by ratio.
    ///
    /// # Complexity
    /// O(log n + k).
    #[must_use]
    pub fn range(&self, energy: f64, k: usize) -> std::ops::Range<usize> {
        let (x, n) = (log(energy), self.logs.len());
        let at = self.logs.partition_point(|e| *e < x);
        let (mut low, mut high) = (at, at);
        while high - low < k.min(n) {
            let below = low.checked_sub(1).map(|j| x - self.logs[j]);
            let above = self.logs.get(high).map(|e| e - x);
            match (below, above) {
                (Some(b), Some(a)) if b <= a => low -= 1,
                (Some(_), None) => low -= 1,
                _ => high += 1,
            }
        }
        low..high
    }

    /// One of the `k` nearest, never the one before where there is another; `draw` is uniform on `[0, 1)`.
    pub fn pick(&mut self, energy: f64, k: usize, draw: f64) -> Option<usize> {
        let range = self.range(energy, k.max(1));
        let barred = self.last.filter(|last| range.len() > 1 && range.contains(last));
        let choices = range.len() - usize::from(barred.is_some());
        if choices == 0 {
            return None;
        }
        let mut pick = range.start + ((draw * choices as f64) as usize).min(choices - 1);
        if barred.is_some_and(|b| pick >= b) {
            pick += 1;
        }
        self.last = Some(pick);
        Some(pick)
    }
}

/// Bins of [`Rolling`] per doubling of energy.
const PER_OCTAVE: f64 = 16.0;
/// Doublings of energy that it spans, around 1.
const OCTAVES: f64 = 200.0;

/// The distribution of what came lately, older events forgotten by a half-life.
///
/// Energies are counted in bins of a sixteenth of a doubling, whose weights grow with time instead of all others shrinking. Memory is
/// fixed, and what is given depends on the past alone.
#[derive(Clone, Debug)]
pub struct Rolling {
    bins: Vec<f64>,
    total: f64,
    /// Seconds at which a new event weighs 1.
    epoch: f64,
    half_life: f64,
    /// Since when events are counted; `None` when there was a past before.
    begun: Option<f64>,
}
impl_state!(Rolling { bins, total, epoch, begun });

impl Rolling {
    /// Nothing yet; half-life in seconds.
    #[must_use]
    pub fn new(half_life: f64) -> Self {
        let bins = vec![0.0; (PER_OCTAVE * OCTAVES) as usize];
        Self { bins, total: 0.0, epoch: 0.0, half_life, begun: Some(0.0) }
    }

    /// Begins as if energies of a take had come at a steady `rate` per second.
    pub fn seed(&mut self, energies: &[f64], rate: f64) {
        if energies.is_empty() {
            return;
        }
        let mass = rate * self.half_life / std::f64::consts::LN_2 / energies.len() as f64;
        for &energy in energies {
            let bin = self.bin(energy);
            self.bins[bin] += mass;
            self.total += mass;
        }
        self.begun = None;
    }

    /// Goes on as another would.
    pub fn take_state(&mut self, old: &Self) {
        self.bins.copy_from_slice(&old.bins);
        (self.total, self.epoch, self.begun) = (old.total, old.epoch, old.begun);
    }

    fn bin(&self, energy: f64) -> usize {
        let at = (log(energy) / std::f64::consts::LN_2 + 0.5 * OCTAVES) * PER_OCTAVE;
        at.clamp(0.0, (self.bins.len() - 1) as f64) as usize
    }

    /// Adds an event at a time in seconds, and gives its rank among all so far, itself counted half.
    ///
    /// # Complexity
    /// O(1) in the number of events: one pass over 3200 bins.
    pub fn add(&mut self, time: f64, energy: f64) -> f64 {
        // Weights stay far from the largest number.
        if time - self.epoch > 200.0 * self.half_life {
            let shrink = (-(time - self.epoch) / self.half_life).exp2();
            self.bins.iter_mut().for_each(|b| *b *= shrink);
            self.total *= shrink;
            self.epoch = time;
        }
        let weight = ((time - self.epoch) / self.half_life).exp2();
        let bin = self.bin(energy);
        self.bins[bin] += weight;
        self.total += weight;
        let below: f64 = self.bins[..bin].iter().sum();
        (below + 0.5 * self.bins[bin]) / self.total
    }

    /// Events per second lately, at a time in seconds.
    #[must_use]
    pub fn rate(&self, time: f64) -> f64 {
        let mass = self.total * (-(time - self.epoch) / self.half_life).exp2();
        let seen = self.begun.map_or(1.0, |begun| 1.0 - (-(time - begun) / self.half_life).exp2());
        mass * std::f64::consts::LN_2 / self.half_life / seen.max(1e-9)
    }
}

#[cfg(test)]
#[path = "matching_tests.rs"]
mod tests;
