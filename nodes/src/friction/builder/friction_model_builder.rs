//! A friction model from a roller recording, as a node.

use std::borrow::Cow;

use super::analysis::BuildError;
use super::encoder::{EncoderError, EncoderTrack, Signal};
use super::mono_recording::{MonoRecording, check_length, check_min_length};
use super::roller::{BuilderParams, build, checked_params, hop_samples};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::{Fold, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Incoming, Shape};
use crate::core::state::{StateArchive, Stateful};
use crate::core::time::TICKS_PER_SECOND;
use crate::friction::model::{FrictionModel, Source, model_summary};
use crate::{archive_state, choices, params, ports};

choices! { @param Signal {
    /// Speed of the surface; its absolute value is used.
    Speed,
    /// Angle of the roller, cumulative or wrapped at whole turns; it changes by less than half a turn in a millisecond.
    Angle,
} }

params! {
    /// Measures a friction model from a roller recording: cloth turns against cloth at a measured speed.
    ///
    /// The readings of the encoder come from a CSV, or from a signal linked to `turning`: a second channel of the
    /// recording, or a file of any rate. About 1000 samples per second of the signal are used. A noisy signal needs a
    /// `LowPass` first.
    ///
    /// The channels of the recording are averaged. It is cut into clips under a triangular window. Clips on the seam,
    /// at rest or changing speed are dropped, and the power of clips of similar speed is averaged. The spectrum of the
    /// roller at rest (`rest`) is subtracted as the noise floor. Without it, broadband noise is a large part of the
    /// spectra that are interpolated.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2. The
    /// paper has one spectrum per clip, whose bins scatter by 100 %; so does `raw`.
    pub struct FrictionModelBuilderParams {
        /// CSV of the encoder with the header `time_s,speed_m_s` or `time_s,angle_rad`; time 0 is the first sample.
        /// None if `turning` is linked.
        encoder: Option<AssetPath> = None;
        /// Quantity that `turning` measures.
        signal: Signal = Signal::Speed;
        /// Reading for a sample of 1 of `turning`, in m/s or radians: 6.2832 for a channel that rises from 0 to 1 in
        /// each turn.
        full_scale: f64 = 1.0, unit "m/s or rad", range 0.000001..=1000000.0;
        /// Radius of the roller with the cloth on it, for angles and seams.
        roller_radius: f64 = 0.0, unit "m", range 0.0..=100.0;
        /// Angles of the seams, from and to.
        seams: Vec<[f64; 2]> = Vec::new(), unit "rad", range -1000.0..=1000.0;
        /// Length of a clip.
        clip: f64 = 0.05, unit "s", range 0.001..=10.0;
        /// Time from one clip to the next.
        hop: f64 = 0.0125, unit "s", range 0.0001..=10.0;
        /// Number of logarithmic bins of speed.
        n_speed: usize = 32, unit "bins", range 2..=4096;
        /// One spectrum per clip instead of averages, as in the paper.
        raw: bool = false;
        /// Slowest speed to measure.
        min_speed: f64 = 0.001, unit "m/s", range 0.000001..=100.0;
        /// Largest change of speed within a clip, relative to the speed at its centre.
        speed_change: f64 = 0.2, unit "", range 0.0..=10.0;
        /// Cut-off of the high-pass on the spectra; 0 only removes DC.
        high_pass: f64 = 20.0, unit "Hz", range 0.0..=1000.0;
        /// Sliding area in the recording; levels are stored per 1e-4 m^2.
        contact_area: f64 = 0.0001, unit "m^2", range 0.000000001..=100.0;
        /// Names of the two materials.
        materials: [Text; 2] = ["cloth".into(), "cloth".into()];
        /// Subject and author of the recording.
        provenance: Text = "".into();
        /// Licence of the recording.
        licence: Text = "".into();
    }
}

ports! {
    pub struct FrictionModelBuilderPorts / FrictionModelBuilderIo {
        in {
            /// The recording of the roller.
            recording: Stream<f32>,
            /// The roller at rest, at the rate of `recording`: the noise floor.
            rest: Option<Stream<f32>>,
            /// Signal of the encoder, in place of its CSV; it begins with the recording.
            turning: Option<Stream<f32>>,
        }
        out {
            /// The friction model, once the recording has ended.
            model: Fold<FrictionModel>,
        }
    }
}

/// The node over [`build`].
pub struct FrictionModelBuilder {
    fs: f64,
    encoder: Encoder,
    params: BuilderParams,
    recording: MonoRecording,
    rest: Option<MonoRecording>,
}

