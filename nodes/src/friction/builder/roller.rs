//! A friction model from a roller recording: cloth turns against cloth while an encoder measures its speed.
//!
//! # Source
//! An, James and Marschner (SIGGRAPH 2012), section 2. The paper "convolves" its clips with a triangle; here they are
//! multiplied by it. The paper has one spectrum per clip, whose bins scatter by 100 %; here the power of clips of
//! similar speed is averaged, unless `raw` is set.

use super::analysis::{BuildError, check, check_model, check_samples, checked_clip, high_pass, mean_speed};
use super::encoder::{EncoderTrack, Motion};
use super::psd::{AnalysisWindow, Periodogram, welch};
use crate::friction::model::{
    Conventions, FrictionModel, MODEL_VERSION, Origin, REFERENCE_AREA, Rejections, Source,
};

/// Minimum power after subtraction of the noise floor, relative to the largest bin of the spectrum.
const MIN_POWER: f64 = 1e-12;

/// Parameters of the analysis of a roller recording.
#[derive(Clone, Debug, PartialEq)]
pub struct BuilderParams {
    /// Names of the two materials.
    pub material_pair: [String; 2],
    /// Length of a clip, in seconds.
    pub clip: f64,
    /// Time from one clip to the next, in seconds.
    pub hop: f64,
    /// Radius of the roller with the cloth on it, in metres; 0 for an encoder of speeds without seams.
    pub roller_radius: f64,
    /// Angles of the seams, `(from, to)` in radians.
    pub seams: Vec<(f64, f64)>,
    /// Largest change of speed within a clip, relative to the speed at its centre.
    pub speed_change: f64,
    /// Slowest speed to measure, in m/s.
    pub min_speed: f64,
    /// Number of logarithmic bins of speed.
    pub n_speed: usize,
    /// One spectrum per clip instead of averages, as in the paper.
    pub raw: bool,
    /// Cut-off of the high-pass on the spectra, in hertz; 0 only removes DC.
    pub high_pass: f64,
    /// Sliding area in the recording, in square metres; levels are stored per [`REFERENCE_AREA`].
    pub contact_area: f64,
    /// Provenance and licence of the recording.
    pub sources: Vec<Source>,
}

impl Default for BuilderParams {
    fn default() -> Self {
        Self {
            material_pair: ["cloth".to_owned(), "cloth".to_owned()],
            clip: 0.050,
            hop: 0.0125,
            roller_radius: 0.0,
            seams: Vec::new(),
            speed_change: 0.2,
            min_speed: 1e-3,
            n_speed: 32,
            raw: false,
            high_pass: 20.0,
            contact_area: REFERENCE_AREA,
            sources: Vec::new(),
        }
    }
}

/// Checks the parameters at a rate and returns the clip length in samples.
pub(super) fn checked_params(params: &BuilderParams, fs: f64) -> Result<usize, BuildError> {
    let len = checked_clip(params.clip, fs)?;
    check("hop", params.hop, 1.0 / fs..=1e3, "a distance of at least one sample is needed")?;
    check("speed_change", params.speed_change, 0.0..=f64::MAX, "a share of at least 0 is needed")?;
    check("min_speed", params.min_speed, f64::MIN_POSITIVE..=f64::MAX, "a speed above 0 is needed")?;
    check_model((params.n_speed, params.high_pass, params.contact_area), fs)?;
    Ok(len)
}

/// Returns the number of samples from one clip to the next.
pub(super) fn hop_samples(params: &BuilderParams, fs: f64) -> usize {
    ((params.hop * fs).round() as usize).max(1)
}

/// A usable clip: its first sample and its speed.
#[derive(Clone, Copy)]
struct Clip {
    start: usize,
    speed: f64,
}

