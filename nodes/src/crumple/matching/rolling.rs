//! The distribution of the recent energies.

use super::histogram::log;
use crate::impl_state;

/// Bins per doubling of energy.
const PER_OCTAVE: f64 = 16.0;
/// Range in doublings of energy, centred at 1.
const OCTAVES: f64 = 200.0;

/// The distribution of recent energies: the weight of an event decays with a half-life.
///
/// Energies are counted in bins of 1/16 of a doubling. The weight of new events grows exponentially instead of decaying
/// all bins. Memory is constant, and results depend on earlier events alone.
#[derive(Clone, Debug)]
pub struct Rolling {
    bins: Vec<f64>,
    total: f64,
    /// Time at which a new event has weight 1, s.
    epoch: f64,
    half_life: f64,
    /// Start of the count, s; `None` after a seed.
    start: Option<f64>,
}
impl_state!(Rolling { bins, total, epoch, start });

impl Rolling {
    /// Creates an empty distribution with a half-life in seconds.
    #[must_use]
    pub fn new(half_life: f64) -> Self {
        let bins = vec![0.0; (PER_OCTAVE * OCTAVES) as usize];
        Self { bins, total: 0.0, epoch: 0.0, half_life, start: Some(0.0) }
    }

    /// Initialises the distribution as if the energies had occurred at a constant `rate` per second.
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
        self.start = None;
    }

    /// Copies the state of another distribution.
    pub fn take_state(&mut self, old: &Self) {
        self.bins.copy_from_slice(&old.bins);
        (self.total, self.epoch, self.start) = (old.total, old.epoch, old.start);
    }

    /// Returns the bin of an energy.
    fn bin(&self, energy: f64) -> usize {
        let position = (log(energy) / std::f64::consts::LN_2 + 0.5 * OCTAVES) * PER_OCTAVE;
        position.clamp(0.0, (self.bins.len() - 1) as f64) as usize
    }

    /// Adds an event at a time in seconds and returns its rank among all events so far, with itself counted half.
    ///
    /// # Complexity
    /// O(1) in the number of events: one pass over 3200 bins.
    pub fn add(&mut self, time: f64, energy: f64) -> f64 {
        // The rescaling avoids overflow of the weights.
        if time - self.epoch > 200.0 * self.half_life {
            let decay = (-(time - self.epoch) / self.half_life).exp2();
            self.bins.iter_mut().for_each(|b| *b *= decay);
            self.total *= decay;
            self.epoch = time;
        }
        let weight = ((time - self.epoch) / self.half_life).exp2();
        let bin = self.bin(energy);
        self.bins[bin] += weight;
        self.total += weight;
        let below: f64 = self.bins[..bin].iter().sum();
        (below + 0.5 * self.bins[bin]) / self.total
    }

    /// Returns the recent number of events per second at a time in seconds.
    #[must_use]
    pub fn rate(&self, time: f64) -> f64 {
        let mass = self.total * (-(time - self.epoch) / self.half_life).exp2();
        let observed = self.start.map_or(1.0, |start| 1.0 - (-(time - start) / self.half_life).exp2());
        mass * std::f64::consts::LN_2 / self.half_life / observed.max(1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crumple::matching::testing::log_normal;

    #[test]
    fn old_events_decay_and_the_rate_is_that_of_recent_events() {
        let mut rolling = Rolling::new(10.0);
        // A hundred seconds of weak events, then strong ones.
        let weak = log_normal(1000, 1.0, 0.0, 5);
        let shuffled = |k: usize, set: &[f64]| set[k * 617 % set.len()];
        for k in 0..1000 {
            rolling.add(0.1 * k as f64, shuffled(k, &weak));
        }
        assert!((rolling.rate(100.0) - 10.0).abs() < 0.3, "{}", rolling.rate(100.0));
        let middle = weak[500];
        assert!((rolling.clone().add(100.0, middle) - 0.5).abs() < 0.05);
        assert!(rolling.clone().add(100.0, 1e6 * middle) > 0.99);
        for k in 0..1000 {
            rolling.add(100.0 + 0.1 * k as f64, 1e6 * shuffled(k, &weak));
        }
        assert!((rolling.clone().add(200.0, 1e6 * middle) - 0.5).abs() < 0.05);
        // Much later the weights are rescaled, and old events have no weight.
        let p = rolling.add(1e5, 1.0);
        assert!((p - 0.5).abs() < 1e-6, "{p}");
    }

    #[test]
    fn a_seed_sets_the_distribution_and_the_rate_is_right_from_the_start() {
        let energies = log_normal(400, 1.0, 0.0, 6);
        let mut seeded = Rolling::new(60.0);
        seeded.seed(&energies, 25.0);
        assert!((seeded.rate(0.0) - 25.0).abs() < 1e-6);
        assert!((seeded.add(0.0, energies[100]) - 0.25).abs() < 0.03);
        let mut fresh = Rolling::new(60.0);
        assert_eq!(fresh.add(0.05, 3.0), 0.5);
        for k in 1..40 {
            fresh.add(0.05 * f64::from(k), 1.0);
        }
        assert!((fresh.rate(2.0) - 20.0).abs() < 1.0, "{}", fresh.rate(2.0));
    }
}