/// Readings of the encoder.
enum Encoder {
    Table(EncoderTrack),
    Signal { recording: MonoRecording, rate: f64, signal: Signal, full_scale: f64 },
}

impl Stateful for Encoder {
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        match self {
            Self::Table(_) => Ok(()),
            Self::Signal { recording, .. } => recording.archive_state(archive),
        }
    }
}

impl Encoder {
    fn track(&self) -> Cow<'_, EncoderTrack> {
        match self {
            Self::Table(track) => Cow::Borrowed(track),
            Self::Signal { recording, rate, signal, full_scale } => {
                let rate = rate / recording.step as f64;
                Cow::Owned(EncoderTrack::from_signal(&recording.samples, rate, *signal, *full_scale))
            }
        }
    }

    /// Returns the field that the readings come from.
    fn field(&self) -> &'static str {
        if matches!(self, Self::Table(_)) { "encoder" } else { "turning" }
    }
}

/// Readings of an encoder signal per second, enough for clips of tens of milliseconds.
const READING_RATE: f64 = 1000.0;

fn builder_params(p: &FrictionModelBuilderParams) -> BuilderParams {
    BuilderParams {
        material_pair: p.materials.clone().map(|name| name.0),
        clip: p.clip,
        hop: p.hop,
        roller_radius: p.roller_radius,
        seams: p.seams.iter().map(|&[from, to]| (from, to)).collect(),
        speed_change: p.speed_change,
        min_speed: p.min_speed,
        n_speed: p.n_speed,
        raw: p.raw,
        high_pass: p.high_pass,
        contact_area: p.contact_area,
        sources: vec![Source { provenance: p.provenance.0.clone(), licence: p.licence.0.clone() }],
    }
}

/// Parses the CSV of the encoder and checks its times and readings.
fn parse_table(p: &FrictionModelBuilderParams, path: &str, bytes: &[u8]) -> Result<EncoderTrack, Reject> {
    let track = EncoderTrack::from_csv(bytes).and_then(|track| track.motion(p.roller_radius).map(|_| track));
    track.map_err(|e| Reject::new("F077", format!("{path:?}: {e}")).at(encoder_field(&e, "encoder")))
}

