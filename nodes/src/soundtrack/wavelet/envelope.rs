//! Levels by octave of the roots of a tree and of their edges, by which roots are joined.

use super::tree::WaveletTree;
use std::ops::Range;

/// The least number of coefficients whose mean power makes a level.
const LEAST: usize = 16;

/// The least power, full scale being 1.
const FLOOR: f32 = 1e-12;

/// The share of a root that is its edge, unless that has too few coefficients.
const EDGE: usize = 4;

/// The number of frames of a root, unless they have too few coefficients.
const FRAMES: usize = 32;

/// Frequency above which joins are audible, Hz.
const HIGH: f64 = 8000.0;
/// Duration before or after a join that is heard as part of it, s.
const AROUND: f64 = 0.0025;
/// The share of the frames above [`HIGH`] that are not loud.
const SOFT: f64 = 0.9;

/// The greatest number of classes of borders of a kind, and the least number of borders in each.
const CLASSES: usize = 4;
const MEMBERS: usize = 8;
/// The minimum number of borders before loud ones at which stretches can end instead.
const BEFORE: usize = 4;
/// The greatest number of classes of loudness of a recording, and the least number of roots in each.
const LOUDNESS_CLASSES: usize = 16;
const LOUDNESS_MEMBERS: usize = 8;

/// Kind of a border of two roots, by its level above 8 kHz.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BorderKind {
    /// Neither of the others.
    #[default]
    Soft,
    /// Not loud, but the border after it is.
    BeforeLoud,
    /// Louder than nine tenths of the frames of 2.5 ms of its recording, just before or just after it.
    Loud,
}

/// The class of a border of two roots. What is joined at borders of the same class has about the same level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Border {
    /// Its kind.
    pub kind: BorderKind,
    /// By mean level over octaves, equal shares of the borders of this kind of a recording, the softest first.
    pub class: u8,
}

