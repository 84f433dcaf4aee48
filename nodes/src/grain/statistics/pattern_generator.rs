//! The node `PatternGenerator`.

use super::generator::{GeneratorRules, generated};
use super::model::PatternModel;
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::dsp::db_to_linear;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::GrainDictionary;
use crate::grain::synthesis::sequence;
use crate::{params, ports};

params! {
    /// Draws a pattern of any duration from the statistics of recordings, or from a mixture of two.
    ///
    /// Link `generated` to a `PatternResynth`, which plays it, once or again and again.
    ///
    /// # Randomness
    /// Intervals, levels and grains.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 6, which
    /// names this as future work.
    pub struct PatternGeneratorParams {
        /// Duration of the sound.
        seconds: f64 = 10.0, unit "s", range 0.01..=86_400.0;
        /// Factor on the number of grains in a time.
        density: f64 = 1.0, unit "", range 0.01..=100.0;
        /// Level relative to the recordings.
        loudness: f64 = 0.0, unit "dB", range -200.0..=60.0;
        /// Share of the second model.
        blend: f64 = 0.0, unit "", range 0.0..=1.0;
        /// Give the sound the mean envelope of the recordings, stretched to its duration, as for an impact that decays.
        shaped: bool = false;
    }
}
ports! {
    pub struct PatternGeneratorPorts / PatternGeneratorIo {
        in {
            /// The statistics.
            model: Value<PatternModel>,
            /// The model of other recordings, for `blend`.
            second: Option<Value<PatternModel>>,
            /// The grains of both.
            dictionary: Value<GrainDictionary>,
        }
        out {
            /// The pattern.
            generated: Value<CorrelationPatterns>,
        }
    }
}

/// Checks that models belong to a dictionary, and can be mixed.
///
/// # Errors
/// The first thing found, at its port.
pub(super) fn check_models(
    model: &PatternModel,
    second: Option<&PatternModel>,
    dictionary: &GrainDictionary,
) -> Result<(), Fault> {
    for (port, model) in [("model", Some(model)), ("second", second)] {
        let checked = model.map_or(Ok(()), |model| model.check_dictionary(dictionary));
        checked.map_err(|e| Fault::new("F151", e.to_string()).at(port))?;
    }
    let Some(second) = second.filter(|second| second.clusters.len() != model.clusters.len()) else {
        return Ok(());
    };
    let message = format!("the models have {} and {} clusters", model.clusters.len(), second.clusters.len());
    let help = "give both PatternStatistics the same `clusters`";
    Err(Fault::new("F151", message).at("second").help(help))
}

/// The node over [`generated`].
#[derive(Debug)]
pub struct PatternGenerator;

impl Func for PatternGenerator {
    type Params = PatternGeneratorParams;
    type Ports = PatternGeneratorPorts;
    const NAME: &'static str = "PatternGenerator";
    const VERSION: u32 = 2;

    fn eval(
        p: &PatternGeneratorParams,
        cx: &Build<'_>,
        mut io: PatternGeneratorIo<'_>,
    ) -> Result<Summary, Fault> {
        let (model, dictionary) = (io.model, io.dictionary);
        check_models(model, io.second, dictionary)?;
        let second = io.second.unwrap_or(model);
        let rules = GeneratorRules { density: p.density, gain: db_to_linear(p.loudness), blend: p.blend };
        let frames = (p.seconds * dictionary.rate).round().max(1.0) as u64;
        if frames > u64::from(u32::MAX) {
            let message = format!("{} s are {frames} samples; a pattern has up to {}", p.seconds, u32::MAX);
            return Err(Fault::new("F151", message).at("seconds"));
        }
        let steps = generated([model, second], dictionary, &rules, frames, p.shaped, |index, lane| {
            cx.random.uniform(0, index, lane)
        });
        let about = Pattern { name: "generated".to_owned(), frames, ..Pattern::default() };
        let grains = steps.len();
        let pattern = sequence(&about, &steps, frames);
        io.generated
            .set(CorrelationPatterns { patterns: vec![pattern], ..CorrelationPatterns::none(dictionary) });
        Ok(vec![("grains", grains.into()), ("seconds", p.seconds.into())])
    }

    fn trial(rng: &mut Rng) -> (PatternGeneratorParams, MemoryFiles) {
        let p = PatternGeneratorParams::trial(rng);
        let params = PatternGeneratorParams {
            seconds: rng.between(0.1, 1.0),
            density: rng.between(0.2, 4.0),
            loudness: rng.between(-20.0, 6.0),
            ..p
        };
        (params, MemoryFiles::default())
    }
}
