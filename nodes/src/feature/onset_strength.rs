//! Onsets of recordings.

use super::flux::FluxFrames;
use foley_fft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::f64::consts::TAU;

/// Default rise of the strength over its mean.
pub const ONSET_RISE: f64 = 0.4;
/// Bands of the spectrum.
const BANDS: usize = 24;
/// Lowest band, Hz.
const LOWEST: f64 = 60.0;
/// Level at which the compression of a band begins, relative to the loudest band of the recording: -50 dB.
const KNEE: f64 = 316.0;
/// Durations around a peak: in which it is the greatest, in which its mean is taken, and from one onset to the next, s.
const AROUND: [f64; 3] = [0.03, 0.1, 0.03];
/// Frames over which a rise is measured.
const LAG: usize = 4;

/// Amplitudes of bands of equal ratio in each frame, `[frames][BANDS]`. Frame `k` is centred on sample `k hop`; outside is silence.
fn bands(x: &[f32], frames: FluxFrames, rate: f64) -> Vec<[f64; BANDS]> {
    let (n, hop) = (frames.frame.max(16), frames.hop.max(1));
    let plan = RealFftPlanner::<f32>::new().plan_fft_forward(n);
    let window: Vec<f32> = (0..n).map(|i| (0.5 - 0.5 * (TAU * i as f64 / n as f64).cos()) as f32).collect();
    let (mut input, mut spectrum) = (plan.make_input_vec(), plan.make_output_vec());
    let mut scratch = plan.make_scratch_vec();
    let highest = (0.45 * rate).min(16_000.0);
    // Each band has at least one bin.
    let edge = |b: usize| {
        let hz = LOWEST * (highest / LOWEST).powf(b as f64 / BANDS as f64);
        ((hz * n as f64 / rate) as usize).max(b + 1)
    };
    let edges: Vec<usize> = (0..=BANDS).map(edge).collect();
    let power = |x: &[Complex<f32>]| x.iter().map(|x| f64::from(x.norm_sqr())).sum::<f64>();
    (0..=x.len() / hop)
        .map(|k| {
            let first = (k * hop) as i64 - (n / 2) as i64;
            for ((i, y), w) in (first..).zip(input.iter_mut()).zip(&window) {
                *y = w * usize::try_from(i).ok().and_then(|i| x.get(i)).copied().unwrap_or(0.0);
            }
            let mut levels = [0.0; BANDS];
            // Lengths agree by construction.
            if plan.process_with_scratch(&mut input, &mut spectrum, &mut scratch).is_ok() {
                for (level, pair) in levels.iter_mut().zip(edges.windows(2)) {
                    *level =
                        power(spectrum.get(pair[0]..pair[1].max(pair[0] + 1)).unwrap_or_default()).sqrt();
                }
            }
            levels
        })
        .collect()
}

/// Onset strength: the rise of compressed levels of bands over four frames, averaged over bands. Item `k` belongs to frame `k`.
///
/// A level `a` of a band counts as `ln(1 + 316 a / m)`, where `m` is the loudest band of the recording, so that the strength does not depend on
/// the gain, and noise 50 dB below the loudest counts little.
///
/// # Complexity
/// One transform a hop.
///
/// # Source
/// Böck and Widmer, "Maximum filter vibrato suppression for onset detection" (DAFx 2013), without the filter. The normalised flux of
/// Picard et al. (2009) is about as great in the noise before an onset as at it.
#[must_use]
pub fn onset_strength(x: &[f32], frames: FluxFrames, rate: f64) -> Vec<f64> {
    let levels = bands(x, frames, rate);
    let loudest = levels.iter().flatten().copied().fold(0.0, f64::max);
    if loudest <= 0.0 {
        return vec![0.0; levels.len()];
    }
    let compressed: Vec<[f64; BANDS]> =
        levels.iter().map(|frame| frame.map(|a| (1.0 + KNEE * a / loudest).ln())).collect();
    let rise = |k: usize| {
        let before = k.checked_sub(LAG).map_or([0.0; BANDS], |j| compressed[j]);
        compressed[k].iter().zip(before).map(|(a, b)| (a - b).max(0.0)).sum::<f64>() / BANDS as f64
    };
    (0..levels.len()).map(rise).collect()
}

/// Samples of the onsets of a recording: maxima of the onset strength that exceed its mean around them by `rise`.
#[must_use]
pub fn onsets(x: &[f32], frames: FluxFrames, rate: f64, rise: f64) -> Vec<usize> {
    let hop = frames.hop.max(1);
    let strength = onset_strength(x, frames, rate);
    let [around, mean, apart] = AROUND.map(|seconds| ((seconds * rate) as usize / hop).max(1));
    let mut found: Vec<usize> = Vec::new();
    for (k, s) in strength.iter().enumerate() {
        let near = &strength[k.saturating_sub(around)..(k + around + 1).min(strength.len())];
        let wide = &strength[k.saturating_sub(mean)..(k + mean + 1).min(strength.len())];
        let level = wide.iter().sum::<f64>() / wide.len() as f64;
        let is_greatest = near.iter().all(|other| other <= s);
        if is_greatest && *s >= level + rise && found.last().is_none_or(|last| k - last >= apart) {
            found.push(k);
        }
    }
    // The rise lies between the frames that are compared.
    found
        .into_iter()
        .map(|k| (k * hop).saturating_sub(LAG * hop / 2).min(x.len().saturating_sub(1)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_and_short_sounds_have_no_strength_that_is_not_finite() {
        let frames = FluxFrames::at_rate(44_100.0);
        assert!(
            onsets(&[], frames, 44_100.0, 0.1).is_empty()
                && onsets(&[0.0; 9000], frames, 44_100.0, 0.1).is_empty()
        );
        assert!(onset_strength(&[0.5; 10], frames, 44_100.0).iter().all(|s| s.is_finite()));
    }

    #[test]
    fn a_click_is_one_onset_at_any_gain() {
        let mut x = vec![0.0_f32; 30_000];
        for (i, y) in x[12_000..].iter_mut().enumerate() {
            *y = 0.5 * (-(i as f32) / 2000.0).exp() * (0.2 * i as f32).sin();
        }
        let frames = FluxFrames::at_rate(44_100.0);
        let found = onsets(&x, frames, 44_100.0, ONSET_RISE);
        assert!(found.len() == 1 && found[0].abs_diff(12_000) < 300, "{found:?}");
        let quiet: Vec<f32> = x.iter().map(|x| x / 256.0).collect();
        assert_eq!(onsets(&quiet, frames, 44_100.0, ONSET_RISE), found);
    }
}
