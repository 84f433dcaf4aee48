//! The node `WavIn`.

use super::{AudioError, AudioInfo, AudioReader};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::{archive_state, params, ports};

params! {
    /// Plays a recording: WAV, FLAC, Ogg Vorbis or MP3, recognised by content.
    ///
    /// Rate and channels are those of the file. Full scale is +-1.
    pub struct WavInParams {
        /// The file.
        path: AssetPath;
        /// Start in the file, rounded to the nearest sample.
        start: f64 = 0.0, unit "s", range 0.0..=86_400.0;
        /// Maximum length; None plays to the end.
        duration: Option<f64> = None, unit "s", range 0.0..=86_400.0;
    }
}
ports! {
    /// Ports of `WavIn`.
    pub struct WavInPorts / WavInIo {
        in {}
        out {
            /// The recording.
            audio: Stream<f32>,
        }
    }
}

/// The node `WavIn`.
pub struct WavInNode {
    reader: AudioReader<'static>,
    /// Frame of the file at time zero.
    start: u64,
    /// Next frame, counted from `start`.
    next: i64,
    played: u64,
}

/// Range of frames to play: the first, and one after the last.
fn frame_range(p: &WavInParams, info: &AudioInfo) -> Result<(u64, u64), Reject> {
    let frames = |seconds: f64| (seconds * f64::from(info.rate)).round() as u64;
    let start = frames(p.start);
    if start > info.frames {
        let message = format!("the recording is {:.3} s long, `start` is {} s", info.seconds(), p.start);
        let help = format!("start below {:.3}", info.seconds());
        return Err(Reject::new("F051", message).at("start").help(help));
    }
    let end =
        p.duration.map_or(info.frames, |seconds| start.saturating_add(frames(seconds)).min(info.frames));
    Ok((start, end))
}

fn reject(path: &AssetPath, e: &AudioError) -> Reject {
    Reject::new("F065", format!("{:?}: {e}", path.0)).at("path")
}

impl Node for WavInNode {
    type Params = WavInParams;
    type Ports = WavInPorts;
    const NAME: &'static str = "WavIn";
    const CLASS: Class = Class::Io;
    const COST: f64 = 4.0;

    fn shape(p: &WavInParams, s: &mut Shape<'_, '_, WavInPorts>) -> Result<(), Reject> {
        let info = super::probe(s.open("path", &p.path.0)?).map_err(|e| reject(&p.path, &e))?;
        info.warning_texts(&p.path.0).for_each(|text| s.note(text));
        let (start, end) = frame_range(p, &info)?;
        let rate = Rate::new(info.rate.into(), 1);
        let (Some(rate), Ok(channels)) = (rate, u16::try_from(info.channels)) else {
            let message = format!("{:?} has {} channels at {} Hz", p.path.0, info.channels, info.rate);
            return Err(Reject::new("F065", message).at("path"));
        };
        s.ends(Some(rate.tick((end - start) as i64)));
        s.output(WavInPorts::audio, rate, Channels(channels));
        Ok(())
    }

    fn build(p: &WavInParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let source = cx.open("path", &p.path.0)?;
        let mut reader = AudioReader::open(source).map_err(|e| reject(&p.path, &e))?;
        let (start, _) = frame_range(p, reader.info())?;
        reader.seek(start).map_err(|e| reject(&p.path, &e))?;
        Ok(Self { reader, start, next: 0, played: 0 })
    }

    fn run(&mut self, mut io: WavInIo<'_>) -> Result<(), Fault> {
        let (requested, time) = (io.audio.len(), io.audio.rate().tick(io.audio.first()));
        let fault = |message: String| Fault::new("F066", message).at("path").when(time);
        if self.next != io.audio.first() {
            // The node replaces another one in a running graph.
            let frame = self.start.saturating_add_signed(io.audio.first());
            self.reader.seek(frame).map_err(|e| fault(e.to_string()))?;
        }
        self.next = io.audio.first() + requested as i64;
        let read = self.reader.read(io.audio.items()).map_err(|e| fault(e.to_string()))?;
        if read < requested {
            return Err(fault(format!("the recording ends {} samples early", requested - read)));
        }
        self.played += read as u64;
        Ok(())
    }

    fn finish(&mut self, _: WavInIo<'_>) -> Result<Summary, Fault> {
        let info = self.reader.info();
        let warnings: Vec<String> = info.warnings.iter().map(ToString::to_string).collect();
        let mut summary: Summary = vec![("frames", self.played.into()), ("warnings", warnings.into())];
        summary.extend(info.corrupt_packets().map(|warning| ("warning", warning.to_string().into())));
        Ok(summary)
    }

    archive_state!(played);

    fn trial(rng: &mut Rng) -> (WavInParams, MemoryFiles) {
        use super::{AudioWriter, WriteFormat, WriteSpec};
        let (rate, channels) = ([60, 100, 1000][rng.below(3)], 1 + rng.below(3));
        let samples: Vec<f32> =
            (0..channels * (50 + rng.below(250))).map(|_| rng.between(-1.0, 1.0) as f32).collect();
        let format = [WriteFormat::Pcm16, WriteFormat::Pcm24, WriteFormat::Float32][rng.below(3)];
        let mut bytes = std::io::Cursor::new(Vec::new());
        let written =
            AudioWriter::new(&mut bytes, WriteSpec::new(rate, channels, format)).and_then(|mut w| {
                w.write(&samples)?;
                w.finish()
            });
        let mut files = MemoryFiles::default();
        let seconds = written.map_or(0.0, |info| info.frames as f64 / f64::from(rate));
        files.insert("trial", bytes.into_inner());
        let duration = (rng.below(2) == 0).then(|| rng.between(0.0, seconds));
        (WavInParams { path: "trial".into(), start: rng.between(0.0, seconds / 2.0), duration }, files)
    }
}
