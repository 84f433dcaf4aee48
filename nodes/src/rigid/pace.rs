//! How long a frame of the engine lasts, all along a log: engines change their rate, and logs leave out frames without contacts.

use crate::core::time::{Tick, ticks};

/// Steps to either side that tell the pace of a place in the log.
const AROUND: usize = 12;
/// Fewer tell nothing.
const LEAST: usize = 6;
/// A pace slower than this many frames of the log is a row of single touches.
const SLOWEST: Tick = 4;

/// Lengths of frames.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pace {
    /// That of most of the log.
    pub step: Tick,
    /// The longest: the time to wait for the next frame.
    pub longest: Tick,
    /// That of each frame with contacts.
    pub steps: Vec<Tick>,
    /// Steps of time that are no whole number of frames.
    pub uneven: usize,
}

impl Pace {
    /// The paces of a log with contacts at these times, which rise; of a known `rate` in Hz, or found.
    ///
    /// A step is one frame where the steps before it or those after it are as long, and several frames where all around it are
    /// shorter: so a log may go on at another rate, and a contact that is missing for a frame is still missing.
    pub fn new(times: &[Tick], rate: Option<f64>) -> Self {
        let gaps: Vec<Tick> = times.windows(2).map(|w| w[1] - w[0]).collect();
        let step = rate.map_or_else(|| quartile(&gaps), |rate| Some(ticks(1.0 / rate)));
        let step = step.unwrap_or(ticks(1.0 / 60.0)).max(1);
        let around = |k: usize| {
            let before = gaps.get(k.saturating_sub(AROUND)..k).and_then(even);
            let after = gaps.get(k + 1..gaps.len().min(k + 1 + AROUND)).and_then(even);
            [before, after].map(|pace| pace.filter(|pace| *pace <= step.saturating_mul(SLOWEST)))
        };
        let of = |k: usize| if rate.is_some() { step } else { pace(gaps[k], around(k)).unwrap_or(step) };
        let mut steps: Vec<Tick> = (0..gaps.len()).map(of).collect();
        let off = |(gap, step): (&Tick, &Tick)| {
            let frames = *gap as f64 / *step as f64;
            (frames - frames.round()).abs() > 0.25 || frames < 0.75
        };
        let uneven = gaps.iter().zip(&steps).filter(|pair| off(*pair)).count();
        // A step that is not even a frame and a half is one that came late.
        let whole = |(gap, step): (&Tick, &Tick)| if 2 * gap < 3 * step { *gap.max(step) } else { *step };
        let longest = gaps.iter().zip(&steps).map(whole).max().unwrap_or(step);
        // The first frame lasts as long as the one after it.
        steps.insert(0, steps.first().copied().unwrap_or(step));
        Self { step, longest, steps, uneven }
    }
}

/// The lower quartile of steps: what is longer passed without any contact.
fn quartile(gaps: &[Tick]) -> Option<Tick> {
    let mut gaps: Vec<Tick> = gaps.iter().copied().filter(|gap| *gap > 0).collect();
    gaps.sort_unstable();
    gaps.get(gaps.len() / 4).copied()
}

/// The common length of steps, three quarters of which have it.
fn even(gaps: &[Tick]) -> Option<Tick> {
    let pace = quartile(gaps).filter(|_| gaps.len() >= LEAST)?;
    let alike = gaps.iter().filter(|gap| (pace - pace / 5..=pace + pace / 4).contains(*gap)).count();
    (4 * alike >= 3 * gaps.len()).then_some(pace)
}

/// The length of the frame that ends a step, by the paces before and after it.
fn pace(gap: Tick, around: [Option<Tick>; 2]) -> Option<Tick> {
    match around.map(|pace| pace.filter(|pace| gap >= pace - pace / 4)) {
        // Nothing touched in between: the frame belongs to those after it.
        [Some(before), Some(after)] if 4 * gap >= 7 * before.max(after) => Some(after),
        [before, after] => before.max(after),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times of frames after steps in hundredths of a second.
    fn paces(steps: &[i64]) -> Vec<Tick> {
        let mut times = vec![0];
        times.extend(steps.iter().scan(0, |time, step| {
            *time += step;
            Some(*time)
        }));
        let times: Vec<Tick> = times.into_iter().map(|k| ticks(0.01 * k as f64)).collect();
        Pace::new(&times, None)
            .steps
            .into_iter()
            .map(|step| (step as f64 / ticks(0.01) as f64).round() as i64)
            .collect()
    }

    fn rows(parts: &[(i64, usize)]) -> Vec<i64> {
        parts.iter().flat_map(|(step, count)| vec![*step; *count]).collect()
    }

    #[test]
    fn a_change_of_rate_is_followed_from_one_frame_to_the_next() {
        for (before, after) in [(1, 2), (2, 1), (1, 3), (2, 3)] {
            let steps = rows(&[(before, 40), (after, 40)]);
            assert_eq!(paces(&steps)[1..], steps, "{before} to {after}");
        }
        // Several times, also where the slower parts are most of the log.
        let steps = rows(&[(1, 20), (2, 60), (1, 20), (4, 30)]);
        assert_eq!(paces(&steps)[1..], steps);
    }

    #[test]
    fn what_is_missing_is_no_other_rate() {
        for missing in [vec![2], vec![3, 1, 2], vec![2, 2], vec![2, 1, 2, 1, 2]] {
            let steps = [rows(&[(1, 20)]), missing, rows(&[(1, 20)])].concat();
            assert!(paces(&steps).iter().all(|step| *step == 1), "{steps:?}");
        }
        // A ball that bounces lower and lower and then rolls; and one that is struck again and again.
        let steps = [vec![47, 32, 20, 13, 9, 6, 4, 3, 2], rows(&[(1, 30)])].concat();
        assert!(paces(&steps).iter().all(|step| *step == 1));
        let steps = rows(&[(1, 30), (12, 20)]);
        assert!(paces(&steps).iter().all(|step| *step == 1));
        // Away for a while, and back at another rate.
        let steps = [rows(&[(1, 20)]), vec![30], rows(&[(2, 20)])].concat();
        assert_eq!(paces(&steps)[19..24], [1, 1, 2, 2, 2]);
    }

    #[test]
    fn the_longest_frame_is_none_that_is_missing() {
        let longest = |steps: &[i64]| {
            let mut times = vec![0];
            steps.iter().for_each(|step| times.push(times[times.len() - 1] + step));
            Pace::new(&times, None).longest
        };
        assert_eq!(longest(&rows(&[(10, 40)])), 10);
        assert_eq!(longest(&[rows(&[(10, 20)]), vec![12, 9, 14, 30], rows(&[(10, 20)])].concat()), 14);
        assert_eq!(longest(&rows(&[(10, 40), (20, 40)])), 20);
    }

    #[test]
    fn a_known_rate_is_that_of_all_and_few_frames_have_one() {
        let times: Vec<Tick> = (0..60).map(|k| ticks(0.02 * f64::from(k))).collect();
        let known = Pace::new(&times, Some(100.0));
        assert!(known.steps.iter().all(|step| *step == ticks(0.01)) && known.uneven == 0);
        assert_eq!(Pace::new(&[], None).step, ticks(1.0 / 60.0));
        assert_eq!(Pace::new(&[5], None).steps, [ticks(1.0 / 60.0)]);
        assert_eq!(paces(&[1, 1, 2]), [1, 1, 1, 1]);
    }
}
