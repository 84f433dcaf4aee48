//! The node `GrainRecordings`.

use super::kind::{SourceKind, guess_kind};
use super::label::{Component, RecordingLabel, matching_tags};
use super::recordings::{GrainRecording, GrainRecordings, Part};
use crate::core::content::audio_digest;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, FolderPath, Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::grain::sinusoid::{PeakRules, TrackRules, split};
use crate::io::{
    ListedRecording, MaxLength, RecordingList, RecordingParam, Whole, recording_warnings, trial_wav,
};
use crate::{choices, params, ports};
use rayon::prelude::*;

choices! {
    /// Recordings that are split into a steady and a transient part.
    pub enum SplitRule {
        /// Recordings of contact that lasts.
        Continuous,
        /// None.
        None,
        /// All.
        All,
    }
}

params! {
    /// Reads recordings from which grains are cut, with their metadata.
    ///
    /// Recordings come from a list, from a folder, and from a manifest, a CSV with the columns `file` (relative to the CSV), and optionally
    /// `tags` (words such as `stone scrape`), `kind` (`impulsive` or `continuous`), `speed` of the recorded motion in m/s, and `licence`.
    /// Without tags, a recording has the words of its file name: `scrape_stone_2.flac` has `scrape` and `stone`. A kind that is not given is
    /// guessed from the envelope, and reported.
    ///
    /// Continuous recordings are split into a steady part, a sum of sinusoids, and a transient part, the residual, which is the part that
    /// sounds unnatural when it is repeated or shifted in frequency.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 3.1.
    pub struct GrainRecordingsParams {
        /// The recordings, of any rates and at most ten minutes each.
        recordings: Vec<AssetPath> = Vec::new();
        /// A folder whose recordings are added, in order of their names.
        folder: Option<FolderPath> = None;
        /// CSV of recordings that are added.
        manifest: Option<AssetPath> = None;
        /// Tags of all recordings without tags of their own; empty for the words of their file names.
        tags: Text = "".into();
        /// Tags that a recording must have; empty for all recordings.
        only: Text = "".into();
        /// The licence of recordings without one of their own.
        licence: Text = "".into();
        /// Rate to which recordings are resampled.
        rate: Rate = Rate::hz(48_000);
        /// Recordings that are split into a steady and a transient part.
        split: SplitRule = SplitRule::Continuous;
        /// Lowest level of a sinusoid of the steady part.
        threshold: f64 = -80.0, unit "dB", range -160.0..=0.0;
        /// Maximum number of sinusoids at a time.
        sinusoids: usize = 100, unit "", range 1..=1000;
    }
}
ports! {
    pub struct GrainRecordingsPorts / GrainRecordingsIo {
        in {}
        out {
            /// The recordings with their tags and components.
            recorded: Value<GrainRecordings>,
        }
    }
}

/// The node `GrainRecordings`.
#[derive(Debug)]
pub struct GrainRecordingsNode;

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F150", max: MaxLength::Seconds(600) };

impl GrainRecordingsParams {
    /// Tags of a recording.
    fn tags_of(&self, label: &RecordingLabel) -> Vec<String> {
        let mut label = label.clone();
        if label.tags.trim().is_empty() {
            label.tags.clone_from(&self.tags.0);
        }
        label.tag_words()
    }
}

/// Reads one recording.
fn read(
    p: &GrainRecordingsParams,
    cx: &Build<'_>,
    listed: &ListedRecording<RecordingLabel>,
) -> Result<(GrainRecording, Summary), Fault> {
    let ListedRecording { path, field, entry } = listed;
    let wrong = |text: String| RECORDINGS.unusable(path, text).at(field);
    let Whole { channels, samples, info } = RECORDINGS.read_whole(cx, field, path, p.rate)?;
    let whole = Part { component: Component::Whole, channels };
    let mono = whole.mono();
    let given = entry.given_kind().map_err(&wrong)?;
    let kind = given.unwrap_or_else(|| guess_kind(&mono, p.rate.as_f64()));
    let splits = match p.split {
        SplitRule::Continuous => kind == SourceKind::Continuous,
        SplitRule::None => false,
        SplitRule::All => true,
    };
    let licence = if entry.licence.is_empty() { p.licence.0.clone() } else { entry.licence.clone() };
    let peak = samples.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
    let clipped = samples.iter().filter(|x| x.abs() >= 0.999).count();
    let mut warnings = recording_warnings(path, &info, &mono);
    if peak == 0.0 {
        warnings.push(("warning", format!("{path:?}: it is silent and has no grain").into()));
    }
    if clipped * 1000 > samples.len() {
        warnings.push(("warning", format!("{path:?}: {clipped} samples are clipped").into()));
    }
    let recording = GrainRecording {
        name: path.clone(),
        licence,
        tags: p.tags_of(entry),
        kind,
        guessed: given.is_none(),
        speed: entry.given_speed().map_err(&wrong)?,
        content: audio_digest(info.rate, info.channels, &samples),
        parts: if splits { split_part(p, &whole) } else { vec![whole] },
    };
    Ok((recording, warnings))
}

