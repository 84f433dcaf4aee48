//! The walk through a pattern, which selects one grain after the other.

use super::segment::GrainStep;
use crate::choices;
use crate::dsp::db_to_linear;
use crate::grain::correlation::{Pattern, Peak};
use crate::grain::dictionary::GrainDictionary;

choices! {
    /// Sound after a grain that no other follows soon.
    pub enum GapRule {
        /// The best grain in an interval twice as long, and so on.
        Extend,
        /// Silence until the next grain.
        Leave,
        /// Noise with the mean spectrum of the grains and the level of both neighbours, for sounds that never pause.
        Noise,
    }
}

/// Difference from the greatest correlation up to which the earliest grain is taken.
const NEARLY_BEST: f32 = 0.02;

/// Returns the peaks of a pattern that begin in `from ..= to`.
fn between(pattern: &Pattern, from: i64, to: i64) -> &[Peak] {
    let index = |t: i64| pattern.peaks.partition_point(|peak| i64::from(peak.t) < t);
    let (low, high) = (index(from), index(to + 1));
    pattern.peaks.get(low..high.max(low)).unwrap_or_default()
}

/// The earliest of the candidates that are nearly the best.
fn choose<'a>(candidates: impl Iterator<Item = &'a Peak> + Clone) -> Option<&'a Peak> {
    let best = candidates.clone().map(|peak| peak.correlation).fold(f32::NEG_INFINITY, f32::max);
    let mut good = candidates.filter(|peak| peak.correlation >= best - NEARLY_BEST);
    // Peaks are sorted by time, then by falling correlation, then by grain.
    good.next()
}

/// Amplitude of a peak with its sign.
fn signed(peak: &Peak) -> f32 {
    if peak.negative { -peak.gain } else { peak.gain }
}

/// Samples from the beginning of a windowed grain to that of the next one.
fn advance(dictionary: &GrainDictionary, grain: u32) -> i64 {
    dictionary
        .grains
        .get(grain as usize)
        .map_or(1, |g| (g.window_len() as i64 - i64::from(g.taper[1])).max(1))
}

/// Walks through a pattern: each grain is followed by the best one that begins where its last taper begins, or up to half the median length
/// of grains later. The peaks of a sequence are taken as they are.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.1; of
/// of candidates that are nearly the best, the earliest is taken, so that short grains are not left out.
#[must_use]
pub fn walk(pattern: &Pattern, dictionary: &GrainDictionary, gap: GapRule) -> Vec<GrainStep> {
    if pattern.is_sequence {
        let step = |peak: &Peak| GrainStep { grain: peak.grain, t: peak.t.into(), gain: signed(peak) };
        return pattern.peaks.iter().map(step).collect();
    }
    let half = (dictionary.median_len() as i64 / 2).max(1);
    let (mut start, mut steps) = (0_i64, Vec::new());
    let last = pattern.peaks.last().map_or(-1, |peak| i64::from(peak.t));
    while start <= last {
        let mut reach = half;
        let peak = loop {
            if let Some(peak) = choose(between(pattern, start, start + reach).iter()) {
                break peak;
            }
            match gap {
                GapRule::Extend => reach *= 2,
                // Noise is no grain.
                GapRule::Leave | GapRule::Noise => start += half,
            }
        };
        steps.push(GrainStep { grain: peak.grain, t: peak.t.into(), gain: signed(peak) });
        start = i64::from(peak.t) + advance(dictionary, peak.grain);
    }
    steps
}

/// A pattern whose peaks are the grains of a sound.
#[must_use]
pub fn sequence(pattern: &Pattern, steps: &[GrainStep], frames: u64) -> Pattern {
    let peak = |step: &GrainStep| Peak {
        t: step.t.max(0) as u32,
        grain: step.grain,
        correlation: 1.0,
        gain: step.gain.abs(),
        negative: step.gain < 0.0,
    };
    let mut peaks: Vec<Peak> = steps.iter().map(peak).collect();
    peaks.sort_by_key(|peak| peak.t);
    Pattern { frames, is_sequence: true, peaks, ..pattern.clone() }
}

/// Frames after the last grain of some steps, at least `frames`.
#[must_use]
pub fn frames_of(dictionary: &GrainDictionary, steps: &[GrainStep], frames: u64) -> u64 {
    let end = |step: &GrainStep| {
        let len = dictionary.grains.get(step.grain as usize).map_or(0, |grain| grain.window_len());
        step.t.max(0) as u64 + len as u64
    };
    steps.iter().map(end).max().unwrap_or(0).max(frames)
}

/// Rise of the power of a grain over that of the one before that makes an onset: 6 dB.
const ONSET: f64 = 4.0;

