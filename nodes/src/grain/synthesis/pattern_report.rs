//! The node `PatternReport`.

use super::segment::{GrainStep, sound_of};
use super::selection::check_patterns;
use super::walk::{GapRule, walk};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::GrainRecordings;
use crate::grain::{Component, Distortion, GrainRecording, Peak};
use crate::plot::{Chart, Line};
use crate::table::ResultTable;
use crate::{params, ports};

params! {
    /// Compares recordings with their patterns: peaks of the correlation, grains that are played, and the error of the sound.
    ///
    /// `table` has a row for each recording: the number of peaks, the grains of the walk, the share of the time without a grain, the
    /// segmental signal-to-noise ratio (frames of 20 ms, each between -10 and 35 dB) and the log-spectral distance. Tapped as SVG it draws
    /// the peaks and both sounds of the first recordings.
    ///
    /// # Source
    /// Figure 3 of Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009):
    /// correlation peaks, and a recording beside its reconstruction.
    pub struct PatternReportParams {
        /// Number of recordings that are drawn.
        drawn: usize = 3, unit "", range 0..=24;
        /// Duration that is drawn of each; None for all.
        seconds: Option<f64> = Some(2.0), unit "s", range 0.01..=600.0;
    }
}
ports! {
    pub struct PatternReportPorts / PatternReportIo {
        in {
            /// The recordings.
            recordings: Value<GrainRecordings>,
            /// Their patterns.
            patterns: Value<CorrelationPatterns>,
            /// The grains.
            dictionary: Value<GrainDictionary>,
        }
        out {
            /// Peaks, grains and errors of each recording.
            table: Value<ResultTable>,
        }
    }
}

/// The node `PatternReport`.
#[derive(Debug)]
pub struct PatternReport;

/// A pattern and the walk through it.
struct Walked<'a> {
    pattern: &'a Pattern,
    steps: Vec<GrainStep>,
}

/// Share of the frames that no grain covers.
fn gaps(dictionary: &GrainDictionary, walked: &Walked<'_>) -> f64 {
    let (mut end, mut gap) = (0_i64, 0_i64);
    for step in &walked.steps {
        let len = dictionary.grains.get(step.grain as usize).map_or(0, |grain| grain.window_len() as i64);
        gap += (step.t - end).max(0);
        end = end.max(step.t + len);
    }
    let frames = walked.pattern.frames as i64;
    (gap + (frames - end).max(0)) as f64 / frames.max(1) as f64
}

/// Columns of a drawn waveform.
const COLUMNS: usize = 1500;

/// Least and greatest sample of each column of a waveform.
fn outline(x: &[f32], rate: f64) -> Vec<[f64; 2]> {
    let width = x.len().div_ceil(COLUMNS).max(1);
    let of_column = |(k, x): (usize, &[f32])| {
        let (low, high) = x.iter().fold((0.0_f32, 0.0_f32), |(l, h), x| (l.min(*x), h.max(*x)));
        let time = (k * width) as f64 / rate;
        [[time, low.into()], [time, high.into()]]
    };
    x.chunks(width).enumerate().flat_map(of_column).collect()
}

fn charts(name: &str, rate: f64, seconds: f64, all: &[Walked<'_>], sounds: [&[f32]; 2]) -> Vec<Chart> {
    let file = name.rsplit('/').next().unwrap_or(name);
    let time = ("time, s", false);
    let limit = (seconds * rate).min(1e12) as usize;
    let mut charts = Vec::new();
    for walked in all {
        let title = match walked.pattern.component {
            Component::Whole => file.to_owned(),
            component => format!("{file}, {}", format!("{component:?}").to_lowercase()),
        };
        let peaks = walked.pattern.peaks.iter().filter(|p| (p.t as usize) < limit);
        let point = |t: i64, c: f32| [t as f64 / rate, f64::from(c)];
        let played = |step: &&GrainStep| step.t < limit as i64;
        let correlation = |step: &GrainStep| {
            let peaks = &walked.pattern.peaks;
            let at = peaks.partition_point(|p| i64::from(p.t) < step.t);
            let same = |p: &&Peak| p.grain == step.grain;
            peaks[at..]
                .iter()
                .take_while(|p| i64::from(p.t) == step.t)
                .find(same)
                .map_or(0.0, |p| p.correlation)
        };
        let lines = vec![
            Line::dots("peaks", peaks.map(|p| point(p.t.into(), p.correlation)).collect()),
            Line::dots(
                "played",
                walked.steps.iter().filter(played).map(|s| point(s.t, correlation(s))).collect(),
            ),
        ];
        charts.push(Chart::of(title, time, ("correlation", false), lines));
    }
    for (sound, title) in sounds.into_iter().zip(["recorded", "played"]) {
        let lines = vec![Line::new(title, outline(&sound[..sound.len().min(limit)], rate))];
        charts.push(Chart::of(format!("{file}, {title}"), time, ("amplitude", false), lines));
    }
    charts
}

impl Func for PatternReport {
    type Params = PatternReportParams;
    type Ports = PatternReportPorts;
    const NAME: &'static str = "PatternReport";

    fn eval(p: &PatternReportParams, _: &Build<'_>, mut io: PatternReportIo<'_>) -> Result<Summary, Fault> {
        let (recordings, dictionary, patterns) = (io.recordings, io.dictionary, io.patterns);
        check_patterns(patterns, dictionary)?;
        let mut table = ResultTable::new(&[
            "recording",
            "seconds",
            "peaks",
            "grains",
            "gaps",
            "segmental_snr_db",
            "log_spectral_distance_db",
        ]);
        let mut total = Distortion::default();
        let of_name = |recording: &&GrainRecording| {
            patterns.patterns.iter().any(|pattern| pattern.name == recording.name)
        };
        for (k, recording) in recordings.recordings.iter().filter(of_name).enumerate() {
            let own = patterns.patterns.iter().filter(|pattern| pattern.name == recording.name);
            let all: Vec<Walked<'_>> = own
                .map(|pattern| Walked { pattern, steps: walk(pattern, dictionary, GapRule::Extend) })
                .collect();
            let original = recording.mono();
            let played = sound_of(dictionary, all.iter().map(|walked| &walked.steps), original.len());
            let mut error = Distortion::default();
            error.add(&original, &played, dictionary.rate);
            total = total.with(error);
            let gap = all.iter().map(|w| gaps(dictionary, w)).sum::<f64>() / all.len().max(1) as f64;
            table.push([
                recording.name.as_str().into(),
                (original.len() as f64 / dictionary.rate).into(),
                all.iter().map(|w| w.pattern.peaks.len()).sum::<usize>().into(),
                all.iter().map(|w| w.steps.len()).sum::<usize>().into(),
                gap.into(),
                error.segmental_ratio().into(),
                error.log_spectral_distance().into(),
            ]);
            if k < p.drawn {
                let seconds = p.seconds.unwrap_or(f64::INFINITY);
                table.charts.extend(charts(
                    &recording.name,
                    dictionary.rate,
                    seconds,
                    &all,
                    [&original, &played],
                ));
            }
        }
        if table.rows.is_empty() {
            let message = "no recording has a pattern: names of both differ";
            return Err(Fault::new("F151", message)
                .at("recordings")
                .help("link the recordings that were correlated"));
        }
        let summary = vec![
            ("recordings", table.rows.len().into()),
            ("segmental_snr_db", total.segmental_ratio().into()),
            ("log_spectral_distance_db", total.log_spectral_distance().into()),
        ];
        io.table.set(table);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (PatternReportParams, MemoryFiles) {
        (PatternReportParams::trial(rng), MemoryFiles::default())
    }
}
