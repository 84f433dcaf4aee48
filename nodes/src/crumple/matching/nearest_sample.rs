//! Choice of the samples of a bank with the nearest energies.

use super::histogram::log;
use crate::crumple::bank::CrumpleBank;
use crate::impl_state;

/// Samples of a bank by energy. The last choice is not repeated.
#[derive(Clone, Debug)]
pub struct Nearest {
    logs: Vec<f64>,
    last: Option<usize>,
}
impl_state!(Nearest { last });

impl Nearest {
    /// Prepares the energies of a bank.
    #[must_use]
    pub fn new(bank: &CrumpleBank) -> Self {
        Self { logs: bank.energies.iter().map(|e| log(*e)).collect(), last: None }
    }

    /// Returns the range of the `k` samples whose energies are nearest to `energy` by ratio.
    ///
    /// # Complexity
    /// O(log n + k).
    #[must_use]
    pub fn range(&self, energy: f64, k: usize) -> std::ops::Range<usize> {
        let (x, n) = (log(energy), self.logs.len());
        let split = self.logs.partition_point(|e| *e < x);
        let (mut low, mut high) = (split, split);
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

    /// Chooses one of the `k` nearest samples, not the previous one if there is another. `draw` is uniform on `[0, 1)`.
    pub fn pick(&mut self, energy: f64, k: usize, draw: f64) -> Option<usize> {
        let range = self.range(energy, k.max(1));
        let excluded = self.last.filter(|last| range.len() > 1 && range.contains(last));
        let choices = range.len() - usize::from(excluded.is_some());
        if choices == 0 {
            return None;
        }
        let mut pick = range.start + ((draw * choices as f64) as usize).min(choices - 1);
        if excluded.is_some_and(|last| pick >= last) {
            pick += 1;
        }
        self.last = Some(pick);
        Some(pick)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn the_nearest_samples_are_chosen_by_ratio_without_repetition() {
        let mut nearest = Nearest::new(&CrumpleBank::testing(&[1.0, 10.0, 100.0, 1000.0]));
        assert_eq!(nearest.pick(4.0, 1, 0.0), Some(1));
        assert_eq!(nearest.pick(3.0, 1, 0.0), Some(0));
        assert_eq!(nearest.range(0.0, 1), 0..1);
        assert_eq!(nearest.range(1e9, 2), 2..4);
        assert_eq!(nearest.range(50.0, 9), 0..4);
        let mut rng = Rng::new(4);
        let mut last = None;
        let mut counts = [0; 4];
        for _ in 0..300 {
            let pick = nearest.pick(30.0, 3, rng.uniform()).unwrap();
            assert!(pick != 3 && last != Some(pick));
            last = Some(pick);
            counts[pick] += 1;
        }
        assert!(counts[..3].iter().all(|n| *n > 80), "{counts:?}");
        let mut single = Nearest::new(&CrumpleBank::testing(&[1.0]));
        assert_eq!([single.pick(5.0, 4, 0.9), single.pick(0.0, 4, 0.9)], [Some(0), Some(0)]);
    }
}
