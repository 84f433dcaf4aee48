//! Energy at high frequencies around joins.

use super::active::{ActiveSound, power_db};
use super::statistics::percentile;
use crate::dsp::{Band, Butterworth, Cascade};
use serde::{Deserialize, Serialize};

/// Jumps are audible as energy above this frequency, Hz.
pub(super) const HIGH: f64 = 8000.0;
/// Duration around a join that is measured, s.
const AROUND: f64 = 0.005;
/// Blocks within that duration.
const BLOCKS: usize = 10;
/// Minimum distance of a listed join from a louder one, s.
const APART: f64 = 0.02;
/// The share of intervals of the recordings that are softer than the limit.
const SHARE: f64 = 0.95;

/// Levels above 8 kHz in intervals of 5 ms, relative to the level of the active frames of the whole sound.
#[derive(Clone, Debug)]
pub(super) struct HighLevels {
    /// Sum of the energies before each block of half a millisecond.
    sums: Vec<f64>,
    block: usize,
    level: f64,
}

impl HighLevels {
    /// Measures a sound; `None` for silence, and for one whose rate is too low.
    pub(super) fn new(sound: &ActiveSound) -> Option<Self> {
        let level = sound.level()?;
        let design = Butterworth::design(Band::HighPass, 4, HIGH, sound.rate).ok()?;
        let mut high = sound.samples.clone();
        Cascade::new(&design, 1).process(&mut high);
        let block = ((AROUND / BLOCKS as f64 * sound.rate).round() as usize).max(1);
        let mut sums = vec![0.0];
        let mut sum = 0.0;
        for x in high.chunks_exact(block) {
            sum += x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
            sums.push(sum);
        }
        Some(Self { sums, block, level })
    }

    /// Level of the part of the interval around a sample that is within the sound.
    pub(super) fn around(&self, sample: usize) -> f64 {
        let last = self.sums.len() - 1;
        let middle = (sample + self.block / 2) / self.block;
        let [from, to] = [middle.saturating_sub(BLOCKS / 2), middle + BLOCKS / 2].map(|k| k.min(last));
        let count = ((to - from) * self.block).max(1) as f64;
        power_db((self.sums[to] - self.sums[from]).max(0.0) / count) - self.level
    }

    /// Levels of active intervals every 2.5 ms, in increasing order, up to the number that is counted.
    pub(super) fn sorted(&self, sound: &ActiveSound, counts: impl Fn(usize) -> bool) -> Vec<f64> {
        let all = (0..sound.samples.len()).step_by(self.block * BLOCKS / 2);
        let mut all: Vec<f64> =
            all.filter(|at| sound.is_active(*at) && counts(*at)).map(|at| self.around(at)).collect();
        all.sort_unstable_by(f64::total_cmp);
        all
    }
}

/// A join with its level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JoinPlace {
    /// Time, s.
    pub at: f64,
    /// Level above 8 kHz over the 95th percentile of the recordings, dB; over that of the sound between joins if there are no recordings.
    pub excess_db: f64,
}

/// Levels above 8 kHz in 5 ms around joins, each relative to the level of its sound.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JoinReport {
    /// Number of joins within active frames.
    pub count: usize,
    /// 95th percentile of the joins, dB.
    pub joins_db: Option<f64>,
    /// 95th percentile of intervals without a join, dB.
    pub between_db: Option<f64>,
    /// 95th percentile of intervals of the recordings, dB.
    pub recordings_db: Option<f64>,
    /// Share of joins above the 95th percentile of the recordings: 0.05 if joins are like the recordings.
    pub share_above: Option<f64>,
    /// The loudest joins at least 20 ms apart, loudest first.
    pub loudest: Vec<JoinPlace>,
}

