//! Peaks of the normalised cross-correlation of one grain.

use super::bounds::SEGMENT;
use super::normaliser::{BLOCK, Normaliser};
use super::transform::{Blocks, Buffers};
use fearless_simd::{Level, dispatch};

/// Normalised correlations of one grain, computed block by block when they are needed.
#[derive(Clone, Debug, Default)]
pub struct Scores {
    values: Vec<f32>,
    /// Greatest value of each block; negative if the block was not computed.
    tops: Vec<f32>,
    /// Answers of the greedy choice so far.
    choices: Vec<Option<bool>>,
    /// Blocks of transforms that are computed.
    transformed: Vec<bool>,
}

impl Scores {
    fn reset(&mut self, len: usize, transforms: usize) {
        self.transformed.clear();
        self.transformed.resize(transforms, false);
        self.values.resize(len.max(self.values.len()), 0.0);
        self.tops.clear();
        self.tops.resize(len.div_ceil(BLOCK), -1.0);
        self.choices.clear();
        self.choices.resize(len, None);
    }
}

/// Transforms by which correlations are computed where they are needed.
pub struct Transforms<'a> {
    pub blocks: &'a Blocks,
    /// With the spectrum of the grain.
    pub buffers: &'a mut Buffers,
    /// Bounds of the normalised correlation in each [`SEGMENT`] of outputs; none where they are not known.
    pub bounds: &'a [f32],
}

/// The correlation of a grain with part of a recording.
pub struct GrainCorrelation<'a> {
    /// `sum_n x[t + n] g[n]` for `t` from `first` on, where it is computed.
    pub y: &'a mut [f32],
    pub first: usize,
    /// Samples and norm of the grain.
    pub len: usize,
    pub norm: f64,
    pub normaliser: &'a Normaliser,
    /// Take peaks of the magnitude.
    pub absolute: bool,
    /// The transforms that compute `y`, with their rounding errors added to each value; none if it is there and exact.
    pub transforms: Option<Transforms<'a>>,
    scores: &'a mut Scores,
    level: Level,
}

/// Rounding error of a correlation by transforms, relative to the norms of its block and of the grain.
const ROUNDING: f64 = 1e-6;

/// Greatest value, at least 0.
fn greatest(level: Level, y: &[f32], absolute: bool) -> f32 {
    dispatch!(level, _simd => greatest_in_lanes(y, absolute))
}

#[inline(always)]
fn greatest_in_lanes(y: &[f32], absolute: bool) -> f32 {
    let mut lanes = [0.0_f32; 16];
    let (chunks, rest) = y.as_chunks::<16>();
    // The bits without the sign are those of the magnitude.
    let mask = if absolute { 0x7fff_ffff } else { u32::MAX };
    for chunk in chunks {
        for (lane, y) in lanes.iter_mut().zip(chunk) {
            let y = f32::from_bits(y.to_bits() & mask);
            *lane = if y > *lane { y } else { *lane };
        }
    }
    let of_rest = rest.iter().map(|y| f32::from_bits(y.to_bits() & mask));
    lanes.into_iter().chain(of_rest).fold(0.0, f32::max)
}

impl<'a> GrainCorrelation<'a> {
    /// The correlations `y` from sample `first` on, of a grain of `len` samples and a norm.
    pub fn new(
        y: &'a mut [f32],
        first: usize,
        (len, norm): (usize, f64),
        normaliser: &'a Normaliser,
        absolute: bool,
        transforms: Option<Transforms<'a>>,
        scores: &'a mut Scores,
    ) -> Self {
        scores.reset(y.len(), transforms.as_ref().map_or(0, |t| t.blocks.count()));
        Self { y, first, len, norm, normaliser, absolute, transforms, scores, level: Level::new() }
    }

    /// The first and the last block of transforms that have outputs of a block.
    fn transforms_of(&self, block: usize) -> Option<[usize; 2]> {
        let from = block * BLOCK;
        let last = (from + BLOCK).min(self.y.len()) - 1;
        self.transforms.as_ref().map(|t| [from, last].map(|k| t.blocks.block_of(k)))
    }

