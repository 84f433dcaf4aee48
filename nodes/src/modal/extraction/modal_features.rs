//! Modes of many recordings with their uncertainties, as a node.

use super::extract::{ExtractParams, Extracted, extract};
use super::feature::{FeatureSet, FeatureSets};
use super::onset::impacts;
use super::report::{ExtractionReport, PICTURE, RINGING, RecordingReport, spectrogram};
use super::surrogate::surrogate;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::io::{MaxLength, RecordingParam, recording_warnings, trial_wav};
use crate::plot::Image;
use crate::{choices, params, ports};

choices! {
    /// What becomes of a recording with several impacts.
    pub enum Split {
        /// An error that names the onsets.
        None,
        /// The first impact counts, up to the next one.
        First,
        /// Each impact counts as a recording.
        All,
    }
}

params! {
    /// Modes of recordings of impacts, with uncertainties, for a `FeatureGate` and a `DampingFit`.
    ///
    /// Each recording is explained by damped sines, as in `ModalFromRecording`. Their frequencies and decay rates have standard deviations,
    /// which follow from what is left unexplained around each mode. A tap of `report` as SVG draws the modes into spectrograms; as JSON it
    /// lists what was found. A recording rings if it is explained better by 5 dB than noise with the same spectrogram, its surrogate: dull
    /// thuds are explained as well as their surrogates, and their modes say little of the material. Surrogates depend on the index of the
    /// recording only.
    ///
    /// # Source
    /// Sirdey et al., "Modal analysis of impact sounds with ESPRIT in Gabor transforms" (DAFx 2011); Sterling et al.,
    /// "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5), 2019), section 4.1.
    pub struct ModalFeaturesParams {
        /// The recordings, of at most a minute each.
        recordings: Vec<AssetPath>;
        /// Name of the object that was struck; recordings of one object share modes.
        object: Text = "".into();
        /// What becomes of a recording with several impacts.
        split: Split = Split::None;
        /// Maximum number of modes of each recording.
        count: usize = 64, unit "modes", range 1..=1024;
        /// Lowest frequency of a mode.
        lowest: f64 = 20.0, unit "Hz", range 1.0..=100_000.0;
        /// Highest frequency of a mode; at most 0.45 of the recording's rate.
        highest: f64 = 20_000.0, unit "Hz", range 2.0..=200_000.0;
        /// True to compare each recording with its surrogate, which takes as long as the recording.
        surrogate: bool = true;
    }
}
ports! {
    pub struct ModalFeaturesPorts / ModalFeaturesIo {
        in {}
        out {
            /// The modes of the object of each recording: those that decay by less than 500 1/s at a certain rate.
            features: Value<FeatureSets>,
            /// What was found, with spectrograms.
            report: Value<ExtractionReport>,
        }
    }
}

/// The node over [`extract`].
#[derive(Debug)]
pub struct ModalFeatures;

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F077", max: MaxLength::Seconds(60) };
/// Number of samples in a row at the peak that are clipped.
const CLIPPED: usize = 3;
/// Largest relative standard deviation of a certain decay rate.
const UNCERTAINTY: f64 = 0.3;
/// Decay rate below which that of a room is suspected, as multiples of the slowest mode.
const ROOM: f64 = 1.3;

/// Warnings of one impact.
fn warnings(samples: &[f32], found: &Extracted) -> Vec<String> {
    let mut out = Vec::new();
    let peak = samples.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    // The crest of a wave that decays reaches the peak once; what is clipped does so again and again.
    let runs = samples.chunk_by(|a, b| a == b).filter(|run| run.len() >= CLIPPED && run[0].abs() == peak);
    let clipped = runs.count();
    if clipped > 1 {
        out.push(format!("clipped in {clipped} stretches: record with less gain"));
    }
    let mut decays: Vec<f64> =
        found.features.iter().filter(|f| f.is_certain(UNCERTAINTY)).map(|f| f.decay).collect();
    decays.sort_by(f64::total_cmp);
    // In a room nothing decays more slowly than its sound: the slow half of the modes has one decay.
    if decays.len() >= 8 && decays[0] > 5.0 && decays[decays.len() / 2] < ROOM * decays[0] {
        out.push(format!(
            "half of the modes decay at {:.1} to {:.1} 1/s at all frequencies, as the sound of a room does: record in a dry room",
            decays[0],
            decays[decays.len() / 2]
        ));
    }
    out
}