/// The steady and the transient part of a recording.
fn split_part(p: &GrainRecordingsParams, whole: &Part) -> Vec<Part> {
    let rate = p.rate.as_f64();
    let peaks = PeakRules { threshold: p.threshold, max_peaks: p.sinusoids, ..PeakRules::at_rate(rate) };
    let tracks = TrackRules::at_rate(rate, peaks.hop);
    let parts: Vec<_> = whole.channels.par_iter().map(|x| split(x, peaks, tracks, rate)).collect();
    let (steady, transient) = parts.into_iter().map(|part| (part.steady, part.transient)).unzip();
    vec![
        Part { component: Component::Steady, channels: steady },
        Part { component: Component::Transient, channels: transient },
    ]
}

impl Func for GrainRecordingsNode {
    type Params = GrainRecordingsParams;
    type Ports = GrainRecordingsPorts;
    const NAME: &'static str = "GrainRecordings";
    // Attacks of steady parts are where onsets are.
    const VERSION: u32 = 2;
    // Recordings are named after their files.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &GrainRecordingsParams, s: &mut Shape<'_, '_, GrainRecordingsPorts>) -> Result<(), Reject> {
        let list = RecordingList {
            recordings: &p.recordings,
            folder: p.folder.as_ref(),
            manifest: p.manifest.as_ref(),
            code: RECORDINGS.code,
        };
        let mut all: Vec<ListedRecording<RecordingLabel>> = list.all(s)?;
        if !p.only.0.trim().is_empty() {
            let tags: Vec<Vec<String>> = all.iter().map(|listed| p.tags_of(&listed.entry)).collect();
            let (found, is_exact) = matching_tags(&p.only.0, tags.iter().map(Vec::as_slice));
            if !is_exact {
                let mut words = tags.concat();
                words.sort_unstable();
                words.dedup();
                let reject =
                    Reject::new(RECORDINGS.code, format!("no recording has all tags of {:?}", p.only.0));
                return Err(reject.at("only").help(format!("tags are {}", words.join(", "))));
            }
            all = found.into_iter().map(|k| all[k].clone()).collect();
        }
        for listed in &all {
            if !RECORDINGS.check_one(s, &listed.field, &listed.path) {
                break;
            }
        }
        s.prepare(all);
        Ok(())
    }

    fn eval(
        p: &GrainRecordingsParams,
        cx: &Build<'_>,
        mut io: GrainRecordingsIo<'_>,
    ) -> Result<Summary, Fault> {
        let listed = cx.prepared::<Vec<ListedRecording<RecordingLabel>>>().unwrap_or_default();
        let (mut recordings, mut warnings) = (Vec::with_capacity(listed.len()), Summary::new());
        for (k, one) in listed.iter().enumerate() {
            if (cx.monitor)(k as f64 / listed.len() as f64) {
                return Err(Fault::stopped());
            }
            let (recording, found) = read(p, cx, one)?;
            recordings.push(recording);
            warnings.extend(found);
        }
        let recordings = GrainRecordings { rate: p.rate.as_f64(), recordings };
        let guessed: Vec<String> = recordings
            .recordings
            .iter()
            .filter(|r| r.guessed && r.kind == SourceKind::Continuous)
            .map(|r| r.name.rsplit('/').next().unwrap_or_default().to_owned())
            .collect();
        let mut summary = recordings.summary();
        if !guessed.is_empty() {
            summary.push(("guessed_continuous", guessed.join(", ").into()));
        }
        io.recorded.set(recordings);
        Ok([summary, warnings].concat())
    }

    fn trial(rng: &mut Rng) -> (GrainRecordingsParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let sample = |n: usize| (0.4 * (-(n as f64) / 800.0).exp() * (0.4 * n as f64).sin()) as f32;
        files.insert("knock.wav", trial_wav(&(0..3000).map(sample).collect::<Vec<_>>(), 8000));
        let noise: Vec<f32> = (0..5000).map(|_| rng.between(-0.2, 0.2) as f32).collect();
        files.insert("rub.wav", trial_wav(&noise, 8000));
        files.insert(
            "list.csv",
            "file,tags,kind,speed\nknock.wav,wood hit,impulsive,\nrub.wav,wood rub,,0.3\n",
        );
        let from_list = rng.below(2) == 0;
        let params = GrainRecordingsParams {
            recordings: if from_list { vec!["knock.wav".into(), "rub.wav".into()] } else { Vec::new() },
            folder: None,
            manifest: (!from_list).then(|| "list.csv".into()),
            only: "".into(),
            rate: Rate::hz(8000),
            sinusoids: 1 + rng.below(20),
            ..GrainRecordingsParams::trial(rng)
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests;
