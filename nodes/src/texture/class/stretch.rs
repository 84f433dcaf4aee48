//! Histogram of luminance between its percentiles 1 and 99.
//!
//! An image of low contrast in 8 bits has few codes, and bins that are finer than its codes would be empty between them. The pixels
//! of a code are therefore spread evenly over the interval of luminance that the code stands for, if it is one of a gradation: a run of at
//! least [`RUN`] tones at about equal distances, at most [`GAP`] of the range. Other tones remain tones.

use crate::texture::maps::Luma;

/// Number of bins of the histogram.
pub const BINS: usize = 256;

/// Steps of luminance from black to white: several for each code of 8 bits.
const STEPS: usize = 1 << 16;
/// Fraction of the pixels beyond each end of the range.
const BEYOND: f64 = 0.01;
/// Least number of tones of a gradation.
const RUN: usize = 4;
/// Largest distance between tones of a gradation, as a fraction of the range, and over the median distance: the lightness of the
/// codes of an image differs by 0.7 to 1.4 of the median from code to code.
const GAP: f64 = 1.0 / 8.0;
const UNEVEN: f64 = 1.6;

/// Luminance at the percentiles 1 and 99, and pixels in each of [`BINS`] bins between them. The first and the last bin also hold
/// what is beyond.
///
/// # Complexity
/// `O(pixels)`.
pub(super) fn stretched(luma: &Luma) -> ([f32; 2], Vec<f64>) {
    let scale = (STEPS - 1) as f32 / luma.kind.max();
    let mut counts = vec![0_u32; STEPS];
    let mut total = 0_u64;
    for (k, x) in luma.grid.samples.iter().enumerate() {
        if luma.holes.get(k) != Some(&true) {
            counts[((x * scale).round().max(0.0) as usize).min(STEPS - 1)] += 1;
            total += 1;
        }
    }
    let tones: Vec<(f64, f64)> = counts
        .iter()
        .enumerate()
        .filter(|(_, n)| **n > 0)
        .map(|(step, n)| (step as f64, f64::from(*n)))
        .collect();
    let [low, high] = [BEYOND, 1.0 - BEYOND].map(|fraction| {
        let rank = (total.saturating_sub(1) as f64 * fraction).round();
        let mut below = 0.0;
        let found = tones.iter().find(|(_, n)| {
            below += n;
            below > rank
        });
        found.map_or(0.0, |(step, _)| *step)
    });
    let mut bins = vec![0.0; BINS];
    let inside = tones.windows(2).filter(|w| w[0].0 >= low && w[1].0 <= high);
    let mut gaps: Vec<f64> = inside.map(|w| w[1].0 - w[0].0).collect();
    gaps.sort_unstable_by(f64::total_cmp);
    let gap = gaps.get(gaps.len() / 2).map_or(0.0, |median| (UNEVEN * median).min((high - low) * GAP));
    for run in tones.chunk_by(|a, b| b.0 - a.0 <= gap) {
        for (k, (step, pixels)) in run.iter().enumerate() {
            let middle = |other: Option<&(f64, f64)>| match other {
                Some((other, _)) if run.len() >= RUN => 0.5 * (step + other),
                _ => *step,
            };
            let ends = [middle(k.checked_sub(1).and_then(|k| run.get(k))), middle(run.get(k + 1))];
            spread(&mut bins, ends.map(|x| (x - low) / (high - low).max(1.0)), *pixels);
        }
    }
    ([low, high].map(|step| step as f32 / scale), bins)
}

/// Adds pixels evenly to the bins of an interval, whose ends are fractions of the range.
fn spread(bins: &mut [f64], [from, to]: [f64; 2], pixels: f64) {
    let last = bins.len() - 1;
    let place = |x: f64| (x * last as f64 + 0.5).clamp(0.0, bins.len() as f64);
    let [from, to] = [place(from), place(to)];
    let [first, end] = [from, to].map(|x| (x as usize).min(last));
    if first == end {
        bins[first] += pixels;
        return;
    }
    for (k, bin) in bins.iter_mut().enumerate().take(end + 1).skip(first) {
        let inside = to.min(k as f64 + 1.0) - from.max(k as f64);
        *bin += pixels * inside / (to - from);
    }
}
