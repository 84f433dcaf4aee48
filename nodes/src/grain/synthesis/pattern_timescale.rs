//! The node `PatternTimescale`.

use super::selection::check_patterns;
use super::walk::{frames_of, sequence, time_scaled};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
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
