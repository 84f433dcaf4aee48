//! Correlation patterns: the occurrences of grains in recordings.

use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::dsp::db_to_linear;
use crate::grain::dictionary::{Grain, GrainDictionary};
use crate::grain::recording::{Component, SourceKind};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Version of the format of [`CorrelationPatterns`].
pub const PATTERNS_VERSION: u32 = 1;
/// Steps of a stored correlation.
const CORRELATION_STEPS: f32 = 255.0;
/// Steps of a stored gain, in dB.
const GAIN_STEP: f64 = 1.0 / 256.0;

/// A grain at a time of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Peak {
    /// First sample of the windowed grain in the recording.
    pub t: u32,
    /// Index of the grain.
    pub grain: u32,
    /// Normalised cross-correlation, 0 to 1.
    pub correlation: f32,
    /// Amplitude that gives the grain the power of the recording under its window.
    pub gain: f32,
    /// True if the grain occurs with the opposite sign.
    pub negative: bool,
}

/// A correlation as it is stored.
#[must_use]
pub fn stored_correlation(c: f64) -> f32 {
    (c.clamp(0.0, 1.0) as f32 * CORRELATION_STEPS).round() / CORRELATION_STEPS
}

/// Steps of a gain in a file.
pub(super) fn gain_steps(gain: f64) -> i16 {
    (20.0 * gain.max(1e-6).log10() / GAIN_STEP).round().clamp(-32_767.0, 32_767.0) as i16
}

/// The gain of a number of steps.
pub(super) fn gain_of_steps(steps: i16) -> f32 {
    db_to_linear(f64::from(steps) * GAIN_STEP) as f32
}

/// A gain as it is stored: in steps of 1/256 dB.
#[must_use]
pub fn stored_gain(gain: f64) -> f32 {
    gain_of_steps(gain_steps(gain))
}

/// Grains that occur in one component of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pattern {
    /// Provenance of the recording.
    pub name: String,
    /// Licence of the recording.
    pub licence: String,
    /// Words that describe it.
    pub tags: Vec<String>,
    /// Kind of contact.
    pub kind: SourceKind,
    /// The component.
    pub component: Component,
    /// Speed of the recorded motion, m/s, if it is known.
    pub speed: Option<f64>,
    /// Samples of the recording.
    pub frames: u64,
    /// True if the peaks are the grains of a sound, one after the other, rather than candidates.
    pub is_sequence: bool,
    /// Peaks of the correlation, by time, then falling correlation, then grain.
    pub peaks: Vec<Peak>,
}

impl Pattern {
    /// Sorts the peaks.
    pub fn sort(&mut self) {
        self.peaks.sort_by(|a, b| {
            a.t.cmp(&b.t).then(b.correlation.total_cmp(&a.correlation)).then(a.grain.cmp(&b.grain))
        });
    }
}

/// Patterns of recordings over the grains of one dictionary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CorrelationPatterns {
    /// [`PATTERNS_VERSION`].
    pub version: u32,
    /// Sample rate, Hz.
    pub rate: f64,
    /// Digest of the dictionary.
    pub dictionary: String,
    /// The patterns.
    pub patterns: Vec<Pattern>,
}

/// Reasons why patterns cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PatternError {
    /// Another version of the format.
    #[error("the patterns have version {found}; this reads version {PATTERNS_VERSION}: correlate again")]
    Version {
        /// The version found.
        found: u32,
    },
    /// Patterns of another dictionary.
    #[error(
        "the patterns belong to another dictionary: its digest is {wanted}, that of the dictionary here {found}"
    )]
    Dictionary {
        /// Digest of the linked dictionary.
        found: String,
        /// Digest in the patterns.
        wanted: String,
    },
    /// A peak that does not fit.
    #[error(
        "peak {peak} of pattern {pattern} ({name:?}) has grain {grain} at sample {t}, outside the dictionary or the recording"
    )]
    Peak {
        /// Index of the pattern.
        pattern: usize,
        /// Its name.
        name: String,
        /// Index of the peak.
        peak: usize,
        /// Its grain.
        grain: u32,
        /// Its time.
        t: u32,
    },
    /// Peaks out of order, or numbers that are not finite.
    #[error("pattern {pattern} ({name:?}) is damaged at peak {peak}")]
    Damaged {
        /// Index of the pattern.
        pattern: usize,
        /// Its name.
        name: String,
        /// Index of the peak.
        peak: usize,
    },
}

