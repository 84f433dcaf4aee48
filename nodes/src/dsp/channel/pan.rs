//! The node `Pan`; stereo panning and balance.

use crate::core::fault::{Fault, Reject};
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Ends, Shape};
use crate::dsp::Gain;
use crate::dsp::level::gain::check_control;
use crate::dsp::ramp_frames;
use crate::{params, ports};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

/// The position of a mono signal between left (-1) and right (1): gains cos and sin of an angle, whose squares add up to 1.
///
/// At the centre the gain is -3.01 dB on each side, so the loudness in a room does not depend on the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pan {
    /// Gain of the left channel.
    pub left: f32,
    /// Gain of the right channel.
    pub right: f32,
}

impl Pan {
    /// Returns the gains of a position. Positions are clamped to [-1, 1]; NaN is the centre.
    #[must_use]
    pub fn new(position: f32) -> Self {
        let (right, left) = (FRAC_PI_4 * (clamped(position) + 1.0)).sin_cos();
        Self { left: left.max(0.0), right }
    }

    /// Writes mono `input` to stereo `out`.
    ///
    /// # Shapes
    /// `out` has two samples for each of `input`; surplus samples of either are ignored.
    pub fn process(&self, input: &[f32], out: &mut [f32]) {
        for (x, frame) in input.iter().zip(out.as_chunks_mut::<2>().0) {
            *frame = [x * self.left, x * self.right];
        }
    }
}

/// A stereo signal's balance from left only (-1) to right only (1).
///
/// The centre leaves the signal unchanged. Towards a side, the gain of the other channel falls as a cosine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance {
    /// Gain of the left channel.
    pub left: f32,
    /// Gain of the right channel.
    pub right: f32,
}

impl Balance {
    /// Returns the gains of a position. Positions are clamped to [-1, 1]; NaN is the centre.
    #[must_use]
    pub fn new(position: f32) -> Self {
        let position = clamped(position);
        let gain = |x: f32| if x >= 1.0 { 0.0 } else { (FRAC_PI_2 * x.max(0.0)).cos() };
        Self { left: gain(position), right: gain(-position) }
    }

    /// Balances stereo samples in place.
    pub fn process(&self, samples: &mut [f32]) {
        for [left, right] in samples.as_chunks_mut::<2>().0 {
            *left *= self.left;
            *right *= self.right;
        }
    }
}

fn clamped(position: f32) -> f32 {
    if position.is_nan() { 0.0 } else { position.clamp(-1.0, 1.0) }
}

params! {
    /// Pans mono audio between two loudspeakers with constant power.
    ///
    /// A stream linked to `position` replaces the parameter; after its end it holds its last value.
    /// A parameter that changes while the graph runs is reached along a linear ramp of 10 ms.
    pub struct PanParams {
        /// From left (-1) to right (1).
        position: f32 = 0.0, unit "", range -1.0..=1.0_f32;
    }
}
ports! {
    /// Ports of `Pan`.
    pub struct PanPorts / PanIo {
        in {
            /// Mono audio.
            audio: Stream<f32>,
            /// Position for each sample, mono; replaces the parameter.
            position: Option<Stream<f32>>,
        }
        out {
            /// Stereo audio.
            out: Stream<f32>,
        }
    }
}

/// The node `Pan`.
#[derive(Debug)]
pub struct PanNode {
    position: Gain,
}

impl Node for PanNode {
    type Params = PanParams;
    type Ports = PanPorts;
    const NAME: &'static str = "Pan";
    const CLASS: Class = Class::Audio;

    fn shape(_: &PanParams, s: &mut Shape<'_, '_, PanPorts>) -> Result<(), Reject> {
        let audio = s.input(PanPorts::audio);
        if audio.format != Channels(1) {
            let message = format!("`audio` has {} channels; Pan takes mono", audio.format.0);
            s.wrong(Reject::new("F046", message).at("audio").help("insert Mono before it"));
        }
        if let Some(position) = s.optional(PanPorts::position) {
            s.check(check_control("position", &audio, &position));
        }
        s.when_ended(PanPorts::audio, Ends::Stop);
        s.when_ended(PanPorts::position, Ends::Hold);
        s.output(PanPorts::out, audio.rate, Channels(2));
        Ok(())
    }