/// Builds a model from a roller recording.
///
/// `rest` is audio of the roller at rest. Its spectrum is subtracted as the noise floor, because interpolation
/// displaces amplitude and a floor contains much of it. The subtraction leaves at least 1e-12 of the spectrum's largest
/// bin.
///
/// # Errors
/// Names the wrong parameter, sample or encoder reading, or counts the rejected clips by reason.
///
/// # Complexity
/// O(clips N log N) time, O(speeds N) memory.
pub fn build(
    samples: &[f32],
    fs: f64,
    encoder: &EncoderTrack,
    rest: Option<&[f32]>,
    params: &BuilderParams,
) -> Result<FrictionModel, BuildError> {
    let len = checked_params(params, fs)?;
    check_samples(0, samples)?;
    let motion = encoder.motion(params.roller_radius)?;
    if !params.seams.is_empty() && !motion.has_angle() {
        return Err(BuildError::SeamWithoutAngle);
    }
    let floor = match rest {
        None => Vec::new(),
        Some(rest) => {
            check_samples(1, rest)?;
            welch(rest, fs, len, len / 2, AnalysisWindow::Triangle)
                .ok_or(BuildError::Floor { found: rest.len(), expected: len })?
        }
    };
    let hop = hop_samples(params, fs);
    let (mut clips, rejected, count) = select_clips(samples.len(), fs, len, hop, &motion, params);
    clips.sort_by(|a, b| a.speed.total_cmp(&b.speed));
    let groups = group(&clips, params);
    if groups.len() < 2 {
        let speeds = groups.len();
        return Err(BuildError::TooFew { speeds, usable: clips.len(), clips: count, rejected });
    }
    let mut periodogram = Periodogram::new(len, fs, AnalysisWindow::Triangle);
    let (bins, df) = (periodogram.bins(), fs / len as f64);
    let area = REFERENCE_AREA / params.contact_area;
    let (mut psd, mut speeds) = (Vec::with_capacity(groups.len() * bins), Vec::with_capacity(groups.len()));
    for group in &groups {
        let mut mean = vec![0.0; bins];
        for clip in *group {
            periodogram.accumulate(&samples[clip.start..clip.start + len], &mut mean);
        }
        mean.iter_mut().for_each(|s| *s /= group.len() as f64);
        if !floor.is_empty() {
            let min_power = MIN_POWER * mean.iter().copied().fold(0.0, f64::max);
            mean.iter_mut().zip(&floor).for_each(|(s, f)| *s = (*s - f).max(min_power));
        }
        psd.extend(
            mean.iter().enumerate().map(|(k, s)| (area * s * high_pass(k, df, params.high_pass)) as f32),
        );
        speeds.push(mean_speed(group.iter().map(|c| c.speed)));
    }
    let model = FrictionModel {
        version: MODEL_VERSION,
        material_pair: params.material_pair.clone(),
        speeds,
        psd,
        df,
        fs,
        floor: floor.iter().map(|&s| (area * s) as f32).collect(),
        clips: groups.iter().map(|g| g.len() as u32).collect(),
        rejected,
        conventions: Conventions {
            origin: if params.raw { Origin::RollerRaw } else { Origin::Roller },
            clip_samples: len as u32,
            hop: params.hop,
            high_pass: params.high_pass,
            floor_subtracted: !floor.is_empty(),
            contact_area: params.contact_area,
        },
        sources: params.sources.clone(),
    };
    model.validate()?;
    Ok(model)
}

/// Returns the clips on the encoder track that have a steady speed and are off the seams, the numbers of rejected
/// clips, and the number of all clips.
fn select_clips(
    samples: usize,
    fs: f64,
    len: usize,
    hop: usize,
    motion: &Motion,
    params: &BuilderParams,
) -> (Vec<Clip>, Rejections, usize) {
    let mut rejected = Rejections::default();
    let (mut clips, mut count) = (Vec::new(), 0);
    for start in (0..(samples + 1).saturating_sub(len)).step_by(hop) {
        count += 1;
        let (from, to) = (start as f64 / fs, (start + len) as f64 / fs);
        if !motion.covers(from, to) {
            rejected.outside_encoder += 1;
            continue;
        }
        let speed = motion.speed_at(0.5 * (from + to));
        let (slowest, fastest) = motion.speed_range(from, to);
        if speed < params.min_speed {
            rejected.at_rest += 1;
        } else if params.seams.iter().any(|&seam| motion.touches(seam, from, to)) {
            rejected.seam += 1;
        } else if fastest - slowest > params.speed_change * speed {
            rejected.speed_change += 1;
        } else {
            clips.push(Clip { start, speed });
        }
    }
    (clips, rejected, count)
}

/// Groups clips in order of speed for averaging. No two groups have the same mean speed.
fn group<'a>(clips: &'a [Clip], params: &BuilderParams) -> Vec<&'a [Clip]> {
    let (Some(first), Some(last)) = (clips.first(), clips.last()) else { return Vec::new() };
    let log_range = (last.speed / first.speed).ln();
    let bin = |c: &Clip| {
        let fraction = (c.speed / first.speed).ln() / log_range;
        ((fraction * params.n_speed as f64) as usize).min(params.n_speed - 1)
    };
    if log_range == 0.0 {
        vec![clips]
    } else if params.raw {
        clips.chunk_by(|a, b| a.speed == b.speed).collect()
    } else {
        clips.chunk_by(|a, b| bin(a) == bin(b)).collect()
    }
}

#[cfg(test)]
mod tests;
