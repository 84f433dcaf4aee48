//! The level of a whole recording, and bringing it to a wanted one.

use super::db_to_linear;
use super::gain::Gain;
use super::node::ramp;
use crate::core::fault::{Fault, Reject};
use crate::core::item::Data;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{archive_state, impl_state, params, ports};
use serde::{Deserialize, Serialize};

/// How loud a whole recording is, all channels together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Largest magnitude of a sample.
    pub peak: f32,
    /// Root mean square of all samples.
    pub rms: f64,
}

impl Data for Level {
    const NAME: &'static str = "level";

    fn trial(rng: &mut Rng) -> Self {
        let peak = rng.between(0.01, 2.0) as f32;
        Self { peak, rms: f64::from(peak) * rng.between(0.01, 1.0) }
    }
}

/// Measures a [`Level`] block by block.
#[derive(Clone, Copy, Debug, Default)]
pub struct LevelMeter {
    peak: f32,
    sum_squares: f64,
    samples: u64,
}
impl_state!(LevelMeter { peak, sum_squares, samples });

impl LevelMeter {
    /// Takes in samples, one after the other, so that blocks do not change a bit.
    pub fn process(&mut self, samples: &[f32]) {
        self.process_each(samples);
    }

    /// The same of any samples, such as those of one channel.
    pub fn process_each<'a>(&mut self, samples: impl IntoIterator<Item = &'a f32>) {
        for &x in samples {
            self.peak = self.peak.max(x.abs());
            self.sum_squares += f64::from(x) * f64::from(x);
            self.samples += 1;
        }
    }

    /// The level of everything so far; that of silence where there was nothing.
    #[must_use]
    pub fn level(&self) -> Level {
        Level { peak: self.peak, rms: (self.sum_squares / self.samples.max(1) as f64).sqrt() }
    }
}

params! {
    /// Measures peak and root mean square of a whole recording.
    ///
    /// The value is there once the recording has ended: what it is linked to runs in a later phase.
    pub struct LoudnessParams {}
}
ports! {
    /// Ports of `Loudness`.
    pub struct LoudnessPorts / LoudnessIo {
        in {
            /// Audio with an end.
            audio: Stream<f32>,
        }
        out {
            /// Its level.
            level: Fold<Level>,
        }
    }
}

/// The node `Loudness`.
#[derive(Debug)]
pub struct LoudnessNode(LevelMeter);

impl Node for LoudnessNode {
    type Params = LoudnessParams;
    type Ports = LoudnessPorts;
    const NAME: &'static str = "Loudness";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 3.0;

    fn shape(_: &LoudnessParams, s: &mut Shape<'_, '_, LoudnessPorts>) -> Result<(), Reject> {
        let _ = s.input(LoudnessPorts::audio);
        Ok(())
    }

    fn build(_: &LoudnessParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self(LevelMeter::default()))
    }

    fn run(&mut self, io: LoudnessIo<'_>) -> Result<(), Fault> {
        self.0.process(io.audio.items());
        Ok(())
    }

    fn finish(&mut self, mut io: LoudnessIo<'_>) -> Result<Summary, Fault> {
        let level = self.0.level();
        io.level.set(level);
        Ok(vec![("peak", level.peak.into()), ("rms", level.rms.into())])
    }

    archive_state!(0);
}

params! {
    /// Brings a recording to a wanted peak by one gain for all of it.
    ///
    /// `Normalize(audio: "x", level: "loudness")` with `"loudness": Loudness(audio: "x")` plays `x` twice: once to measure it.
    /// Silence stays silence.
    pub struct NormalizeParams {
        /// Peak of the output, relative to full scale.
        peak_db: f32 = -1.0, unit "dB", range -120.0..=60.0_f32;
    }
}
ports! {
    /// Ports of `Normalize`.
    pub struct NormalizePorts / NormalizeIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
            /// Its level.
            level: Value<Level>,
        }
        out {
            /// The audio at the wanted level.
            out: Stream<f32>,
        }
    }
}

/// The node `Normalize`.
#[derive(Debug)]
pub struct NormalizeNode {
    gain: Gain,
    level: Level,
}

fn factor(p: &NormalizeParams, level: Level) -> f64 {
    let wanted = db_to_linear(f64::from(p.peak_db));
    if level.peak > 0.0 { wanted / f64::from(level.peak) } else { 1.0 }
}

impl Node for NormalizeNode {
    type Params = NormalizeParams;
    type Ports = NormalizePorts;
    const NAME: &'static str = "Normalize";
    const CLASS: Class = Class::Audio;

    fn shape(_: &NormalizeParams, s: &mut Shape<'_, '_, NormalizePorts>) -> Result<(), Reject> {
        let audio = s.input(NormalizePorts::audio);
        s.output(NormalizePorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &NormalizeParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (audio, level) = (cx.input(NormalizePorts::audio), *cx.value(NormalizePorts::level));
        Ok(Self { gain: Gain::new(factor(p, level), ramp(audio.rate), audio.format.0.into()), level })
    }

    fn run(&mut self, mut io: NormalizeIo<'_>) -> Result<(), Fault> {
        let out = io.out.items();
        out.copy_from_slice(io.audio.items());
        self.gain.process(out);
        Ok(())
    }

    fn retune(&mut self, new: &NormalizeParams) -> Retune {
        self.gain.set_target(factor(new, self.level));
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.gain.start_from(old.gain.current());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    #[test]
    fn a_measured_recording_comes_out_at_its_peak() {
        let (rate, audio) = (Rate::hz(100), vec![0.1, -0.25, 0.2, 0.0]);
        let measure = Standalone::new::<LoudnessNode>(LoudnessParams {});
        let run = measure.input(LoudnessPorts::audio, rate, Channels(2), audio.clone()).run().unwrap();
        let level = *run.value(0).unwrap().get::<Level>().unwrap();
        assert_eq!(level.peak, 0.25);
        assert!((level.rms - (0.1125_f64 / 4.0).sqrt()).abs() < 1e-8);
        let loud = Standalone::new::<NormalizeNode>(NormalizeParams { peak_db: 0.0 });
        let loud = loud.input(NormalizePorts::audio, rate, Channels(2), audio);
        let run = loud.value(NormalizePorts::level, level).run().unwrap();
        assert_eq!(run.stream(NormalizePorts::out), [0.4, -1.0, 0.8, 0.0]);
    }

    #[test]
    fn silence_stays_silence() {
        let standalone = Standalone::new::<NormalizeNode>(NormalizeParams { peak_db: -1.0 });
        let standalone = standalone.input(NormalizePorts::audio, Rate::hz(100), Channels(1), vec![0.0; 4]);
        let run = standalone.value(NormalizePorts::level, Level::default()).run().unwrap();
        assert_eq!(run.stream(NormalizePorts::out), [0.0; 4]);
    }
}
