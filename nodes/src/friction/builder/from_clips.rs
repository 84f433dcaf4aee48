//! A friction model from cloth recordings without measured speeds.
//!
//! Cloth that slides faster is louder, so the level of a clip replaces the missing encoder. Shapes and levels of the
//! spectra are measured. The speeds are assumed, and so is that microphone and contact did not change during the
//! recording.

use serde::{Deserialize, Serialize};

use super::analysis::{BuildError, check, check_model, check_samples, checked_clip, high_pass, mean_speed};
use super::psd::{AnalysisWindow, Periodogram, centroid};
use crate::friction::model::rebin::rebin;
use crate::friction::model::{
    Conventions, FrictionModel, MODEL_VERSION, Origin, REFERENCE_AREA, Rejections, Source, clip_samples,
};

/// The law that assigns speeds to clips.
///
/// In all laws the quietest usable clip is at `slowest` or above, and the loudest (or brightest) clip at `fastest`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum SpeedLaw {
    /// By rank of level: `slowest (fastest/slowest)^(rank / (n-1))`. Assumes that the recording has equal time in every
    /// octave of speed. Independent of the distribution of levels.
    #[default]
    LevelRank,
    /// By level: amplitude is a power of speed. Its exponent assigns `slowest` to the quietest clip and `fastest` to
    /// the loudest.
    Level,
    /// By level: amplitude is this power of speed, and the loudest clip is at `fastest`. Clips below `slowest` count as
    /// silent.
    Exponent(f64),
    /// By rank of spectral centroid: assumes that faster is brighter. The levels of the bins are
    /// assigned in ascending order, so that faster is also louder.
    CentroidRank,
}

/// A mono recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording<'a> {
    /// Samples, full scale +-1.
    pub samples: &'a [f32],
    /// Sample rate in hertz.
    pub fs: f64,
    /// Provenance and licence.
    pub source: Source,
}

/// Parameters of [`from_clips`].
#[derive(Clone, Debug, PartialEq)]
pub struct ClipModelParams {
    /// Names of the two materials.
    pub material_pair: [String; 2],
    /// Length of a clip, in seconds.
    pub clip: f64,
    /// Time from one clip to the next, in seconds.
    pub hop: f64,
    /// Level below the loudest clip at which clips are silence, in dB (above 0).
    pub silence: f64,
    /// Speed of the quietest usable clip, in m/s.
    pub slowest: f64,
    /// Speed of the loudest clip, in m/s.
    pub fastest: f64,
    /// The law that assigns speeds to clips.
    pub law: SpeedLaw,
    /// Number of logarithmic bins of speed.
    pub n_speed: usize,
    /// Scales each recording until its loudest clip is as loud as the loudest of all. Recordings of different
    /// gains then all cover the whole range of speeds.
    pub match_levels: bool,
    /// Cut-off of the high-pass on the spectra, in hertz; 0 only removes DC.
    pub high_pass: f64,
    /// Sliding area in the recordings, in square metres; levels are stored per [`REFERENCE_AREA`].
    pub contact_area: f64,
}

impl Default for ClipModelParams {
    fn default() -> Self {
        Self {
            material_pair: ["cloth".to_owned(), "cloth".to_owned()],
            clip: 0.050,
            hop: 0.0125,
            silence: 40.0,
            slowest: 0.05,
            fastest: 1.0,
            law: SpeedLaw::default(),
            n_speed: 8,
            match_levels: true,
            high_pass: 20.0,
            contact_area: REFERENCE_AREA,
        }
    }
}

/// A clip: its power per bin on the grid of the model.
struct Clip {
    power: Vec<f64>,
    total: f64,
    speed: f64,
    /// Number of bins up to the Nyquist frequency of its recording.
    valid_bins: usize,
}

