//! Intervals of a recording that sound like one of it.

use super::matches::MotionMatch;
use super::som::{Alignment, string_matches, units};
use crate::choices;
use crate::core::time::Rate;
use crate::feature::MelCepstrum;
use crate::feature::conventions::{
    BandShape, FeatureConventions, FeatureWindow, FloorRule, LogScale, MelScale,
};
use crate::statistics::quantile;
use thiserror::Error;

/// Mel cepstral coefficients of a frame, without the first, which is the loudness.
const COEFFICIENTS: usize = 12;
/// Window and hop at 32 kHz, samples.
const FRAME: (f64, f64, f64) = (1024.0, 256.0, 32_000.0);
/// Lowest energy of a band.
const FLOOR: f64 = 1e-10;
/// The least number of frames of a query.
const MIN_FRAMES: usize = 3;

choices! {
    /// Method of the comparison of passages.
    pub enum SpotMode {
        /// Mel cepstra by dynamic time warping.
        Warping,
        /// Strings of the units of a self-organising map of the mel cepstra.
        Strings,
    }
}

/// Seed of the map.
const SEED: u64 = 1;

/// The reason why an interval cannot be searched for.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "the interval is from {from} s to {to} s, and the recording ends at {end:.3} s; {needed:.3} s and more can be searched for"
)]
pub struct SpotError {
    /// Its start.
    pub from: f64,
    /// Its end.
    pub to: f64,
    /// End of the recording.
    pub end: f64,
    /// The shortest interval.
    pub needed: f64,
}

/// Mel cepstra and their differences of all frames of a recording, each dimension with mean 0 and variance 1, and the frames per second.
fn features(x: &[f32], rate: f64) -> (Vec<[f32; 2 * COEFFICIENTS]>, f64) {
    let (frame, hop) =
        ((FRAME.0 * rate / FRAME.2).round() as usize, (FRAME.1 * rate / FRAME.2).round().max(1.0) as usize);
    let conventions = FeatureConventions {
        rate: Rate::from_f64(rate).unwrap_or(Rate::hz(32_000)),
        unit: hop as u32,
        window: FeatureWindow::Hann,
        frame: frame as u32,
        shape: BandShape::Triangular,
        mel: MelScale::Slaney,
        bands: 40,
        f_lo: 50.0_f64.min(0.1 * rate),
        f_hi: 0.45 * rate,
        log: LogScale::Decibel,
        floor: FloorRule::Level(-100.0),
        n: COEFFICIENTS as u32,
        first: 1,
        high_pass: 0.0,
        high_pass_order: 1,
        joined: 1,
        widths: Vec::new(),
        causal: false,
    };
    let mut cepstrum = MelCepstrum::new(&conventions, FLOOR);
    let mut window = vec![0.0; frame];
    let count = x.len().div_ceil(hop);
    let mut all = vec![[0.0_f32; 2 * COEFFICIENTS]; count];
    for (k, out) in all.iter_mut().enumerate() {
        for (n, w) in window.iter_mut().enumerate() {
            let at = (k * hop + n).checked_sub(frame / 2);
            *w = at.and_then(|at| x.get(at)).copied().unwrap_or(0.0);
        }
        cepstrum.process(&window, &mut out[..COEFFICIENTS]);
    }
    for k in 0..count {
        let (a, b) = (k.saturating_sub(1), (k + 1).min(count - 1));
        for c in 0..COEFFICIENTS {
            all[k][COEFFICIENTS + c] = (all[b][c] - all[a][c]) / (b - a).max(1) as f32;
        }
    }
    for c in 0..2 * COEFFICIENTS {
        let n = count.max(1) as f64;
        let mean = all.iter().map(|f| f64::from(f[c])).sum::<f64>() / n;
        let variance = all.iter().map(|f| (f64::from(f[c]) - mean).powi(2)).sum::<f64>() / n;
        let factor = if variance > 1e-12 { 1.0 / variance.sqrt() } else { 0.0 };
        all.iter_mut().for_each(|f| f[c] = ((f64::from(f[c]) - mean) * factor) as f32);
    }
    (all, rate / hop as f64)
}

const NONE: Alignment = Alignment { cost: f64::INFINITY, steps: 0, start: 0 };

/// The best alignment of a query with a part of a sequence that ends at each frame, with the steps (1, 1), (1, 2) and (2, 1).
fn alignments<const N: usize>(query: &[[f32; N]], all: &[[f32; N]]) -> Vec<Alignment> {
    let local = |a: &[f32; N], b: &[f32; N]| -> f64 {
        a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
    };
    // Rows of this frame and of the two before it, by frame of the query.
    let [mut row, mut last, mut before] = [(); 3].map(|()| vec![NONE; query.len()]);
    let mut out = Vec::with_capacity(all.len());
    for (t, frame) in all.iter().enumerate() {
        for (i, q) in query.iter().enumerate() {
            let cost = local(q, frame);
            if i == 0 {
                row[0] = Alignment { cost, steps: 1, start: t as u32 };
                continue;
            }
            let from = [last[i - 1], before[i - 1], if i > 1 { last[i - 2] } else { NONE }];
            let best = from.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).unwrap_or(NONE);
            row[i] = Alignment { cost: best.cost + cost, steps: best.steps + 1, start: best.start };
        }
        out.push(row[query.len() - 1]);
        std::mem::swap(&mut before, &mut last);
        std::mem::swap(&mut last, &mut row);
    }
    out
}

