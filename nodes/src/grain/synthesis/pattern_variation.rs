//! The node `PatternVariation`.

use super::selection::check_patterns;
use super::walk::{VariationRules, frames_of, sequence, varied};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::GrainDictionary;
use crate::{choices, params, ports};

choices! {
    /// Choice of a grain.
    pub enum VariationChoice {
        /// Each of the best with equal chances.
        Rank,
        /// The more likely the greater the correlation.
        Softmax,
    }
}

params! {
    /// Makes variations of recordings: similar to them, and all different.
    ///
    /// At each time one of the best grains is chosen, with the gain that it has there. Attacks stay at their times. For the rhythm of one
    /// recording with the material of another, correlate the one with the grains of the other.
    ///
    /// # Randomness
    /// The choice of a grain, its shift and its level are functions of the seed, the pattern and the number of the grain.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.3.
    pub struct PatternVariationParams {
        /// Choice of a grain.
        choice: VariationChoice = VariationChoice::Rank;
        /// Number of grains among which one is chosen.
        among: usize = 4, unit "", range 1..=1000;
        /// Difference of correlation over which a grain becomes less likely by a factor of e, with `choice: Softmax`.
        temperature: f64 = 0.05, unit "", range 0.000001..=10.0;
        /// Greatest shift of a grain that is no attack.
        jitter: f64 = 0.005, unit "s", range 0.0..=1.0;
        /// Greatest change of the level of a grain.
        level: f64 = 1.0, unit "dB", range 0.0..=24.0;
        /// Factor on the number of grains that are no attacks: below 1 some are left out, above 1 more begin while one sounds.
        density: f64 = 1.0, unit "", range 0.0..=16.0;
    }
}
ports! {
    pub struct PatternVariationPorts / PatternVariationIo {
        in {
            /// The patterns.
            patterns: Value<CorrelationPatterns>,
            /// The grains.
            dictionary: Value<GrainDictionary>,
        }
        out {
            /// The patterns of the other sounds.
            varied: Value<CorrelationPatterns>,
        }
    }
}

/// The node over [`varied`].
#[derive(Debug)]
pub struct PatternVariation;

impl Func for PatternVariation {
    type Params = PatternVariationParams;
    type Ports = PatternVariationPorts;
    const NAME: &'static str = "PatternVariation";
    const VERSION: u32 = 2;

    fn eval(
        p: &PatternVariationParams,
        cx: &Build<'_>,
        mut io: PatternVariationIo<'_>,
    ) -> Result<Summary, Fault> {
        let (patterns, dictionary) = (io.patterns, io.dictionary);
        check_patterns(patterns, dictionary)?;
        let rules = VariationRules {
            among: p.among,
            temperature: (p.choice == VariationChoice::Softmax).then_some(p.temperature),
            jitter: p.jitter * dictionary.rate,
            level: p.level,
            density: p.density,
        };
        let vary = |(k, pattern): (usize, &Pattern)| {
            if pattern.is_sequence {
                return pattern.clone();
            }
            let steps =
                varied(pattern, dictionary, &rules, |index, lane| cx.random.uniform(k as u32, index, lane));
            sequence(pattern, &steps, frames_of(dictionary, &steps, pattern.frames))
        };
        let all: Vec<Pattern> = patterns.patterns.iter().enumerate().map(vary).collect();
        let grains: usize = all.iter().map(|p| p.peaks.len()).sum();
        io.varied.set(CorrelationPatterns { patterns: all, ..patterns.clone() });
        Ok(vec![("grains", grains.into())])
    }

    fn trial(rng: &mut Rng) -> (PatternVariationParams, MemoryFiles) {
        let p = PatternVariationParams::trial(rng);
        (
            PatternVariationParams { among: 1 + p.among % 6, jitter: rng.between(0.0, 0.01), ..p },
            MemoryFiles::default(),
        )
    }
}