/// Power of a step in the sound.
fn power(dictionary: &GrainDictionary, step: &GrainStep) -> f64 {
    let own = dictionary.grains.get(step.grain as usize).map_or(0.0, |grain| f64::from(grain.power));
    own * f64::from(step.gain).powi(2)
}

/// Steps of a walk whose power rises by 6 dB over that of the step before; the first one counts.
#[must_use]
pub fn onset_steps(dictionary: &GrainDictionary, steps: &[GrainStep]) -> Vec<usize> {
    let powers: Vec<f64> = steps.iter().map(|step| power(dictionary, step)).collect();
    let rises = |k: &usize| *k == 0 || powers[*k] >= ONSET * powers[k - 1];
    (0..powers.len()).filter(rises).collect()
}

/// Picks that are not repeated at once.
const AVOIDED: usize = 2;

/// Changes the duration of a pattern by a factor, without changing its grains.
///
/// At position `p` of the output the walk searches for grains around `p / factor` of the source. Grains are placed unchanged, so that a longer
/// sound has more of them. An onset, a grain whose power rises by 6 dB, occurs once, at `factor` times its time. A factor of 1 is the walk.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.3.
#[must_use]
pub fn time_scaled(pattern: &Pattern, dictionary: &GrainDictionary, factor: f64) -> Vec<GrainStep> {
    let source = walk(pattern, dictionary, GapRule::Extend);
    if factor == 1.0 {
        return source;
    }
    let onsets: Vec<GrainStep> = onset_steps(dictionary, &source).into_iter().map(|k| source[k]).collect();
    let end = (pattern.frames as f64 * factor).round() as i64;
    let scaled = |t: i64| (t as f64 * factor).round() as i64;
    let mut steps: Vec<GrainStep> = Vec::new();
    let mut recent = [(i64::MIN, u32::MAX); AVOIDED];
    for (k, onset) in onsets.iter().enumerate() {
        let next = onsets.get(k + 1).map(|step| step.t);
        let until = next.map_or(end, scaled);
        let mut p = scaled(onset.t) + advance(dictionary, onset.grain);
        steps.push(GrainStep { t: scaled(onset.t), ..*onset });
        // What lies between two onsets is filled with grains from between them.
        let between = [onset.t + advance(dictionary, onset.grain) / 2, next.unwrap_or(i64::MAX)];
        while p < until {
            let Some(peak) = fill(pattern, dictionary, (p as f64 / factor).floor() as i64, between, &recent)
            else {
                break;
            };
            let from = (p as f64 / factor).floor() as i64;
            let t = p + (i64::from(peak.t) - from).max(0);
            if t >= until {
                break;
            }
            recent.rotate_right(1);
            recent[0] = (i64::from(peak.t), peak.grain);
            steps.push(GrainStep { grain: peak.grain, t, gain: signed(&peak) });
            p = t + advance(dictionary, peak.grain);
        }
    }
    steps
}

/// The best peak from `from` on, of those that lie between two times with all of their grain, and were not used lately; or else an earlier
/// one.
fn fill(
    pattern: &Pattern,
    dictionary: &GrainDictionary,
    from: i64,
    [low, high]: [i64; 2],
    recent: &[(i64, u32)],
) -> Option<Peak> {
    let half = (dictionary.median_len() as i64 / 2).max(1);
    let ends_in_time = |peak: &&Peak| i64::from(peak.t) + advance(dictionary, peak.grain) <= high;
    let is_new = |peak: &&Peak| !recent.contains(&(i64::from(peak.t), peak.grain));
    let from = from.clamp(low, high);
    let mut reach = half;
    loop {
        let range = [from.max(low), (from.saturating_add(reach)).min(high - 1)];
        let candidates = between(pattern, range[0], range[1]).iter().filter(ends_in_time).filter(is_new);
        let earlier =
            between(pattern, (from - reach).max(low), range[0]).iter().filter(ends_in_time).filter(is_new);
        if let Some(peak) = choose(candidates).or_else(|| choose(earlier)) {
            return Some(*peak);
        }
        if from - reach <= low && from.saturating_add(reach) >= high.min(pattern.frames as i64) {
            // Nothing is new: what was used lately is better than silence.
            return choose(between(pattern, low, high - 1).iter().filter(ends_in_time)).copied();
        }
        reach *= 2;
    }
}

/// Rules of a variation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VariationRules {
    /// Grains among which one is chosen: the best for each time.
    pub among: usize,
    /// Difference of correlation over which a grain becomes less likely by a factor of e; `None` for equal chances.
    pub temperature: Option<f64>,
    /// Greatest shift of a grain that is no onset, samples.
    pub jitter: f64,
    /// Greatest change of the level of a grain, dB.
    pub level: f64,
    /// Factor on the number of grains that are no onsets.
    pub density: f64,
}

