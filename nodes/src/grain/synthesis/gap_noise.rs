//! Noise in the gaps between grains.

use super::segment::{Fade, FadeShape, GrainSegment};
use crate::core::random::Rng;
use crate::friction::builder::psd::{AnalysisWindow, welch};
use crate::grain::dictionary::{GRAINS_VERSION, GrainDictionary, Run};
use crate::statistics::normal::standard_normal;
use foley_fft::RealFftPlanner;
use realfft::num_complex::Complex;

/// Samples of a frame of the spectrum of the grains.
const FRAME: usize = 1024;
/// Maximum period of the noise, samples; it is periodic, so that it repeats without a join.
const MAX_PERIOD: usize = 1 << 18;

/// Periodic Gaussian noise with a power spectrum and a mean square of 1.
fn noise(spectrum: &[f64], period: usize, rng: &mut Rng) -> Vec<f32> {
    let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(period);
    let (mut bins, mut out) = (plan.make_input_vec(), plan.make_output_vec());
    let last = period / 2;
    for (k, bin) in bins.iter_mut().enumerate().take(last).skip(1) {
        let at = k as f64 * (spectrum.len() - 1) as f64 / last as f64;
        let pair = [at as usize, (at as usize + 1).min(spectrum.len() - 1)].map(|bin| spectrum[bin]);
        let deviation = (pair[0] + at.fract() * (pair[1] - pair[0])).sqrt();
        *bin = Complex::new(deviation * standard_normal(rng), deviation * standard_normal(rng));
    }
    // Lengths agree, and the first and the last bin are real, by construction.
    if plan.process(&mut bins, &mut out).is_err() {
        out.fill(0.0);
    }
    let power = out.iter().map(|x| x * x).sum::<f64>() / period as f64;
    let scale = if power > 0.0 { power.sqrt().recip() } else { 0.0 };
    out.into_iter().map(|x| (scale * x) as f32).collect()
}