    fn build(p: &PanParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let rate = cx.input(PanPorts::audio).rate;
        Ok(Self { position: Gain::new(f64::from(p.position), ramp_frames(rate), 1) })
    }

    fn run(&mut self, mut io: PanIo<'_>) -> Result<(), Fault> {
        let (audio, out) = (io.audio.items(), io.out.items());
        match io.position {
            Some(position) => {
                for ((x, frame), position) in audio.chunks(1).zip(out.chunks_mut(2)).zip(position.items()) {
                    Pan::new(*position).process(x, frame);
                }
            }
            None => {
                let mut done = 0;
                while self.position.is_moving() && done < audio.len() {
                    let pan = Pan::new(self.position.advance() as f32);
                    pan.process(&audio[done..=done], &mut out[2 * done..2 * done + 2]);
                    done += 1;
                }
                Pan::new(self.position.current() as f32).process(&audio[done..], &mut out[2 * done..]);
            }
        }
        Ok(())
    }

    fn retune(&mut self, new: &PanParams) -> Retune {
        self.position.set_target(f64::from(new.position));
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.position.start_from(old.position.current());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    #[test]
    fn the_power_does_not_depend_on_the_position() {
        for i in -10_i8..=10 {
            let pan = Pan::new(f32::from(i) / 10.0);
            assert!((pan.left * pan.left + pan.right * pan.right - 1.0).abs() < 1e-6);
        }
        assert_eq!(Pan::new(-1.0), Pan { left: 1.0, right: 0.0 });
        assert!(Pan::new(5.0).left < 1e-7 && Pan::new(5.0).right == 1.0);
        assert_eq!(Pan::new(f32::NAN), Pan::new(0.0));
        let mut out = [0.0; 4];
        Pan::new(-1.0).process(&[0.5, -0.25], &mut out);
        assert_eq!(out, [0.5, 0.0, -0.25, 0.0]);
    }

    #[test]
    fn balance_leaves_the_centre_unchanged_and_silences_the_opposite_side() {
        assert_eq!(Balance::new(0.0), Balance { left: 1.0, right: 1.0 });
        assert_eq!(Balance::new(1.0), Balance { left: 0.0, right: 1.0 });
        assert_eq!(Balance::new(-2.0), Balance { left: 1.0, right: 0.0 });
        let mut x = [0.5, 0.25];
        Balance::new(0.5).process(&mut x);
        assert!((x[0] - 0.5 * 0.5_f32.sqrt()).abs() < 1e-6 && x[1] == 0.25);
    }

    #[test]
    fn the_node_pans_by_parameter_and_by_link() {
        let standalone = |position| {
            let params = PanParams { position };
            let audio = vec![1.0, 1.0, 1.0];
            Standalone::new::<PanNode>(params).input(PanPorts::audio, Rate::hz(100), Channels(1), audio)
        };
        assert_eq!(standalone(-1.0).run().unwrap().stream(PanPorts::out), [1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
        let linked =
            standalone(0.0).optional(PanPorts::position, Rate::hz(100), Channels(1), vec![-1.0, 1.0]);
        let out = linked.run().unwrap().stream(PanPorts::out);
        assert_eq!(out[..2], [1.0, 0.0]);
        assert!(out[3] == 1.0 && out[5] == 1.0 && out[4].abs() < 1e-7, "{out:?}");
    }

    #[test]
    fn stereo_is_refused_with_a_hint() {
        let standalone = Standalone::new::<PanNode>(PanParams { position: 0.0 });
        let stereo = standalone.input(PanPorts::audio, Rate::hz(100), Channels(2), vec![0.0; 4]);
        assert!(stereo.shape().unwrap_err().help.unwrap().contains("Mono"));
    }
}
