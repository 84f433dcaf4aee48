//! Peaks of the normalised cross-correlation of one grain.

use super::bounds::SEGMENT;
use super::normaliser::{BLOCK, Normaliser};
use super::transform::{Blocks, Buffers, greatest};
use std::ops::Range;

/// Normalised correlations of one grain, computed block by block when they are needed.
#[derive(Clone, Debug, Default)]
pub struct Scores {
    values: Vec<f32>,
    /// Greatest value of each block; negative if the block was not computed.
    tops: Vec<f32>,
    /// Answers of the greedy choice so far, in the blocks that are computed.
    choices: Vec<Option<bool>>,
    /// Greatest correlation of each block that is transformed, before it is normalised.
    transformed_tops: Vec<f32>,
    /// Blocks of transforms that are computed.
    transformed: Vec<bool>,
}

impl Scores {
    fn reset(&mut self, len: usize, transforms: usize) {
        self.transformed.clear();
        self.transformed.resize(transforms, false);
        let blocks = len.div_ceil(BLOCK);
        self.tops.clear();
        self.tops.resize(blocks, -1.0);
        // Of a block, nothing is read before it is computed.
        self.transformed_tops.resize(blocks, 0.0);
        self.values.resize(len.max(self.values.len()), 0.0);
        self.choices.resize(len.max(self.choices.len()), None);
    }
}

/// Transforms by which correlations are computed where they are needed.
pub struct Transforms<'a> {
    pub blocks: &'a Blocks,
    /// With the spectrum of the grain.
    pub buffers: &'a mut Buffers,
    /// Bounds of the normalised correlation in each [`SEGMENT`] of outputs, with twice its rounding error; none where they are not known.
    pub bounds: &'a [f32],
}

