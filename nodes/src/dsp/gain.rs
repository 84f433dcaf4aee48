//! Gain that moves without clicks.

use super::node::ramp;
use crate::core::fault::{Fault, Reject};
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, same_rate};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Ends, Incoming, Shape};
use crate::{impl_state, params, ports};

/// Samples that are multiplied at once.
const LANES: usize = 32;

/// Amplitude factor of a level in dB; -infinity is 0.
#[must_use]
pub fn db_to_linear(db: f64) -> f64 {
    10_f64.powf(db / 20.0)
}

/// Level in dB of an amplitude factor; 0 is -infinity.
#[must_use]
pub fn linear_to_db(linear: f64) -> f64 {
    20.0 * linear.abs().log10()
}

/// Multiplies interleaved samples by those of a control of one channel, or of as many, and by a constant.
pub fn modulate(samples: &mut [f32], channels: usize, control: &[f32], width: usize, factor: f64) {
    let frames = samples.chunks_exact_mut(channels.max(1)).zip(control.chunks_exact(width.max(1)));
    for (frame, control) in frames {
        for (x, gain) in frame.iter_mut().zip(control.iter().cycle()) {
            *x = (f64::from(*x) * f64::from(*gain) * factor) as f32;
        }
    }
}

/// Multiplies samples by a constant on their way from one slice to another of the same length.
fn scale(samples: &[f32], gain: f32, out: &mut [f32]) {
    let (blocks, rest) = samples.as_chunks::<LANES>();
    let (out_blocks, out_rest) = out.as_chunks_mut::<LANES>();
    // Of a length that is known the loop becomes straight-line code; `map` on such arrays remains a call.
    for (out, block) in out_blocks.iter_mut().zip(blocks) {
        for (out, x) in out.iter_mut().zip(block) {
            *out = x * gain;
        }
    }
    for (out, x) in out_rest.iter_mut().zip(rest) {
        *out = x * gain;
    }
}

/// A gain that goes to each new target on a straight line of a fixed number of frames.
///
/// The gain of a frame is computed from how many frames have passed, not accumulated, so it arrives exactly.
#[derive(Clone, Debug)]
pub struct Gain {
    from: f64,
    target: f64,
    ramp: u64,
    passed: u64,
    channels: usize,
}
impl_state!(Gain { from, target, passed });

impl Gain {
    /// A gain at rest at `linear`, whose ramps last `ramp` frames (0: at once).
    #[must_use]
    pub fn new(linear: f64, ramp: u64, channels: usize) -> Self {
        Self { from: linear, target: linear, ramp, passed: ramp, channels: channels.max(1) }
    }

    /// The gain of the next frame.
    #[must_use]
    pub fn current(&self) -> f64 {
        if self.passed >= self.ramp {
            self.target
        } else {
            self.from + (self.target - self.from) * (self.passed as f64 / self.ramp as f64)
        }
    }

    /// Starts a ramp from the present gain.
    pub fn set_target(&mut self, linear: f64) {
        self.from = self.current();
        self.target = linear;
        self.passed = 0;
    }

    /// Starts a ramp from another gain to the present target.
    pub fn start_from(&mut self, linear: f64) {
        self.from = linear;
        self.passed = 0;
    }

    /// Whether a ramp is under way.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.passed < self.ramp
    }

    /// The gain of the next frame, which is then past.
    pub fn advance(&mut self) -> f64 {
        let gain = self.current();
        self.passed = self.passed.saturating_add(1);
        gain
    }

    /// Applies the gain to interleaved samples in place.
    pub fn process(&mut self, samples: &mut [f32]) {
        let moving = self.moving_samples(samples.len());
        let (ramp, still) = samples.split_at_mut(moving);
        for frame in ramp.chunks_exact_mut(self.channels) {
            let gain = self.advance() as f32;
            frame.iter_mut().for_each(|x| *x *= gain);
        }
        let gain = self.target as f32;
        still.iter_mut().for_each(|x| *x *= gain);
    }

    /// Applies the gain to interleaved samples on their way from one slice to another of the same length.
    #[inline]
    pub fn apply(&mut self, samples: &[f32], out: &mut [f32]) {
        if self.is_moving() {
            out.copy_from_slice(samples);
            self.process(out);
        } else {
            // Nearly always the gain is at rest, and then this is all there is to do.
            scale(samples, self.target as f32, out);
        }
    }

    /// How many of the next samples the ramp still reaches.
    fn moving_samples(&self, samples: usize) -> usize {
        let left = self.ramp.saturating_sub(self.passed);
        if left == 0 {
            return 0;
        }
        let frames = samples / self.channels;
        usize::try_from(left).map_or(frames, |left| left.min(frames)) * self.channels
    }
}

