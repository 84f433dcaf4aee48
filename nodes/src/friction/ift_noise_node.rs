//! Friction noise as a node.

use super::ift_noise::{AreaWeight, ClipInput, Emitters, IftNoise, IftNoiseParams, Magnitude, SpeedCoverage};
use super::interpolate::Gain;
use super::model::MAX_CLIP_SAMPLES;
use super::{ClipStream, FrictionModel, Window};
use crate::contact::Speeds;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::{Param, Params};
use crate::core::ports::{Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::dsp;
use crate::{archive_state, choices, params, ports};

choices! { @param Window {
    /// Square root of a triangle: the power of overlapping clips is constant.
    SqrtTriangle,
    /// Half a sine: constant power too, smooth at its top.
    Sine,
    /// Plain triangle, for comparison: 3 dB dips at the clip rate.
    Triangle,
} }

choices! { @param Magnitude {
    /// Every bin has the magnitude that the model says, as in the paper.
    Fixed,
    /// Magnitudes are Rayleigh distributed around it, as in Gaussian noise.
    Rayleigh,
} }

choices! { @param AreaWeight {
    /// Power in proportion to the area of cloth that a vertex stands for, so that a finer mesh is not louder.
    Sqrt,
    /// Every vertex alike, as in the paper: four times the vertices are 6 dB louder.
    None,
} }

choices! { @param Gain {
    /// The sum of amplitudes is linear in speed, the paper's reading; loses power between spectra of unequal width.
    Mass,
    /// The sum of squared amplitudes is linear in speed.
    Rms,
} }

choices! {
    /// How vertices become sound sources.
    pub enum EmitterKind {
        /// The powers of vertices that are heard from one place are added before phases are drawn: one transform per clip. For
        /// `IftNoise`, which knows no places, that is all of them.
        Clustered,
        /// Every vertex has phases of its own: the reference, and slow.
        PerVertex,
    }
}

choices! {
    /// When in a clip the motion is taken that it sounds of.
    pub enum MotionAt {
        /// At its middle: in time on average, though the start of a slide is heard half a clip early.
        Centre,
        /// At its start: nothing is heard early and nothing waited for, for live use; all is heard half a clip later.
        Start,
    }
}

impl MotionAt {
    /// Speeds before and after those of a window that its clips are made of.
    pub(super) fn reach(self) -> [usize; 2] {
        match self {
            Self::Centre => [1, 1],
            Self::Start => [2, 0],
        }
    }

    /// The speed that a clip is made of; each is the middle of one clip and the start of the next.
    pub(super) fn item(self, clip: u64) -> i64 {
        match self {
            Self::Centre => clip as i64,
            Self::Start => clip as i64 - 1,
        }
    }
}

params! {
    /// The sound of sliding cloth: noise with the friction model's spectrum at the speed of every vertex.
    ///
    /// Each item of `speeds` is the middle of one clip, or its start (`motion_at`); clips overlap by half and so are two items long: 50 ms at 40
    /// speeds per second. A clip has the model's amplitudes and random phases and is made by an inverse Fourier transform.
    /// Speeds outside of the model are clamped above and fall off in level below; the summary tells their shares. Vertices
    /// that do not slide cost nothing, and where none slides the output is exactly zero.
    ///
    /// There must be a whole number of samples from one speed to the next. This node makes audio from something that is
    /// none, so it has a sample rate of its own; everything after it follows.
    ///
    /// # Randomness
    /// A phase follows from the seed, the emitter, the clip and the bin alone.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2; Rodet
    /// and Depalle, "Spectral envelopes and inverse FFT synthesis" (1992). The paper gives no output window; the triangle
    /// of its analysis would dip by 3 dB at the clip rate.
    pub struct IftNoiseNodeParams {
        /// Sample rate of the audio.
        rate: Rate = Rate::hz(48_000);
        /// Cross-fade between clips.
        window: Window = Window::SqrtTriangle;
        /// Magnitude of a bin around its expected value.
        magnitude: Magnitude = Magnitude::Fixed;
        /// How vertices become sound sources.
        emitters: EmitterKind = EmitterKind::Clustered;
        /// When in a clip speeds are taken.
        motion_at: MotionAt = MotionAt::Centre;
        /// How loud a vertex is for its area.
        area_weight: AreaWeight = AreaWeight::Sqrt;
        /// Level of spectra between measured speeds.
        gain: Gain = Gain::Rms;
        /// Factor on the output; one that changes while the graph runs is reached on a straight line in 10 ms.
        level: f32 = 1.0, unit "", range 0.0..=1000.0;
    }
}

ports! {
    pub struct IftNoisePorts / IftNoiseIo {
        in {
            /// Sliding speed per vertex.
            speeds: Stream<Speeds>,
            /// Power density per speed.
            model: Value<FrictionModel>,
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
    /// The level, which moves to a new value in 10 ms.
    level: dsp::Gain,
    peak: f32,
    params: IftNoiseNodeParams,
}

/// What is told of friction noise in the end.
pub(super) fn told(coverage: SpeedCoverage, peak: f32) -> Summary {
    vec![
        ("emitter_clips", coverage.sliding.into()),
        ("share_above", coverage.share_above().into()),
        ("share_below", coverage.share_below().into()),
        ("peak", peak.into()),
    ]
}

/// Samples from one speed to the next.
pub(super) fn hop(audio: Rate, speeds: Rate) -> Result<usize, Reject> {
    let exact = audio.num() as f64 * speeds.den() as f64 / (audio.den() as f64 * speeds.num() as f64);
    let most = MAX_CLIP_SAMPLES as f64 / 2.0;
    let nearest = exact.round().clamp(1.0, most) as u64;
    let fitting = audio.divided_by(nearest);
    if fitting == Some(speeds) {
        return Ok(nearest as usize);
    }
    let found = format!("{exact:.3} samples at {audio} from one speed to the next at {speeds}");
    let reject =
        Reject::new("F074", format!("{found}; a whole number is needed, of at most {most}")).at("speeds");
    Err(match fitting {
        Some(rate) => reject.help(format!("set `rate: {}` on the node that gives the speeds", rate.write())),
        None => reject,
    })
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
        let [past, ahead] = p.motion_at.reach();
        s.lookaround(IftNoisePorts::speeds, past, ahead);
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
            window: p.window,
            magnitude: p.magnitude,
            emitters: match p.emitters {
                EmitterKind::Clustered => Emitters::default(),
                EmitterKind::PerVertex => Emitters::PerVertex,
            },
            area_weight: p.area_weight,
            gain: p.gain,
        };
        let noise = IftNoise::new(&model, fs, params, &speeds.format, cx.random);
        let noise = noise.map_err(|e| Fault::new("F076", e.to_string()).at("model"))?;
        let ramp = (0.010 * fs).round() as u64;
        let level = dsp::Gain::new(f64::from(p.level), ramp, 1);
        Ok(Self { clips: ClipStream::new(noise), level, peak: 0.0, params: p.clone() })
    }

    fn run(&mut self, mut io: IftNoiseIo<'_>) -> Result<(), Fault> {
        let (speeds, first) = (&io.speeds, io.speeds.first());
        let from = io.audio.first().max(0) as u64;
        let out = io.audio.items();
        let motion_at = self.params.motion_at;
        let clip = |clip: u64| ClipInput {
            speeds: speeds.item((motion_at.item(clip) - first) as isize),
            positions: None,
        };
        self.clips.fill(from, out, clip).map_err(|e| Fault::new("F076", e.to_string()).at("speeds"))?;
        self.level.process(out);
        self.peak = out.iter().fold(self.peak, |peak, x| peak.max(x.abs()));
        Ok(())
    }

    fn retune(&mut self, new: &IftNoiseNodeParams) -> Retune {
        if (IftNoiseNodeParams { level: new.level, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        self.level.set_target(f64::from(new.level));
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.level.start_from(old.level.current());
    }

    fn finish(&mut self, _: IftNoiseIo<'_>) -> Result<Summary, Fault> {
        Ok(told(self.clips.noise().coverage(), self.peak))
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