/// The levels of each root, and of its edges, in the octaves in which it has at least 16 coefficients.
///
/// An edge is a quarter of a root, or its 16 first or last coefficients if these are more.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelopes {
    bands: usize,
    /// In dB, by root and band.
    levels: Vec<f32>,
    /// Levels of the first and of the last edge, in dB, by root and band.
    edges: Vec<[f32; 2]>,
    /// Level of the loudest frame, in dB, by band.
    loudest: Vec<f32>,
    /// The median of the mean-square differences of consecutive roots, dB².
    change: f64,
    /// By root, the classes of the borders at its beginning and at its end.
    borders: Vec<[Border; 2]>,
    /// By recording, true if it has borders before loud ones.
    avoids: Vec<bool>,
    /// By root, its class of loudness.
    loudness: Vec<u32>,
    /// By class of loudness, the share of all roots in it.
    loudness_shares: Vec<f64>,
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
        own.borders = own.classes(tree);
        let is_before = |root| own.borders(root)[1].kind == BorderKind::BeforeLoud;
        own.avoids = tree.sources.iter().map(|s| (s.first..s.first + s.roots).any(is_before)).collect();
        own.rank(tree);
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

    /// The classes of the borders at the beginning and at the end of a root.
    #[must_use]
    pub fn borders(&self, root: u32) -> [Border; 2] {
        self.borders.get(root as usize).copied().unwrap_or_default()
    }

    /// True if stretches of a recording end before loud borders, of which it has enough.
    #[must_use]
    pub fn avoids_loud_borders(&self, source: usize) -> bool {
        self.avoids.get(source).copied().unwrap_or(false)
    }

    /// The class of loudness of a root: its mean level over octaves, in classes of equal shares of its recording. Each recording has classes of its own.
    #[must_use]
    pub fn loudness(&self, root: u32) -> u32 {
        self.loudness.get(root as usize).copied().unwrap_or(0)
    }

    /// The share of all roots in each class of loudness.
    #[must_use]
    pub fn loudness_shares(&self) -> &[f64] {
        &self.loudness_shares
    }

    /// Finds the classes of loudness.
    fn rank(&mut self, tree: &WaveletTree) {
        self.loudness = vec![0; tree.roots()];
        for source in &tree.sources {
            let first = self.loudness_shares.len();
            let mut levels: Vec<(f32, u32)> = (source.first..source.first + source.roots)
                .map(|root| (self.of(root).iter().sum(), root))
                .collect();
            levels.sort_by(|a, b| a.0.total_cmp(&b.0));
            let classes = (levels.len() / LOUDNESS_MEMBERS).clamp(1, LOUDNESS_CLASSES);
            let mut sizes = vec![0; classes];
            for (k, (_, root)) in levels.iter().enumerate() {
                let class = k * classes / levels.len();
                self.loudness[*root as usize] = (first + class) as u32;
                sizes[class] += 1;
            }
            self.loudness_shares.extend(sizes.iter().map(|size| f64::from(*size) / tree.roots() as f64));
        }
    }

    /// [`borders`](Self::borders) of all roots. Each recording has classes by its own levels, so the borders of two recordings of different levels are of the same classes.
    fn classes(&self, tree: &WaveletTree) -> Vec<[Border; 2]> {
        let mut out = vec![[Border::default(); 2]; tree.roots()];
        for source in &tree.sources {
            let roots = source.first..source.first + source.roots;
            // The roots before and after each border, with the edges that are at it: the last one of the one, and the first one of the other.
            let ends = roots.clone().map(|root| (root, 1));
            let wrap = roots.clone().next().filter(|_| source.wraps).map(|root| (root, 0));
            let begins = roots.clone().skip(1).map(|root| Some((root, 0))).chain([wrap]);
            let first = roots.clone().next().filter(|_| !source.wraps).map(|root| [None, Some((root, 0))]);
            let borders: Vec<[Option<(u32, usize)>; 2]> =
                ends.zip(begins).map(|(end, begin)| [Some(end), begin]).chain(first).collect();
            for (kind, of) in kinds(tree, roots, &borders) {
                let mut levels: Vec<(f32, usize)> =
                    of.iter().map(|k| (self.level_at(&borders[*k]), *k)).collect();
                levels.sort_by(|a, b| a.0.total_cmp(&b.0));
                let classes = (levels.len() / MEMBERS).clamp(1, CLASSES);
                for (n, (_, k)) in levels.iter().enumerate() {
                    let border = Border { kind, class: (n * classes / levels.len()) as u8 };
                    borders[*k].iter().flatten().for_each(|(root, edge)| out[*root as usize][*edge] = border);
                }
            }
        }
        out
    }

    /// The mean level of the edges at a border over octaves, in dB.
    fn level_at(&self, border: &[Option<(u32, usize)>; 2]) -> f32 {
        let sides = || border.iter().flatten();
        let levels =
            |(root, edge): &(u32, usize)| self.edges(*root).iter().map(|octave| octave[*edge]).sum::<f32>();
        sides().map(levels).sum::<f32>() / (sides().count() * self.bands).max(1) as f32
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

/// The borders of a recording by their kind. Border `k` is at the end of root `k`; one more may be before the first.
fn kinds(
    tree: &WaveletTree,
    roots: Range<u32>,
    borders: &[[Option<(u32, usize)>; 2]],
) -> [(BorderKind, Vec<usize>); 3] {
    let (high, limit) = high_levels(tree, roots.clone());
    let is_loud = |k: &usize| {
        let high = |(root, edge): &(u32, usize)| high[(root - roots.start) as usize][*edge];
        borders[*k].iter().flatten().any(|side| high(side) > limit)
    };
    let (loud, soft): (Vec<usize>, Vec<usize>) = (0..borders.len()).partition(is_loud);
    let next = |k: &usize| borders[*k][1].map(|(root, _)| (root - roots.start) as usize);
    let is_before = |k: &usize| next(k).is_some_and(|next| loud.binary_search(&next).is_ok());
    let (before, rest): (Vec<usize>, Vec<usize>) = soft.iter().partition(|k| is_before(k));
    if before.len() < BEFORE {
        return [(BorderKind::Loud, loud), (BorderKind::BeforeLoud, Vec::new()), (BorderKind::Soft, soft)];
    }
    [(BorderKind::Loud, loud), (BorderKind::BeforeLoud, before), (BorderKind::Soft, rest)]
}

/// The power above [`HIGH`] in the first and in the last frame of [`AROUND`] of each root, and that which the share [`SOFT`] of all frames does not exceed.
fn high_levels(tree: &WaveletTree, roots: Range<u32>) -> (Vec<[f32; 2]>, f32) {
    let finest = tree.depth as usize - 1;
    // The share of each octave that is above the frequency; the finest one stands for it at low rates.
    let share = |octave: usize| {
        let top = tree.rate / tree.span(octave) as f64;
        (2.0 * (top - HIGH) / top).clamp(if octave == finest { 0.01 } else { 0.0 }, 1.0) as f32
    };
    let octaves: Vec<(usize, f32)> = (0..=finest).map(|l| (l, share(l))).filter(|o| o.1 > 0.0).collect();
    let most = octaves.first().map_or(1, |(octave, _)| 1 << octave);
    let count = ((tree.span(0) as f64 / tree.rate / AROUND).round() as usize).clamp(1, most);
    let power = |root: usize, frame: usize| {
        let of = |(octave, share): &(usize, f32)| {
            let [from, to] =
                [frame, frame + 1].map(|k| ((root * count + k) << octave) / count * tree.channels);
            share * tree.details[*octave][from..to].iter().map(|x| x * x).sum::<f32>()
        };
        octaves.iter().map(of).sum::<f32>()
    };
    let frames = roots.flat_map(|root| (0..count).map(move |frame| (root as usize, frame)));
    let mut powers: Vec<f32> = frames.map(|(root, frame)| power(root, frame)).collect();
    let edges = powers.chunks_exact(count).map(|own| [own[0], own[count - 1]]).collect();
    let soft = (SOFT * powers.len() as f64) as usize;
    let limit = *powers.select_nth_unstable_by(soft, f32::total_cmp).1;
    (edges, limit)
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
    use super::super::tree::{TreeRecording, TreeRules};
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
    fn borders_have_classes_by_level_in_each_recording() {
        let mut rng = Rng::new(5);
        let mut recording = |roots: usize, name: &str| {
            let channels = vec![(0..roots * 1024 + 960).map(|_| rng.between(-1.0, 1.0) as f32).collect()];
            TreeRecording { name: name.into(), content: String::new(), channels }
        };
        let recordings = [recording(40, "rising"), recording(20, "softer")];
        let rules = TreeRules { block: Some(1024.5 / 48e3), ..TreeRules::default() };
        let mut tree = WaveletTree::analyse(48e3, &recordings, &rules).unwrap();
        assert_eq!((tree.roots(), tree.span(0)), (60, 1024));
        tree.sources[0].wraps = false;
        // Each root is 1 dB above the one before it, and the second recording is 60 dB softer.
        let of = |root: usize| if root < 40 { root as f32 } else { root as f32 - 100.0 };
        for (level, details) in tree.details.iter_mut().enumerate() {
            details.iter_mut().enumerate().for_each(|(k, x)| *x = 10_f32.powf(of(k >> level) / 20.0));
        }
        let envelopes = Envelopes::new(&tree);
        let ends =
            |roots: Range<u32>| -> Vec<Border> { roots.map(|root| envelopes.borders(root)[1]).collect() };
        // Louder than the frames of nine tenths of 40 roots are the last three; the border before them is one of theirs.
        let first = ends(0..40);
        assert_eq!(first.iter().position(|b| b.kind == BorderKind::Loud), Some(36), "{first:?}");
        assert!(first[36..].iter().all(|b| *b == Border { kind: BorderKind::Loud, class: 0 }));
        let classes = |all: &[Border]| {
            let soft = |class| move |b: &&Border| **b == Border { kind: BorderKind::Soft, class };
            [0, 1, 2, 3].map(|class| all.iter().filter(soft(class)).count())
        };
        // With the border before the first root there are 37 that are not loud.
        assert_eq!((envelopes.borders(0)[0], classes(&first)), (Border::default(), [9, 9, 9, 9]));
        assert!((1..40).all(|root| envelopes.borders(root)[0] == first[root as usize - 1]));
        let second = ends(40..60);
        assert_eq!(envelopes.borders(40)[0], second[19], "it wraps");
        // Two classes, as each has eight borders at least.
        assert_eq!(classes(&second), [9, 9, 0, 0], "{second:?}");
    }

    #[test]
    fn borders_before_loud_ones_are_a_kind_if_they_are_four() {
        let mut rng = Rng::new(5);
        let channels = vec![(0..60 * 1024).map(|_| rng.between(-1.0, 1.0) as f32).collect()];
        let recording = TreeRecording { name: "bangs".into(), content: String::new(), channels };
        let rules = TreeRules { block: Some(1024.5 / 48e3), ..TreeRules::default() };
        let mut tree = WaveletTree::analyse(48e3, &[recording], &rules).unwrap();
        for count in [3, 4] {
            // Bangs begin in the middle of roots, and last for three quarters of one.
            for (level, details) in tree.details.iter_mut().enumerate() {
                let is_bang = |k: usize| {
                    let quarter = (4 * k) >> level;
                    (1..=40 * count).contains(&quarter) && matches!(quarter % 40, 0 | 38 | 39)
                };
                details.iter_mut().enumerate().for_each(|(k, x)| *x = if is_bang(k) { 1.0 } else { 0.001 });
            }
            let envelopes = Envelopes::new(&tree);
            for root in 0..60 {
                let expected = match root {
                    _ if root < 10 * count as u32 && root % 10 == 9 => BorderKind::Loud,
                    _ if count == 4 && root < 40 && root % 10 == 8 => BorderKind::BeforeLoud,
                    _ => BorderKind::Soft,
                };
                assert_eq!(envelopes.borders(root)[1].kind, expected, "{count} bangs, root {root}");
            }
        }
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
