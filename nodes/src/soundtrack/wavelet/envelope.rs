//! Levels by octave of the roots of a tree, by which roots are joined.

use super::tree::WaveletTree;

/// The least number of coefficients whose mean power makes a level.
const LEAST: usize = 16;

/// The least power, full scale being 1.
const FLOOR: f32 = 1e-12;

/// The levels of each root in the octaves in which it has at least 16 coefficients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelopes {
    bands: usize,
    /// In dB, by root and band.
    levels: Vec<f32>,
    /// The median of the mean-square differences of consecutive roots, dB².
    change: f64,
}

impl Envelopes {
    /// # Complexity
    /// Linear in the nodes.
    pub fn new(tree: &WaveletTree) -> Self {
        let octaves = (0..tree.depth as usize).filter(|level| 1 << level >= LEAST);
        let level = |octave: usize, root: usize| {
            let values = tree.channels << octave;
            let own = &tree.details[octave][root * values..(root + 1) * values];
            10.0 * (own.iter().map(|x| x * x).sum::<f32>() / values as f32 + FLOOR).log10()
        };
        let bands: Vec<usize> = octaves.collect();
        let levels = (0..tree.roots()).flat_map(|root| bands.iter().map(move |octave| level(*octave, root)));
        let mut own = Self { bands: bands.len(), levels: levels.collect(), change: 0.0 };
        let pairs = tree.sources.iter().flat_map(|s| (s.first + 1)..(s.first + s.roots));
        let mut changes: Vec<f64> = pairs.map(|root| own.difference(root - 1, root)).collect();
        if !changes.is_empty() {
            let middle = changes.len() / 2;
            own.change = *changes.select_nth_unstable_by(middle, f64::total_cmp).1;
        }
        own
    }

    fn of(&self, root: u32) -> &[f32] {
        let k = root as usize * self.bands;
        self.levels.get(k..k + self.bands).unwrap_or(&[])
    }

    /// The mean-square difference of the levels of two roots, dB².
    fn difference(&self, a: u32, b: u32) -> f64 {
        let pairs = self.of(a).iter().zip(self.of(b));
        pairs.map(|(a, b)| f64::from((a - b) * (a - b))).sum::<f64>() / self.bands.max(1) as f64
    }

    /// The difference of the levels of two roots, relative to the median difference of consecutive ones; 0 for the same root.
    #[must_use]
    pub fn relative_difference(&self, a: u32, b: u32) -> f64 {
        let difference = self.difference(a, b);
        if difference > 0.0 { (difference / self.change).sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::random::Rng;

    #[test]
    fn differences_are_relative_to_those_of_consecutive_roots() {
        let mut tree = WaveletTree::trial(&mut Rng::new(3));
        let finest = tree.depth as usize - 1;
        let roots = tree.roots();
        // Each root is 2 dB above the one before it in all octaves.
        for octave in 0..=finest {
            let values = tree.channels << octave;
            for root in 0..roots {
                let level = 10_f32.powf(0.1 * root as f32);
                for (k, x) in tree.details[octave][root * values..(root + 1) * values].iter_mut().enumerate()
                {
                    *x = if k % 2 == 0 { level } else { -level };
                }
            }
        }
        let envelopes = Envelopes::new(&tree);
        assert_eq!(envelopes.bands, tree.depth as usize - 4);
        assert!((envelopes.change - 4.0).abs() < 1e-3, "{}", envelopes.change);
        assert!((envelopes.relative_difference(0, 3) - 3.0).abs() < 1e-3);
        assert_eq!(envelopes.relative_difference(2, 2), 0.0);
    }

    #[test]
    fn without_any_change_another_level_is_infinitely_far() {
        let mut tree = WaveletTree::trial(&mut Rng::new(3));
        tree.details.iter_mut().flatten().for_each(|x| *x = 0.5);
        let finest = tree.depth as usize - 1;
        let values = tree.channels << finest;
        assert_eq!(Envelopes::new(&tree).relative_difference(0, 1), 0.0);
        tree.details[finest][..values].fill(0.1);
        assert_eq!(Envelopes::new(&tree).relative_difference(0, 1), f64::INFINITY);
    }
}
