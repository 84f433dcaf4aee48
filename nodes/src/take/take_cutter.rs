//! Takes of raw recordings, as a value node.

use rayon::prelude::*;

use super::cutting::{TakeRules, cut, loudest_level};
use super::takes::{CutRecording, Takes};
use crate::core::content::audio_digest;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, FolderPath, Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::dsp::{Band, Butterworth};
use crate::io::manifest::ManifestEntry;
use crate::io::{
    ListedRecording, MaxLength, RecordingList, RecordingParam, Whole, recording_warnings, trial_wav,
};
use crate::unit::UnitSource;
use crate::unit::database::builder::clean;
use crate::{params, ports};

params! {
    /// Cuts the takes out of raw recordings, for unit databases, friction models and crumple banks.
    ///
    /// Each recording is resampled to `rate`, high-passed against rumble, and gated: a take begins where the level exceeds the noise
    /// floor by `open`, and ends where it has stayed less than `close` above it for `hold`. The noise floor is the level that the
    /// quietest 3 % of the recording are below. A recording whose level never exceeds the floor by `open` is steady noise: it is one
    /// take, with a warning. Silent recordings and too short takes are dropped, and reported.
    ///
    /// `--tap NODE.takes=takes.svg` draws the takes in the levels of the recordings. The gate is an addition.
    pub struct TakeCutterParams {
        /// The recordings, of any rates and at most ten minutes each.
        recordings: Vec<AssetPath> = Vec::new();
        /// A folder whose recordings are added, in order of their names.
        folder: Option<FolderPath> = None;
        /// CSV of recordings that are added, with the columns `file` (relative to the CSV), and optionally `tag` and `licence`.
        manifest: Option<AssetPath> = None;
        /// Tag of recordings without one of their own, such as a material or a cause.
        tag: Text = "".into();
        /// The licence of recordings without one of their own; their paths are their provenance.
        licence: Text = "".into();
        /// Rate to which recordings are resampled.
        rate: Rate = Rate::hz(48_000);
        /// Cut-off of the high-pass against rumble; 0 for none.
        high_pass: f64 = 80.0, unit "Hz", range 0.0..=2000.0;
        /// Level of the noise floor; None to measure that of each recording.
        floor: Option<f64> = None, unit "dB", range -200.0..=0.0;
        /// Level above the noise floor at which a take begins.
        open: f64 = 12.0, unit "dB", range 0.0..=120.0;
        /// Level above the noise floor below which it ends.
        close: f64 = 8.0, unit "dB", range 0.0..=120.0;
        /// Time for which the level must stay below that.
        hold: f64 = 0.05, unit "s", range 0.0..=10.0;
        /// Window of the level.
        window: f64 = 0.01, unit "s", range 0.001..=1.0;
        /// Time that a take begins earlier.
        lead: f64 = 0.01, unit "s", range 0.0..=1.0;
        /// Time that a take ends later.
        tail: f64 = 0.03, unit "s", range 0.0..=10.0;
        /// Length below which a take is dropped.
        min_len: f64 = 0.1, unit "s", range 0.0..=60.0;
        /// Level to which the loudest twentieth of the takes of each recording is brought, for recordings of different gains; None
        /// leaves levels as they are.
        level: Option<f64> = None, unit "dB", range -120.0..=0.0;
    }
}
ports! {
    pub struct TakeCutterPorts / TakeCutterIo {
        in {}
        out {
            /// The takes.
            takes: Value<Takes>,
        }
    }
}

/// The node over [`cut`].
#[derive(Debug)]
pub struct TakeCutter;

/// A line of a manifest.
#[derive(Clone, Debug, Default, PartialEq)]
struct TakeLabel {
    file: String,
    tag: String,
    licence: String,
}

impl ManifestEntry for TakeLabel {
    const NAME: &'static str = "recording";
    const COLUMNS: &'static str = "file, and optionally tag, licence";

    fn field(column: &str) -> Option<fn(&mut Self) -> &mut String> {
        Some(match column {
            "file" => |label| &mut label.file,
            "tag" => |label| &mut label.tag,
            "licence" => |label| &mut label.licence,
            _ => return None,
        })
    }
}

/// Recordings that are read at the same time; the progress is reported after them.
const AT_ONCE: usize = 32;
/// Order of the high-pass.
const HIGH_PASS_ORDER: usize = 4;

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F101", max: MaxLength::Seconds(600) };

fn rules(p: &TakeCutterParams) -> TakeRules {
    let TakeCutterParams { floor, open, close, hold, window, lead, tail, min_len, .. } = *p;
    TakeRules { floor, open, close, hold, window, lead, tail, min_len }
}

