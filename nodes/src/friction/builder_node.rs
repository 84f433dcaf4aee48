//! The roller measurement as a node: a whole recording in, a friction model out.

use std::borrow::Cow;

use super::builder::{BuildError, BuilderParams, build, checked_params, hop_samples};
use super::encoder::{EncoderError, EncoderTrack, Signal};
use super::model::{FrictionModel, Source};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::{Fold, In, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Incoming, Shape};
use crate::core::state::{StateArchive, Stateful};
use crate::core::time::TICKS_PER_SECOND;
use crate::{archive_state, choices, impl_state, params, ports};

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

/// A whole recording, mono.
struct Take {
    samples: Vec<f32>,
    length: usize,
    /// One of so many samples is kept.
    step: usize,
}
impl_state!(Take { samples });

/// Longest recording, in samples: half an hour at 192 kHz.
const LONGEST: i64 = 1800 * 192_000;

/// Readings of the encoder per second that are enough for clips of tens of milliseconds.
const READINGS: f64 = 1000.0;

impl Take {
    fn new(audio: &Incoming<f32>, step: usize) -> Self {
        let length = audio.items().unwrap_or(0).clamp(0, LONGEST) as usize;
        Self { samples: Vec::with_capacity(length.div_ceil(step)), length, step }
    }

    /// Adds a window, without what stands after the end of the recording.
    fn add(&mut self, audio: &In<'_, f32>) {
        let (width, first) = (audio.width().max(1), audio.first().max(0) as usize);
        let left = self.length.saturating_sub(first);
        let mean = |frame: &[f32]| frame.iter().sum::<f32>() / width as f32;
        let frames = audio.items().chunks_exact(width).take(left);
        let next = first.next_multiple_of(self.step) - first;
        self.samples.extend(frames.skip(next).step_by(self.step).map(mean));
    }
}

fn check_length(port: &str, audio: &Incoming<f32>) -> Result<(), Reject> {
    match audio.items() {
        Some(samples) if samples <= LONGEST => Ok(()),
        found => {
            let length = found.map_or("does not end".into(), |n| format!("has {n} samples"));
            let message = format!("`{port}` {length}; a recording of at most {LONGEST} samples is needed");
            Err(Reject::new("F075", message).at(port).help("give a recorded file, or cut the stream"))
        }
    }
}

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