/// Twice the greatest rounding error of each [`SEGMENT`] of outputs, relative to the norm of a grain.
pub fn segment_errors(blocks: &Blocks, outputs: usize) -> Vec<f64> {
    let ends = |from: usize| [from, (from + SEGMENT).min(outputs) - 1];
    let error = |from: usize| {
        ends(from).map(|t| 2.0 * blocks.error(blocks.block_of(t))).into_iter().fold(0.0, f64::max)
    };
    (0..outputs).step_by(SEGMENT).map(error).collect()
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
        if transforms.is_none() {
            for (y, top) in y.chunks(BLOCK).zip(&mut scores.transformed_tops) {
                *top = greatest(y, absolute);
            }
        }
        Self { y, first, len, norm, normaliser, absolute, transforms, scores }
    }

    /// The outputs of a block.
    fn outputs(&self, block: usize) -> Range<usize> {
        block * BLOCK..((block + 1) * BLOCK).min(self.y.len())
    }

    /// Computes the outputs of a block, unless they are there, and returns their rounding error, relative to the norm of the grain.
    fn transform(&mut self, block: usize) -> f64 {
        self.transforms.as_mut().map_or(0.0, |transforms| {
            let j = transforms.blocks.block_of(block * BLOCK);
            if !self.scores.transformed[j] {
                let tops = &mut self.scores.transformed_tops;
                transforms.blocks.fill(j, transforms.buffers, self.absolute, self.y, tops);
                self.scores.transformed[j] = true;
            }
            transforms.blocks.error(j)
        })
    }

    /// Computes a block, unless it is there.
    fn compute(&mut self, block: usize) {
        if self.scores.tops.get(block).is_none_or(|top| *top >= 0.0) {
            return;
        }
        self.transform(block);
        let outputs = self.outputs(block);
        let Scores { values, tops, choices, .. } = &mut *self.scores;
        let c = &mut values[outputs.clone()];
        choices[outputs.clone()].fill(None);
        let grain = (self.len, self.norm);
        self.normaliser.normalise(self.first + outputs.start, grain, self.absolute, &self.y[outputs], c);
        tops[block] = greatest(c, false);
    }

    /// Normalised correlation at a sample of the recording; 0 in silence and outside.
    fn at(&mut self, t: usize) -> f32 {
        let Some(k) = t.checked_sub(self.first).filter(|k| *k < self.y.len()) else { return 0.0 };
        self.compute(k / BLOCK);
        self.scores.values[k]
    }

    /// Rounding error of `y` at a sample of the recording, relative to the norm of the grain.
    fn noise(&self, t: usize) -> f64 {
        self.transforms.as_ref().map_or(0.0, |of| of.blocks.error(of.blocks.block_of(t - self.first)))
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

    /// Returns true if the bounds show that no correlation of a segment reaches `least`, whatever the rounding errors.
    fn is_bounded(&self, segment: usize, least: f64) -> bool {
        let bound = self.transforms.as_ref().and_then(|of| of.bounds.get(segment));
        bound.is_some_and(|bound| f64::from(*bound) < least)
    }

    /// Returns true if no correlation of a block reaches `least`, whatever the rounding errors.
    fn is_below(&mut self, block: usize, least: f64) -> bool {
        let outputs = self.outputs(block);
        if self.is_bounded(outputs.start / SEGMENT, least) {
            return true;
        }
        let noise = self.transform(block);
        let norm = self.normaliser.least(self.first + outputs.start, outputs.len(), self.len);
        let bound = (least * norm - noise) * self.norm;
        let top = self.scores.transformed_tops[block];
        f64::from(top) < bound || top <= 0.0
    }

    /// Visits all local maxima in `range` whose correlation, raised by its rounding error, reaches `least`, which is the least of a range of samples,
    /// and which the greedy choice by falling correlation takes: none that it takes before, within `apart` samples, is greater (or equal
    /// and earlier).
    pub fn taken(
        &mut self,
        range: Range<usize>,
        apart: usize,
        least: impl Fn(Range<usize>) -> f64,
        mut visit: impl FnMut(&Self, usize, f64),
    ) {
        let end = range.end.min(self.first + self.y.len());
        let mut t = range.start.max(self.first);
        while t < end {
            let segment = (t - self.first) / SEGMENT;
            let next = (self.first + (segment + 1) * SEGMENT).min(end);
            let of_all = least(t..next);
            if !self.is_bounded(segment, of_all) {
                for block in (t - self.first) / BLOCK..(next - self.first).div_ceil(BLOCK) {
                    if !self.is_below(block, of_all) {
                        let outputs = self.outputs(block);
                        let of_block = t.max(self.first + outputs.start)..next.min(self.first + outputs.end);
                        self.taken_in(block, of_block, apart, &least, &mut visit);
                    }
                }
            }
            t = next;
        }
    }

    /// [`Self::taken`] in a range of a block.
    fn taken_in(
        &mut self,
        block: usize,
        range: Range<usize>,
        apart: usize,
        least: &impl Fn(Range<usize>) -> f64,
        visit: &mut impl FnMut(&Self, usize, f64),
    ) {
        self.compute(block);
        // Rounding errors matter in few windows.
        let norm = self.normaliser.least(range.start, range.len(), self.len);
        let certain = least(range.clone()) - self.noise(range.start) / norm;
        if f64::from(self.scores.tops[block]) < certain {
            return;
        }
        for t in range {
            let c = self.scores.values[t - self.first];
            if c <= 0.0 || f64::from(c) < certain {
                continue;
            }
            let wanted = least(t..t + 1);
            let reaches = f64::from(c) >= wanted || f64::from(c) + self.error(t) >= wanted;
            if reaches && self.is_maximum(t, c) && self.is_taken(t, c, apart) {
                visit(self, t, f64::from(c));
            }
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

    /// The first sample of a range of computed blocks whose correlation is at least `least`.
    fn reaching(&self, range: Range<usize>, least: f32) -> Option<usize> {
        let values = &self.scores.values[range.start - self.first..range.end - self.first];
        values.iter().position(|d| *d >= least).map(|k| range.start + k)
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
            let mut rest = start.max(from)..(start + BLOCK).min(to);
            while let Some(u) = self.reaching(rest.clone(), best.map_or(c, |best| best.1)) {
                rest.start = u + 1;
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
        let errors = segment_errors(&blocks, outputs);
        let bounds = if is_bounded {
            bands.bounds(g, norm(g), &normaliser, 0, &errors, &mut bands.buffers())
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
