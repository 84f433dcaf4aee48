//! Modes from a recording, as a value node.

use super::extract::{ExtractParams, extract};
use super::onset::{impacts, loudest_impact};
use super::trial::trial_impact;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::io::{MaxLength, RecordingParam, recording_warnings};
use crate::modal::mode::modes::Modes;
use crate::{params, ports};

params! {
    /// Modes of an object from a recording of one impact on it.
    ///
    /// Damped sines are found in bands of the sound after the impact. The ones that explain most of the energy together are selected and
    /// refined jointly. No amplitude exceeds four times the peak of the recording. Several channels are averaged. Of several impacts the
    /// loudest counts, up to the next one. The summary lists the number of modes, the time of the impact, and the energy of the
    /// residual: over the whole sound, and from 5 ms after the impact on.
    ///
    /// # Source
    /// Sirdey, Derrien, Kronland-Martinet and Aramaki, "Modal analysis of impact sounds with ESPRIT in Gabor transforms" (DAFx 2011);
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 5, who give no
    /// method.
    pub struct ModalFromRecordingParams {
        /// The recording, of at most a minute.
        recording: AssetPath;
        /// Maximum number of modes.
        count: usize = 64, unit "modes", range 1..=1024;
        /// Lowest frequency of a mode.
        lowest: f64 = 20.0, unit "Hz", range 1.0..=100_000.0;
        /// Highest frequency of a mode; at most 0.45 of the recording's rate.
        highest: f64 = 20_000.0, unit "Hz", range 2.0..=200_000.0;
        /// True to include the parts of the contact: those that decay faster than 500 1/s or whose decay is uncertain. They complete
        /// the onset of an impact; without them `ModalResidual` does, and sliding and rolling have the sound of the object alone.
        contact: bool = false;
        /// Impulse of the recorded impact, if known: an impact of this impulse sounds as loud as the recording.
        impulse: f64 = 0.05, unit "N s", range 0.000000001..=1_000_000.0;
        /// True to start modes with their phases in the recording, false to start them as sines.
        phases: bool = true;
    }
}
ports! {
    pub struct ModalFromRecordingPorts / ModalFromRecordingIo {
        in {}
        out {
            /// The modes.
            modes: Value<Modes>,
        }
    }
}

/// The node over [`extract`].
#[derive(Debug)]
pub struct ModalFromRecording;

/// Energy of the residual in dB above which there is a warning: half of the recording.
const MAX_RESIDUAL: f64 = -3.0;
/// Maximum length of a recording, in seconds.
const MAX_SECONDS: u64 = 60;

const RECORDING: RecordingParam =
    RecordingParam { name: "recording", code: "F077", max: MaxLength::Seconds(MAX_SECONDS) };

impl Func for ModalFromRecording {
    type Params = ModalFromRecordingParams;
    type Ports = ModalFromRecordingPorts;
    const NAME: &'static str = "ModalFromRecording";
    const VERSION: u32 = 4;
    // The modes are named after the recording.
    const EXPOSES_PATHS: bool = true;

    fn check(
        p: &ModalFromRecordingParams,
        s: &mut Shape<'_, '_, ModalFromRecordingPorts>,
    ) -> Result<(), Reject> {
        if p.highest <= p.lowest {
            let message = format!("`highest` is {} Hz, `lowest` {} Hz", p.highest, p.lowest);
            s.wrong(Reject::new("F077", message).at("highest").help("it must be more"));
        }
        let path = &p.recording.0;
        let reader = RECORDING.open(path, s.open("recording", path)?)?;
        s.hold("recording", path, reader.info().bytes())?;
        reader.info().warning_texts(path).for_each(|text| s.note(text));
        Ok(())
    }