impl Default for VariationRules {
    fn default() -> Self {
        Self { among: 4, temperature: None, jitter: 0.0, level: 0.0, density: 1.0 }
    }
}

/// Walks through a pattern with other grains than the best, for a similar but different sound.
///
/// At each time one of the best grains is chosen at random, with the gain that it has there, so that the envelope of the recording remains.
/// Onsets, grains whose power rises by 6 dB, stay at their times. With a `density` below 1 other grains are left out at random; above 1 more
/// of them begin while one sounds. `uniform` returns a random number in [0, 1) for a step and a purpose.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.3.
#[must_use]
pub fn varied(
    pattern: &Pattern,
    dictionary: &GrainDictionary,
    rules: &VariationRules,
    uniform: impl Fn(u64, u32) -> f64,
) -> Vec<GrainStep> {
    let source = walk(pattern, dictionary, GapRule::Extend);
    let mut onsets: Vec<i64> = onset_steps(dictionary, &source).into_iter().map(|k| source[k].t).collect();
    onsets.reverse();
    let half = (dictionary.median_len() as i64 / 2).max(1);
    let last = source.last().map_or(-1, |step| step.t);
    let mut steps: Vec<GrainStep> = Vec::new();
    let mut start = 0_i64;
    for index in 0.. {
        if start > last {
            break;
        }
        while onsets.last().is_some_and(|t| *t < start) {
            onsets.pop();
        }
        let mut onset = onsets.last().copied().filter(|t| *t <= start + half);
        let around = |t: i64| (t - half / 2, t + half / 2);
        let (mut low, mut high) = onset.map_or((start, start + half), around);
        let chosen = loop {
            if let Some(peak) = draw(between(pattern, low, high), rules, uniform(index, 0)) {
                break peak;
            }
            match onsets.last() {
                // Nothing begins before the next onset.
                Some(t) if onset.is_none() && *t <= high + half => {
                    onset = Some(*t);
                    (low, high) = around(*t);
                }
                _ => (low, high) = (low - i64::from(onset.is_some()) * half, high + half),
            }
        };
        let jitter = if onset.is_some() { 0.0 } else { rules.jitter * (2.0 * uniform(index, 1) - 1.0) };
        let level = db_to_linear(rules.level * (2.0 * uniform(index, 2) - 1.0)) as f32;
        let t = onset.unwrap_or_else(|| i64::from(chosen.t).max(start));
        let step = |peak: &Peak, t: i64| GrainStep {
            grain: peak.grain,
            t: (t + jitter as i64).max(0),
            gain: level * signed(peak),
        };
        let count = if onset.is_some() { 1 } else { (rules.density + uniform(index, 3)).floor() as i64 };
        if count > 0 {
            steps.push(step(&chosen, t));
        }
        // The next onset is not left out, even if the grain reaches beyond it.
        let next = onsets.iter().rev().copied().find(|t| onset.is_none_or(|onset| *t > onset));
        let end = t + advance(dictionary, chosen.grain);
        let end = next.map_or(end, |next| end.min(next));
        for k in 1..count {
            // In equal parts of the time to the next grain.
            let at = t + k * (end - t) / count;
            let near = between(pattern, at - half / 2, at + half / 2);
            steps.extend(draw(near, rules, uniform(index, 3 + k as u32)).map(|peak| step(&peak, at)));
        }
        start = end.max(t + 1);
    }
    steps.sort_by_key(|step| step.t);
    steps
}

/// One of the best grains of some peaks.
fn draw(peaks: &[Peak], rules: &VariationRules, uniform: f64) -> Option<Peak> {
    let mut best: Vec<Peak> = Vec::new();
    for peak in peaks {
        match best.iter_mut().find(|p| p.grain == peak.grain) {
            Some(same) if same.correlation >= peak.correlation => {}
            Some(same) => *same = *peak,
            None => best.push(*peak),
        }
    }
    best.sort_by(|a, b| b.correlation.total_cmp(&a.correlation).then(a.grain.cmp(&b.grain)));
    best.truncate(rules.among.max(1));
    let top = best.first().map_or(0.0, |peak| f64::from(peak.correlation));
    let weight = |peak: &Peak| {
        rules.temperature.map_or(1.0, |t| ((f64::from(peak.correlation) - top) / t.max(1e-6)).exp())
    };
    let mut left = uniform * best.iter().map(weight).sum::<f64>();
    for peak in &best {
        left -= weight(peak);
        if left < 0.0 {
            return Some(*peak);
        }
    }
    best.first().copied()
}

#[cfg(test)]
mod tests;