/// Builds a model from recordings without measured speeds, at the highest of their rates.
///
/// The recordings are cut into clips, and silent clips are dropped. The law assigns speeds to the others. The power of
/// the clips in each logarithmic bin of speed is averaged. A clip does not count above the Nyquist frequency of its
/// recording, so mixed rates do not attenuate high frequencies. Bins of speed without clips are left out.
///
/// # Errors
/// Names the wrong parameter or sample, or counts the rejected clips by reason.
///
/// # Complexity
/// O(clips N log N) time, O(clips N) memory.
pub fn from_clips(
    recordings: &[Recording<'_>],
    params: &ClipModelParams,
) -> Result<FrictionModel, BuildError> {
    let fs = recordings.iter().map(|r| r.fs).fold(1.0, f64::max);
    let len = checked_clip(params.clip, fs)?;
    check("hop", params.hop, 1.0 / fs..=1e3, "a distance of at least one sample is needed")?;
    check(
        "silence",
        params.silence,
        1e-3..=400.0,
        "a level in dB below the loudest clip, above 0, is needed",
    )?;
    check("slowest", params.slowest, f64::MIN_POSITIVE..=f64::MAX, "a speed above 0 m/s is needed")?;
    let fastest_range = params.slowest * 1.001..=f64::MAX;
    check("fastest", params.fastest, fastest_range, "a speed at least 0.1 % above `slowest` is needed")?;
    check_model((params.n_speed, params.high_pass, params.contact_area), fs)?;
    if let SpeedLaw::Exponent(e) = params.law {
        check("exponent", e, 1e-3..=100.0, "a power above 0 is needed (amplitude ~ speed^exponent)")?;
    }
    let (bins, df) = (len / 2 + 1, fs / len as f64);
    let mut rejected = Rejections::default();
    let mut clips = cut_clips(recordings, params, bins, df, &mut rejected)?;
    let count = clips.len();
    let loudest = clips.iter().map(|c| c.total).fold(0.0, f64::max);
    let mut min_power = loudest * 10.0_f64.powf(-0.1 * params.silence);
    if let SpeedLaw::Exponent(e) = params.law {
        min_power = min_power.max(loudest * (params.slowest / params.fastest).powf(2.0 * e) * (1.0 - 1e-9));
    }
    clips.retain(|c| c.total > 0.0 && c.total >= min_power);
    rejected.silent = (count - clips.len()) as u32;
    assign_speeds(&mut clips, params, df);
    let log_range = (params.fastest / params.slowest).ln();
    let bin = |c: &Clip| {
        let fraction = (c.speed / params.slowest).ln() / log_range;
        ((fraction * params.n_speed as f64).max(0.0) as usize).min(params.n_speed - 1)
    };
    let groups: Vec<&[Clip]> = clips.chunk_by(|a, b| bin(a) == bin(b)).collect();
    if groups.len() < 2 {
        let speeds = groups.len();
        return Err(BuildError::TooFew { speeds, usable: clips.len(), clips: count, rejected });
    }
    let mut rows: Vec<Vec<f64>> = groups.iter().map(|g| mean_power(g, bins)).collect();
    if params.law == SpeedLaw::CentroidRank {
        sort_levels(&mut rows);
    }
    let area = REFERENCE_AREA / params.contact_area;
    let model = FrictionModel {
        version: MODEL_VERSION,
        material_pair: params.material_pair.clone(),
        speeds: groups.iter().map(|g| mean_speed(g.iter().map(|c| c.speed))).collect(),
        psd: rows.iter().flatten().map(|p| (area * p / df) as f32).collect(),
        df,
        fs,
        floor: Vec::new(),
        clips: groups.iter().map(|g| g.len() as u32).collect(),
        rejected,
        conventions: Conventions {
            origin: Origin::Recordings,
            clip_samples: len as u32,
            hop: params.hop,
            high_pass: params.high_pass,
            floor_subtracted: false,
            contact_area: params.contact_area,
        },
        sources: recordings.iter().map(|r| r.source.clone()).collect(),
    };
    model.validate()?;
    Ok(model)
}

/// Returns all clips of all recordings, high-passed, on the grid of the model.
fn cut_clips(
    recordings: &[Recording<'_>],
    params: &ClipModelParams,
    bins: usize,
    df: f64,
    rejected: &mut Rejections,
) -> Result<Vec<Clip>, BuildError> {
    let (mut clips, mut ends): (Vec<Clip>, Vec<usize>) = (Vec::new(), Vec::new());
    for (i, recording) in recordings.iter().enumerate() {
        check_samples(i, recording.samples)?;
        checked_clip(params.clip, recording.fs)?;
        let (len, source_fs) = (clip_samples(params.clip, recording.fs), recording.fs);
        let source_df = source_fs / len as f64;
        let mut periodogram = Periodogram::new(len, source_fs, AnalysisWindow::Triangle);
        let hop = ((params.hop * source_fs).round() as usize).max(1);
        rejected.too_short += u32::from(recording.samples.len() < len);
        let valid_bins = ((0.5 * source_fs / df) as usize + 1).min(bins);
        for frame in recording.samples.windows(len).step_by(hop) {
            let mut spectrum = vec![0.0; periodogram.bins()];
            periodogram.accumulate(frame, &mut spectrum);
            spectrum
                .iter_mut()
                .enumerate()
                .for_each(|(k, s)| *s *= source_df * high_pass(k, source_df, params.high_pass));
            let mut power = vec![0.0; bins];
            rebin(&spectrum, source_df, &mut power, df);
            power[0] = 0.0;
            clips.push(Clip { total: power.iter().sum(), power, speed: 0.0, valid_bins });
        }
        ends.push(clips.len());
    }
    if params.match_levels {
        let loudest = |clips: &[Clip]| clips.iter().map(|c| c.total).fold(0.0, f64::max);
        let level = loudest(&clips);
        let mut start = 0;
        for end in ends {
            let peak = loudest(&clips[start..end]);
            if peak > 0.0 {
                for clip in &mut clips[start..end] {
                    clip.power.iter_mut().for_each(|p| *p *= level / peak);
                    clip.total *= level / peak;
                }
            }
            start = end;
        }
    }
    Ok(clips)
}

/// Sorts clips by speed and assigns their speeds.
fn assign_speeds(clips: &mut [Clip], params: &ClipModelParams, df: f64) {
    if params.law == SpeedLaw::CentroidRank {
        clips.sort_by_cached_key(|c| (centroid(&c.power, df) * 1e3) as u64);
    } else {
        clips.sort_by(|a, b| a.total.total_cmp(&b.total));
    }
    let (Some(first), Some(last)) = (clips.first(), clips.last()) else { return };
    let (quietest, loudest, n) = (first.total, last.total, clips.len());
    let ratio = params.fastest / params.slowest;
    for (rank, clip) in clips.iter_mut().enumerate() {
        let speed_at = |fraction: f64| params.slowest * ratio.powf(fraction);
        clip.speed = match params.law {
            SpeedLaw::LevelRank | SpeedLaw::CentroidRank => speed_at(rank as f64 / (n - 1).max(1) as f64),
            SpeedLaw::Level if loudest > quietest => {
                speed_at((clip.total / quietest).ln() / (loudest / quietest).ln())
            }
            SpeedLaw::Level => params.fastest,
            SpeedLaw::Exponent(e) => params.fastest * (clip.total / loudest).powf(0.5 / e),
        };
    }
}

/// Returns the mean power per bin, over the clips for which the bin is valid.
fn mean_power(clips: &[Clip], bins: usize) -> Vec<f64> {
    let mut sum = vec![0.0; bins];
    let mut counts = vec![0_u32; bins];
    for clip in clips {
        sum.iter_mut().zip(&clip.power).for_each(|(s, p)| *s += p);
        counts[..clip.valid_bins].iter_mut().for_each(|n| *n += 1);
    }
    sum.iter_mut().zip(counts).for_each(|(s, n)| *s /= f64::from(n.max(1)));
    sum
}

/// Scales the rows so that their total powers are in ascending order.
fn sort_levels(rows: &mut [Vec<f64>]) {
    let mut totals: Vec<f64> = rows.iter().map(|r| r.iter().sum()).collect();
    let unsorted = totals.clone();
    totals.sort_by(f64::total_cmp);
    for ((row, total), unsorted) in rows.iter_mut().zip(totals).zip(unsorted) {
        if unsorted > 0.0 {
            row.iter_mut().for_each(|p| *p *= total / unsorted);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Random;

    /// Noise whose level rises tenfold, through a one-pole filter whose cut-off rises with it.
    fn swell(seconds: f64, fs: f64, node: &str, gain: f64) -> Vec<f32> {
        let random = Random::new(2, node);
        let mut y = 0.0;
        (0..(seconds * fs) as u64)
            .map(|i| {
                let fraction = i as f64 / fs / seconds;
                y += (0.05 + 0.9 * fraction) * (random.uniform(0, i, 0) - 0.5 - y);
                (gain * 0.1 * 10.0_f64.powf(fraction) * y) as f32
            })
            .collect()
    }

    fn recording(samples: &[f32], fs: f64) -> Recording<'_> {
        Recording { samples, fs, source: Source::default() }
    }

    fn rises(model: &FrictionModel) -> bool {
        (1..model.speeds.len()).all(|k| model.row_power(k) > model.row_power(k - 1))
    }

    #[test]
    fn every_law_gives_power_that_rises_with_speed() {
        let x = swell(1.0, 48000.0, "swell", 1.0);
        for law in [SpeedLaw::LevelRank, SpeedLaw::Level, SpeedLaw::Exponent(1.0), SpeedLaw::CentroidRank] {
            let params = ClipModelParams { law, ..Default::default() };
            let model = from_clips(&[recording(&x, 48000.0)], &params).unwrap();
            assert!(model.speeds.len() >= 4, "{law:?}: {:?}", model.speeds);
            assert!(rises(&model), "{law:?}");
            let (s0, s1) = model.speed_range();
            assert!(s0 >= 0.05 && s1 <= 1.0 && s1 > 0.8, "{law:?}: {s0} {s1}");
        }
    }

    #[test]
    fn an_exponent_of_one_makes_amplitude_proportional_to_speed() {
        let x = swell(2.0, 48000.0, "law", 1.0);
        let params = ClipModelParams { law: SpeedLaw::Exponent(1.0), ..Default::default() };
        let model = from_clips(&[recording(&x, 48000.0)], &params).unwrap();
        let top = model.speeds.len() - 1;
        for k in 0..top {
            let expected = (model.speeds[k] / model.speeds[top]).powi(2);
            assert!((model.row_power(k) / model.row_power(top) / expected - 1.0).abs() < 0.05, "{k}");
        }
    }

    #[test]
    fn brighter_clips_are_faster() {
        let x = swell(1.0, 48000.0, "bright", 1.0);
        let model = from_clips(&[recording(&x, 48000.0)], &ClipModelParams::default()).unwrap();
        let bright = |k: usize| {
            let row: Vec<f64> = model.row(k).iter().map(|&s| f64::from(s)).collect();
            centroid(&row, model.df)
        };
        assert!(bright(model.speeds.len() - 1) > 2.0 * bright(0));
    }

    #[test]
    fn short_recordings_of_several_rates_give_a_model() {
        let (a, b) = (swell(0.25, 44100.0, "a", 0.02), swell(0.4, 48000.0, "b", 0.6));
        let all = [recording(&a, 44100.0), recording(&b, 48000.0), recording(&b[..100], 48000.0)];
        let model = from_clips(&all, &ClipModelParams::default()).unwrap();
        assert_eq!((model.fs, model.bins(), model.rejected.too_short), (48000.0, 1201, 1));
        assert!(rises(&model));
        assert_eq!(model.speeds.len(), 8);
        assert_eq!(model.sources.len(), 3);
    }

    #[test]
    fn silence_between_sounds_is_left_out() {
        let mut x = swell(0.5, 48000.0, "gap", 1.0);
        x.extend(vec![0.0; 48000]);
        let model = from_clips(&[recording(&x, 48000.0)], &ClipModelParams::default()).unwrap();
        assert!(model.rejected.silent > 70, "{}", model.rejected.silent);
        assert!(model.row_power(0) > 1e-4 * model.row_power(7));
    }

    #[test]
    fn recordings_without_usable_clips_give_an_error_with_counts() {
        let silent = [0.0; 48000];
        for x in [&silent[..], &silent[..10], &[]] {
            let error = from_clips(&[recording(x, 48000.0)], &ClipModelParams::default()).unwrap_err();
            assert!(matches!(error, BuildError::TooFew { speeds: 0, .. }), "{error}");
        }
        assert!(matches!(
            from_clips(&[], &ClipModelParams::default()),
            Err(BuildError::TooFew { .. }) | Err(BuildError::Parameter { .. })
        ));
        let slow = ClipModelParams { fastest: 0.01, ..Default::default() };
        let error = from_clips(&[recording(&silent, 48000.0)], &slow).unwrap_err();
        assert!(matches!(error, BuildError::Parameter { name: "fastest", .. }));
        let error =
            from_clips(&[recording(&[f32::INFINITY], 48000.0)], &ClipModelParams::default()).unwrap_err();
        assert!(matches!(error, BuildError::Sample { index: 0, .. }));
    }
}