/// Refuses a recording of fewer samples than the least that can be measured.
fn check_enough(port: &str, audio: &Incoming<f32>, least: usize, why: &str) -> Result<(), Reject> {
    let found = audio.items().unwrap_or(i64::MAX);
    if found >= least as i64 {
        return Ok(());
    }
    let message = format!("`{port}` has {found} samples; {why} take {least}");
    Err(Reject::new("F077", message).at(port).help("give a longer recording, or a shorter `clip`"))
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
        let summary = told(&model);
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

/// What the report says of a model.
pub(super) fn told(model: &FrictionModel) -> Summary {
    let (slowest, fastest) = model.speed_range();
    let rejected = &model.rejected;
    vec![
        ("speeds", model.speeds.len().into()),
        ("slowest", slowest.into()),
        ("fastest", fastest.into()),
        ("clips", model.clips.iter().sum::<u32>().into()),
        ("rejected_seam", rejected.seam.into()),
        ("rejected_speed_change", rejected.speed_change.into()),
        ("rejected_at_rest", rejected.at_rest.into()),
        ("rejected_silent", rejected.silent.into()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::random::Random;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Rate, ticks};

    fn all_params() -> FrictionModelBuilderParams {
        let p = FrictionModelBuilderParams::read(&|_| None).unwrap();
        FrictionModelBuilderParams { high_pass: 0.0, encoder: Some("encoder.csv".into()), ..p }
    }

    /// Noise twice as loud in the second half, where the encoder says that the roller turns twice as fast.
    fn standalone(window: f64) -> Standalone {
        let mut standalone = recorded(all_params()).window(ticks(window));
        standalone.files.insert("encoder.csv", "time_s,speed_m_s\n0,0.2\n0.99,0.2\n1.01,0.4\n2,0.4\n");
        standalone
    }

    fn recorded(p: FrictionModelBuilderParams) -> Standalone {
        let random = Random::new(1, "roller");
        let noise = |i: u64| (random.uniform(0, i, 0) - 0.5) as f32 * if i < 8000 { 0.1 } else { 0.2 };
        let stereo = (0..16_000).flat_map(|i| [noise(i), noise(i)]).collect();
        Standalone::new::<FrictionModelBuilder>(p)
            .input(FrictionModelBuilderPorts::recording, Rate::hz(8000), Channels(2), stereo)
            .optional(FrictionModelBuilderPorts::rest, Rate::hz(8000), Channels(1), vec![0.0; 4000])
    }

    #[test]
    fn the_model_of_a_recording_rises_with_speed_and_does_not_depend_on_windows() {
        let model = |window| {
            standalone(window).run().unwrap().value(0).unwrap().get::<FrictionModel>().unwrap().clone()
        };
        let whole = model(3.0);
        let (low, high) = (whole.power(0.2), whole.power(0.4));
        assert!((high / low / 4.0 - 1.0).abs() < 0.1, "{low} {high}");
        assert!((low - 0.01 / 12.0).abs() < 0.1 * low, "{low}");
        for window in [0.001, 0.0177] {
            assert_eq!(model(window), whole);
        }
    }

    /// The take of `standalone` with a signal in place of its table.
    fn with_signal(p: FrictionModelBuilderParams, rate: u32, turning: Vec<f32>) -> Standalone {
        let port = FrictionModelBuilderPorts::turning;
        let mut standalone =
            recorded(p).optional(port, Rate::hz(rate), Channels(1), turning).window(ticks(0.0377));
        standalone.files.insert("encoder.csv", "time_s,speed_m_s\n0,0.2\n2,0.4\n");
        standalone
    }

    #[test]
    fn a_signal_of_the_encoder_gives_the_model_of_its_table() {
        let model = |standalone: Standalone| {
            standalone.run().unwrap().value(0).unwrap().get::<FrictionModel>().unwrap().clone()
        };
        // A ramp of quarters of a thousandth, which single precision and text both hold exactly.
        let speed = |i: usize| 0.25 + i as f32 / 4096.0;
        let mut tabled = standalone(3.0);
        let rows: String =
            (0..2048).map(|i| format!("{},{}\n", i as f64 / 1000.0, f64::from(speed(i)))).collect();
        tabled.files.insert("encoder.csv", format!("time_s,speed_m_s\n{rows}"));
        let wanted = model(tabled);
        assert!(wanted.speeds.len() > 5);
        let p = FrictionModelBuilderParams { encoder: None, ..all_params() };
        assert!(model(with_signal(p.clone(), 1000, (0..2048).map(speed).collect())) == wanted);
        // At 8 kHz and backwards, with full scale at 2 m/s: every eighth sample counts.
        let half = FrictionModelBuilderParams { full_scale: 2.0, ..p.clone() };
        let fine = (0..2048 * 8).map(|i| if i % 8 == 0 { -0.5 * speed(i / 8) } else { 9.0 }).collect();
        assert!(model(with_signal(half, 8000, fine)) == wanted);
        // As an angle that wraps each turn, on a roller of 0.1 m; its speed is a difference and so not the same bits.
        let angle = FrictionModelBuilderParams {
            signal: Signal::Angle,
            full_scale: std::f64::consts::TAU,
            roller_radius: 0.1,
            ..p
        };
        let turned = |i: usize| {
            let t = i as f64 / 1000.0;
            ((0.25 * t + 0.5 * t * t * 1000.0 / 4096.0) / 0.1 / std::f64::consts::TAU).fract() as f32
        };
        let found = model(with_signal(angle, 1000, (0..2048).map(turned).collect()));
        assert_eq!(found.clips, wanted.clips);
        assert!(found.speeds.iter().zip(&wanted.speeds).all(|(a, b)| (a / b - 1.0).abs() < 1e-3));
    }

    #[test]
    fn no_encoder_two_of_them_and_one_that_cannot_be_used_are_refused() {
        let p = FrictionModelBuilderParams { encoder: None, ..all_params() };
        let refused =
            |standalone: Standalone| standalone.shape().err().map(|reject| reject.field.unwrap_or_default());
        let signal = || vec![0.3; 2000];
        assert_eq!(refused(with_signal(p.clone(), 1000, signal())), None);
        assert_eq!(refused(with_signal(all_params(), 1000, signal())), Some("encoder".into()));
        assert_eq!(refused(recorded(p.clone())), Some("encoder".into()));
        assert_eq!(refused(with_signal(p.clone(), 1000, vec![0.3])), Some("turning".into()));
        // The recording lasts 2 s.
        assert_eq!(refused(with_signal(p.clone(), 1000, vec![0.3; 1999])), None);
        let short = with_signal(p.clone(), 1000, vec![0.3; 1900]).shape().unwrap_err();
        assert_eq!((short.code, short.field.as_deref()), ("F047", Some("turning")));
        let angle = FrictionModelBuilderParams { signal: Signal::Angle, ..p.clone() };
        assert_eq!(refused(with_signal(angle, 1000, signal())), Some("roller_radius".into()));
        let fault = with_signal(p, 1000, vec![f32::NAN; 2000]).run().err().unwrap();
        assert_eq!((fault.code, fault.field.as_deref()), ("F077", Some("turning")));
    }

    #[test]
    fn what_is_wrong_with_the_encoder_is_told_before_the_run() {
        let mut standalone = standalone(1.0);
        standalone.files.insert("encoder.csv", "t,v\n0,1\n");
        let reject = standalone.shape().unwrap_err();
        assert_eq!((reject.code, reject.field.as_deref()), ("F077", Some("encoder")));
        standalone.files.insert("encoder.csv", "time_s,speed_m_s\n0,0.2\n1,0.2\n0.5,0.4\n");
        let reject = standalone.shape().unwrap_err();
        assert_eq!((reject.code, reject.field.as_deref()), ("F077", Some("encoder")));
        assert!(reject.message.contains("encoder.csv") && reject.message.contains("sample 2"), "{reject}");
    }

    #[test]
    fn a_recording_too_slow_or_too_short_to_measure_is_refused_before_the_run() {
        let refused = |rate: u32, samples: usize, rest: usize| {
            let port = FrictionModelBuilderPorts::recording;
            let files = standalone(1.0).files;
            let mut standalone = Standalone::new::<FrictionModelBuilder>(all_params())
                .input(port, Rate::hz(rate), Channels(1), vec![0.1; samples])
                .optional(FrictionModelBuilderPorts::rest, Rate::hz(rate), Channels(1), vec![0.0; rest]);
            standalone.files = files;
            standalone.shape().err().map(|reject| (reject.code, reject.field.unwrap_or_default()))
        };
        // A clip of 50 ms is 400 samples at 8 kHz, and the next begins 100 later.
        assert_eq!(refused(8000, 500, 400), None);
        assert_eq!(refused(8000, 499, 400), Some(("F077", "recording".into())));
        assert_eq!(refused(8000, 500, 399), Some(("F077", "rest".into())));
        assert_eq!(refused(24, 1000, 1000), Some(("F077", "clip".into())));
    }
}