/// Returns the field that an error of the encoder refers to.
fn encoder_field(e: &EncoderError, source: &'static str) -> &'static str {
    if matches!(e, EncoderError::Radius { .. }) { "roller_radius" } else { source }
}

/// Refuses a signal that does not end, is too short, or lacks a radius.
fn check_turning(p: &FrictionModelBuilderParams, turning: &Incoming<f32>) -> Result<(), Reject> {
    check_length("turning", turning)?;
    // Two samples show all errors that do not depend on the samples.
    let found = turning.items().unwrap_or(0).clamp(0, 2) as usize;
    let track = EncoderTrack::from_signal(&[0.0; 2][..found], turning.rate.as_f64(), p.signal, p.full_scale);
    match track.motion(p.roller_radius) {
        Ok(_) => Ok(()),
        Err(e) => Err(Reject::new("F077", e.to_string()).at(encoder_field(&e, "turning"))),
    }
}

/// Refuses a signal that ends more than one sample before the recording.
fn check_lasts(recording: &Incoming<f32>, turning: &Incoming<f32>) -> Result<(), Reject> {
    let (Some(recording_end), Some(signal_end)) = (recording.end, turning.end) else { return Ok(()) };
    if signal_end + turning.rate.span(1) >= recording_end {
        return Ok(());
    }
    let [signal, recorded] = [signal_end, recording_end].map(|end| end as f64 / TICKS_PER_SECOND as f64);
    let message = format!("`turning` ends after {signal:.3} s, `recording` after {recorded:.3} s");
    let help = "cut the recording with Trim, or link a signal that lasts as long";
    Err(Reject::new("F047", message).at("turning").help(help))
}

impl Node for FrictionModelBuilder {
    type Params = FrictionModelBuilderParams;
    type Ports = FrictionModelBuilderPorts;
    const NAME: &'static str = "FrictionModelBuilder";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Offline;

    fn shape(
        p: &FrictionModelBuilderParams,
        s: &mut Shape<'_, '_, FrictionModelBuilderPorts>,
    ) -> Result<(), Reject> {
        let recording = s.input(FrictionModelBuilderPorts::recording);
        check_length("recording", &recording)?;
        let (params, fs) = (builder_params(p), recording.rate.as_f64());
        let clip = checked_params(&params, fs).map_err(|e| {
            let field = match e {
                BuildError::Parameter { name, .. } if name != "fs" => name,
                _ => "recording",
            };
            Reject::new("F077", format!("at {}: {e}", recording.rate)).at(field)
        })?;
        let two_clips = clip + hop_samples(&params, fs);
        s.check(check_min_length("recording", &recording, two_clips, "a model (two clips, for two speeds)"));
        if let Some(rest) = s.optional(FrictionModelBuilderPorts::rest) {
            s.check(check_length("rest", &rest));
            s.check(crate::core::node::same_rate("rest", rest.rate, "`recording`", recording.rate));
            s.check(check_min_length("rest", &rest, clip, "the noise floor (one clip)"));
        }
        match (&p.encoder, s.optional(FrictionModelBuilderPorts::turning)) {
            (Some(path), None) => parse_table(p, &path.0, &s.bytes("encoder", &path.0)?).map(drop),
            (None, Some(turning)) => {
                check_turning(p, &turning)?;
                check_lasts(&recording, &turning)
            }
            (Some(_), Some(_)) => {
                let message = "both `encoder` and `turning` are given; only one of them can be used";
                Err(Reject::new("F077", message).at("encoder").help("remove one of them"))
            }
            (None, None) => {
                let help = "give `encoder`, a CSV file, or link the signal of the encoder to `turning`";
                Err(Reject::new(
                    "F077",
                    "neither `encoder` nor `turning` is given; the speed of the roller is needed",
                )
                .at("encoder")
                .help(help))
            }
        }
    }

    fn build(p: &FrictionModelBuilderParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let recording = cx.input(FrictionModelBuilderPorts::recording);
        let encoder = match (&p.encoder, cx.optional(FrictionModelBuilderPorts::turning)) {
            (Some(path), _) => Encoder::Table(parse_table(p, &path.0, &cx.bytes("encoder", &path.0)?)?),
            (None, turning) => {
                let turning = turning.ok_or_else(|| {
                    Fault::new(
                        "F077",
                        "neither `encoder` nor `turning` is given; the speed of the roller is needed",
                    )
                })?;
                let rate = turning.rate.as_f64();
                let recording = MonoRecording::new(&turning, ((rate / READING_RATE) as usize).max(1));
                Encoder::Signal { recording, rate, signal: p.signal, full_scale: p.full_scale }
            }
        };
        Ok(Self {
            fs: recording.rate.as_f64(),
            encoder,
            params: builder_params(p),
            recording: MonoRecording::new(&recording, 1),
            rest: cx.optional(FrictionModelBuilderPorts::rest).map(|rest| MonoRecording::new(&rest, 1)),
        })
    }

    fn run(&mut self, io: FrictionModelBuilderIo<'_>) -> Result<(), Fault> {
        self.recording.add(&io.recording);
        if let (Some(rest), Some(audio)) = (&mut self.rest, &io.rest) {
            rest.add(audio);
        }
        if let (Encoder::Signal { recording, .. }, Some(turning)) = (&mut self.encoder, &io.turning) {
            recording.add(turning);
        }
        Ok(())
    }

    fn finish(&mut self, mut io: FrictionModelBuilderIo<'_>) -> Result<Summary, Fault> {
        let rest = self.rest.as_ref().map(|rest| &rest.samples[..]);
        let track = self.encoder.track();
        let model = build(&self.recording.samples, self.fs, &track, rest, &self.params).map_err(|e| {
            let field = match &e {
                BuildError::Encoder(e) => encoder_field(e, self.encoder.field()),
                _ => "recording",
            };
            Fault::new("F077", e.to_string()).at(field)
        })?;
        let summary = model_summary(&model);
        io.model.set(model);
        Ok(summary)
    }

    archive_state!(encoder, recording, each rest);

    fn trial(rng: &mut Rng) -> (FrictionModelBuilderParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert("encoder.csv", "time_s,speed_m_s\n0,0.1\n0.05,0.3\n0.5,1.0\n10,1.2\n1000,9.0\n");
        let params = FrictionModelBuilderParams {
            encoder: Some("encoder.csv".into()),
            clip: rng.between(0.06, 0.2),
            hop: rng.between(0.03, 0.06),
            speed_change: 10.0,
            seams: Vec::new(),
            min_speed: 0.001,
            high_pass: rng.between(0.0, 10.0),
            ..FrictionModelBuilderParams::trial(rng)
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests;
