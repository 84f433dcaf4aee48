//! The node `PatternStatistics`.

use super::model::{PatternModel, fit};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::{Component, matching_tags};
use crate::grain::synthesis::check_patterns;
use crate::{choices, params, ports};

choices! {
    /// Component of recordings.
    pub enum StatisticsComponent {
        /// The component of the first pattern.
        First,
        /// Whole recordings.
        Whole,
        /// Steady parts.
        Steady,
        /// Transient parts.
        Transient,
    }
}

params! {
    /// Measures the statistics of patterns with some tags, from which a `PatternGenerator` draws any number of others.
    ///
    /// The model has the distribution of the intervals between grains, the distribution of their levels and the correlation of successive
    /// ones, the probability of each cluster of similar grains after each other one, and the mean envelope of the recordings.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 6, which
    /// names this as future work.
    pub struct PatternStatisticsParams {
        /// Tags of the recordings, such as `stone scrape`; all by default.
        tags: Text = "".into();
        /// Component that is measured.
        component: StatisticsComponent = StatisticsComponent::First;
        /// Number of clusters of grains.
        clusters: usize = 16, unit "", range 1..=256;
        /// Number that is added to each count of a transition, so that transitions that were not recorded have a small chance.
        smoothing: f64 = 0.1, unit "", range 0.0..=1000.0;
    }
}
ports! {
    pub struct PatternStatisticsPorts / PatternStatisticsIo {
        in {
            /// The patterns.
            patterns: Value<CorrelationPatterns>,
            /// The grains.
            dictionary: Value<GrainDictionary>,
        }
        out {
            /// The model.
            model: Value<PatternModel>,
        }
    }
}

/// The node over [`fit`].
#[derive(Debug)]
pub struct PatternStatistics;

impl Func for PatternStatistics {
    type Params = PatternStatisticsParams;
    type Ports = PatternStatisticsPorts;
    const NAME: &'static str = "PatternStatistics";
    const VERSION: u32 = 2;

    fn eval(
        p: &PatternStatisticsParams,
        _: &Build<'_>,
        mut io: PatternStatisticsIo<'_>,
    ) -> Result<Summary, Fault> {
        let (patterns, dictionary) = (io.patterns, io.dictionary);
        check_patterns(patterns, dictionary)?;
        let (found, is_exact) = matching_tags(&p.tags.0, patterns.patterns.iter().map(|p| p.tags.as_slice()));
        let tagged = found.iter().map(|k| &patterns.patterns[*k]);
        let component = match p.component {
            StatisticsComponent::First => tagged.clone().next().map(|pattern| pattern.component),
            StatisticsComponent::Whole => Some(Component::Whole),
            StatisticsComponent::Steady => Some(Component::Steady),
            StatisticsComponent::Transient => Some(Component::Transient),
        };
        let chosen: Vec<&Pattern> = tagged.filter(|pattern| Some(pattern.component) == component).collect();
        if chosen.is_empty() {
            let message = format!("no pattern has a tag of {:?} and this component", p.tags.0);
            return Err(Fault::new("F151", message).at("tags").help("leave `tags` empty for all recordings"));
        }
        let model = fit(dictionary, &chosen, p.clusters, p.smoothing)
            .map_err(|e| Fault::new("F151", e.to_string()).at("patterns"))?;
        let mut summary = model.figures();
        summary.push(("recordings", chosen.len().into()));
        if !is_exact {
            let message = format!("no recording has all tags of {:?}; the nearest are used", p.tags.0);
            summary.push(("notice", message.into()));
        }
        io.model.set(model);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (PatternStatisticsParams, MemoryFiles) {
        let p = PatternStatisticsParams::trial(rng);
        let params = PatternStatisticsParams {
            tags: "".into(),
            component: StatisticsComponent::First,
            clusters: 1 + p.clusters % 6,
            ..p
        };
        (params, MemoryFiles::default())
    }
}