/// Reads and cuts one recording; the summary lists the parts that were dropped, and warnings.
fn read(
    p: &TakeCutterParams,
    cx: &Build<'_>,
    listed: &ListedRecording<TakeLabel>,
    design: Option<&Butterworth>,
) -> Result<(CutRecording, Summary), Fault> {
    let ListedRecording { path, field, entry } = listed;
    let Whole { mut channels, samples, info } = RECORDINGS.read_whole(cx, field, path, p.rate)?;
    let clipped = samples.iter().filter(|x| x.abs() >= 0.999).count();
    let content = audio_digest(info.rate, info.channels, &samples);
    let mut warnings = recording_warnings(path, &info, &[]);
    let mut warn = |text: String| warnings.push(("warning", format!("{path:?}: {text}").into()));
    if clipped * 1000 > samples.len() {
        warn(format!("{clipped} samples are clipped"));
    }
    drop(samples);
    channels.par_iter_mut().for_each(|x| *x = clean(x, design, 0));
    let fs = p.rate.as_f64();
    let found = cut(&channels, fs, &rules(p));
    match found.floor {
        None => warn("it is silent and is dropped".into()),
        Some(_) if found.steady => warn(format!(
            "its level varies by {:.1} dB only, so it is steady noise or one steady sound, and is one take; leave it out if \
             it is the noise of a room",
            found.spread
        )),
        Some(floor) if found.takes.is_empty() => warn(format!(
            "it has {} takes, all shorter than `min_len` {} s, and is dropped; its noise floor is {floor:.1} dB",
            found.short, p.min_len
        )),
        Some(_) => {}
    }
    let mut gain = 1.0;
    if let Some(level) = p.level.zip(loudest_level(&channels, &found.takes, fs, p.window)) {
        gain = 10f64.powf((level.0 - level.1) / 20.0);
        channels.iter_mut().flatten().for_each(|x| *x = (f64::from(*x) * gain) as f32);
    }
    if found.takes.is_empty() {
        // It stays as a source without sound, so that the numbers of recordings stay.
        channels.iter_mut().for_each(Vec::clear);
    }
    let own = |own: &String, all: &Text| if own.is_empty() { all.0.clone() } else { own.clone() };
    let recording = CutRecording {
        source: UnitSource {
            provenance: path.clone(),
            licence: own(&entry.licence, &p.licence),
            tag: own(&entry.tag, &p.tag),
            content,
        },
        channels,
        takes: found.takes,
        floor: found.floor.unwrap_or(super::cutting::DIGITAL_SILENCE),
        gain,
    };
    if found.short > 0 {
        warnings.push(("short_takes", found.short.into()));
    }
    Ok((recording, warnings))
}

impl Func for TakeCutter {
    type Params = TakeCutterParams;
    type Ports = TakeCutterPorts;
    const NAME: &'static str = "TakeCutter";
    // Paths are the provenance of the takes.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &TakeCutterParams, s: &mut Shape<'_, '_, TakeCutterPorts>) -> Result<(), Reject> {
        let list = RecordingList {
            recordings: &p.recordings,
            folder: p.folder.as_ref(),
            manifest: p.manifest.as_ref(),
            code: RECORDINGS.code,
        };
        let all: Vec<ListedRecording<TakeLabel>> = list.all(s)?;
        if p.close > p.open {
            let message = format!("`close` is {} dB, above `open`, {} dB", p.close, p.open);
            s.wrong(
                Reject::new("F051", message)
                    .at("close")
                    .help("a take ends below the level at which it begins"),
            );
        }
        for listed in &all {
            if !RECORDINGS.check_one(s, &listed.field, &listed.path) {
                break;
            }
        }
        s.prepare(all);
        Ok(())
    }

    fn eval(p: &TakeCutterParams, cx: &Build<'_>, mut io: TakeCutterIo<'_>) -> Result<Summary, Fault> {
        let listed = cx.prepared::<Vec<ListedRecording<TakeLabel>>>().unwrap_or_default();
        let design = match p.high_pass > 0.0 {
            true => {
                let design =
                    Butterworth::design(Band::HighPass, HIGH_PASS_ORDER, p.high_pass, p.rate.as_f64());
                Some(design.map_err(|e| Reject::from(e).at("high_pass"))?)
            }
            false => None,
        };
        let (mut recordings, mut warnings, mut short) =
            (Vec::with_capacity(listed.len()), Summary::new(), 0.0);
        for some in listed.chunks(AT_ONCE) {
            if (cx.monitor)(recordings.len() as f64 / listed.len() as f64) {
                return Err(Fault::stopped());
            }
            let read: Vec<_> = some.par_iter().map(|one| read(p, cx, one, design.as_ref())).collect();
            for one in read {
                let (recording, found) = one?;
                for (name, value) in found {
                    match name {
                        "short_takes" => short += value.as_f64().unwrap_or(0.0),
                        _ => warnings.push((name, value)),
                    }
                }
                recordings.push(recording);
            }
        }
        let fs = p.rate.as_f64();
        let takes = Takes { rate: p.rate, recordings };
        if takes.count() == 0 {
            let message = "no recording has a take: all are silent, or shorter than `min_len`";
            return Err(Fault::new("F101", message)
                .at("recordings")
                .help("give louder or longer recordings"));
        }
        let total: usize = takes.recordings.iter().map(CutRecording::len).sum();
        let inside: usize = takes.recordings.iter().map(CutRecording::samples_in_takes).sum();
        let mut summary: Summary = vec![
            ("recordings", takes.recordings.len().into()),
            ("takes", takes.count().into()),
            ("seconds", (inside as f64 / fs).into()),
            ("share_in_takes", (inside as f64 / total.max(1) as f64).into()),
            ("short_takes", (short as usize).into()),
        ];
        summary.extend(warnings);
        io.takes.set(takes);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (TakeCutterParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        for name in ["a.wav", "b.wav"] {
            let level = |i: usize| if i % 2000 < 1200 { 0.5 } else { 0.002 };
            let samples: Vec<f32> = (0..6000).map(|i| (level(i) * rng.between(-0.5, 0.5)) as f32).collect();
            files.insert(name, trial_wav(&samples, 8000));
        }
        let params = TakeCutterParams {
            recordings: vec!["a.wav".into(), "b.wav".into()],
            folder: None,
            manifest: None,
            rate: Rate::hz([4000, 8000][rng.below(2)]),
            high_pass: rng.between(0.0, 200.0),
            floor: None,
            open: rng.between(8.0, 20.0),
            close: rng.between(0.0, 8.0),
            hold: rng.between(0.0, 0.1),
            window: rng.between(0.005, 0.02),
            min_len: rng.between(0.0, 0.1),
            level: Some(rng.between(-40.0, -20.0)),
            ..TakeCutterParams::trial(rng)
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests;