/// The intervals of a recording that sound most like one of it, that itself among them: at most `count`, the most similar first.
///
/// Mel cepstra of the interval are aligned with every part of half to twice its length, or the strings of their units in a map of 8 by 8; the similarity is `exp(-c / m)` with the mean distance
/// `c` along the alignment and its median `m` over the recording. Parts closer to a better one than half of the interval are left out.
///
/// # Errors
/// Intervals outside of the recording, or too short.
///
/// # Complexity
/// Frames of the recording times frames of the interval.
///
/// # Source
/// Spevak and Polfreman, "Sound spotting - a frame-based approach" (ISMIR 2001), which Cardle et al. use, with self-organising maps and strings;
/// dynamic time warping is a choice.
pub fn spots(
    x: &[f32],
    rate: f64,
    (from, to): (f64, f64),
    mode: SpotMode,
    count: usize,
    least: f64,
) -> Result<Vec<MotionMatch>, SpotError> {
    let (all, frames) = features(x, rate);
    let (a, b) = ((from * frames).round() as usize, (to * frames).round() as usize);
    if b > all.len() || b < a + MIN_FRAMES {
        return Err(SpotError { from, to, end: x.len() as f64 / rate, needed: MIN_FRAMES as f64 / frames });
    }
    let ends = match mode {
        SpotMode::Warping => alignments(&all[a..b], &all),
        SpotMode::Strings => {
            let text = units(&all, SEED);
            string_matches(&text[a..b], &text)
        }
    };
    let mean = |cell: &Alignment| cell.cost / f64::from(cell.steps.max(1));
    let mut costs: Vec<f64> = ends.iter().map(mean).filter(|c| c.is_finite()).collect();
    costs.sort_by(f64::total_cmp);
    let median = quantile(&costs, 0.5).max(1e-9);
    let mut order: Vec<(usize, &Alignment)> =
        ends.iter().enumerate().filter(|(_, c)| c.cost.is_finite()).collect();
    order.sort_by(|x, y| mean(x.1).total_cmp(&mean(y.1)).then(x.0.cmp(&y.0)));
    let mut found: Vec<(f64, f64)> = Vec::new();
    let mut out = Vec::new();
    let near = (b - a) as f64 / 2.0;
    for (end, cell) in order {
        let (start, end) = (f64::from(cell.start), end as f64 + 1.0);
        let similarity = (-mean(cell) / median).exp();
        if out.len() == count || similarity < least {
            break;
        }
        let is_free = |(s, e): &(f64, f64)| ((s + e) - (start + end)).abs() / 2.0 > near;
        if found.iter().all(is_free) {
            found.push((start, end));
            out.push(MotionMatch {
                from: start / frames,
                to: (end / frames).min(x.len() as f64 / rate),
                similarity,
            });
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn planted_bursts_are_found_and_nothing_else() {
        let rate = 32_000.0;
        let mut rng = Rng::new(2);
        let mut x: Vec<f32> = (0..320_000).map(|_| rng.between(-0.02, 0.02) as f32).collect();
        // A chirp of 0.4 s, 10 dB and more above the noise.
        let starts = [1.0, 2.7, 4.1, 6.0, 8.3];
        for start in starts {
            let mut phase = 0.0_f64;
            for k in 0..12_800 {
                let t = k as f64 / 12_800.0;
                phase += std::f64::consts::TAU * (800.0 + 3000.0 * t) / rate;
                x[(start * rate) as usize + k] += (0.08 * phase.sin()) as f32;
            }
        }
        for mode in [SpotMode::Warping, SpotMode::Strings] {
            let mut found = spots(&x, rate, (1.0, 1.4), mode, 20, 0.5).unwrap();
            assert!((found[0].from - 1.0).abs() < 0.01 && found[0].similarity == 1.0, "{found:?}");
            found.sort_by(|a, b| a.from.total_cmp(&b.from));
            assert_eq!(found.len(), starts.len(), "{found:?}");
            for (spot, start) in found.iter().zip(starts) {
                assert!((spot.from - start).abs() < 0.03 && (spot.to - start - 0.4).abs() < 0.04, "{spot:?}");
            }
            assert_eq!(spots(&x, rate, (1.0, 1.4), mode, 2, 0.5).unwrap().len(), 2);
        }
        let spots = |interval| spots(&x, rate, interval, SpotMode::Warping, 2, 0.5);
        assert!(spots((9.9, 10.5)).unwrap_err().to_string().contains("ends at 10.000 s"));
        assert!(spots((1.0, 1.001)).is_err());
    }

    #[test]
    fn silence_has_no_preference() {
        let found = spots(&[0.0; 32_000], 32_000.0, (0.2, 0.4), SpotMode::Warping, 3, 0.1).unwrap();
        assert!(!found.is_empty() && found.iter().all(|m| m.similarity.is_finite()));
    }
}