/// Noise for the gaps between joined segments, in order of time: with the mean spectrum of their sound, and in each gap the mean power of both
/// neighbours.
///
/// `None` without a gap, or for a sound of fewer than 1024 samples. The noise is the same in each run.
#[must_use]
pub fn gap_noise(
    dictionary: &GrainDictionary,
    segments: &[GrainSegment],
) -> Option<(GrainDictionary, Vec<GrainSegment>)> {
    // Beyond its window a segment has what is stored around the grain, which was too soft for a grain.
    let window = |segment: &GrainSegment| {
        let span = dictionary.grains.get(segment.grain as usize).map_or(0..0, |grain| grain.span());
        [span.start, span.end].map(|at| segment.start + at as i64 - i64::from(segment.from))
    };
    let gaps: Vec<&[GrainSegment]> = segments.windows(2).filter(|w| w[1].start > w[0].end()).collect();
    let range = |pair: &[GrainSegment]| [window(&pair[0])[1], window(&pair[1])[0]];
    let longest =
        gaps.iter().map(|pair| range(pair)).map(|[start, end]| (end - start).max(0) as usize).max()?;
    let period = longest.next_power_of_two().clamp(FRAME, MAX_PERIOD);
    let mut sound = vec![0.0; segments.iter().map(GrainSegment::end).max()?.max(0) as usize];
    segments.iter().for_each(|segment| segment.add(dictionary, 0, 1, &mut sound));
    let spectrum = welch(&sound, dictionary.rate, FRAME, FRAME / 2, AnalysisWindow::Hann)?;
    let samples = noise(&spectrum, period, &mut Rng::new(1));
    let own = GrainDictionary {
        version: GRAINS_VERSION,
        rate: dictionary.rate,
        symmetric_tapers: false,
        bits: 0,
        sources: Vec::new(),
        grains: Vec::new(),
        runs: vec![Run { offset: 0, frames: period as u32, channels: 1 }],
        steps: Vec::new(),
        samples,
        tracks: None,
    };
    let power = |segment: &GrainSegment| {
        let grain = dictionary.grains.get(segment.grain as usize);
        let of_grain =
            |g: &crate::grain::Grain| f64::from(g.power) * f64::from(segment.gain / g.gain).powi(2);
        grain.map_or(0.0, of_grain)
    };
    let mut all = Vec::new();
    for pair in gaps {
        let gain = (0.5 * (power(&pair[0]) + power(&pair[1]))).sqrt() as f32;
        let fades = [pair[0].fades[1].len, pair[1].fades[0].len];
        let [mut start, end] = range(pair);
        let first = all.len();
        while start < end {
            let len = (end - start).min(period as i64) as u32;
            all.push(GrainSegment { start, len, gain, ratio: 1.0, ..GrainSegment::default() });
            start += i64::from(len);
        }
        let fade = |len: u32| Fade { len, shape: FadeShape::EqualPower(0.0) };
        let Some(last) = all.len().checked_sub(1).filter(|last| *last >= first) else { continue };
        all[first].fades[0] = fade(fades[0].min(all[first].len));
        all[last].fades[1] = fade(fades[1].min(all[last].len));
    }
    Some((own, all))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grain::recording::{Component, GrainRecording, GrainRecordings, Part};
    use crate::grain::synthesis::{GrainStep, segments};

    #[test]
    fn a_gap_has_noise_of_the_level_and_the_spectrum_of_its_neighbours() {
        // Noise of low frequencies with a pause of 20,000 samples, in which there are no grains.
        let mut rng = Rng::new(4);
        let mut low = 0.0;
        let mut sample = |i: usize| {
            low += 0.3 * (rng.between(-1.0, 1.0) - low);
            if (30_000..50_000).contains(&i) { 0.0 } else { low as f32 }
        };
        let channels = vec![(0..80_000).map(&mut sample).collect()];
        let part = Part { component: Component::Whole, channels };
        let recording = GrainRecording { parts: vec![part], ..GrainRecording::default() };
        let all = GrainRecordings { rate: 44_100.0, recordings: vec![recording] };
        let rules = crate::grain::dictionary::ExtractRules::at_rate(44_100.0);
        let (dictionary, _) = crate::grain::dictionary::extract(&all, &rules);
        // Every grain twice as loud as recorded.
        let own = dictionary.grains.iter().enumerate();
        let step = |(k, g): (usize, &crate::grain::Grain)| GrainStep {
            grain: k as u32,
            t: g.window_start() as i64,
            gain: 2.0,
        };
        let played = segments(&dictionary, &own.map(step).collect::<Vec<_>>());
        let (noise, filled) = gap_noise(&dictionary, &played).unwrap();
        let mut out = vec![0.0; 80_000];
        played.iter().for_each(|s| s.add(&dictionary, 0, 1, &mut out));
        filled.iter().for_each(|s| s.add(&noise, 0, 1, &mut out));
        let gap = played.windows(2).find(|w| w[1].start > w[0].end() + 10_000).unwrap();
        let range = gap[0].end() as usize..gap[1].start as usize;
        let power = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len() as f64;
        // Differences of successive samples are small where the spectrum is low.
        let slope = |x: &[f32]| {
            x.windows(2).map(|w| f64::from(w[1] - w[0]).powi(2)).sum::<f64>() / x.len() as f64 / power(x)
        };
        let (before, within) = (&out[1000..range.start - 1000], &out[range.clone()]);
        let own = |s: &GrainSegment| f64::from(dictionary.grains[s.grain as usize].power) * 4.0;
        let level = 10.0 * (power(within) / (0.5 * (own(&gap[0]) + own(&gap[1])))).log10();
        assert!(level.abs() < 0.5, "{level} dB");
        assert!((slope(within) / slope(before)).ln().abs() < 0.2, "{} {}", slope(within), slope(before));
        // The noise fades in at once, and lasts.
        let least = within.chunks_exact(220).map(power).fold(f64::INFINITY, f64::min);
        assert!(least > 0.02 * power(before), "{least}");
        assert!(gap_noise(&dictionary, &played[..5]).is_none());
    }
}
