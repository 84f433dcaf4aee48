//! The node `GrainCorrelate`.

use super::patterns::CorrelationPatterns;
use super::search::{CorrelateRules, Retention, correlate, memory};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::{GrainRecording, GrainRecordings};
use crate::{choices, params, ports};

choices! {
    /// Peaks of the correlation that are retained.
    pub enum Retain {
        /// The best in each interval of the mean length of a grain.
        PerInterval,
        /// The best of each recording.
        Largest,
    }
}
choices! {
    /// Norm that a correlation is divided by, beside that of the grain.
    pub enum Normalise {
        /// The norm of the recording under the grain: soft passages count as much as loud ones.
        Local,
        /// The norm of the whole recording: loud passages have most of the peaks.
        Global,
    }
}
choices! {
    /// Sign of a grain in a recording.
    pub enum Polarity {
        /// As it was recorded.
        Positive,
        /// As it was recorded, or inverted.
        Absolute,
    }
}

params! {
    /// Finds the occurrences of the grains of a dictionary in recordings, by normalised cross-correlation.
    ///
    /// Every recording is correlated with every grain. The pattern of a recording consists of the peaks of all correlations, with the gain of
    /// each grain: `PatternResynth` plays the recording from it. Patterns may be of other recordings than the grains; then the sound consists
    /// of other material in the rhythm of the recording.
    ///
    /// The effort is at most that of one transform for each grain and each 6,000 to 13,000 samples of sound; where the frequencies of both show that no peak
    /// would be retained, there is none. A tap of `patterns` as BIN writes a file for
    /// `CorrelationPatternsFile`.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), sections 3.3 and
    /// 5.1, where correlating 94 recordings took four hours.
    pub struct GrainCorrelateParams {
        /// Peaks that are retained.
        retain: Retain = Retain::PerInterval;
        /// Number of peaks in an interval.
        peaks: usize = 4, unit "", range 1..=1000;
        /// Number of peaks of a recording with `retain: Largest`; 0 for eight for each mean length of a grain.
        largest: usize = 0, unit "", range 0..=10_000_000;
        /// Smallest correlation of a peak.
        least: f64 = 0.05, unit "", range 0.0..=1.0;
        /// Norm that a correlation is divided by.
        normalise: Normalise = Normalise::Local;
        /// Sign of a grain.
        polarity: Polarity = Polarity::Positive;
        /// Level below which a recording correlates with nothing, relative to its peak.
        floor: f64 = -70.0, unit "dB", range -200.0..=0.0;
        /// Also correlate steady parts with transient grains, and whole recordings with both.
        cross_component: bool = false;
    }
}
ports! {
    pub struct GrainCorrelatePorts / GrainCorrelateIo {
        in {
            /// The recordings.
            recordings: Value<GrainRecordings>,
            /// The grains.
            dictionary: Value<GrainDictionary>,
        }
        out {
            /// The pattern of each recording.
            patterns: Value<CorrelationPatterns>,
        }
    }
}

/// The node over [`correlate`].
#[derive(Debug)]
pub struct GrainCorrelate;

impl GrainCorrelateParams {
    fn rules(&self) -> CorrelateRules {
        CorrelateRules {
            retain: match self.retain {
                Retain::PerInterval => Retention::PerInterval(self.peaks),
                Retain::Largest => Retention::Largest(self.largest),
            },
            min: self.least,
            global: self.normalise == Normalise::Global,
            absolute: self.polarity == Polarity::Absolute,
            floor: self.floor,
            cross_component: self.cross_component,
            ..CorrelateRules::default()
        }
    }
}

impl Func for GrainCorrelate {
    type Params = GrainCorrelateParams;
    type Ports = GrainCorrelatePorts;
    const NAME: &'static str = "GrainCorrelate";
    // Patterns are named after the recordings.
    const EXPOSES_PATHS: bool = true;

    fn eval(
        p: &GrainCorrelateParams,
        cx: &Build<'_>,
        mut io: GrainCorrelateIo<'_>,
    ) -> Result<Summary, Fault> {
        let (recordings, dictionary) = (io.recordings, io.dictionary);
        if (recordings.rate - dictionary.rate).abs() > 1e-9 {
            let message =
                format!("the recordings have {} Hz, the dictionary {} Hz", recordings.rate, dictionary.rate);
            let help = "set `rate` of GrainRecordings to that of the dictionary";
            return Err(Fault::new("F151", message).at("recordings").help(help));
        }
        let longest = recordings.recordings.iter().map(GrainRecording::len).max().unwrap_or(0);
        let bytes = memory(dictionary, longest, rayon::current_num_threads());
        let patterns =
            correlate(recordings, dictionary, &p.rules(), &|share| (cx.monitor)(share), cx.partial);
        let patterns = patterns.ok_or_else(Fault::stopped)?;
        let mut summary = patterns.summary();
        let empty = patterns.patterns.iter().filter(|p| p.peaks.is_empty()).map(|p| p.name.as_str());
        for name in empty {
            summary.push(("warning", format!("{name:?}: no grain occurs in it").into()));
        }
        summary.push(("working_memory_mb", (bytes as f64 / 1e6).into()));
        io.patterns.set(patterns);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (GrainCorrelateParams, MemoryFiles) {
        let p = GrainCorrelateParams::trial(rng);
        let params = GrainCorrelateParams { peaks: 1 + p.peaks % 5, largest: p.largest % 50, ..p };
        (params, MemoryFiles::default())
    }
}