impl Func for ModalFeatures {
    type Params = ModalFeaturesParams;
    type Ports = ModalFeaturesPorts;
    const NAME: &'static str = "ModalFeatures";
    // Recordings are named after their files.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &ModalFeaturesParams, s: &mut Shape<'_, '_, ModalFeaturesPorts>) -> Result<(), Reject> {
        if p.highest <= p.lowest {
            let message = format!("`highest` is {} Hz, `lowest` {} Hz", p.highest, p.lowest);
            s.wrong(Reject::new("F077", message).at("highest").help("it must be more"));
        }
        if p.recordings.is_empty() {
            return Err(Reject::new("F077", "there is no recording").at("recordings"));
        }
        RECORDINGS.check(s, &p.recordings);
        Ok(())
    }

    fn eval(p: &ModalFeaturesParams, cx: &Build<'_>, mut io: ModalFeaturesIo<'_>) -> Result<Summary, Fault> {
        let params = ExtractParams { modes: p.count, lowest: p.lowest, highest: p.highest, contact: true };
        let (mut sets, mut reports, mut summary) = (Vec::new(), Vec::new(), Summary::new());
        for path in p.recordings.iter().map(|path| &path.0) {
            let (samples, info) = RECORDINGS.read_mono(cx, path)?;
            let rate = f64::from(info.rate);
            let mut parts = impacts(&samples, rate);
            if parts.len() > 1 && p.split == Split::None {
                let times: Vec<String> =
                    parts.iter().map(|part| format!("{:.3} s", part.start as f64 / rate)).collect();
                let message = format!("{path:?}: {} impacts, at {}", parts.len(), times.join(", "));
                let reject = Reject::new("F077", message).at("recordings");
                return Err(reject.help("`split: First` or `split: All`, or one impact in each file").into());
            }
            if p.split == Split::First {
                parts.truncate(1);
            }
            let several = parts.len() > 1;
            for (k, part) in parts.into_iter().enumerate() {
                let name = if several { format!("{path} #{}", k + 1) } else { path.clone() };
                let sound = &samples[part.clone()];
                let found = extract(sound, rate, &params).map_err(|e| RECORDINGS.unusable(&name, e))?;
                let after = &sound[found.onset..];
                let surrogate_db = p.surrogate.then(|| {
                    let noise = surrogate(after, sets.len() as u64);
                    extract(&noise, rate, &params).map_or(0.0, |found| found.residual_db)
                });
                let (pixels, seconds) =
                    spectrogram(&after.iter().map(|x| f64::from(*x)).collect::<Vec<_>>(), rate);
                let certain: Vec<_> =
                    found.features.iter().filter(|f| f.is_certain(UNCERTAINTY)).copied().collect();
                reports.push(RecordingReport {
                    recording: name.clone(),
                    onset_s: (part.start + found.onset) as f64 / rate,
                    modes: found.features.len(),
                    certain: certain.len(),
                    unexplained_db: found.residual_db,
                    unexplained_after_5_ms_db: found.late_residual_db,
                    surrogate_db,
                    ringing: surrogate_db.map(|db| found.residual_db <= db - RINGING),
                    warnings: warnings(sound, &found),
                    features: certain.clone(),
                    picture: Image::grey(PICTURE, &pixels).unwrap_or_default(),
                    seconds,
                });
                let object =
                    if p.object.0.is_empty() { p.recordings[0].0.clone() } else { p.object.0.clone() };
                sets.push(FeatureSet { recording: name, object, features: certain });
            }
            summary.extend(recording_warnings(path, &info, &samples));
        }
        let worst = reports.iter().map(|r| r.unexplained_db).fold(f64::NEG_INFINITY, f64::max);
        summary.push(("recordings", reports.len().into()));
        summary.push(("features", sets.iter().map(|s| s.features.len()).sum::<usize>().into()));
        summary.push(("largest_unexplained_db", worst.into()));
        if p.surrogate {
            summary.push(("ringing", reports.iter().filter(|r| r.ringing == Some(true)).count().into()));
        }
        for report in &reports {
            for text in &report.warnings {
                summary.push(("warning", format!("{}: {text}", report.recording).into()));
            }
            if report.certain == 0 {
                let text = format!(
                    "{}: no mode has a certain decay: it says nothing of the material",
                    report.recording
                );
                summary.push(("warning", text.into()));
            }
        }
        io.features.set(FeatureSets { sets });
        io.report.set(ExtractionReport { recordings: reports });
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (ModalFeaturesParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let (f, d) = (rng.between(200.0, 2000.0), rng.between(5.0, 30.0));
        let sample = |n: usize| {
            let t = n as f64 / 8000.0;
            (0.5 * (-d * t).exp() * (std::f64::consts::TAU * f * t).sin()) as f32
        };
        files.insert("hit.wav", trial_wav(&(0..4000).map(sample).collect::<Vec<_>>(), 8000));
        let p = ModalFeaturesParams::trial(rng);
        let params = ModalFeaturesParams {
            recordings: vec!["hit.wav".into()],
            split: Split::First,
            count: 1 + rng.below(8),
            lowest: rng.between(10.0, 100.0),
            highest: rng.between(2500.0, 5000.0),
            ..p
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::params::Datum;
    use crate::core::standalone::{Standalone, StandaloneRun};

    fn run(sounds: &[Vec<f32>], split: &'static str) -> Result<StandaloneRun, Fault> {
        let names: Vec<String> = (0..sounds.len()).map(|k| format!("{k}.wav")).collect();
        let list = Datum::List(names.iter().map(|n| Datum::Text(n.clone())).collect());
        let p = ModalFeaturesParams::read(&|name| match name {
            "recordings" => Some(list.clone()),
            "split" => Some(Datum::Name(split.into())),
            _ => None,
        })
        .unwrap();
        let mut standalone = Standalone::func::<ModalFeatures>(p);
        for (name, sound) in names.iter().zip(sounds) {
            standalone.files.insert(name, trial_wav(sound, 44_100));
        }
        standalone.run()
    }

    const MODES: [(f64, f64); 5] =
        [(440.0, 6.0), (1100.0, 9.0), (2500.0, 20.0), (6000.0, 50.0), (11_000.0, 90.0)];

    fn ring(onsets: &[usize]) -> Vec<f32> {
        let mode = |t: f64| {
            MODES.iter().map(|(f, d)| (-d * t).exp() * (std::f64::consts::TAU * f * t).cos()).sum::<f64>()
        };
        let sample = |n: usize| {
            let impact = |at: &usize| n.checked_sub(*at).map_or(0.0, |n| 0.1 * mode(n as f64 / 44_100.0));
            onsets.iter().map(impact).sum::<f64>() as f32
        };
        (0..66_150).map(sample).collect()
    }

    #[test]
    fn a_bell_rings_and_noise_does_not() {
        let mut rng = Rng::new(8);
        let thud: Vec<f32> = (0..44_100)
            .map(|n| (0.5 * (-f64::from(n) / 900.0).exp() * rng.between(-1.0, 1.0)) as f32)
            .collect();
        let run = run(&[ring(&[2000]), thud], "None").unwrap();
        let report = run.value(1).unwrap().get::<ExtractionReport>().unwrap().clone();
        let [bell, thud] = [&report.recordings[0], &report.recordings[1]];
        assert_eq!((bell.ringing, thud.ringing), (Some(true), Some(false)), "{:?}", thud.surrogate_db);
        let sets = run.value(0).unwrap().get::<FeatureSets>().unwrap().clone();
        for (f, d) in MODES {
            let near = sets.sets[0].features.iter().find(|q| (q.freq_hz - f).abs() < 0.5).unwrap();
            assert!((near.decay / d - 1.0).abs() < 0.01, "{near:?}");
        }
        assert!(report.plot().unwrap().contains("surrogate"));
    }

    #[test]
    fn several_impacts_are_an_error_unless_they_are_split() {
        let sound = ring(&[2000, 30_000]);
        let fault = run(std::slice::from_ref(&sound), "None").err().unwrap();
        assert!(fault.code == "F077" && fault.message.contains("2 impacts, at 0.000 s, 0.67"), "{fault:?}");
        let count = |split| {
            let run = run(std::slice::from_ref(&sound), split).unwrap();
            run.value(0).unwrap().get::<FeatureSets>().unwrap().sets.len()
        };
        assert_eq!((count("First"), count("All")), (1, 2));
    }

    #[test]
    fn clipped_and_silent_recordings_are_named() {
        let clipped: Vec<f32> = ring(&[2000]).iter().map(|x| (4.0 * x).clamp(-0.5, 0.5)).collect();
        let run_clipped = run(&[clipped], "None").unwrap();
        assert!(
            run_clipped.summary.iter().any(|(k, t)| *k == "warning" && t.to_string().contains("clipped"))
        );
        let fault = run(&[vec![0.0; 20_000]], "None").err().unwrap();
        assert!(fault.message.contains("silent"), "{fault:?}");
    }
}
