//! Onsets of impacts in a recording.

use foley_fft::RealFftPlanner;
use std::f64::consts::TAU;
use std::ops::Range;

/// Frame of the analysis, s.
const FRAME: f64 = 0.008;
/// Distance of two frames, s.
const HOP: f64 = 0.002;
/// Least time between two onsets, s.
const APART: f64 = 0.05;
/// Edges of the bands, Hz.
const BANDS: [f64; 8] = [200.0, 400.0, 800.0, 1600.0, 3200.0, 6400.0, 12_800.0, 20_000.0];
/// Rise of a band at an onset, relative to the maximum of the frames before it, dB.
const RISE: f64 = 9.0;
/// Minimum level of a band at which its rises count, relative to its maximum, dB.
const RANGE: f64 = 35.0;
/// Part of the bands that rise at an onset.
const SHARE: f64 = 0.6;
/// Level of an onset relative to the loudest frame, dB.
const LOUD: f64 = -30.0;
/// The same at the start of a recording, where nothing precedes it that it could rise above.
const LOUD_START: f64 = -20.0;
/// Time before an onset that belongs to the impact, s.
const MARGIN: f64 = 0.002;
/// Milliseconds over which an impact may be soft before it becomes loud again.
const DIP: usize = 3;
/// Minimum ratio of energies at which a rise is not part of the impact before it.
const LOUDER: f64 = 10.0;

/// Index of the first sample of the loudest impact.
///
/// It lies in the first millisecond of the run that ends with the loudest one, in which one of three has a hundredth of its power.
#[must_use]
pub fn onset(samples: &[f32], rate: f64) -> usize {
    let hop = ((rate / 1000.0) as usize).max(1);
    let power = |frame: &[f32]| frame.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let powers: Vec<f64> = samples.chunks(hop).map(power).collect();
    let (mut first, max) =
        powers.iter().copied().enumerate().fold((0, 0.0), |best, p| if p.1 > best.1 { p } else { best });
    // Close modes cancel each other for a moment, and low ones at their zero crossings.
    while let Some(gap) = powers[first.saturating_sub(DIP)..first].iter().rev().position(|p| *p > 0.01 * max)
    {
        first -= gap + 1;
    }
    // Within that millisecond, the first sample above a tenth of its peak.
    let frame = samples.get(first * hop..).unwrap_or_default();
    let frame = &frame[..hop.min(frame.len())];
    let peak = frame.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    first * hop + frame.iter().position(|x| x.abs() > 0.1 * peak).unwrap_or(0)
}

/// Indices of the first samples of all impacts, in order of time: of each range of [`impacts`] the [`onset`].
///
/// # Complexity
/// O(samples).
#[must_use]
pub fn onsets(samples: &[f32], rate: f64) -> Vec<usize> {
    impacts(samples, rate).into_iter().map(|part| part.start + onset(&samples[part], rate)).collect()
}

/// Indices of the first samples of sudden rises.
///
/// At one most octave bands rise at once, by 9 dB above all frames of the 50 ms before it. The beating of close modes raises single bands
/// only. A recording that begins within a sound has a rise at its start.
fn rises(samples: &[f32], rate: f64) -> Vec<usize> {
    let (frame, hop) = ((FRAME * rate) as usize & !1, ((HOP * rate) as usize).max(1));
    if frame < 8 || samples.len() < 2 * frame {
        return if samples.is_empty() { Vec::new() } else { vec![onset(samples, rate)] };
    }
    let levels = band_levels(samples, rate, frame, hop);
    let bands = BANDS.windows(2).filter(|b| b[1] <= 0.5 * rate || b[0] < 0.25 * rate).count();
    let maximum: Vec<f64> =
        (0..bands).map(|b| levels.iter().map(|l| l[b]).fold(f64::NEG_INFINITY, f64::max)).collect();
    let total = |l: &[f64; 7]| l[..bands].iter().map(|db| 10_f64.powf(0.1 * db)).sum::<f64>();
    let loudest = levels.iter().map(total).fold(0.0, f64::max);
    let before = (APART / HOP) as usize;
    // Frames that overlap share samples: those of the history end before this one begins.
    let overlap = frame.div_ceil(hop) - 1;
    let is_rise = |t: usize| {
        let first = t.saturating_sub(before);
        let history = &levels[first..t.saturating_sub(overlap).max(first)];
        let rises = |b: &usize| {
            let max = history.iter().map(|l| l[*b]).fold(maximum[*b] - 90.0, f64::max);
            levels[t][*b] > (max + RISE).max(maximum[*b] - RANGE)
        };
        let rising = (0..bands).filter(rises).count();
        let least = if history.is_empty() { LOUD_START } else { LOUD };
        rising as f64 >= SHARE * bands as f64 && total(&levels[t]) > 10_f64.powf(0.1 * least) * loudest
    };
    // Of rises within 50 ms the first one counts, unless a later one is much louder: then the first was no impact.
    let mut starts: Vec<usize> = Vec::new();
    for t in (0..levels.len()).filter(|t| is_rise(*t)) {
        match starts.last_mut() {
            Some(last) if t - *last < before => {
                let peak = |t: usize| {
                    levels[t..(t + overlap + 1).min(levels.len())].iter().map(total).fold(0.0, f64::max)
                };
                if t - *last > overlap && peak(t) > LOUDER * peak(*last) {
                    *last = t;
                }
            }
            _ => starts.push(t),
        }
    }
    let first_sample = |t: usize| {
        let first = (t * hop).saturating_sub(2 * hop);
        let end = (t * hop + 2 * frame).min(samples.len());
        first + onset(&samples[first..end], rate)
    };
    if starts.is_empty() {
        vec![onset(samples, rate)]
    } else {
        starts.into_iter().map(first_sample).collect()
    }
}

