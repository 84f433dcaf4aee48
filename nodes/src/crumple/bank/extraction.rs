//! Cuts micro-sounds out of a recording: where it is loud, from one zero crossing to another.

use serde::{Deserialize, Serialize};

/// How micro-sounds are found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extraction {
    /// Mean square over the window above which there is a sound, full scale^2. As a mean it holds at any rate; the paper's 0.50, 0.25
    /// and 0.025 are sums over 1920 samples.
    pub threshold: f64,
    /// Window of the mean, s.
    pub window: f64,
    /// Shorter sounds are left out, s.
    pub min_len: f64,
    /// Longer sounds are split, s.
    pub max_len: f64,
    /// Sounds with no more than this between them are one, s.
    pub merge_gap: f64,
}

impl Default for Extraction {
    fn default() -> Self {
        Self { threshold: 2.6e-4, window: 0.02, min_len: 0.001, max_len: 0.5, merge_gap: 0.0 }
    }
}

/// How far an end may move to a zero crossing, s.
const REACH: f64 = 0.01;
/// Fade of an end that found none, s.
const FADE: f64 = 0.001;

/// One sound in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// First sample.
    pub start: usize,
    /// Sample after the last.
    pub end: usize,
    /// Whether it begins, and ends, somewhere else than at a zero crossing, and has to be faded there.
    pub fades: [bool; 2],
}

/// Sums of squares over a centred window of `w` samples: from `n - w/2` on, zeros outside.
///
/// # Complexity
/// O(n), in double precision throughout.
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

/// Whether the signal changes sign, or is 0, between sample `n - 1` and sample `n`.
fn crosses(x: &[f32], n: usize) -> bool {
    n == 0 || n >= x.len() || x[n - 1] == 0.0 || x[n] == 0.0 || (x[n - 1] < 0.0) != (x[n] < 0.0)
}

/// Where a recording is loud, as extents in order, without overlaps.
///
/// Each run of windows louder than the threshold is extended to the nearest zero crossing on either side, 10 ms at most. Runs that
/// overlap then are one. What is too long is split where, in its middle half, the quietest zero crossing is.
///
/// # Complexity
/// O(n), and O(n log n) for long sounds.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3.
#[must_use]
pub fn extents(x: &[f32], fs: f64, how: &Extraction) -> Vec<Extent> {
    let samples = |seconds: f64| (seconds * fs).round() as usize;
    let window = samples(how.window).max(1);
    let energy = windowed_energy(x, window);
    let least = how.threshold * window as f64;
    let (reach, gap) = (samples(REACH), samples(how.merge_gap));
    let mut found: Vec<Extent> = Vec::new();
    let mut at = 0;
    while at < x.len() {
        if energy[at] <= least {
            at += 1;
            continue;
        }
        let run = energy[at..].iter().take_while(|e| **e > least).count();
        let extent = extended(x, at, at + run, reach);
        at += run;
        match found.last_mut() {
            Some(last) if extent.start < last.end + gap => {
                (last.end, last.fades[1]) = (extent.end, extent.fades[1]);
            }
            _ => found.push(extent),
        }
    }
    let (most, shortest) = (samples(how.max_len).max(4), samples(how.min_len).max(1));
    let mut whole = Vec::new();
    found.into_iter().for_each(|extent| split(x, &energy, extent, most, &mut whole));
    whole.retain(|extent| extent.end - extent.start >= shortest);
    whole
}

/// A run with both ends moved outwards to the nearest zero crossing.
fn extended(x: &[f32], start: usize, end: usize, reach: usize) -> Extent {
    let left = (start.saturating_sub(reach)..=start).rev().find(|n| crosses(x, *n));
    let right = (end..=(end + reach).min(x.len())).find(|n| crosses(x, *n));
    Extent {
        start: left.unwrap_or(start.saturating_sub(reach)),
        end: right.unwrap_or((end + reach).min(x.len())),
        fades: [left.is_none(), right.is_none()],
    }
}

fn split(x: &[f32], energy: &[f64], extent: Extent, most: usize, out: &mut Vec<Extent>) {
    let Extent { start, end, fades } = extent;
    let length = end - start;
    if length <= most {
        out.push(extent);
        return;
    }
    // Near its ends a sound is always quiet: only the middle half is looked at.
    let middle = start + length / 4..end - length / 4;
    let quietest = |crossings: bool| {
        let places = middle.clone().filter(|n| !crossings || crosses(x, *n));
        places.min_by(|a, b| energy[*a].total_cmp(&energy[*b]))
    };
    let (at, fade) = match quietest(true) {
        Some(at) => (at, false),
        None => (quietest(false).unwrap_or(start + length / 2), true),
    };
    split(x, energy, Extent { start, end: at, fades: [fades[0], fade] }, most, out);
    split(x, energy, Extent { start: at, end, fades: [fade, fades[1]] }, most, out);
}

/// The samples of an extent, faded where it is not cut at a zero crossing.
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
