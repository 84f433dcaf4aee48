//! The content of a score.

use super::curve::WeightCurve;
use crate::artefact::text::Location;
use crate::choices;
use crate::core::item::Data;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};

/// Maximum number of targets, and of sources, of a score.
pub const MAX_TARGETS: usize = 100_000;

choices! {
    /// Constraint on a sound outside of its targets.
    #[derive(Serialize, Deserialize)]
    pub enum Outside {
        /// Nothing: it may occur.
        None,
        /// It must not occur.
        Exclude,
    }
}

/// A sound: one or more intervals of a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreSource {
    /// Its name.
    pub name: String,
    /// The recording, by the end of its path; `None` for the first.
    pub recording: Option<String>,
    /// Start and end of each interval, s.
    pub segments: Vec<(f64, f64)>,
    /// Constraint outside of its targets.
    pub outside: Outside,
    /// Location in its file.
    pub location: Location,
}

/// An interval of the output in which sounds are wanted, or not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreTarget {
    /// The sounds, by index, in increasing order.
    pub sources: Vec<usize>,
    /// The weight over time: 1 is hard inclusion and -1 hard exclusion; between them it is the probability of inclusion or exclusion, in
    /// addition to that of a random choice. 0 is no constraint.
    pub curve: WeightCurve,
    /// Location in its file.
    pub location: Location,
}

/// Constraints on the sounds of an output.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SoundScore {
    /// Path of its file, for messages.
    pub file: String,
    /// Duration of the output that it is made for, s, if it is known.
    pub duration: Option<f64>,
    /// The sounds.
    pub sources: Vec<ScoreSource>,
    /// The targets.
    pub targets: Vec<ScoreTarget>,
    /// Length of the soft ramps before and after constraints that begin or end at once, s; `None` for 50 ms.
    pub pad: Option<f64>,
}

/// Length of the ramps beside constraints unless a score says otherwise, s.
pub const DEFAULT_PAD: f64 = 0.05;

impl SoundScore {
    /// The names of sounds, for messages.
    #[must_use]
    pub fn names(&self, sources: &[usize]) -> String {
        let names: Vec<&str> =
            sources.iter().filter_map(|k| self.sources.get(*k)).map(|s| s.name.as_str()).collect();
        names.join(" and ")
    }
}

impl Data for SoundScore {
    const NAME: &'static str = "sound score";

    fn trial(rng: &mut Rng) -> Self {
        let source = |name: &str, from: f64| ScoreSource {
            name: name.into(),
            recording: None,
            segments: vec![(from, from + 0.02)],
            outside: Outside::None,
            location: Location::default(),
        };
        let mut target = |source: usize, from: f64| ScoreTarget {
            sources: vec![source],
            curve: WeightCurve::constant(from, from + rng.between(0.01, 0.05), rng.between(-0.9, 0.9)),
            location: Location::default(),
        };
        let targets = vec![target(0, 0.0), target(1, 0.05), target(0, 0.1)];
        let sources = vec![source("a", 0.0), source("b", 0.03), source("c", 0.05)];
        Self { file: String::new(), duration: None, sources, targets, pad: None }
    }
}