/// Ranges of samples with one impact each: from before its onset to just before the next one.
///
/// At an onset most octave bands rise at once, by 9 dB above all frames of the 50 ms before it.
///
/// # Complexity
/// O(samples).
#[must_use]
pub fn impacts(samples: &[f32], rate: f64) -> Vec<Range<usize>> {
    let onsets = rises(samples, rate);
    let margin = (MARGIN * rate) as usize;
    // The part before the first impact belongs to it: it holds the noise.
    let starts = std::iter::once(0).chain(onsets.iter().skip(1).map(|n| n.saturating_sub(margin)));
    let ends = onsets.iter().skip(1).map(|n| n.saturating_sub(margin)).chain([samples.len()]);
    starts.zip(ends).take(onsets.len()).map(|(a, b)| a..b.max(a)).collect()
}

/// The range of [`impacts`] that holds the loudest one; the whole recording if there is none.
#[must_use]
pub fn loudest_impact(samples: &[f32], rate: f64) -> Range<usize> {
    let loudest = onset(samples, rate);
    impacts(samples, rate).into_iter().rfind(|part| part.start <= loudest).unwrap_or(0..samples.len())
}

/// Levels of the bands in dB, per frame.
fn band_levels(samples: &[f32], rate: f64, frame: usize, hop: usize) -> Vec<[f64; 7]> {
    let plan = RealFftPlanner::<f32>::new().plan_fft_forward(frame);
    let (mut time, mut spectrum) = (plan.make_input_vec(), plan.make_output_vec());
    let window: Vec<f32> =
        (0..frame).map(|k| (0.5 - 0.5 * libm::cos(TAU * (k as f64 + 0.5) / frame as f64)) as f32).collect();
    let bin = |f: f64| ((f * frame as f64 / rate).round() as usize).clamp(1, frame / 2);
    let mut out = Vec::new();
    for first in (0..=samples.len() - frame).step_by(hop) {
        for (t, (x, w)) in time.iter_mut().zip(samples[first..].iter().zip(&window)) {
            *t = x * w;
        }
        let mut levels = [-300.0; 7];
        if plan.process(&mut time, &mut spectrum).is_ok() {
            for (level, band) in levels.iter_mut().zip(BANDS.windows(2)) {
                let (low, high) = (bin(band[0]), bin(band[1]).max(bin(band[0]) + 1));
                let power: f64 =
                    spectrum[low..high.min(spectrum.len())].iter().map(|z| f64::from(z.norm_sqr())).sum();
                *level = 10.0 * power.max(1e-30).log10();
            }
        }
        out.push(levels);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(modes: &[(f64, f64)], from: usize, samples: &mut [f32]) {
        for (n, x) in samples[from..].iter_mut().enumerate() {
            let t = n as f64 / 44_100.0;
            let sum = |(f, d): &(f64, f64)| libm::exp(-d * t) * libm::sin(TAU * f * t);
            *x += (0.1 * modes.iter().map(sum).sum::<f64>()) as f32;
        }
    }

    const MODES: [(f64, f64); 6] =
        [(300.0, 5.0), (650.0, 6.0), (1500.0, 9.0), (2900.0, 20.0), (5800.0, 40.0), (11_000.0, 80.0)];

    #[test]
    fn each_impact_has_an_onset() {
        let mut samples = vec![0.0; 66_150];
        ring(&MODES, 4410, &mut samples);
        ring(&MODES, 22_050, &mut samples);
        let found = onsets(&samples, 44_100.0);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].abs_diff(4410) < 20 && found[1].abs_diff(22_050) < 60, "{found:?}");
        let parts = impacts(&samples, 44_100.0);
        assert_eq!(loudest_impact(&samples, 44_100.0), parts[1]);
        assert_eq!((parts.len(), parts[0].start, parts[1].end), (2, 0, 66_150));
        assert!(
            parts[0].end == parts[1].start && parts[0].end < 22_050 && parts[0].end > 21_900,
            "{parts:?}"
        );
    }

    #[test]
    fn beating_modes_are_one_impact() {
        let mut samples = vec![0.0; 66_150];
        let pairs: Vec<(f64, f64)> =
            MODES.iter().flat_map(|(f, d)| [(*f, 0.3 * d), (f + 3.0, 0.3 * d)]).collect();
        ring(&pairs[..4], 4410, &mut samples);
        assert_eq!(onsets(&samples, 44_100.0).len(), 1);
    }

    #[test]
    fn an_impact_after_a_softer_sound_begins_where_it_is_loud() {
        // The recording begins within a sound of a hundredth of the power, such as that of a hand that reaches for the object.
        let mut samples: Vec<f32> =
            (0..22_050).map(|n| 0.02 * libm::sinf(0.9 * (n * n % 977) as f32)).collect();
        ring(&MODES, 1800, &mut samples);
        let found = onsets(&samples, 44_100.0);
        assert!(found.len() == 1 && found[0].abs_diff(1800) < 50, "{found:?}");
    }

    #[test]
    fn a_dip_of_a_beat_is_no_onset() {
        let mut samples = vec![0.0; 22_050];
        ring(&[(60.0, 10.0), (75.0, 12.0), (200.0, 15.0)], 3000, &mut samples);
        let found = onset(&samples, 44_100.0);
        assert!(found.abs_diff(3000) < 100, "{found}");
    }

    #[test]
    fn a_recording_without_sound_has_one_onset_at_most() {
        assert!(onsets(&[], 44_100.0).is_empty() && impacts(&[], 44_100.0).is_empty());
        assert_eq!(onsets(&[0.0; 50], 44_100.0).len(), 1);
        assert_eq!(onsets(&[0.0; 5000], 44_100.0).len(), 1);
    }
}
