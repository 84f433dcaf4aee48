//! Extraction of micro-sounds from a recording: the loud parts, from zero crossing to zero crossing.

use serde::{Deserialize, Serialize};

/// Parameters of the extraction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extraction {
    /// Mean square over the window above which there is a sound, full scale^2. A mean does not depend on the rate; the
    /// paper's 0.50, 0.25 and 0.025 are sums over 1920 samples.
    pub threshold: f64,
    /// Window of the mean, s.
    pub window: f64,
    /// Minimum length, s; shorter sounds are dropped.
    pub min_len: f64,
    /// Maximum length, s; longer sounds are split.
    pub max_len: f64,
    /// Maximum gap between sounds that are joined, s.
    pub merge_gap: f64,
}

impl Default for Extraction {
    fn default() -> Self {
        Self { threshold: 2.6e-4, window: 0.02, min_len: 0.001, max_len: 0.5, merge_gap: 0.0 }
    }
}

/// Maximum shift of an end to a zero crossing, s.
const MAX_SHIFT: f64 = 0.01;
/// Fade at an end without a zero crossing, s.
const FADE: f64 = 0.001;

/// A sound in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// First sample.
    pub start: usize,
    /// Sample after the last.
    pub end: usize,
    /// True if the start, and the end, is not at a zero crossing and must be faded.
    pub fades: [bool; 2],
}

/// Returns sums of squares over a centred window of `w` samples, from `n - w/2`, with zeros outside.
///
/// # Complexity
/// O(n), in double precision.
#[must_use]
pub fn windowed_energy(x: &[f32], w: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(x.len() + 1);
    sums.push(0.0);
    let mut sum = 0.0;
    for sample in x {
        sum += f64::from(*sample) * f64::from(*sample);
        sums.push(sum);
    }
    let at = |n: usize| sums[(n + w).saturating_sub(w / 2).min(x.len())] - sums[n.saturating_sub(w / 2)];
    (0..x.len()).map(at).collect()
}

/// Returns true if the signal changes sign, or is 0, between samples `n - 1` and `n`.
fn crosses(x: &[f32], n: usize) -> bool {
    n == 0 || n >= x.len() || x[n - 1] == 0.0 || x[n] == 0.0 || (x[n - 1] < 0.0) != (x[n] < 0.0)
}

/// Returns the sounds of a recording in order, without overlaps.
///
/// Each run of windows above the threshold is extended to the nearest zero crossing on both sides, by at most 10 ms.
/// Runs that then overlap are joined. A sound above the maximum length is split at the quietest zero crossing in its
/// middle half.
///
/// # Complexity
/// O(n), and O(n log n) for long sounds.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3.
#[must_use]
pub fn extents(x: &[f32], fs: f64, params: &Extraction) -> Vec<Extent> {
    let samples = |seconds: f64| (seconds * fs).round() as usize;
    let window = samples(params.window).max(1);
    let energy = windowed_energy(x, window);
    let min_energy = params.threshold * window as f64;
    let (max_shift, gap) = (samples(MAX_SHIFT), samples(params.merge_gap));
    let mut found: Vec<Extent> = Vec::new();
    let mut start = 0;
    while start < x.len() {
        if energy[start] <= min_energy {
            start += 1;
            continue;
        }
        let run = energy[start..].iter().take_while(|e| **e > min_energy).count();
        let extent = extended(x, start, start + run, max_shift);
        start += run;
        match found.last_mut() {
            Some(last) if extent.start < last.end + gap => {
                (last.end, last.fades[1]) = (extent.end, extent.fades[1]);
            }
            _ => found.push(extent),
        }
    }
    let (max_len, min_len) = (samples(params.max_len).max(4), samples(params.min_len).max(1));
    let mut sounds = Vec::new();
    found.into_iter().for_each(|extent| split(x, &energy, extent, max_len, &mut sounds));
    sounds.retain(|extent| extent.end - extent.start >= min_len);
    sounds
}

/// Returns a run with both ends moved outwards to the nearest zero crossing.
fn extended(x: &[f32], start: usize, end: usize, max_shift: usize) -> Extent {
    let left = (start.saturating_sub(max_shift)..=start).rev().find(|n| crosses(x, *n));
    let right = (end..=(end + max_shift).min(x.len())).find(|n| crosses(x, *n));
    Extent {
        start: left.unwrap_or(start.saturating_sub(max_shift)),
        end: right.unwrap_or((end + max_shift).min(x.len())),
        fades: [left.is_none(), right.is_none()],
    }
}

/// Splits a sound into parts of at most `max_len` samples.
fn split(x: &[f32], energy: &[f64], extent: Extent, max_len: usize, out: &mut Vec<Extent>) {
    let Extent { start, end, fades } = extent;
    let length = end - start;
    if length <= max_len {
        out.push(extent);
        return;
    }
    // A sound is quiet near its ends, so only its middle half is searched.
    let middle = start + length / 4..end - length / 4;
    let quietest = |crossings: bool| {
        let candidates = middle.clone().filter(|n| !crossings || crosses(x, *n));
        candidates.min_by(|a, b| energy[*a].total_cmp(&energy[*b]))
    };
    let (cut, fade) = match quietest(true) {
        Some(cut) => (cut, false),
        None => (quietest(false).unwrap_or(start + length / 2), true),
    };
    split(x, energy, Extent { start, end: cut, fades: [fades[0], fade] }, max_len, out);
    split(x, energy, Extent { start: cut, end, fades: [fade, fades[1]] }, max_len, out);
}

/// Returns the samples of a sound, faded at ends that are not zero crossings.
#[must_use]
pub fn cut(x: &[f32], fs: f64, extent: &Extent) -> Vec<f32> {
    let mut samples = x[extent.start..extent.end].to_vec();
    let fade = ((FADE * fs).round() as usize).clamp(1, samples.len().max(1));
    let rise = |k: usize| 0.5 - 0.5 * libm::cos(std::f64::consts::PI * (k as f64 + 0.5) / fade as f64);
    if extent.fades[0] {
        samples.iter_mut().take(fade).enumerate().for_each(|(k, x)| *x *= rise(k) as f32);
    }
    if extent.fades[1] {
        samples.iter_mut().rev().take(fade).enumerate().for_each(|(k, x)| *x *= rise(k) as f32);
    }
    samples
}

#[cfg(test)]
mod tests;
