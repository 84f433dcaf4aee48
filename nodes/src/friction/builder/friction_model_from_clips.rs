//! A friction model from recordings without measured speeds, as a value node.

use super::from_clips::{ClipModelParams, Recording, SpeedLaw, from_clips};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::friction::model::{FrictionModel, Source, model_summary};
use crate::io::{MaxLength, RecordingParam, recording_warnings, trial_wav};
use crate::take::Takes;
use crate::unit::UnitSource;
use crate::{choices, params, ports};

choices! {
    /// The law that assigns the unknown speeds to clips.
    pub enum Law {
        /// By rank of level: assumes that the recordings have equal time in every octave of speed.
        LevelRank,
        /// By level: amplitude is a power of speed, fitted to the quietest and the loudest clip.
        Level,
        /// By level: amplitude is speed to the power `exponent`, and the loudest clip is at `fastest`.
        Exponent,
        /// By rank of the spectral centroid: assumes that faster is brighter.
        CentroidRank,
    }
}

params! {
    /// Makes a friction model from cloth recordings without roller and encoder.
    ///
    /// Cloth that slides faster is louder, so clips are ordered by level (or brightness) and assigned speeds from
    /// `slowest` to `fastest`. Shapes and levels of the spectra are measured, the speeds are assumed. The channels of a
    /// recording are averaged.
    ///
    /// # Source
    /// An addition: An, James and Marschner (SIGGRAPH 2012) measure speeds on a roller; so does `FrictionModelBuilder`.
    pub struct FrictionModelFromClipsParams {
        /// Recordings of any rates, up to ten minutes at 192 kHz each.
        recordings: Vec<AssetPath> = Vec::new();
        /// Speed of the quietest usable clip.
        slowest: f64 = 0.05, unit "m/s", range 0.0001..=100.0;
        /// Speed of the loudest clip.
        fastest: f64 = 1.0, unit "m/s", range 0.0002..=1000.0;
        /// Law that assigns speeds to clips.
        law: Law = Law::LevelRank;
        /// Power of speed that amplitude follows, for the law `Exponent`.
        exponent: f64 = 1.0, unit "", range 0.01..=10.0;
        /// Length of a clip.
        clip: f64 = 0.05, unit "s", range 0.001..=10.0;
        /// Time from one clip to the next.
        hop: f64 = 0.0125, unit "s", range 0.0001..=10.0;
        /// Level below the loudest clip at which clips are silence.
        silence: f64 = 40.0, unit "dB", range 0.1..=200.0;
        /// Number of logarithmic bins of speed.
        n_speed: usize = 8, unit "bins", range 2..=1024;
        /// Scales every recording to the level of the loudest, for recordings of different gains.
        match_levels: bool = true;
        /// Cut-off of the high-pass on the spectra; 0 only removes DC.
        high_pass: f64 = 20.0, unit "Hz", range 0.0..=1000.0;
        /// Sliding area in the recordings, by default 0.1 m square. Levels are stored per 1e-4 m^2: four times the
        /// area makes the sound 6 dB softer.
        contact_area: f64 = 0.01, unit "m^2", range 0.000000001..=100.0;
        /// Names of the two materials.
        materials: [Text; 2] = ["cloth".into(), "cloth".into()];
        /// Licence of the recordings; their paths are stored as their provenance.
        licence: Text = "".into();
    }
}

ports! {
    pub struct FrictionModelFromClipsPorts / FrictionModelFromClipsIo {
        in {
            /// Takes of recordings, in addition to `recordings`.
            takes: Option<Value<Takes>>,
        }
        out {
            /// The friction model.
            model: Value<FrictionModel>,
        }
    }
}

/// The node over [`from_clips`].
#[derive(Debug)]
pub struct FrictionModelFromClips;

/// Maximum length of a recording in frames: ten minutes at 192 kHz.
const MAX_FRAMES: u64 = 600 * 192_000;

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F077", max: MaxLength::Frames(MAX_FRAMES) };

impl Func for FrictionModelFromClips {
    type Params = FrictionModelFromClipsParams;
    type Ports = FrictionModelFromClipsPorts;
    const NAME: &'static str = "FrictionModelFromClips";
    const VERSION: u32 = 2;
    // Paths are the provenance of the model's sources.
    const EXPOSES_PATHS: bool = true;

    fn check(
        p: &FrictionModelFromClipsParams,
        s: &mut Shape<'_, '_, FrictionModelFromClipsPorts>,
    ) -> Result<(), Reject> {
        if p.recordings.is_empty() && !s.linked(FrictionModelFromClipsPorts::takes) {
            let reject = Reject::new("F077", "no recording is given").at("recordings");
            s.wrong(reject.help("give `recordings`, or link the `takes` of a TakeCutter"));
        }
        if p.fastest < 1.001 * p.slowest {
            let message = format!("`fastest` is {} m/s, `slowest` {} m/s", p.fastest, p.slowest);
            s.wrong(Reject::new("F077", message).at("fastest").help("it must be at least 0.1 % more"));
        }
        RECORDINGS.check(s, &p.recordings);
        Ok(())
    }

