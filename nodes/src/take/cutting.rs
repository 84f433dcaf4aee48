//! Takes of a recording: the parts that are louder than its noise floor, by a gate with hysteresis.

use std::ops::Range;

use crate::crumple::bank::extraction::windowed_energy;
use crate::likeness::power_db;
use crate::statistics::quantile;

/// Parameters of the gate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TakeRules {
    /// Level of the noise floor, dB of full scale; `None`: the level that the quietest [`FLOOR_SHARE`] of the recording is below.
    pub floor: Option<f64>,
    /// Level above the noise floor at which a take begins, dB.
    pub open: f64,
    /// Level above the noise floor below which it ends, dB.
    pub close: f64,
    /// Time for which the level must stay below that, s.
    pub hold: f64,
    /// Window of the level, s.
    pub window: f64,
    /// Time that a take begins earlier, s.
    pub lead: f64,
    /// Time that a take ends later, s.
    pub tail: f64,
    /// Length below which a take is dropped, s.
    pub min_len: f64,
}

impl Default for TakeRules {
    fn default() -> Self {
        Self {
            floor: None,
            open: 12.0,
            close: 8.0,
            hold: 0.05,
            window: 0.01,
            lead: 0.01,
            tail: 0.03,
            min_len: 0.1,
        }
    }
}

/// Share of a recording that is no louder than its noise floor.
pub const FLOOR_SHARE: f64 = 0.03;
/// Share of a recording that is softer than its loudest twentieth.
const LOUDEST: f64 = 0.95;
/// Level of digital silence, dB: it is no noise floor.
pub const DIGITAL_SILENCE: f64 = -120.0;
/// Time from one level to the next, s.
const HOP: f64 = 0.001;

/// Result of [`cut`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cutting {
    /// Samples of each take, in order, without overlaps.
    pub takes: Vec<Range<usize>>,
    /// Noise floor, dB of full scale; `None` in a silent recording.
    pub floor: Option<f64>,
    /// Difference of the loudest twentieth and the noise floor, dB.
    pub spread: f64,
    /// Number of takes that were too short.
    pub short: usize,
    /// True if no part is louder than the floor by `open`: then the whole recording is one take.
    pub steady: bool,
}

/// Level of a recording in windows around every [`HOP`], dB of full scale, over all channels.
pub(super) fn levels(channels: &[Vec<f32>], window: usize, hop: usize) -> Vec<f64> {
    let n = channels.iter().map(Vec::len).min().unwrap_or(0);
    let mut sums = vec![0.0; n.div_ceil(hop)];
    for channel in channels {
        let energies = windowed_energy(channel, window);
        sums.iter_mut().zip(energies.iter().step_by(hop)).for_each(|(sum, e)| *sum += e);
    }
    let samples = (window * channels.len()).max(1) as f64;
    sums.into_iter().map(|sum| power_db(sum / samples)).collect()
}

/// Levels above digital silence, sorted; `None` if there is none.
fn audible(levels: impl Iterator<Item = f64>) -> Option<Vec<f64>> {
    let mut sorted: Vec<f64> = levels.filter(|level| *level > DIGITAL_SILENCE).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    (!sorted.is_empty()).then_some(sorted)
}

/// The level of the loudest twentieth of the takes of a recording, dB of full scale; `None` if they are silent.
#[must_use]
pub fn loudest_level(channels: &[Vec<f32>], takes: &[Range<usize>], fs: f64, window: f64) -> Option<f64> {
    let (window, hop) = (samples(window, fs).max(1), samples(HOP, fs).max(1));
    let levels = levels(channels, window, hop);
    let inside = takes.iter().flat_map(|take| levels.get(take.start.div_ceil(hop)..take.end.div_ceil(hop)));
    Some(quantile(&audible(inside.flatten().copied())?, LOUDEST))
}

fn samples(seconds: f64, fs: f64) -> usize {
    (seconds * fs).round() as usize
}

