//! The node `WavOut`.

use super::{AudioError, AudioWriter, Dither, ReadLimits, WriteFormat, WriteSpec};
use crate::core::fault::{Fault, Reject};
use crate::core::files::WriteSeek;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::OutPath;
use crate::core::ports::Stream;
use crate::core::shape::{Build, Incoming, Shape};
use crate::core::time::Rate;
use crate::{archive_state, choices, params, ports};

choices!(@param WriteFormat {
    /// 16-bit linear, clipped at full scale.
    Pcm16,
    /// 24-bit linear, clipped at full scale.
    Pcm24,
    /// 32-bit float, without rounding or clipping.
    Float32,
});
params! {
    /// Writes audio to a WAV file.
    ///
    /// A file that is too long for WAV becomes RF64. The report has the peak, the root mean square and the number of samples
    /// beyond full scale.
    ///
    /// # Randomness
    /// Dither is a function of the seed, the channel and the frame.
    pub struct WavOutParams {
        /// The file.
        path: OutPath;
        /// Format of the stored samples.
        format: WriteFormat = WriteFormat::Pcm24;
        /// True to add triangular noise of one step before rounding, which makes the error independent of the signal.
        dither: bool = true;
    }
}
ports! {
    /// Ports of `WavOut`.
    pub struct WavOutPorts / WavOutIo {
        in {
            /// Audio with any number of channels, at an integer number of samples per second.
            audio: Stream<f32>,
        }
        out {}
    }
}

/// The node `WavOut`.
pub struct WavOutNode {
    writer: Option<AudioWriter<Box<dyn WriteSeek>>>,
    path: String,
    rate: Rate,
    channels: u16,
}

/// The sample rate of a WAV file of an input.
///
/// # Errors
/// A rate that is not an integer, or too high; the error names `field`.
pub(crate) fn wav_rate(field: &'static str, rate: Rate) -> Result<u32, Reject> {
    let wrong = |message: String| Reject::new("F045", message).at(field).help("insert Resample before it");
    let Some(whole) = u32::try_from(rate.num()).ok().filter(|_| rate.den() == 1) else {
        return Err(wrong(format!(
            "a WAV file has an integer number of samples per second, `{field}` has {rate}"
        )));
    };
    let max = ReadLimits::default().max_rate;
    if whole > max {
        return Err(wrong(format!("a WAV file of {whole} samples per second is above the maximum of {max}")));
    }
    Ok(whole)
}

fn spec(p: &WavOutParams, audio: &Incoming<f32>, dither: Dither) -> Result<WriteSpec, Reject> {
    let rate = wav_rate("audio", audio.rate)?;
    let spec = WriteSpec::new(rate, audio.format.0.into(), p.format);
    let dither = if p.dither && p.format != WriteFormat::Float32 { dither } else { Dither::None };
    Ok(WriteSpec { dither, ..spec })
}

fn fault(e: &AudioError) -> Fault {
    Fault::new("F080", e.to_string())
}

impl Node for WavOutNode {
    type Params = WavOutParams;
    type Ports = WavOutPorts;
    const NAME: &'static str = "WavOut";
    const CLASS: Class = Class::Io;
    const COST: f64 = 10.0;

    fn shape(p: &WavOutParams, s: &mut Shape<'_, '_, WavOutPorts>) -> Result<(), Reject> {
        spec(p, &s.input(WavOutPorts::audio), Dither::None)?;
        let extension = p.path.0.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase());
        if !matches!(extension.as_deref(), Some("wav" | "wave" | "rf64" | "bw64")) {
            s.note(format!("{:?} is written as WAV: use the extension .wav", p.path.0));
        }
        Ok(())
    }

    fn build(p: &WavOutParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(WavOutPorts::audio);
        let spec = spec(p, &audio, Dither::Triangular(cx.random))?;
        let sink = cx.create("path", &p.path.0)?;
        let writer = AudioWriter::new(sink, spec).map_err(|e| fault(&e).at("path"))?;
        let (path, rate, Incoming { format, .. }) = (p.path.0.clone(), audio.rate, audio);
        Ok(Self { writer: Some(writer), path, rate, channels: format.0 })
    }

    fn run(&mut self, io: WavOutIo<'_>) -> Result<(), Fault> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        writer.write(io.audio.items()).map_err(|e| match e {
            AudioError::NotFinite { frame, .. } => fault(&e).at("audio").when(self.rate.tick(frame as i64)),
            e => fault(&e).at("path").when(self.rate.tick(io.audio.first())),
        })
    }

    fn finish(&mut self, _: WavOutIo<'_>) -> Result<Summary, Fault> {
        let Some(writer) = self.writer.take() else { return Ok(Summary::new()) };
        let written = writer.finish().map_err(|e| fault(&e).at("path"))?;
        Ok(vec![
            ("path", self.path.as_str().into()),
            ("rate", self.rate.num().into()),
            ("channels", self.channels.into()),
            ("frames", written.frames.into()),
            ("peak", written.peak.into()),
            ("rms", written.rms.into()),
            ("clipped", written.clipped.into()),
        ])
    }

    archive_state!(each writer);
}