/// Measures the joins of a sound at some samples. `recordings` are the sorted levels of the recordings.
///
/// # Complexity
/// Linear in samples, and n log n in joins.
pub(super) fn join_report(
    sound: &ActiveSound,
    joins: &[usize],
    recordings: &[f64],
    worst: usize,
) -> Option<(JoinReport, [Vec<f64>; 2])> {
    let high = HighLevels::new(sound)?;
    let half = high.block * BLOCKS / 2;
    let mut active: Vec<usize> = joins.iter().copied().filter(|at| sound.is_active(*at)).collect();
    active.sort_unstable();
    active.dedup();
    let is_between = |at: usize| {
        let next = active.partition_point(|join| *join < at.saturating_sub(half));
        active.get(next).is_none_or(|join| *join > at + half)
    };
    let between = high.sorted(sound, is_between);
    let mut levels: Vec<f64> = active.iter().map(|at| high.around(*at)).collect();
    let (recordings_db, between_db) = (percentile(recordings, SHARE), percentile(&between, SHARE));
    let limit = recordings_db.or(between_db);
    let place = |(at, level): (&usize, &f64)| {
        Some(JoinPlace { at: *at as f64 / sound.rate, excess_db: level - limit? })
    };
    let mut places: Vec<JoinPlace> = active.iter().zip(&levels).filter_map(place).collect();
    places.sort_by(|a, b| b.excess_db.total_cmp(&a.excess_db));
    let mut loudest: Vec<JoinPlace> = Vec::new();
    for place in places {
        if loudest.len() < worst && loudest.iter().all(|p| (p.at - place.at).abs() >= APART) {
            loudest.push(place);
        }
    }
    let above = |limit: f64| {
        let count = levels.iter().filter(|level| **level > limit).count();
        (!levels.is_empty()).then(|| count as f64 / levels.len() as f64)
    };
    let share_above = recordings_db.and_then(above);
    levels.sort_unstable_by(f64::total_cmp);
    let joins_db = percentile(&levels, SHARE);
    let report =
        JoinReport { count: active.len(), joins_db, between_db, recordings_db, share_above, loudest };
    Some((report, [levels, between]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likeness::statistics::testing::gaussian;

    #[test]
    fn a_click_at_a_join_is_found_there() {
        let mut x = gaussian(96_000, 1);
        x[31_000] += 3.0;
        let sound = ActiveSound::new(&x, 48_000.0);
        let recording = ActiveSound::new(&gaussian(48_000, 2), 48_000.0);
        let recordings = HighLevels::new(&recording).unwrap().sorted(&recording, |_| true);
        let joins: Vec<usize> = (1..95).map(|k| 1000 * k).collect();
        let (report, _) = join_report(&sound, &joins, &recordings, 3).unwrap();
        assert_eq!((report.count, report.loudest.len()), (94, 3));
        assert!((report.loudest[0].at - 31_000.0 / 48_000.0).abs() < 1e-9, "{report:?}");
        // In 240 samples of variance 0.01, two thirds of them above 8 kHz, 9 times two thirds are added.
        let expected = power_db((2.4 + 9.0) / 2.4) - (report.recordings_db.unwrap() - power_db(2.0 / 3.0));
        assert!((report.loudest[0].excess_db - expected).abs() < 1.0, "{report:?} {expected}");
        assert!(report.loudest[1].excess_db < 1.0 && report.share_above.unwrap() < 0.15, "{report:?}");
        // Joins of one noise are like the recordings, and like the rest.
        assert!((report.joins_db.unwrap() - report.recordings_db.unwrap()).abs() < 0.5, "{report:?}");
        assert!((report.between_db.unwrap() - report.recordings_db.unwrap()).abs() < 0.3, "{report:?}");
    }

    #[test]
    fn a_low_rate_and_silence_have_no_levels() {
        assert!(HighLevels::new(&ActiveSound::new(&gaussian(16_000, 1), 16_000.0)).is_none());
        assert!(join_report(&ActiveSound::new(&[0.0; 9600], 48_000.0), &[100], &[], 3).is_none());
    }
}
