//! Friction noise in one channel, as a node.

use super::clip_stream::ClipStream;
use super::clip_timing::{check_pressure, hop};
use super::noise::{ClipInput, IftNoise};
use super::noise_params::{ClipParams, EmitterKind, Emitters, IftNoiseParams, VertexLevelParams};
use super::speed_coverage::coverage_summary;
use crate::contact::{Pressures, Speeds};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::Rate;
use crate::dsp;
use crate::friction::model::FrictionModel;
use crate::{archive_state, params, ports};

params! {
    /// Synthesises the sound of sliding cloth: noise with the spectrum of a friction model at each vertex's speed.
    ///
    /// Each item of `speeds` is the middle of one clip, or its start (`motion_at`). Clips overlap by half, so a clip is
    /// two items long: 50 ms at 40 speeds per second. A clip is the inverse Fourier transform of the model's amplitudes
    /// with random phases. Above the fastest speed of the model its spectrum is held; below the slowest its level
    /// falls. The summary reports the fractions of both. Vertices at rest cost nothing, and if all are at rest the
    /// output is exactly zero.
    ///
    /// There must be a whole number of samples from one speed to the next. The parameter `rate` sets the sample rate of
    /// the audio.
    ///
    /// # Randomness
    /// A phase is a function of the seed, the emitter, the clip and the bin.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2;
    /// Rodet and Depalle, "Spectral envelopes and inverse FFT synthesis" (1992). The paper states no output window. The
    /// triangle of its analysis would have dips of 3 dB at the clip rate.
    pub struct IftNoiseNodeParams {
        /// Sample rate of the audio.
        rate: Rate = Rate::hz(48_000);
        /// Clips.
        [group] clips: ClipParams;
        /// Level.
        [group] vertices: VertexLevelParams;
    }
}

ports! {
    pub struct IftNoisePorts / IftNoiseIo {
        in {
            /// Sliding speed per vertex.
            speeds: Stream<Speeds>,
            /// Power density per speed.
            model: Value<FrictionModel>,
            /// Factor on the power per vertex, from `ContactPressure`, at the rate of `speeds`.
            pressure: Option<Stream<Pressures>>,
        }
        out {
            /// Friction sound, mono, full scale +-1.
            audio: Stream<f32>,
        }
    }
}

/// The node over [`ClipStream`].
pub struct IftNoiseNode {
    clips: ClipStream,
    /// Level, which changes in ramps of 10 ms.
    level: dsp::Gain,
    peak: f32,
    params: IftNoiseNodeParams,
}

impl Node for IftNoiseNode {
    type Params = IftNoiseNodeParams;
    type Ports = IftNoisePorts;
    const NAME: &'static str = "IftNoise";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 20.0;

    fn shape(p: &IftNoiseNodeParams, s: &mut Shape<'_, '_, IftNoisePorts>) -> Result<(), Reject> {
        let speeds = s.input(IftNoisePorts::speeds);
        s.check(hop(p.rate, speeds.rate));
        if let Some(model) = s.value(IftNoisePorts::model) {
            s.check(model.validate().map_err(|e| Reject::new("F076", e.to_string()).at("model")));
        }
        let [behind, ahead] = p.vertices.motion_at.lookaround();
        s.lookaround(IftNoisePorts::speeds, behind, ahead);
        if let Some(pressure) = s.optional(IftNoisePorts::pressure) {
            s.check(check_pressure(&speeds, &pressure));
            s.lookaround(IftNoisePorts::pressure, behind, ahead);
            s.when_ended(IftNoisePorts::pressure, Ends::Hold);
        }
        s.output(IftNoisePorts::audio, p.rate, Channels(1));
        Ok(())
    }

    fn build(p: &IftNoiseNodeParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let speeds = cx.input(IftNoisePorts::speeds);
        let model = cx.value(IftNoisePorts::model);
        let clip = 2 * hop(p.rate, speeds.rate)?;
        let fs = p.rate.as_f64();
        let params = IftNoiseParams {
            clip: clip as f64 / fs,
            window: p.clips.window,
            magnitude: p.clips.magnitude,
            emitters: match p.clips.emitters {
                EmitterKind::Clustered => Emitters::default(),
                EmitterKind::PerVertex => Emitters::PerVertex,
            },
            area_weight: p.vertices.area_weight,
            gain: p.vertices.gain,
        };
        let noise = IftNoise::new(&model, fs, params, &speeds.format, cx.random);
        let noise = noise.map_err(|e| Fault::new("F076", e.to_string()).at("model"))?;
        let ramp = (0.010 * fs).round() as u64;
        let level = dsp::Gain::new(f64::from(p.vertices.level), ramp, 1);
        Ok(Self { clips: ClipStream::new(noise), level, peak: 0.0, params: p.clone() })
    }

    fn run(&mut self, mut io: IftNoiseIo<'_>) -> Result<(), Fault> {
        let (speeds, first) = (&io.speeds, io.speeds.first());
        let from = io.audio.first().max(0) as u64;
        let out = io.audio.items();
        let motion_at = self.params.vertices.motion_at;
        let clip = |clip: u64| ClipInput {
            speeds: speeds.item((motion_at.item(clip) - first) as isize),
            pressures: io.pressure.as_ref().map(|p| p.item((motion_at.item(clip) - p.first()) as isize)),
            positions: None,
        };
        self.clips.fill(from, out, clip).map_err(|e| Fault::new("F076", e.to_string()).at("speeds"))?;
        self.level.process(out);
        self.peak = out.iter().fold(self.peak, |peak, x| peak.max(x.abs()));
        Ok(())
    }

    fn retune(&mut self, new: &IftNoiseNodeParams) -> Retune {
        if (IftNoiseNodeParams {
            vertices: VertexLevelParams { level: new.vertices.level, ..self.params.vertices },
            ..self.params.clone()
        }) != *new
        {
            return Retune::Rebuild;
        }
        self.level.set_target(f64::from(new.vertices.level));
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.level.start_from(old.level.current());
    }

    fn finish(&mut self, _: IftNoiseIo<'_>) -> Result<Summary, Fault> {
        Ok(coverage_summary(self.clips.noise().coverage(), self.peak))
    }

    archive_state!(clips, peak);

    fn trial(rng: &mut Rng) -> (IftNoiseNodeParams, MemoryFiles) {
        // Rates that every common rate of speeds divides.
        let rate = [6000, 12_000, 24_000][rng.below(3)];
        (IftNoiseNodeParams { rate: Rate::hz(rate), ..Params::trial(rng) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