    /// Returns true if the outputs of a block are computed.
    fn is_transformed(&self, block: usize) -> bool {
        self.transforms_of(block).is_none_or(|ends| ends.iter().all(|j| self.scores.transformed[*j]))
    }

    /// Computes the outputs of a block, unless they are there.
    fn transform(&mut self, block: usize) {
        for j in self.transforms_of(block).into_iter().flatten() {
            if let Some(transforms) = self.transforms.as_mut().filter(|_| !self.scores.transformed[j]) {
                transforms.blocks.fill(j, transforms.buffers, self.y);
                self.scores.transformed[j] = true;
            }
        }
    }

    /// Computes a block, unless it is there.
    fn compute(&mut self, block: usize) {
        if self.scores.tops.get(block).is_none_or(|top| *top >= 0.0) {
            return;
        }
        self.transform(block);
        let from = block * BLOCK;
        let to = (from + BLOCK).min(self.y.len());
        let mut top = 0.0_f32;
        for k in from..to {
            let y = if self.absolute { self.y[k].abs() } else { self.y[k] };
            let norm = if self.norm > 0.0 { self.normaliser.norm(self.first + k, self.len) } else { None };
            let c = norm.map_or(0.0, |norm| (f64::from(y) / (norm * self.norm)) as f32);
            self.scores.values[k] = c;
            top = top.max(c);
        }
        self.scores.tops[block] = top;
    }

    /// Normalised correlation at a sample of the recording; 0 in silence and outside.
    fn at(&mut self, t: usize) -> f32 {
        let Some(k) = t.checked_sub(self.first).filter(|k| *k < self.y.len()) else { return 0.0 };
        self.compute(k / BLOCK);
        self.scores.values[k]
    }

    /// Rounding error of `y` at a sample of the recording, relative to the norm of the grain.
    fn noise(&self, t: usize) -> f64 {
        self.transforms.as_ref().map_or(0.0, |of| ROUNDING * f64::from(of.blocks.norm_at(t - self.first)))
    }

    /// Rounding error of the normalised correlation at a sample.
    #[must_use]
    pub fn error(&self, t: usize) -> f64 {
        self.normaliser.norm(t, self.len).map_or(0.0, |norm| self.noise(t) / norm)
    }

    /// Returns true if `t` is a local maximum: strict to the left, not exceeded to the right; ends count.
    fn is_maximum(&mut self, t: usize, c: f32) -> bool {
        (t <= self.first || c > self.at(t - 1)) && c >= self.at(t + 1)
    }

    /// Returns true if no correlation of a block reaches `least`, whatever the rounding errors.
    fn is_below(&mut self, block: usize, least: f64) -> bool {
        let from = block * BLOCK;
        let count = BLOCK.min(self.y.len() - from);
        let t = self.first + from;
        let noise = self.noise(t).max(self.noise(t + count - 1));
        let norm = self.normaliser.least(t, count, self.len);
        let known = self.transforms.as_ref().and_then(|of| of.bounds.get(from / SEGMENT));
        // What a transform computes may be off by the noise, and is raised by it.
        if known.is_some_and(|c| f64::from(*c) + 2.0 * noise / norm < least) && !self.is_transformed(block) {
            return true;
        }
        self.transform(block);
        let bound = (least * norm - noise) * self.norm;
        let top = greatest(self.level, &self.y[from..from + count], self.absolute);
        f64::from(top) < bound || top <= 0.0
    }

    /// Visits all local maxima in `range` whose correlation, raised by its rounding error, reaches `least`, which is a function of the sample,
    /// and which the greedy choice by falling correlation takes: none that it takes before, within `apart` samples, is greater (or equal
    /// and earlier).
    pub fn taken(
        &mut self,
        range: std::ops::Range<usize>,
        apart: usize,
        least: impl Fn(usize) -> f64,
        mut visit: impl FnMut(&Self, usize, f64),
    ) {
        let end = range.end.min(self.first + self.y.len());
        let mut t = range.start.max(self.first);
        while t < end {
            let block = (t - self.first) / BLOCK;
            let next = (self.first + (block + 1) * BLOCK).min(end);
            let (low, high) = (least(t), least(next - 1));
            if !self.is_below(block, low.min(high)) {
                for t in t..next {
                    let c = self.at(t);
                    let wanted = if low == high { low } else { least(t) };
                    // Rounding errors matter in few windows.
                    let reaches = f64::from(c) >= wanted || f64::from(c) + self.error(t) >= wanted;
                    if c > 0.0 && reaches && self.is_maximum(t, c) && self.is_taken(t, c, apart) {
                        visit(self, t, f64::from(c));
                    }
                }
            }
            t = next;
        }
    }

