//! The roller measurement as a node: a whole recording in, a friction model out.

use std::borrow::Cow;

use super::analysis::BuildError;
use super::encoder::{EncoderError, EncoderTrack, Signal};
use super::mono_recording::{Take, check_enough, check_length};
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
    /// Speed of the surface; either sign is a speed.
    Speed,
    /// Angle of the roller, going on or wrapped at whole turns; less than half a turn in a millisecond.
    Angle,
} }

params! {
    /// Measures a friction model: cloth turns on a roller against cloth while an encoder notes its speed.
    ///
    /// The encoder is a CSV, or a signal that was recorded beside the sound: a second channel, or a file of its own at any
    /// rate, linked at `turning`. About a thousand samples a second of it are used. One that is noisy goes through a
    /// `LowPass` first.
    ///
    /// Cuts the recording into clips under a triangular window, drops those on the seam, at rest or changing speed, and
    /// averages the power of clips of like speed. The channels of the recording are averaged first. The sound of the
    /// roller at rest can be given to be subtracted as the noise floor; without it, broadband noise holds much of what is
    /// interpolated.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2. The
    /// paper keeps one spectrum per clip, whose bins scatter by 100 %: `raw` does that.
    pub struct FrictionModelBuilderParams {
        /// CSV of the encoder with the header `time_s,speed_m_s` or `time_s,angle_rad`; time 0 is the first sample. None where
        /// `turning` is linked.
        encoder: Option<AssetPath> = None;
        /// What `turning` tells.
        signal: Signal = Signal::Speed;
        /// What a sample of 1 of `turning` stands for, in m/s or radians: 6.2832 for a channel that goes from 0 to 1 each turn.
        full_scale: f64 = 1.0, unit "m/s or rad", range 0.000001..=1000000.0;
        /// Radius of the roller with the cloth on it, for angles and seams.
        roller_radius: f64 = 0.0, unit "m", range 0.0..=100.0;
        /// Angles that the seam covers, from and to.
        seams: Vec<[f64; 2]> = Vec::new(), unit "rad", range -1000.0..=1000.0;
        /// Length of a clip.
        clip: f64 = 0.05, unit "s", range 0.001..=10.0;
        /// Distance of clips.
        hop: f64 = 0.0125, unit "s", range 0.0001..=10.0;
        /// Logarithmic bins of speed.
        n_speed: usize = 32, unit "bins", range 2..=4096;
        /// One spectrum per clip instead of averages, as in the paper.
        raw: bool = false;
        /// Slowest speed to be measured.
        min_speed: f64 = 0.001, unit "m/s", range 0.000001..=100.0;
        /// Largest change of speed within a clip, relative to the speed at its centre.
        speed_change: f64 = 0.2, unit "", range 0.0..=10.0;
        /// Cut-off of the high-pass on the spectra; 0 only removes DC.
        high_pass: f64 = 20.0, unit "Hz", range 0.0..=1000.0;
        /// Sliding area that the recording heard; levels are stored per 1e-4 m^2.
        contact_area: f64 = 0.0001, unit "m^2", range 0.000000001..=100.0;
        /// The two materials.
        materials: [Text; 2] = ["cloth".into(), "cloth".into()];
        /// What was recorded and by whom.
        provenance: Text = "".into();
        /// The licence of the recording.
        licence: Text = "".into();
    }
}

ports! {
    pub struct FrictionModelBuilderPorts / FrictionModelBuilderIo {
        in {
            /// The recording of the roller.
            recording: Stream<f32>,
            /// The same roller at rest, at the same rate: the noise floor.
            rest: Option<Stream<f32>>,
            /// What the encoder told while the roller was recorded, in place of its CSV; begins with the recording.
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
    recording: Take,
    rest: Option<Take>,
}

/// Where the turning of the roller is known from.
enum Encoder {
    Table(EncoderTrack),
    Signal { take: Take, rate: f64, signal: Signal, full_scale: f64 },
}

impl Stateful for Encoder {
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        match self {
            Self::Table(_) => Ok(()),
            Self::Signal { take, .. } => take.archive_state(archive),
        }
    }
}

impl Encoder {
    fn track(&self) -> Cow<'_, EncoderTrack> {
        match self {
            Self::Table(track) => Cow::Borrowed(track),
            Self::Signal { take, rate, signal, full_scale } => {
                let rate = rate / take.step as f64;
                Cow::Owned(EncoderTrack::from_signal(&take.samples, rate, *signal, *full_scale))
            }
        }
    }

    /// The field that it comes from.
    fn field(&self) -> &'static str {
        if matches!(self, Self::Table(_)) { "encoder" } else { "turning" }
    }
}

/// Readings of the encoder per second that are enough for clips of tens of milliseconds.
const READINGS: f64 = 1000.0;

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

