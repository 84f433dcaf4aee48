//! The database builder as a node.

use super::builder::{Augmentation, Gap, Take, build_augmented};
use super::units::{UnitDatabase, UnitSource, database_summary};
use crate::core::content::audio_digest;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::dsp::{Quality, Resampler};
use crate::feature::FeatureConventions;
use crate::io::{AudioReader, MaxLength, RecordingParam, recording_warnings, trial_wav};
use crate::take::Takes;
use crate::{feature_params, ports};
use rayon::prelude::*;

feature_params! {
    /// Cuts recordings into short units with features, from which `UnitSelector` chooses.
    ///
    /// Every channel of every recording (with `joint` every recording) is a gap-free segment. With `gap`, silence splits it into
    /// further segments. No filter and no selection crosses the end of a segment. Each segment has its mean removed, is high-passed
    /// and cut into units; a remainder at its end is dropped. Recordings are resampled to `rate`.
    ///
    /// A short database has few sounds of each level and brightness. `augment` adds copies of all recordings at other speeds and levels, so that
    /// more units are near to a target. A selector takes units that differ in level only for the same one. Correspondences and reports of likeness
    /// refer to the recordings themselves.
    ///
    /// `takes` of a `TakeCutter` are added after the `recordings`, each take as a segment.
    ///
    /// The features must have the same parameters as those of the target: set them on `Mfcc` and `TemporalGaussian`.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), sections 4.1 and 4.2.
    pub struct UnitDatabaseParams {
        /// The recordings, of any rates and lengths.
        recordings: Vec<AssetPath> = Vec::new();
        /// Tag of each recording, such as a material or a cause; one for each, one for all, or none.
        tags: Vec<Text> = Vec::new();
        /// Rate of the units; that of the target.
        rate: Rate = Rate::hz(48_000);
        /// Keep the channels of a recording together in one feature vector, as for binaural recordings.
        joint: bool = false;
        /// Width of the Gaussian over time for each coefficient, or one for all; as in `TemporalGaussian`.
        widths: Vec<f64> = vec![20.0, 50.0, 10.0], unit "units", range 0.0..=10_000.0;
        /// Use only the past half of that Gaussian.
        causal: bool = false;
        /// Duration of a silence that splits a recording into segments; None never splits.
        gap: Option<f64> = None, unit "s", range 0.001..=60.0;
        /// Peak level below which it is silent.
        gap_level: f64 = -80.0, unit "dB", range -200.0..=0.0;
        /// Add copies of the recordings at other speeds and levels (data augmentation). None: where the recordings have less than 30 s.
        augment: Option<bool> = None;
        /// Speeds of the copies, as factors; they change the pitch as well.
        speeds: Vec<f64> = vec![0.84, 1.19], unit "", range 0.25..=4.0;
        /// Levels of the copies.
        gains: Vec<f64> = vec![-8.0, -16.0], unit "dB", range -60.0..=20.0;
        /// The licence of the recordings; their paths are their provenance.
        licence: Text = "".into();
    }
}

ports! {
    pub struct UnitDatabasePorts / UnitDatabaseIo {
        in {
            /// Takes of recordings.
            takes: Option<Value<Takes>>,
        }
        out {
            /// The units.
            database: Value<UnitDatabase>,
        }
    }
}

/// The node over [`build_augmented`].
#[derive(Debug)]
pub struct UnitDatabaseNode;

/// Longest recording, in frames: half an hour at 192 kHz.
const MAX_FRAMES: u64 = 1800 * 192_000;

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F101", max: MaxLength::Frames(MAX_FRAMES) };

/// Recordings with less than this, s, are augmented by default.
const SHORT: f64 = 30.0;