/// Finds the takes of a recording at `fs` hertz.
///
/// A take begins where the level exceeds the noise floor by `open`, and ends where it has stayed less than `close` above it for
/// `hold`. Takes that overlap with their `lead` and `tail` are one.
///
/// # Complexity
/// O(n).
#[must_use]
pub fn cut(channels: &[Vec<f32>], fs: f64, rules: &TakeRules) -> Cutting {
    let n = channels.iter().map(Vec::len).min().unwrap_or(0);
    let hop = samples(HOP, fs).max(1);
    let levels = levels(channels, samples(rules.window, fs).max(1), hop);
    let Some(sorted) = audible(levels.iter().copied()) else { return Cutting::default() };
    let floor = rules.floor.unwrap_or_else(|| quantile(&sorted, FLOOR_SHARE));
    let spread = quantile(&sorted, LOUDEST) - floor;
    let mut cutting = Cutting { floor: Some(floor), spread, ..Cutting::default() };
    let hold = (samples(rules.hold, fs) / hop).max(1);
    let (lead, tail) = (samples(rules.lead, fs), samples(rules.tail, fs));
    let mut open: Option<usize> = None;
    let mut quiet = 0;
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut add = |from: usize, to: usize| {
        let run = (from * hop).saturating_sub(lead)..(to * hop + tail).min(n);
        match runs.last_mut() {
            Some(last) if run.start <= last.end => last.end = run.end,
            _ => runs.push(run),
        }
    };
    for (k, level) in levels.iter().enumerate() {
        let Some(from) = open else {
            if *level >= floor + rules.open {
                (open, quiet) = (Some(k), 0);
            }
            continue;
        };
        quiet = if *level < floor + rules.close { quiet + 1 } else { 0 };
        if quiet > hold {
            add(from, k + 1 - quiet);
            open = None;
        }
    }
    if let Some(from) = open {
        add(from, levels.len());
    }
    if runs.is_empty() {
        cutting.steady = true;
        runs.push(0..n);
    }
    let min_len = samples(rules.min_len, fs).max(1);
    let before = runs.len();
    runs.retain(|run| run.len() >= min_len);
    cutting.short = before - runs.len();
    cutting.takes = runs;
    cutting
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    const FS: f64 = 8000.0;

    /// Noise of an RMS level in dB at each of these stretches in seconds, one after the other.
    fn noise(parts: &[(f64, f64)]) -> Vec<f32> {
        let mut rng = Rng::new(3);
        let part = |&(seconds, db): &(f64, f64)| {
            let peak = 3f64.sqrt() * 10f64.powf(db / 20.0);
            (0..samples(seconds, FS)).map(|_| rng.between(-peak, peak) as f32).collect::<Vec<_>>()
        };
        parts.iter().map(part).collect::<Vec<_>>().concat()
    }

    fn seconds(cutting: &Cutting) -> Vec<[f64; 2]> {
        cutting.takes.iter().map(|take| [take.start as f64 / FS, take.end as f64 / FS]).collect()
    }

    #[test]
    fn takes_are_what_is_louder_than_the_room() {
        let rules = TakeRules::default();
        // The short crack of 20 ms is dropped, the pause of 40 ms ends no take, and 10 dB above the floor hold it open.
        let x = noise(&[
            (1.0, -60.0),
            (0.5, -30.0),
            (0.04, -60.0),
            (0.3, -40.0),
            (0.4, -50.0),
            (0.7, -60.0),
            (0.02, -30.0),
            (1.0, -60.0),
            (0.4, -45.0),
            (1.0, -60.0),
        ]);
        let found = cut(&[x], FS, &rules);
        let expected = [[1.0, 2.24], [3.96, 4.36]];
        assert_eq!((found.takes.len(), found.short, found.steady), (2, 1, false), "{found:?}");
        for (take, wanted) in seconds(&found).iter().zip(expected) {
            let early = wanted[0] - take[0];
            let late = take[1] - wanted[1];
            assert!(
                (0.005..0.02).contains(&early) && (0.02..0.06).contains(&late),
                "{take:?} for {wanted:?}"
            );
        }
        assert!((found.floor.unwrap() + 60.0).abs() < 1.5, "{found:?}");
    }

    #[test]
    fn levels_do_not_depend_on_the_gain_of_the_recording() {
        let x = noise(&[(0.5, -50.0), (0.5, -20.0), (0.5, -50.0)]);
        let soft: Vec<f32> = x.iter().map(|x| 0.01 * x).collect();
        let rules = TakeRules::default();
        assert_eq!(cut(std::slice::from_ref(&x), FS, &rules).takes, cut(&[soft], FS, &rules).takes);
        // Of two channels the louder one decides.
        let both = cut(&[vec![0.0; x.len()], x.clone()], FS, &rules);
        assert_eq!(both.takes.len(), 1);
        let level = loudest_level(&[x], &both.takes, FS, 0.01).unwrap();
        assert!((level + 20.0).abs() < 2.0, "{level}");
    }

    #[test]
    fn steady_noise_is_one_take_and_silence_none() {
        let rules = TakeRules::default();
        let steady = cut(&[noise(&[(2.0, -30.0)])], FS, &rules);
        assert!(steady.steady && seconds(&steady) == [[0.0, 2.0]] && steady.spread < 10.0, "{steady:?}");
        assert_eq!(cut(&[vec![0.0; 8000]], FS, &rules), Cutting::default());
        assert_eq!(cut(&[], FS, &rules), Cutting::default());
        // Digital silence between two sounds is no noise floor.
        let gated = [noise(&[(0.5, -30.0)]), vec![0.0; 8000], noise(&[(0.5, -50.0), (0.5, -30.0)])].concat();
        assert!(cut(&[gated], FS, &rules).floor.unwrap() > -60.0);
    }
}
