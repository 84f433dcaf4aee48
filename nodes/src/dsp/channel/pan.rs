//! Placing sound between two loudspeakers.

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

/// A mono signal's place between left (-1) and right (1): gains cos and sin of an angle, whose squares add up to 1.
///
/// The centre has -3.01 dB on each side, so loudness in a room stays the same all the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pan {
    /// Gain of the left channel.
    pub left: f32,
    /// Gain of the right channel.
    pub right: f32,
}

impl Pan {
    /// The gains of a position; positions beyond +-1 are the ends, NaN is the centre.
    #[must_use]
    pub fn new(position: f32) -> Self {
        let (right, left) = (FRAC_PI_4 * (clean(position) + 1.0)).sin_cos();
        Self { left: left.max(0.0), right }
    }

    /// Writes mono `input` to stereo `out`.
    ///
    /// # Shapes
    /// `out` has two samples for each of `input`; the shorter of the two decides.
    pub fn process(&self, input: &[f32], out: &mut [f32]) {
        for (x, frame) in input.iter().zip(out.as_chunks_mut::<2>().0) {
            *frame = [x * self.left, x * self.right];
        }
    }
}

/// A stereo signal's balance from left only (-1) to right only (1).
///
/// The centre changes nothing; towards a side, the other channel falls as the cosine of the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance {
    /// Gain of the left channel.
    pub left: f32,
    /// Gain of the right channel.
    pub right: f32,
}

impl Balance {
    /// The gains of a position; positions beyond +-1 are the ends, NaN is the centre.
    #[must_use]
    pub fn new(position: f32) -> Self {
        let position = clean(position);
        let gain = |way: f32| if way >= 1.0 { 0.0 } else { (FRAC_PI_2 * way.max(0.0)).cos() };
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

fn clean(position: f32) -> f32 {
    if position.is_nan() { 0.0 } else { position.clamp(-1.0, 1.0) }
}

params! {
    /// Places mono audio between two loudspeakers, equally loud all the way.
    ///
    /// With a link to `position`, the linked stream takes the place of the number; after its end it holds its last value.
    /// A number that changes while the graph runs is reached on a straight line in 10 ms.
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
            /// Position for each sample, in place of the number: mono.
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
            let message = format!("`audio` has {} channels; Pan places mono", audio.format.0);
            s.wrong(Reject::new("F046", message).at("audio").help("put Mono before it"));
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
                for ((x, frame), at) in audio.chunks(1).zip(out.chunks_mut(2)).zip(position.items()) {
                    Pan::new(*at).process(x, frame);
                }
            }
            None => {
                let mut at = 0;
                while self.position.is_moving() && at < audio.len() {
                    let pan = Pan::new(self.position.advance() as f32);
                    pan.process(&audio[at..=at], &mut out[2 * at..2 * at + 2]);
                    at += 1;
                }
                Pan::new(self.position.current() as f32).process(&audio[at..], &mut out[2 * at..]);
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
    fn the_power_is_the_same_everywhere() {
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
    fn balance_leaves_the_centre_alone_and_silences_the_far_side() {
        assert_eq!(Balance::new(0.0), Balance { left: 1.0, right: 1.0 });
        assert_eq!(Balance::new(1.0), Balance { left: 0.0, right: 1.0 });
        assert_eq!(Balance::new(-2.0), Balance { left: 1.0, right: 0.0 });
        let mut x = [0.5, 0.25];
        Balance::new(0.5).process(&mut x);
        assert!((x[0] - 0.5 * 0.5_f32.sqrt()).abs() < 1e-6 && x[1] == 0.25);
    }

    #[test]
    fn the_node_pans_by_number_and_by_link() {
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
    fn stereo_is_refused_with_the_node_that_helps() {
        let standalone = Standalone::new::<PanNode>(PanParams { position: 0.0 });
        let stereo = standalone.input(PanPorts::audio, Rate::hz(100), Channels(2), vec![0.0; 4]);
        assert!(stereo.shape().unwrap_err().help.unwrap().contains("Mono"));
    }
}