    /// Returns true if the greedy choice takes the local maximum at `t`.
    fn is_taken(&mut self, t: usize, c: f32, apart: usize) -> bool {
        if let Some(known) = self.scores.choices[t - self.first] {
            return known;
        }
        let (mut bound, mut taken) = (None, true);
        while let Some((u, d)) = self.greater(t, c, apart, bound).filter(|_| taken) {
            taken = !self.is_taken(u, d, apart);
            bound = Some((u, d));
        }
        self.scores.choices[t - self.first] = Some(taken);
        taken
    }

    /// The greatest local maximum within `apart` samples that comes before the one at `t` in the order of the greedy choice, and after
    /// `bound`.
    fn greater(
        &mut self,
        t: usize,
        c: f32,
        apart: usize,
        bound: Option<(usize, f32)>,
    ) -> Option<(usize, f32)> {
        let from = t.saturating_sub(apart).max(self.first);
        let to = (t + apart + 1).min(self.first + self.y.len());
        let comes_before = |a: (usize, f32), b: (usize, f32)| a.1 > b.1 || (a.1 == b.1 && a.0 < b.0);
        let blocks = (from - self.first) / BLOCK..=(to - 1 - self.first) / BLOCK;
        for block in blocks.clone() {
            if self.scores.tops[block] < 0.0 && !self.is_below(block, f64::from(c)) {
                self.compute(block);
            }
        }
        // With the greatest block first, most others need no look at their values.
        let tops = &self.scores.tops;
        let first = blocks.clone().max_by(|a, b| tops[*a].total_cmp(&tops[*b])).unwrap_or(0);
        let others = blocks.filter(|block| *block != first);
        let mut best: Option<(usize, f32)> = None;
        for block in std::iter::once(first).chain(others) {
            if self.scores.tops[block] < best.map_or(c, |best| best.1) {
                continue;
            }
            let start = self.first + block * BLOCK;
            for u in start.max(from)..(start + BLOCK).min(to) {
                let d = self.scores.values[u - self.first];
                let is_next = comes_before((u, d), best.unwrap_or((t, c)))
                    && bound.is_none_or(|bound| comes_before(bound, (u, d)));
                if is_next && self.is_maximum(u, d) {
                    best = Some((u, d));
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::super::bounds::SegmentBands;
    use super::*;
    use crate::core::random::Rng;

    fn norm(x: &[f32]) -> f64 {
        x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt()
    }

    /// All correlations by the definition, and the greedy choice over them.
    fn greedy(x: &[f32], g: &[f32], apart: usize, least: f64) -> Vec<(usize, f64)> {
        let c: Vec<f64> = (0..=x.len() - g.len())
            .map(|t| {
                let dot: f64 = x[t..].iter().zip(g).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                dot / (norm(g) * norm(&x[t..t + g.len()]))
            })
            .collect();
        let is_maximum = |t: usize| (t == 0 || c[t] > c[t - 1]) && (t + 1 == c.len() || c[t] >= c[t + 1]);
        let mut maxima: Vec<usize> = (0..c.len()).filter(|t| c[*t] >= least && is_maximum(*t)).collect();
        maxima.sort_by(|a, b| c[*b].total_cmp(&c[*a]).then(a.cmp(b)));
        let mut taken: Vec<usize> = Vec::new();
        for t in maxima {
            if taken.iter().all(|u| u.abs_diff(t) > apart) {
                taken.push(t);
            }
        }
        taken.sort_unstable();
        taken.into_iter().map(|t| (t, c[t])).collect()
    }

    #[test]
    fn taken_maxima_are_those_of_the_greedy_choice() {
        let mut rng = Rng::new(9);
        for trial in 0..20 {
            let n = 700 + rng.below(500);
            let x: Vec<f32> =
                (0..n).map(|k| ((0.11 * k as f64).sin() + rng.between(-0.7, 0.7)) as f32).collect();
            let len = 20 + rng.below(150);
            let from = rng.below(n - len);
            let g = x[from..from + len].to_vec();
            let mut y: Vec<f32> = (0..=n - len)
                .map(|t| {
                    x[t..].iter().zip(&g).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>() as f32
                })
                .collect();
            let normaliser = Normaliser::new(&x, -70.0, false);
            let mut scores = Scores::default();
            let mut all =
                GrainCorrelation::new(&mut y, 0, (len, norm(&g)), &normaliser, false, None, &mut scores);
            let apart = if trial % 2 == 0 { len / 2 } else { 3 };
            let mut found = Vec::new();
            all.taken(0..n - len + 1, apart, |_| 0.1, |_, t, c| found.push((t, c)));
            let want = greedy(&x, &g, apart, 0.1);
            assert_eq!(
                found.iter().map(|p| p.0).collect::<Vec<_>>(),
                want.iter().map(|p| p.0).collect::<Vec<_>>()
            );
            assert!(found.iter().zip(&want).all(|(a, b)| (a.1 - b.1).abs() < 1e-6 && a.1 <= 1.0 + 1e-6));
            assert!(found.iter().any(|(t, c)| *t == from && *c > 0.999));
        }
    }

    /// Maxima of a grain in a signal by transforms, and how many of the transforms were computed.
    fn by_transforms(x: &[f32], g: &[f32], is_bounded: bool) -> (Vec<(usize, f64)>, [usize; 2]) {
        let outputs = x.len() - g.len() + 1;
        let (blocks, normaliser) = (Blocks::new(x, outputs, g.len(), 1024), Normaliser::new(x, -70.0, false));
        let (mut buffers, bands) = (blocks.buffers(), SegmentBands::new(x, outputs, g.len()));
        let bounds = if is_bounded {
            bands.bounds(g, norm(g), &normaliser, 0, &mut bands.buffers())
        } else {
            Vec::new()
        };
        blocks.transform(g, &mut buffers);
        let (mut y, mut scores, mut found) = (vec![0.0; outputs], Scores::default(), Vec::new());
        let transforms = Transforms { blocks: &blocks, buffers: &mut buffers, bounds: &bounds };
        let of = (g.len(), norm(g));
        let mut all = GrainCorrelation::new(&mut y, 0, of, &normaliser, false, Some(transforms), &mut scores);
        all.taken(0..outputs, g.len() / 2, |_| 0.4, |_, t, c| found.push((t, c)));
        let computed = scores.transformed.iter().filter(|is_computed| **is_computed).count();
        (found, [computed, scores.transformed.len()])
    }

    #[test]
    fn transforms_are_left_out_only_where_nothing_is_found() {
        let mut rng = Rng::new(12);
        let mut pruned = 0;
        for trial in 0..6 {
            // A low tone with noise, and one stretch that is like the grain.
            let mut x: Vec<f32> =
                (0..20_000).map(|k| ((0.03 * k as f64).sin() + rng.between(-0.05, 0.05)) as f32).collect();
            let g: Vec<f32> = (0..300 + 50 * trial)
                .map(|k| ((0.9 * k as f64).sin() + rng.between(-0.2, 0.2)) as f32)
                .collect();
            x[11_000..11_000 + g.len()].iter_mut().zip(&g).for_each(|(x, g)| *x += 0.7 * g);
            let ((all, _), (few, [computed, count])) =
                (by_transforms(&x, &g, false), by_transforms(&x, &g, true));
            assert_eq!(all, few);
            assert!(few.iter().any(|(t, _)| *t == 11_000), "{few:?}");
            pruned += count - computed;
        }
        assert!(pruned > 30, "{pruned}");
    }

    #[test]
    fn silence_correlates_with_nothing() {
        let x = [vec![0.5_f32, -0.5, 0.5, -0.5], vec![1e-9; 40]].concat();
        let normaliser = Normaliser::new(&x, -70.0, false);
        assert!(normaliser.norm(0, 4).is_some() && normaliser.norm(20, 4).is_none());
        assert!(Normaliser::new(&[0.0; 50], -70.0, false).norm(0, 4).is_none());
    }
}