    fn eval(
        p: &FrictionModelFromClipsParams,
        cx: &Build<'_>,
        mut io: FrictionModelFromClipsIo<'_>,
    ) -> Result<Summary, Fault> {
        let (mut sources, mut notices) = (Vec::with_capacity(p.recordings.len()), Summary::new());
        for path in &p.recordings {
            let mut reader = RECORDINGS.open(&path.0, cx.open("recordings", &path.0)?)?;
            let samples = reader.read_mono().map_err(|e| RECORDINGS.unusable(&path.0, e))?;
            notices.extend(recording_warnings(&path.0, reader.info(), &samples));
            let source = Source { provenance: path.0.clone(), licence: p.licence.0.clone() };
            sources.push((samples, f64::from(reader.info().rate), source));
        }
        if let Some(takes) = &io.takes {
            for recording in takes.recordings.iter().filter(|recording| !recording.takes.is_empty()) {
                let UnitSource { provenance, licence, .. } = recording.source.clone();
                sources.push((recording.gated_mono(), takes.rate.as_f64(), Source { provenance, licence }));
            }
        }
        let recordings: Vec<Recording<'_>> = sources
            .iter()
            .map(|(samples, fs, source)| Recording { samples, fs: *fs, source: source.clone() })
            .collect();
        let params = ClipModelParams {
            material_pair: p.materials.clone().map(|name| name.0),
            clip: p.clip,
            hop: p.hop,
            silence: p.silence,
            slowest: p.slowest,
            fastest: p.fastest,
            law: match p.law {
                Law::LevelRank => SpeedLaw::LevelRank,
                Law::Level => SpeedLaw::Level,
                Law::Exponent => SpeedLaw::Exponent(p.exponent),
                Law::CentroidRank => SpeedLaw::CentroidRank,
            },
            n_speed: p.n_speed,
            match_levels: p.match_levels,
            high_pass: p.high_pass,
            contact_area: p.contact_area,
        };
        let model = from_clips(&recordings, &params)
            .map_err(|e| Fault::new("F077", e.to_string()).at("recordings"))?;
        let summary = [model_summary(&model), notices].concat();
        io.model.set(model);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (FrictionModelFromClipsParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        for name in ["a.wav", "b.wav"] {
            let swell = |i: usize| (i as f64 / 4000.0) as f32;
            let samples: Vec<f32> = (0..4000).map(|i| swell(i) * rng.between(-0.5, 0.5) as f32).collect();
            files.insert(name, trial_wav(&samples, 8000));
        }
        let p = FrictionModelFromClipsParams::trial(rng);
        let slowest = p.slowest.min(10.0);
        let params = FrictionModelFromClipsParams {
            recordings: vec!["a.wav".into(), "b.wav".into()],
            slowest,
            fastest: slowest * rng.between(4.0, 90.0),
            clip: rng.between(0.005, 0.05),
            hop: rng.between(0.005, 0.02),
            silence: p.silence.max(30.0),
            exponent: p.exponent.max(0.5),
            ..p
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Random;
    use crate::core::standalone::Standalone;
    use crate::friction::model::friction_model_file::{FrictionModelFile, FrictionModelFileParams};

    fn clips(files: &[&str]) -> Standalone {
        let list = files.iter().map(|f| crate::core::params::Datum::Text((*f).into())).collect();
        let list = crate::core::params::Datum::List(list);
        let p = FrictionModelFromClipsParams::read(&|n| (n == "recordings").then(|| list.clone())).unwrap();
        let mut standalone = Standalone::func::<FrictionModelFromClips>(p);
        let random = Random::new(4, "clips");
        let swell = |i: u64| (0.5 * (i as f64 / 24_000.0) * (random.uniform(0, i, 0) - 0.5)) as f32;
        standalone.files.insert("swell.wav", trial_wav(&(0..24_000).map(swell).collect::<Vec<_>>(), 48_000));
        standalone.files.insert("text.wav", "not audio at all");
        standalone
    }

    #[test]
    fn louder_clips_become_faster_and_the_model_is_read_back_from_its_file() {
        let run = clips(&["swell.wav"]).run().unwrap();
        let value = run.value(0).unwrap();
        let model = value.get::<FrictionModel>().unwrap();
        assert!(model.power(0.9) > 4.0 * model.power(0.1));
        assert_eq!(model.sources[0].provenance, "swell.wav");
        let mut file =
            Standalone::func::<FrictionModelFile>(FrictionModelFileParams { path: "m.json".into() });
        file.files.insert("m.json", value.json());
        let again = file.run().unwrap().value(0).unwrap();
        assert_eq!(again.get::<FrictionModel>(), Some(model));
        file.files.insert("m.json", value.json().replace("\"version\": 1", "\"version\": 9"));
        let reject = file.shape().unwrap_err();
        assert!(reject.code == "F076" && reject.message.contains("version 9"), "{reject}");
    }

    #[test]
    fn a_file_that_is_no_audio_is_named_before_the_run() {
        let reject = clips(&["swell.wav", "text.wav"]).shape().unwrap_err();
        assert!(reject.code == "F077" && reject.message.contains("text.wav"), "{reject}");
        assert_eq!(clips(&[]).shape().unwrap_err().code, "F077");
        assert_eq!(clips(&["gone.wav"]).shape().unwrap_err().code, "F060");
    }
}
