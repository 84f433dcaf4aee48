//! The node `Normalize`.

use super::meter::Level;
use super::ramp::{Gain, db_to_linear, ramp_frames};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Retune};
use crate::core::ports::{Stream, Value};
use crate::core::shape::{Build, Shape};
use crate::{params, ports};
params! {
    /// Scales a recording to a peak level.
    ///
    /// `Normalize(audio: "x", level: "loudness")` with `"loudness": Loudness(audio: "x")` runs `x` twice, the first time to measure it.
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
            /// Level of the audio.
            level: Value<Level>,
        }
        out {
            /// The scaled audio.
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
    let target = db_to_linear(f64::from(p.peak_db));
    if level.peak > 0.0 { target / f64::from(level.peak) } else { 1.0 }
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
        Ok(Self { gain: Gain::new(factor(p, level), ramp_frames(audio.rate), audio.format.0.into()), level })
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
    use super::super::loudness::{LoudnessNode, LoudnessParams, LoudnessPorts};
    use super::super::weighting::Weighting;
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    #[test]
    fn a_measured_recording_is_scaled_to_the_given_peak() {
        let (rate, audio) = (Rate::hz(100), vec![0.1, -0.25, 0.2, 0.0]);
        let measure = Standalone::new::<LoudnessNode>(LoudnessParams { weighting: Weighting::None });
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