/// The track of an encoder's table, where its times and readings can be used.
fn table(p: &FrictionModelBuilderParams, path: &str, bytes: &[u8]) -> Result<EncoderTrack, Reject> {
    let track = EncoderTrack::from_csv(bytes).and_then(|track| track.motion(p.roller_radius).map(|_| track));
    track.map_err(|e| Reject::new("F077", format!("{path:?}: {e}")).at(encoder_field(&e, "encoder")))
}

/// The field that an error of the encoder is about.
fn encoder_field(e: &EncoderError, from: &'static str) -> &'static str {
    if matches!(e, EncoderError::Radius { .. }) { "roller_radius" } else { from }
}

/// Refuses a signal that does not end, is too short, or lacks a radius.
fn check_turning(p: &FrictionModelBuilderParams, turning: &Incoming<f32>) -> Result<(), Reject> {
    check_length("turning", turning)?;
    // Two samples show all that can be wrong before the samples are known.
    let found = turning.items().unwrap_or(0).clamp(0, 2) as usize;
    let track = EncoderTrack::from_signal(&[0.0; 2][..found], turning.rate.as_f64(), p.signal, p.full_scale);
    match track.motion(p.roller_radius) {
        Ok(_) => Ok(()),
        Err(e) => Err(Reject::new("F077", e.to_string()).at(encoder_field(&e, "turning"))),
    }
}

/// Refuses a signal that ends before the recording, but for its last sample.
fn check_lasts(recording: &Incoming<f32>, turning: &Incoming<f32>) -> Result<(), Reject> {
    let (Some(recorded), Some(told)) = (recording.end, turning.end) else { return Ok(()) };
    if told + turning.rate.span(1) >= recorded {
        return Ok(());
    }
    let [told, recorded] = [told, recorded].map(|end| end as f64 / TICKS_PER_SECOND as f64);
    let message = format!("`turning` ends after {told:.3} s, `recording` after {recorded:.3} s");
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
        let two = clip + hop_samples(&params, fs);
        s.check(check_enough("recording", &recording, two, "two clips, the fewest that give two speeds,"));
        if let Some(rest) = s.optional(FrictionModelBuilderPorts::rest) {
            s.check(check_length("rest", &rest));
            s.check(crate::core::node::same_rate("rest", rest.rate, "`recording`", recording.rate));
            s.check(check_enough("rest", &rest, clip, "one clip, to measure the floor,"));
        }
        match (&p.encoder, s.optional(FrictionModelBuilderPorts::turning)) {
            (Some(path), None) => table(p, &path.0, &s.bytes("encoder", &path.0)?).map(drop),
            (None, Some(turning)) => {
                check_turning(p, &turning)?;
                check_lasts(&recording, &turning)
            }
            (Some(_), Some(_)) => {
                let message =
                    "both `encoder` and `turning` are given; one of them tells how the roller turned";
                Err(Reject::new("F077", message).at("encoder").help("leave out one of them"))
            }
            (None, None) => {
                let help = "give `encoder`, a CSV, or link the recorded signal of the encoder to `turning`";
                Err(Reject::new("F077", "nothing tells how the roller turned").at("encoder").help(help))
            }
        }
    }

    fn build(p: &FrictionModelBuilderParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let recording = cx.input(FrictionModelBuilderPorts::recording);
        let encoder = match (&p.encoder, cx.optional(FrictionModelBuilderPorts::turning)) {
            (Some(path), _) => Encoder::Table(table(p, &path.0, &cx.bytes("encoder", &path.0)?)?),
            (None, turning) => {
                let turning =
                    turning.ok_or_else(|| Fault::new("F077", "nothing tells how the roller turned"))?;
                let rate = turning.rate.as_f64();
                let take = Take::new(&turning, ((rate / READINGS) as usize).max(1));
                Encoder::Signal { take, rate, signal: p.signal, full_scale: p.full_scale }
            }
        };
        Ok(Self {
            fs: recording.rate.as_f64(),
            encoder,
            params: builder_params(p),
            recording: Take::new(&recording, 1),
            rest: cx.optional(FrictionModelBuilderPorts::rest).map(|rest| Take::new(&rest, 1)),
        })
    }

    fn run(&mut self, io: FrictionModelBuilderIo<'_>) -> Result<(), Fault> {
        self.recording.add(&io.recording);
        if let (Some(take), Some(audio)) = (&mut self.rest, &io.rest) {
            take.add(audio);
        }
        if let (Encoder::Signal { take, .. }, Some(turning)) = (&mut self.encoder, &io.turning) {
            take.add(turning);
        }
        Ok(())
    }

    fn finish(&mut self, mut io: FrictionModelBuilderIo<'_>) -> Result<Summary, Fault> {
        let rest = self.rest.as_ref().map(|take| &take.samples[..]);
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
