//! Levels by octave of the roots of a tree and of their edges, by which roots are joined.

use super::tree::WaveletTree;

/// The least number of coefficients whose mean power makes a level.
const LEAST: usize = 16;

/// The least power, full scale being 1.
const FLOOR: f32 = 1e-12;

/// The share of a root that is its edge, unless that has too few coefficients.
const EDGE: usize = 4;

/// The number of frames of a root, unless they have too few coefficients.
const FRAMES: usize = 32;

/// The levels of each root, and of its edges, in the octaves in which it has at least 16 coefficients.
///
/// An edge is a quarter of a root, or its 16 first or last coefficients if these are more.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelopes {
    bands: usize,
    /// In dB, by root and band.
    levels: Vec<f32>,
    /// Of the first and of the last edge, in dB, by root and band.
    edges: Vec<[f32; 2]>,
    /// Of the loudest frame, in dB, by band.
    loudest: Vec<f32>,
    /// The median of the mean-square differences of consecutive roots, dB².
    change: f64,
}

impl Envelopes {
    /// # Complexity
    /// Linear in the nodes.
    pub fn new(tree: &WaveletTree) -> Self {
        let octaves = (0..tree.depth as usize).filter(|level| 1 << level >= LEAST);
        let bands: Vec<usize> = octaves.collect();
        let mut own = Self { bands: bands.len(), ..Self::default() };
        for octave in &bands {
            let frames = (0..tree.roots() as u32).flat_map(|root| frames(tree, *octave, root));
            own.loudest.push(frames.fold(10.0 * FLOOR.log10(), f32::max));
        }
        for root in 0..tree.roots() {
            for octave in &bands {
                let count = tree.channels << octave;
                let values = &tree.details[*octave][root * count..(root + 1) * count];
                let edge = tree.channels * ((1 << octave) / EDGE).max(LEAST);
                own.levels.push(level(values));
                own.edges.push([level(&values[..edge]), level(&values[count - edge..])]);
            }
        }
        let pairs = tree.sources.iter().flat_map(|s| (s.first + 1)..(s.first + s.roots));
        let mut changes: Vec<f64> = pairs.map(|root| own.difference(root - 1, root)).collect();
        if !changes.is_empty() {
            let middle = changes.len() / 2;
            own.change = *changes.select_nth_unstable_by(middle, f64::total_cmp).1;
        }
        own
    }

    /// Number of octaves with levels, the finest ones.
    #[must_use]
    pub fn bands(&self) -> usize {
        self.bands
    }

    /// The levels of the first and of the last edge of a root by octave, in dB; none for a root that is not there.
    #[must_use]
    pub fn edges(&self, root: u32) -> &[[f32; 2]] {
        let k = root as usize * self.bands;
        self.edges.get(k..k + self.bands).unwrap_or(&[])
    }

    /// The level of the loudest frame of an octave, in dB.
    #[must_use]
    pub fn loudest(&self, band: usize) -> f32 {
        self.loudest.get(band).copied().unwrap_or(f32::INFINITY)
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

/// The mean power of coefficients, in dB.
fn level(values: &[f32]) -> f32 {
    let mean = values.iter().map(|x| x * x).sum::<f32>() / values.len() as f32;
    10.0 * (mean + FLOOR).log10()
}

/// The levels in dB of frames of a root, in a level of the tree that has at least 16 coefficients for each: of 32 frames, or of frames of 16.
pub fn frames(
    tree: &WaveletTree,
    octave: usize,
    root: u32,
) -> impl DoubleEndedIterator<Item = f32> + ExactSizeIterator {
    let count = tree.channels << octave;
    let frame = tree.channels * ((1 << octave) / FRAMES).max(LEAST);
    tree.details[octave][root as usize * count..][..count].chunks_exact(frame).map(level)
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
        assert_eq!(envelopes.bands(), tree.depth as usize - 4);
        assert!((envelopes.change - 4.0).abs() < 1e-3, "{}", envelopes.change);
        assert!((envelopes.relative_difference(0, 3) - 3.0).abs() < 1e-3);
        assert_eq!(envelopes.relative_difference(2, 2), 0.0);
    }

    #[test]
    fn edges_are_quarters_or_sixteen_coefficients() {
        let mut tree = WaveletTree::trial(&mut Rng::new(3));
        // Each root swells by 6 dB from its first to its last quarter, in 4 steps.
        for octave in 4..tree.depth as usize {
            let values = tree.channels << octave;
            for (k, x) in tree.details[octave].iter_mut().enumerate() {
                *x = 10_f32.powf(0.1 * (4 * (k % values) / values) as f32);
            }
        }
        let envelopes = Envelopes::new(&tree);
        for (band, [first, last]) in envelopes.edges(1).iter().enumerate() {
            // The coarsest octave has 16 coefficients, the next 32.
            let expected = match band {
                0 => {
                    [10.0 * ((1.0 + 10_f32.powf(0.2) + 10_f32.powf(0.4) + 10_f32.powf(0.6)) / 4.0).log10(); 2]
                }
                1 => [0.0, 4.0].map(|l: f32| {
                    10.0 * ((10_f32.powf(l / 10.0) + 10_f32.powf((l + 2.0) / 10.0)) / 2.0).log10()
                }),
                _ => [0.0, 6.0],
            };
            assert!(
                (first - expected[0]).abs() < 1e-3 && (last - expected[1]).abs() < 1e-3,
                "{band} {first} {last}"
            );
        }
        assert!(envelopes.edges(tree.roots() as u32).is_empty());
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
