//! Frame intervals of an engine over a log: engines change their rate, and logs omit frames without contacts.

use crate::core::time::{Tick, ticks};

/// Number of gaps on either side from which a local interval is estimated.
const NEIGHBOURS: usize = 12;
/// Smallest number of gaps for an estimate.
const MIN_NEIGHBOURS: usize = 6;
/// Largest local interval in common intervals of the log; longer ones are series of single contacts.
const MAX_RATIO: Tick = 4;

/// Lengths of the frames of a log.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FrameIntervals {
    /// Interval of most of the log.
    pub common: Tick,
    /// The longest interval: the time to wait for the next frame.
    pub longest: Tick,
    /// Interval that the gaps have in common, whatever the known rate.
    pub observed: Option<Tick>,
    /// Interval of each frame with contacts.
    pub intervals: Vec<Tick>,
    /// Number of gaps that are not a whole number of frames.
    pub uneven: usize,
}

impl FrameIntervals {
    /// The intervals of a log with contacts at these ascending times, with a known `rate` in Hz or by estimation.
    ///
    /// The gap between two times is one frame if the gaps before or after it are as long, and several frames if all around it are
    /// shorter. So the rate of a log can change, and a frame without contacts is recognised as missing.
    pub fn new(times: &[Tick], rate: Option<f64>) -> Self {
        let gaps: Vec<Tick> = times.windows(2).map(|w| w[1] - w[0]).collect();
        let observed = quartile(&gaps);
        let common = rate.map_or(observed, |rate| Some(ticks(1.0 / rate)));
        let common = common.unwrap_or(ticks(1.0 / 60.0)).max(1);
        let neighbours = |k: usize| {
            let before = gaps.get(k.saturating_sub(NEIGHBOURS)..k).and_then(common_gap);
            let after = gaps.get(k + 1..gaps.len().min(k + 1 + NEIGHBOURS)).and_then(common_gap);
            [before, after].map(|gap| gap.filter(|gap| *gap <= common.saturating_mul(MAX_RATIO)))
        };
        let interval = |k: usize| {
            if rate.is_some() { common } else { local_interval(gaps[k], neighbours(k)).unwrap_or(common) }
        };
        let mut intervals: Vec<Tick> = (0..gaps.len()).map(interval).collect();
        let is_uneven = |(gap, interval): (&Tick, &Tick)| {
            let frames = *gap as f64 / *interval as f64;
            (frames - frames.round()).abs() > 0.25 || frames < 0.75
        };
        let uneven = gaps.iter().zip(&intervals).filter(|pair| is_uneven(*pair)).count();
        // A gap of less than a frame and a half is one late frame.
        let length = |(gap, interval): (&Tick, &Tick)| {
            if 2 * gap < 3 * interval { *gap.max(interval) } else { *interval }
        };
        let longest = gaps.iter().zip(&intervals).map(length).max().unwrap_or(common);
        // The first frame is as long as the next.
        intervals.insert(0, intervals.first().copied().unwrap_or(common));
        Self { common, longest, observed, intervals, uneven }
    }
}

/// Lower quartile of the gaps above 0; longer gaps have frames without contacts.
fn quartile(gaps: &[Tick]) -> Option<Tick> {
    let mut gaps: Vec<Tick> = gaps.iter().copied().filter(|gap| *gap > 0).collect();
    gaps.sort_unstable();
    gaps.get(gaps.len() / 4).copied()
}

/// Length that at least three quarters of the gaps have.
fn common_gap(gaps: &[Tick]) -> Option<Tick> {
    let gap = quartile(gaps).filter(|_| gaps.len() >= MIN_NEIGHBOURS)?;
    let similar = gaps.iter().filter(|other| (gap - gap / 5..=gap + gap / 4).contains(*other)).count();
    (4 * similar >= 3 * gaps.len()).then_some(gap)
}