    fn eval(
        p: &ModalFromRecordingParams,
        cx: &Build<'_>,
        mut io: ModalFromRecordingIo<'_>,
    ) -> Result<Summary, Fault> {
        let path = &p.recording.0;
        let (samples, info) = RECORDING.read_mono(cx, path)?;
        let rate = f64::from(info.rate);
        let params = ExtractParams {
            modes: p.count,
            lowest: p.lowest,
            highest: p.highest,
            contact: p.contact,
            ..ExtractParams::default()
        };
        let (count, part) = (impacts(&samples, rate).len(), loudest_impact(&samples, rate));
        let found = extract(&samples[part.clone()], rate, &params)
            .map_err(|e| RECORDING.unusable(path, e).help(e.help()))?;
        let modes = found.modes(path, p.impulse, p.phases);
        let mut summary = modes.summary();
        summary.push(("onset_s", ((part.start + found.onset) as f64 / rate).into()));
        summary.push(("unexplained_db", found.residual_db.into()));
        summary.push(("unexplained_after_5_ms_db", found.late_residual_db.into()));
        if count > 1 {
            let length = part.len() as f64 / rate;
            let text = format!(
                "{count} impacts were found; the modes are those of the loudest, over {length:.3} s up to the next one"
            );
            summary.push(("warning", text.into()));
        }
        if found.residual_db > MAX_RESIDUAL {
            let share = 100.0 * 10.0_f64.powf(found.residual_db / 10.0);
            let text = format!(
                "{share:.0} % of the recording's energy belongs to none of the modes; it should be a single impact that rings out"
            );
            summary.push(("warning", text.into()));
        }
        summary.extend(recording_warnings(path, &info, &samples));
        io.modes.set(modes);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (ModalFromRecordingParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert("hit.wav", trial_impact(rng));
        let p = ModalFromRecordingParams::trial(rng);
        let params = ModalFromRecordingParams {
            recording: "hit.wav".into(),
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
    use crate::core::params::Datum;
    use crate::core::standalone::{Standalone, StandaloneRun};
    use crate::io::trial_wav;

    fn run(bytes: Vec<u8>) -> Result<StandaloneRun, Fault> {
        let path = Datum::Text("hit".into());
        let p = ModalFromRecordingParams::read(&|name| (name == "recording").then(|| path.clone())).unwrap();
        let mut standalone = Standalone::func::<ModalFromRecording>(p);
        standalone.files.insert("hit", bytes);
        standalone.run()
    }

    #[test]
    fn most_energy_of_recorded_impacts_is_in_modes() {
        for (name, min_db) in [("drum_cowbell.flac", 10.0), ("glass_hit_a1.flac", 3.0)] {
            let path = format!("{}/../graphs/assets/recordings/{name}", env!("CARGO_MANIFEST_DIR"));
            let run = run(std::fs::read(path).unwrap()).unwrap();
            println!("{name}: {:?}", run.summary);
            let residual = run.summary.iter().find(|(k, _)| *k == "unexplained_db").unwrap();
            assert!(residual.1.as_f64().unwrap() < -min_db, "{name}");
            assert!(run.value(0).unwrap().get::<Modes>().unwrap().len() > 3, "{name}");
        }
    }

    #[test]
    fn recordings_of_more_than_one_impact_give_a_warning() {
        let ring = |n: usize| {
            let t = n as f64 / 44_100.0;
            let mode = |(f, d): (f64, f64)| (-d * t).exp() * (std::f64::consts::TAU * f * t).cos();
            0.1 * [(440.0, 6.0), (1100.0, 9.0), (2500.0, 20.0), (6000.0, 50.0), (11_000.0, 90.0)]
                .map(mode)
                .iter()
                .sum::<f64>()
        };
        let warned = |second: usize| {
            let sample = |n: usize| (ring(n) + if n >= second { ring(n - second) } else { 0.0 }) as f32;
            let run = run(trial_wav(&(0..44_100).map(sample).collect::<Vec<_>>(), 44_100)).unwrap();
            run.summary.iter().any(|(k, text)| *k == "warning" && text.to_string().contains("2 impacts"))
        };
        assert!(!warned(50_000));
        assert!(warned(20_000));
    }

    #[test]
    fn a_recording_without_an_impact_is_named() {
        let fault = run(trial_wav(&[0.0; 5000], 8000)).err().unwrap();
        assert!(fault.code == "F077" && fault.message.contains("silent"), "{fault:?}");
        // Noise is no sum of modes.
        let mut rng = Rng::new(4);
        let noise: Vec<f32> = (0..8000).map(|_| rng.between(-0.5, 0.5) as f32).collect();
        let fault = run(trial_wav(&noise, 8000)).err().unwrap();
        assert!(fault.code == "F077" && fault.message.contains("rings"), "{fault:?}");
        assert_eq!(run(b"no audio".to_vec()).err().unwrap().code, "F077");
    }
}