impl CorrelationPatterns {
    /// No patterns of a dictionary.
    #[must_use]
    pub fn none(dictionary: &GrainDictionary) -> Self {
        Self {
            version: PATTERNS_VERSION,
            rate: dictionary.rate,
            dictionary: dictionary.id(),
            patterns: Vec::new(),
        }
    }

    /// Checks that the patterns are valid and belong to a dictionary.
    ///
    /// # Errors
    /// The first thing found.
    pub fn validate(&self, dictionary: &GrainDictionary) -> Result<(), PatternError> {
        self.check_order()?;
        let found = dictionary.id();
        if found != self.dictionary {
            return Err(PatternError::Dictionary { found, wanted: self.dictionary.clone() });
        }
        let end = |grain: &Grain| grain.window_len() as u64;
        for (k, pattern) in self.patterns.iter().enumerate() {
            let outside = |peak: &Peak| {
                let grain = dictionary.grains.get(peak.grain as usize);
                grain.is_none_or(|grain| u64::from(peak.t) + end(grain) > pattern.frames)
            };
            if let Some((index, peak)) = pattern.peaks.iter().enumerate().find(|(_, peak)| outside(peak)) {
                let name = pattern.name.clone();
                return Err(PatternError::Peak {
                    pattern: k,
                    name,
                    peak: index,
                    grain: peak.grain,
                    t: peak.t,
                });
            }
        }
        Ok(())
    }

    /// Checks everything that does not depend on the dictionary.
    ///
    /// # Errors
    /// The first thing found.
    pub fn check_order(&self) -> Result<(), PatternError> {
        if self.version != PATTERNS_VERSION {
            return Err(PatternError::Version { found: self.version });
        }
        for (k, pattern) in self.patterns.iter().enumerate() {
            let wrong = |peak: &Peak| {
                !peak.gain.is_finite() || peak.gain < 0.0 || !(0.0..=1.0).contains(&peak.correlation)
            };
            let unsorted =
                pattern.peaks.windows(2).position(|pair| pair[0].t > pair[1].t).map(|index| index + 1);
            if let Some(peak) = unsorted.or_else(|| pattern.peaks.iter().position(wrong)) {
                return Err(PatternError::Damaged { pattern: k, name: pattern.name.clone(), peak });
            }
        }
        Ok(())
    }

    /// Figures for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let peaks: usize = self.patterns.iter().map(|p| p.peaks.len()).sum();
        let bytes = self.to_bytes().map_or(0, |bytes| bytes.len());
        vec![("patterns", self.patterns.len().into()), ("peaks", peaks.into()), ("bytes", bytes.into())]
    }
}

impl Data for CorrelationPatterns {
    const NAME: &'static str = "correlation patterns";
    const FILES: bool = true;

    fn file(&self) -> Option<Vec<u8>> {
        self.to_bytes().ok()
    }

    fn trial(rng: &mut Rng) -> Self {
        // Trials of nodes have patterns and dictionary of their own seeds; those of one seed belong together.
        let dictionary = crate::grain::trial_dictionary();
        let peaks = |count: usize, frames: usize, rng: &mut Rng| -> Vec<Peak> {
            (0..count)
                .filter_map(|_| {
                    let grain = rng.below(dictionary.len());
                    let room = frames.checked_sub(dictionary.grains[grain].window_len())?;
                    Some(Peak {
                        t: rng.below(room.max(1)) as u32,
                        grain: grain as u32,
                        correlation: stored_correlation(rng.uniform()),
                        gain: stored_gain(rng.between(0.1, 2.0)),
                        negative: false,
                    })
                })
                .collect()
        };
        let patterns = (0..2)
            .map(|k| {
                let mut pattern = Pattern {
                    name: format!("trial_{k}.wav"),
                    tags: vec!["trial".into()],
                    frames: 2000,
                    peaks: peaks(20, 2000, rng),
                    ..Pattern::default()
                };
                pattern.sort();
                pattern
            })
            .collect();
        Self { version: PATTERNS_VERSION, rate: dictionary.rate, dictionary: dictionary.id(), patterns }
    }
}