/// Length of the frame at the end of a gap, from the intervals before and after it.
fn local_interval(gap: Tick, neighbours: [Option<Tick>; 2]) -> Option<Tick> {
    match neighbours.map(|interval| interval.filter(|interval| gap >= interval - interval / 4)) {
        // A gap without contacts: the frame belongs to those after it.
        [Some(before), Some(after)] if 4 * gap >= 7 * before.max(after) => Some(after),
        [before, after] => before.max(after),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Intervals of frames with these gaps, in hundredths of a second.
    fn intervals(gaps: &[i64]) -> Vec<Tick> {
        let mut times = vec![0];
        times.extend(gaps.iter().scan(0, |time, gap| {
            *time += gap;
            Some(*time)
        }));
        let times: Vec<Tick> = times.into_iter().map(|k| ticks(0.01 * k as f64)).collect();
        FrameIntervals::new(&times, None)
            .intervals
            .into_iter()
            .map(|interval| (interval as f64 / ticks(0.01) as f64).round() as i64)
            .collect()
    }

    fn repeated(parts: &[(i64, usize)]) -> Vec<i64> {
        parts.iter().flat_map(|(gap, count)| vec![*gap; *count]).collect()
    }

    #[test]
    fn a_change_of_rate_is_followed_from_one_frame_to_the_next() {
        for (before, after) in [(1, 2), (2, 1), (1, 3), (2, 3)] {
            let gaps = repeated(&[(before, 40), (after, 40)]);
            assert_eq!(intervals(&gaps)[1..], gaps, "{before} to {after}");
        }
        // Several times, also where the slower parts are most of the log.
        let gaps = repeated(&[(1, 20), (2, 60), (1, 20), (4, 30)]);
        assert_eq!(intervals(&gaps)[1..], gaps);
    }

    #[test]
    fn missing_frames_are_not_another_rate() {
        for missing in [vec![2], vec![3, 1, 2], vec![2, 2], vec![2, 1, 2, 1, 2]] {
            let gaps = [repeated(&[(1, 20)]), missing, repeated(&[(1, 20)])].concat();
            assert!(intervals(&gaps).iter().all(|interval| *interval == 1), "{gaps:?}");
        }
        // A ball that bounces lower and lower and then rolls; and one with repeated single contacts.
        let gaps = [vec![47, 32, 20, 13, 9, 6, 4, 3, 2], repeated(&[(1, 30)])].concat();
        assert!(intervals(&gaps).iter().all(|interval| *interval == 1));
        let gaps = repeated(&[(1, 30), (12, 20)]);
        assert!(intervals(&gaps).iter().all(|interval| *interval == 1));
        // A pause, and then another rate.
        let gaps = [repeated(&[(1, 20)]), vec![30], repeated(&[(2, 20)])].concat();
        assert_eq!(intervals(&gaps)[19..24], [1, 1, 2, 2, 2]);
    }

    #[test]
    fn the_longest_frame_excludes_missing_frames() {
        let longest = |gaps: &[i64]| {
            let mut times = vec![0];
            gaps.iter().for_each(|gap| times.push(times[times.len() - 1] + gap));
            FrameIntervals::new(&times, None).longest
        };
        assert_eq!(longest(&repeated(&[(10, 40)])), 10);
        assert_eq!(
            longest(&[repeated(&[(10, 20)]), vec![12, 9, 14, 30], repeated(&[(10, 20)])].concat()),
            14
        );
        assert_eq!(longest(&repeated(&[(10, 40), (20, 40)])), 20);
    }

    #[test]
    fn a_known_rate_applies_to_all_frames_and_few_frames_have_one_rate() {
        let times: Vec<Tick> = (0..60).map(|k| ticks(0.02 * f64::from(k))).collect();
        let known = FrameIntervals::new(&times, Some(100.0));
        assert!(known.intervals.iter().all(|interval| *interval == ticks(0.01)) && known.uneven == 0);
        assert_eq!(FrameIntervals::new(&[], None).common, ticks(1.0 / 60.0));
        assert_eq!(FrameIntervals::new(&[5], None).intervals, [ticks(1.0 / 60.0)]);
        assert_eq!(intervals(&[1, 1, 2]), [1, 1, 1, 1]);
    }
}
