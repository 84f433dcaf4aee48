//! Amplitude modulation: a node with a stream, a value and a state.

use foley::nodes::prelude::node::*;

/// A low-frequency oscillator that scales a signal.
pub struct Modulator {
    depth: f64,
    /// Cycles per frame.
    step: f64,
    phase: f64,
}

impl Modulator {
    /// An oscillator at its loudest; `depth` from 0 to 1, `rate` in Hz, `fs` in frames per second.
    pub fn new(depth: f64, rate: f64, fs: f64) -> Self {
        Self { depth, step: rate / fs, phase: 0.0 }
    }

    /// Scales frames of interleaved channels.
    ///
    /// # Shapes
    /// `input` and `output`: `[frames, channels]`.
    pub fn process(&mut self, input: &[f32], output: &mut [f32], channels: usize) {
        for (input, output) in input.chunks_exact(channels).zip(output.chunks_exact_mut(channels)) {
            let gain = 1.0 - self.depth * (0.5 - 0.5 * (std::f64::consts::TAU * self.phase).cos());
            self.phase = (self.phase + self.step).fract();
            input.iter().zip(output).for_each(|(x, y)| *y = x * gain as f32);
        }
    }
}

params! {
    /// Modulates the amplitude of a sound.
    pub struct TremoloParams {
        /// Depth of the modulation: 1 reaches silence.
        depth: f64 = 0.5, unit "", range 0.0..=1.0;
    }
}

ports! {
    pub struct TremoloPorts / TremoloIo {
        in {
            /// The sound.
            audio: Stream<f32>,
            /// Rate of the modulation, Hz.
            rate: Value<f64>,
        }
        out {
            /// The modulated sound.
            audio_out: Stream<f32>,
        }
    }
}

/// The node `Tremolo`.
pub struct Tremolo(Modulator);

impl Node for Tremolo {
    type Params = TremoloParams;
    type Ports = TremoloPorts;
    const NAME: &'static str = "Tremolo";
    const CLASS: Class = Class::Audio;

    fn shape(_: &TremoloParams, shape: &mut Shape<'_, '_, TremoloPorts>) -> Result<(), Reject> {
        let audio = shape.input(TremoloPorts::audio);
        shape.output(TremoloPorts::audio_out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &TremoloParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let fs = cx.input(TremoloPorts::audio).rate.as_f64();
        Ok(Self(Modulator::new(p.depth, *cx.value(TremoloPorts::rate), fs)))
    }

    fn run(&mut self, mut io: TremoloIo<'_>) -> Result<(), Fault> {
        let channels = io.audio.width();
        self.0.process(io.audio.items(), io.audio_out.items(), channels);
        Ok(())
    }

    fn archive_state(
        &mut self,
        archive: &mut foley::nodes::core::state::StateArchive<'_>,
    ) -> Result<(), Fault> {
        self.0.phase.archive_state(archive)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_depth_reaches_silence_half_a_cycle_after_the_loudest_frame() {
        let mut output = [0.0; 8];
        Modulator::new(1.0, 1.0, 8.0).process(&[1.0; 8], &mut output, 1);
        assert!((output[0] - 1.0).abs() < 1e-6 && output[4].abs() < 1e-6, "{output:?}");
    }
}
