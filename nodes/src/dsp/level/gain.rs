//! The node `Gain`.

use super::ramp::{Gain, db_to_linear, modulate, ramp_frames};
use crate::core::fault::{Fault, Reject};
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, same_rate};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Ends, Incoming, Shape};
use crate::{params, ports};
params! {
    /// Multiplies audio by a gain.
    ///
    /// The gain is the product of the two parameters. A stream linked to `gain` replaces that parameter: it is mono, or has one channel
    /// for each channel of the audio. After its end it holds its last value.
    /// A parameter that changes while the graph runs is reached along a linear ramp of 10 ms.
    pub struct GainParams {
        /// Amplitude factor; a negative factor inverts the polarity.
        gain: f32 = 1.0, unit "", range -1000.0..=1000.0_f32;
        /// Additional level change.
        db: f32 = 0.0, unit "dB", range -120.0..=60.0_f32;
    }
}
ports! {
    /// Ports of `Gain`.
    pub struct GainPorts / GainIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
            /// Amplitude factor for each sample; replaces the parameter.
            gain: Option<Stream<f32>>,
        }
        out {
            /// The audio times the gain.
            out: Stream<f32>,
        }
    }
}

/// The node `Gain`.
#[derive(Debug)]
pub struct GainNode {
    gain: Gain,
    db: f64,
}

/// Refuses a control stream whose rate or number of channels does not fit the audio.
pub(crate) fn check_control(
    field: &str,
    audio: &Incoming<f32>,
    control: &Incoming<f32>,
) -> Result<(), Reject> {
    same_rate(field, control.rate, "`audio`", audio.rate)?;
    let Channels(width) = control.format;
    if width == 1 || width == audio.format.0 {
        return Ok(());
    }
    let message = format!("`{field}` has {width} channels, `audio` has {}", audio.format.0);
    Err(Reject::new("F046", message).at(field).help("one channel, or as many as `audio`"))
}

impl Node for GainNode {
    type Params = GainParams;
    type Ports = GainPorts;
    const NAME: &'static str = "Gain";
    const CLASS: Class = Class::Audio;
    const TAKES_BLOCKS: bool = true;

    fn shape(_: &GainParams, s: &mut Shape<'_, '_, GainPorts>) -> Result<(), Reject> {
        let audio = s.input(GainPorts::audio);
        if let Some(control) = s.optional(GainPorts::gain) {
            check_control("gain", &audio, &control)?;
        }
        s.when_ended(GainPorts::audio, Ends::Stop);
        s.when_ended(GainPorts::gain, Ends::Hold);
        s.output(GainPorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &GainParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(GainPorts::audio);
        let db = db_to_linear(f64::from(p.db));
        let gain = Gain::new(f64::from(p.gain) * db, ramp_frames(audio.rate), audio.format.0.into());
        Ok(Self { gain, db })
    }

    fn run(&mut self, mut io: GainIo<'_>) -> Result<(), Fault> {
        let out = io.out.items();
        match io.gain {
            Some(control) => {
                out.copy_from_slice(io.audio.items());
                modulate(out, io.audio.width(), control.items(), control.width(), self.db);
            }
            None => self.process_block(io.audio.items(), out),
        }
        Ok(())
    }

    fn process_block(&mut self, input: &[f32], out: &mut [f32]) {
        self.gain.apply(input, out);
    }

    fn retune(&mut self, new: &GainParams) -> Retune {
        self.db = db_to_linear(f64::from(new.db));
        self.gain.set_target(f64::from(new.gain) * self.db);
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.gain.start_from(old.gain.current());
    }
}
#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    fn standalone(gain: f32, db: f32) -> Standalone {
        let audio = vec![0.5, -0.25, 1.0, 0.125];
        Standalone::new::<GainNode>(GainParams { gain, db }).input(
            GainPorts::audio,
            Rate::hz(100),
            Channels(2),
            audio,
        )
    }

    #[test]
    fn factor_and_decibels_multiply() {
        let out = standalone(-2.0, 20.0).run().unwrap().stream(GainPorts::out);
        assert_eq!(out, [-10.0, 5.0, -20.0, -2.5]);
    }

    #[test]
    fn a_link_replaces_the_parameter_and_holds_its_last_value() {
        let mono = standalone(9.0, 0.0).optional(GainPorts::gain, Rate::hz(100), Channels(1), vec![4.0]);
        assert_eq!(mono.run().unwrap().stream(GainPorts::out), [2.0, -1.0, 4.0, 0.5]);
        let each =
            standalone(9.0, 20.0).optional(GainPorts::gain, Rate::hz(100), Channels(2), vec![1.0, 0.0]);
        assert_eq!(each.run().unwrap().stream(GainPorts::out), [5.0, 0.0, 10.0, 0.0]);
    }

    #[test]
    fn a_control_of_another_rate_or_width_is_refused() {
        let slow = standalone(1.0, 0.0).optional(GainPorts::gain, Rate::hz(50), Channels(1), vec![1.0]);
        assert_eq!(slow.shape().unwrap_err().field.as_deref(), Some("gain"));
        let wide = standalone(1.0, 0.0).optional(GainPorts::gain, Rate::hz(100), Channels(3), vec![1.0; 3]);
        assert_eq!(wide.shape().unwrap_err().code, "F046");
    }

    #[test]
    fn a_retuned_gain_reaches_its_target_in_ten_milliseconds() {
        let cx_rate = Rate::hz(1000);
        let mut node = GainNode { gain: Gain::new(0.0, ramp_frames(cx_rate), 1), db: 1.0 };
        assert_eq!(node.retune(&GainParams { gain: 1.0, db: 0.0 }), Retune::Done);
        let mut x = [1.0; 12];
        node.gain.process(&mut x);
        assert!((x[5] - 0.5).abs() < 1e-6 && x[9] < 1.0 && x[10] == 1.0);
    }
}