params! {
    /// Makes audio louder or softer.
    ///
    /// The two parameters multiply. With a link to `gain`, the linked stream takes the place of the number: mono for all
    /// channels, or one channel each. After its end the link holds its last value.
    /// A number that changes while the graph runs is reached on a straight line in 10 ms.
    pub struct GainParams {
        /// Amplitude factor; negative turns the polarity.
        gain: f32 = 1.0, unit "", range -1000.0..=1000.0_f32;
        /// Level change on top of it.
        db: f32 = 0.0, unit "dB", range -120.0..=60.0_f32;
    }
}
ports! {
    /// Ports of `Gain`.
    pub struct GainPorts / GainIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
            /// Amplitude factor for each sample, in place of the number.
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

/// Refuses a control stream that does not fit audio sample by sample.
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
        let gain = Gain::new(f64::from(p.gain) * db, ramp(audio.rate), audio.format.0.into());
        Ok(Self { gain, db })
    }

    #[inline]
    fn run(&mut self, mut io: GainIo<'_>) -> Result<(), Fault> {
        let out = io.out.items();
        match io.gain {
            Some(control) => {
                out.copy_from_slice(io.audio.items());
                modulate(out, io.audio.width(), control.items(), control.width(), self.db);
            }
            None => self.gain.apply(io.audio.items(), out),
        }
        Ok(())
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
    use super::super::testing::{assert_block_invariant, signal};
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    #[test]
    fn decibels_and_factors_are_inverse() {
        assert!((db_to_linear(-6.0) - 0.501_187_233_627_272_2).abs() < 1e-15);
        assert!((linear_to_db(db_to_linear(-37.5)) + 37.5).abs() < 1e-12);
        assert_eq!(db_to_linear(f64::NEG_INFINITY), 0.0);
    }

    #[test]
    fn a_ramp_is_straight_and_arrives() {
        let mut gain = Gain::new(0.0, 4, 1);
        gain.set_target(1.0);
        let mut x = [1.0; 6];
        gain.process(&mut x);
        assert_eq!(x, [0.0, 0.25, 0.5, 0.75, 1.0, 1.0]);
        gain.set_target(0.0);
        gain.process(&mut x[..2]);
        gain.set_target(0.5);
        assert_eq!(gain.current(), 0.5);
    }

    #[test]
    fn blocks_do_not_change_a_bit() {
        let new = || {
            let mut gain = Gain::new(0.2, 1500, 2);
            gain.set_target(3.0);
            gain
        };
        assert_block_invariant(&signal(2500, 2), 2, new, |g, _, x| g.process(x));
    }

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
    fn a_link_takes_the_place_of_the_number_and_holds_its_end() {
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
    fn a_retuned_gain_gets_there_in_ten_milliseconds() {
        let cx_rate = Rate::hz(1000);
        let mut node = GainNode { gain: Gain::new(0.0, ramp(cx_rate), 1), db: 1.0 };
        assert_eq!(node.retune(&GainParams { gain: 1.0, db: 0.0 }), Retune::Done);
        let mut x = [1.0; 12];
        node.gain.process(&mut x);
        assert!((x[5] - 0.5).abs() < 1e-6 && x[9] < 1.0 && x[10] == 1.0);
    }
}
