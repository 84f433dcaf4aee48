//! The node `PatternTimescale`.

use super::segment::GrainStep;
use super::selection::check_patterns;
use super::walk::time_scaled;
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::correlation::{CorrelationPatterns, Pattern, Peak};
use crate::grain::dictionary::GrainDictionary;
use crate::{params, ports};

params! {
    /// Changes the duration of recordings by a factor, without changing their grains.
    ///
    /// A longer sound has more grains, a shorter one fewer. Attacks occur once each, at the scaled times. Tap or link `patterns` to a
    /// `PatternResynth`.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.3.
    pub struct PatternTimescaleParams {
        /// Duration of the output over that of the recording.
        factor: f64 = 2.0, unit "", range 0.05..=20.0;
    }
}
ports! {
    pub struct PatternTimescalePorts / PatternTimescaleIo {
        in {
            /// The patterns.
            patterns: Value<CorrelationPatterns>,
            /// The grains.
            dictionary: Value<GrainDictionary>,
        }
        out {
            /// The patterns of the sounds of other durations.
            scaled: Value<CorrelationPatterns>,
        }
    }
}

/// The node over [`time_scaled`].
#[derive(Debug)]
pub struct PatternTimescale;

/// A pattern whose peaks are the grains of a sound.
pub(super) fn sequence(pattern: &Pattern, steps: &[GrainStep], frames: u64) -> Pattern {
    let peak = |step: &GrainStep| Peak {
        t: step.t.max(0) as u32,
        grain: step.grain,
        correlation: 1.0,
        gain: step.gain.abs(),
        negative: step.gain < 0.0,
    };
    let mut peaks: Vec<Peak> = steps.iter().map(peak).collect();
    peaks.sort_by_key(|peak| peak.t);
    Pattern { frames, is_sequence: true, peaks, ..pattern.clone() }
}

/// Frames after the last grain of some steps, at least `frames`.
pub(super) fn frames_of(dictionary: &GrainDictionary, steps: &[GrainStep], frames: u64) -> u64 {
    let end = |step: &GrainStep| {
        let len = dictionary.grains.get(step.grain as usize).map_or(0, |grain| grain.window_len());
        step.t.max(0) as u64 + len as u64
    };
    steps.iter().map(end).max().unwrap_or(0).max(frames)
}

impl Func for PatternTimescale {
    type Params = PatternTimescaleParams;
    type Ports = PatternTimescalePorts;
    const NAME: &'static str = "PatternTimescale";

    fn eval(
        p: &PatternTimescaleParams,
        _: &Build<'_>,
        mut io: PatternTimescaleIo<'_>,
    ) -> Result<Summary, Fault> {
        let (patterns, dictionary) = (io.patterns, io.dictionary);
        check_patterns(patterns, dictionary)?;
        let scale = |pattern: &Pattern| {
            let steps = time_scaled(pattern, dictionary, p.factor);
            let frames = (pattern.frames as f64 * p.factor).round() as u64;
            sequence(pattern, &steps, frames_of(dictionary, &steps, frames))
        };
        let scaled = CorrelationPatterns {
            patterns: patterns.patterns.iter().map(scale).collect(),
            ..patterns.clone()
        };
        let grains: usize = scaled.patterns.iter().map(|p| p.peaks.len()).sum();
        io.scaled.set(scaled);
        Ok(vec![("grains", grains.into())])
    }

    fn trial(rng: &mut Rng) -> (PatternTimescaleParams, MemoryFiles) {
        (PatternTimescaleParams { factor: rng.between(0.3, 4.0) }, MemoryFiles::default())
    }
}