fn augmentation(p: &UnitDatabaseParams, takes: &[Take<'_>]) -> Augmentation {
    let seconds = takes.iter().map(Take::used).sum::<usize>() as f64 / p.rate.as_f64();
    match p.augment.unwrap_or(seconds < SHORT) {
        true => Augmentation { speeds: p.speeds.clone(), gains: p.gains.clone() },
        false => Augmentation::default(),
    }
}

fn conventions(p: &UnitDatabaseParams, joined: u32) -> Result<FeatureConventions, Reject> {
    crate::feature::params::check_widths(&p.widths, p.n)?;
    p.convention_params(&p.widths, p.causal).conventions(p.rate, joined)
}

/// A recording at another rate, channel by channel, and a digest of its content.
fn read(reader: &mut AudioReader<'_>, from: Rate, to: Rate) -> Result<(Vec<Vec<f32>>, String), Reject> {
    let failed = |e: &dyn std::fmt::Display| RECORDINGS.unusable("", e);
    let channels = reader.info().channels.max(1);
    let mut samples = vec![0.0; reader.info().frames as usize * channels];
    let frames = reader.read(&mut samples).map_err(|e| failed(&e))?;
    samples.truncate(frames * channels);
    let digest = audio_digest(reader.info().rate, channels, &samples);
    let resampler = Resampler::new(from, to, Quality::High).map_err(|e| failed(&e))?;
    let all: Result<_, Reject> = (0..channels)
        .into_par_iter()
        .map(|channel| {
            let x: Vec<f32> = samples.iter().skip(channel).step_by(channels).copied().collect();
            if from == to { Ok(x) } else { resampler.whole(&x).map_err(|e| failed(&e)) }
        })
        .collect();
    Ok((all?, digest))
}

fn source(p: &UnitDatabaseParams, k: usize, content: String) -> UnitSource {
    let tag = p.tags.get(k).or(if p.tags.len() == 1 { p.tags.first() } else { None });
    UnitSource {
        provenance: p.recordings.get(k).map(|path| path.0.clone()).unwrap_or_default(),
        licence: p.licence.0.clone(),
        tag: tag.map(|tag| tag.0.clone()).unwrap_or_default(),
        content,
    }
}

impl Func for UnitDatabaseNode {
    type Params = UnitDatabaseParams;
    type Ports = UnitDatabasePorts;
    const NAME: &'static str = "UnitDatabase";
    const VERSION: u32 = 5;
    // They are the provenance of the database's sources.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &UnitDatabaseParams, s: &mut Shape<'_, '_, UnitDatabasePorts>) -> Result<(), Reject> {
        if p.recordings.is_empty() && !s.linked(UnitDatabasePorts::takes) {
            let reject = Reject::new("F101", "there is no recording").at("recordings");
            return Err(reject.help("give `recordings`, or link the `takes` of a TakeCutter"));
        }
        if p.tags.len() > 1 && p.tags.len() != p.recordings.len() {
            let message = format!("{} tags for {} recordings", p.tags.len(), p.recordings.len());
            s.wrong(Reject::new("F051", message).at("tags").help("give one for each, one for all, or none"));
        }
        s.check(conventions(p, 1));
        RECORDINGS.check(s, &p.recordings);
        Ok(())
    }

    fn eval(p: &UnitDatabaseParams, cx: &Build<'_>, mut io: UnitDatabaseIo<'_>) -> Result<Summary, Fault> {
        let (mut takes, mut warnings) = (Vec::with_capacity(p.recordings.len()), Summary::new());
        for (k, path) in p.recordings.iter().enumerate() {
            let mut file = RECORDINGS.open(&path.0, cx.open("recordings", &path.0)?)?;
            let rate = Rate::new(u64::from(file.info().rate), 1)
                .ok_or_else(|| RECORDINGS.unusable(&path.0, "its rate is 0"))?;
            let (channels, content) = read(&mut file, rate, p.rate).map_err(|e| Reject {
                message: format!("{:?}{}", path.0, e.message.trim_start_matches("\"\"")),
                ..e
            })?;
            // The database removes its mean.
            warnings.extend(recording_warnings(&path.0, file.info(), &[]));
            takes.push(Take { channels: channels.into(), spans: None, source: source(p, k, content) });
        }
        let prepared = io.takes.map(|prepared| prepared.at_rate(p.rate)).transpose();
        let prepared = prepared.map_err(|e| Fault::new("F101", e.to_string()).at("takes"))?;
        for recording in prepared.iter().flat_map(|prepared| &prepared.recordings) {
            let (spans, source) = (Some(recording.takes.clone()), recording.source.clone());
            takes.push(Take { channels: (&recording.channels[..]).into(), spans, source });
        }
        let joined = if p.joint { takes.first().map_or(1, |take| take.channels.len()) } else { 1 };
        let conventions = conventions(p, joined as u32)?;
        let gap = p.gap.map(|seconds| Gap {
            samples: (seconds * p.rate.as_f64()).round() as usize,
            level: 10f64.powf(p.gap_level / 20.0) as f32,
        });
        let db = build_augmented(&takes, &conventions, gap, &augmentation(p, &takes));
        let db = db.map_err(|e| Fault::new("F101", e.to_string()).at("recordings"))?;
        drop(takes);
        if db.audio.iter().all(|x| *x == 0.0) {
            warnings.push(("warning", "all recordings are silent, and so is everything made of them".into()));
        }
        let summary = [database_summary(&db), warnings].concat();
        io.database.set(db);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (UnitDatabaseParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let samples: Vec<f32> = (0..2000).map(|_| rng.between(-0.5, 0.5) as f32).collect();
        files.insert("a.wav", trial_wav(&samples, 8000));
        files.insert("b.wav", trial_wav(&samples[500..], 4000));
        let p = UnitDatabaseParams::trial(rng);
        let first = p.first % 3;
        let n = 1 + p.n % 4;
        let params = UnitDatabaseParams {
            recordings: vec!["a.wav".into(), "b.wav".into()],
            tags: Vec::new(),
            rate: Rate::hz([4000, 8000][rng.below(2)]),
            widths: vec![rng.between(0.0, 30.0)],
            gap: None,
            first,
            n,
            bands: p.bands.map(|bands| first + n + bands % 5),
            f_lo: p.f_lo % 100.0,
            f_hi: 200.0 + p.f_hi % 4000.0,
            frame: p.frame.map(|frame| 1 + frame % 12),
            high_pass: p.high_pass % 1000.0,
            ..p
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests;
