//! Some of the grains of a dictionary.

use super::grain::Grain;
use super::grains::{BYTES_PER_GRAIN, GrainDictionary, Run};
use std::ops::Range;

/// Samples of a run that some of its grains need: each windowed grain, and up to `margin` samples around it.
///
/// `grains` are in order of time; the ranges are, too, and none touches the next one.
fn needed<'a>(grains: impl Iterator<Item = &'a Grain>, margin: usize, frames: usize) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for grain in grains {
        let (start, end) = (grain.position as usize, grain.position as usize + grain.len as usize);
        let from = start.saturating_sub(margin.max(grain.reach[0].into()));
        let to = (end + margin.max(grain.reach[1].into())).min(frames);
        match ranges.last_mut().filter(|range| range.end >= from) {
            Some(range) => range.end = range.end.max(to),
            None => ranges.push(from..to),
        }
    }
    ranges
}

impl GrainDictionary {
    /// Indices of the grains of each run, in order of time.
    pub(crate) fn grains_of_runs(&self) -> Vec<Vec<usize>> {
        let mut of_run: Vec<Vec<usize>> = vec![Vec::new(); self.runs.len()];
        for (k, grain) in self.grains.iter().enumerate() {
            if let Some(all) = of_run.get_mut(grain.run as usize) {
                all.push(k);
            }
        }
        of_run.iter_mut().for_each(|all| all.sort_by_key(|k| self.grains[*k].position));
        of_run
    }

    /// Bytes that some grains of a run, in order of time, have in a subset, as [`Self::bytes`] counts them.
    pub(crate) fn bytes_of(
        &self,
        run: usize,
        grains: impl Iterator<Item = usize> + Clone,
        margin: usize,
    ) -> usize {
        let (count, tracks) = (grains.clone().count(), grains.clone());
        let Some(run) = self.runs.get(run) else { return 0 };
        let ranges = needed(grains.map(|k| &self.grains[k]), margin, run.frames as usize);
        let samples: usize = ranges.iter().map(ExactSizeIterator::len).sum();
        let tracks: usize = tracks.map(|k| self.track_bytes(k)).sum();
        samples * usize::from(run.channels) * self.sample_bytes() + BYTES_PER_GRAIN * count + tracks
    }

    /// Returns a dictionary of the grains for which `retained` is true, in their order, with up to `margin` samples around each.
    ///
    /// Sources without grains remain, so that the indices of sources are the same.
    ///
    /// # Shapes
    /// `retained: [len]`; grains beyond its end are left out.
    ///
    /// # Complexity
    /// O(grains + samples).
    #[must_use]
    pub fn subset(&self, retained: &[bool], margin: usize) -> Self {
        let is_retained = |k: usize| retained.get(k).copied().unwrap_or(false);
        let mut subset = Self {
            sources: self.sources.clone(),
            grains: Vec::new(),
            runs: Vec::new(),
            steps: Vec::new(),
            samples: Vec::new(),
            tracks: None,
            ..*self
        };
        let mut moved: Vec<Option<(u32, u32)>> = vec![None; self.grains.len()];
        for (run, mut all) in self.runs.iter().zip(self.grains_of_runs()) {
            all.retain(|k| is_retained(*k));
            for range in needed(all.iter().map(|k| &self.grains[*k]), margin, run.frames as usize) {
                let index = subset.runs.len() as u32;
                for k in all.iter().filter(|k| range.contains(&(self.grains[**k].position as usize))) {
                    moved[*k] = Some((index, self.grains[*k].position - range.start as u32));
                }
                let offset = subset.samples.len() as u64;
                for channel in 0..usize::from(run.channels) {
                    let first = run.offset as usize + channel * run.frames as usize;
                    let samples = self.samples.get(first + range.start..first + range.end);
                    subset.samples.extend(samples.unwrap_or_default());
                }
                subset.runs.push(Run { offset, frames: range.len() as u32, channels: run.channels });
            }
        }
        let grains = self.grains.iter().zip(&moved);
        subset.grains = grains
            .filter_map(|(grain, to)| to.map(|(run, position)| Grain { run, position, ..*grain }))
            .collect();
        let tracks = self.tracks.as_ref();
        subset.tracks = tracks.map(|tracks| tracks.subset(|k| moved.get(k).is_some_and(Option::is_some)));
        if self.bits > 0 {
            subset.quantise(self.bits);
        }
        subset
    }
}

#[cfg(test)]
mod tests {
    use crate::grain::trial_dictionary;

    #[test]
    fn a_subset_has_the_same_sound_in_fewer_bytes() {
        let all = trial_dictionary();
        let retained: Vec<bool> = (0..all.len()).map(|k| k % 3 == 1).collect();
        let some = all.subset(&retained, 40);
        some.validate().unwrap();
        let bytes =
            |(run, own): (usize, Vec<usize>)| all.bytes_of(run, own.into_iter().filter(|k| retained[*k]), 40);
        assert_eq!(all.grains_of_runs().into_iter().enumerate().map(bytes).sum::<usize>(), some.bytes());
        assert_eq!(some.len(), retained.iter().filter(|r| **r).count());
        assert!(some.bytes() < all.bytes());
        let old = all.grains.iter().zip(&retained).filter(|(_, r)| **r).map(|(g, _)| g);
        for (old, new) in old.zip(&some.grains) {
            let error = all
                .windowed(old)
                .iter()
                .zip(some.windowed(new))
                .fold(0.0_f32, |e, (x, y)| e.max((x - y).abs()));
            // Margins are rounded to 16 bits again.
            assert!(error < 1e-4, "{error}");
            assert_eq!((old.start, old.source, old.len), (new.start, new.source, new.len));
        }
        let everything = all.subset(&vec![true; all.len()], usize::MAX / 4);
        assert_eq!(everything, all);
        assert!(all.subset(&[], 40).is_empty());
    }
}
