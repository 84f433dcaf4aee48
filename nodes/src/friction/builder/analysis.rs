//! Errors, checks, high-pass and mean speed for both builders.

use thiserror::Error;

use super::encoder::EncoderError;
use crate::friction::model::{MAX_CLIP_SAMPLES, ModelError, Rejections, clip_samples};

/// Reasons why no model can be made from recordings.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The encoder track is unusable.
    #[error(transparent)]
    Encoder(#[from] EncoderError),
    /// The result is not a valid model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A parameter out of range.
    #[error("parameter `{name}` is {found}; {expected}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        found: f64,
        /// Values that it can have.
        expected: &'static str,
    },
    /// A sample that is not finite.
    #[error("sample {index} of recording {recording} is {found}; samples are finite")]
    Sample {
        /// Index of the recording, from 0.
        recording: usize,
        /// Index of the sample, from 0.
        index: usize,
        /// Its value.
        found: f32,
    },
    /// Seams without a roller radius, and so without angles.
    #[error("`seams` need the angle of the roller: give `roller_radius` in metres")]
    SeamWithoutAngle,
    /// A recording at rest that is shorter than a clip.
    #[error(
        "the recording at rest has {found} samples; one clip of {expected} is needed to measure the noise floor"
    )]
    Floor {
        /// Samples found.
        found: usize,
        /// Samples needed.
        expected: usize,
    },
    /// Too few usable clips or speeds.
    #[error(
        "{speeds} speed(s) from {usable} usable clips of {clips}; 2 speeds are needed (rejected: {} at rest, {} changing \
         speed, {} on the seam, {} outside the encoder track, {} silent, {} recordings too short)",
        .rejected.at_rest, .rejected.speed_change, .rejected.seam, .rejected.outside_encoder, .rejected.silent,
        .rejected.too_short
    )]
    TooFew {
        /// Distinct speeds.
        speeds: usize,
        /// Usable clips.
        usable: usize,
        /// Clips analysed.
        clips: usize,
        /// Numbers of rejected clips by reason.
        rejected: Rejections,
    },
}

pub(super) fn check(
    name: &'static str,
    found: f64,
    range: std::ops::RangeInclusive<f64>,
    expected: &'static str,
) -> Result<(), BuildError> {
    if range.contains(&found) { Ok(()) } else { Err(BuildError::Parameter { name, found, expected }) }
}

/// Checks a clip length and a rate, and returns the clip length in samples.
pub(super) fn checked_clip(seconds: f64, fs: f64) -> Result<usize, BuildError> {
    check("fs", fs, 1.0..=1e7, "a rate of 1 Hz to 10 MHz is needed")?;
    check("clip", seconds, 2.0 / fs..=MAX_CLIP_SAMPLES as f64 / fs, "2 to 1,048,576 samples are needed")?;
    Ok(clip_samples(seconds, fs))
}

/// Checks the number of bins of speed, the cutoff of the high-pass in Hz, and the contact area in m^2, at a rate.
pub(super) fn check_model(
    (n_speed, high_pass, contact_area): (usize, f64, f64),
    fs: f64,
) -> Result<(), BuildError> {
    check("n_speed", n_speed as f64, 2.0..=65536.0, "2 to 65,536 bins are needed")?;
    check("high_pass", high_pass, 0.0..=0.5 * fs, "0 to half the rate is needed (20 to 100 Hz is usual)")?;
    check("contact_area", contact_area, 1e-12..=1e12, "an area above 0 m^2 is needed")
}

pub(super) fn check_samples(recording: usize, samples: &[f32]) -> Result<(), BuildError> {
    match samples.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(BuildError::Sample { recording, index, found: samples[index] }),
        None => Ok(()),
    }
}

/// Returns the power response of a Butterworth high-pass of order 5 at bin `k`. DC is always removed.
pub(super) fn high_pass(k: usize, df: f64, cut_off: f64) -> f64 {
    if k == 0 { 0.0 } else { 1.0 / (1.0 + (cut_off / (k as f64 * df)).powi(10)) }
}

/// Returns the mean of speeds, clamped to their range against rounding.
pub(super) fn mean_speed(speeds: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let (low, high) = speeds.clone().fold((f64::MAX, 0.0), |(a, b), s| (s.min(a), s.max(b)));
    let count = speeds.len() as f64;
    (speeds.sum::<f64>() / count).max(low).min(high)
}
