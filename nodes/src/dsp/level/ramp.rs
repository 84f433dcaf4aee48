//! Gains that change along straight lines, without clicks.

use crate::core::time::Rate;
use crate::dsp::nearest_items;
use crate::impl_state;
/// Samples multiplied at a time.
const LANES: usize = 32;

/// Returns the amplitude factor of a level in dB; that of -infinity is 0.
#[must_use]
pub fn db_to_linear(db: f64) -> f64 {
    10_f64.powf(db / 20.0)
}

/// Returns the level in dB of an amplitude factor; that of 0 is -infinity.
#[must_use]
pub fn linear_to_db(linear: f64) -> f64 {
    20.0 * linear.abs().log10()
}

/// Multiplies interleaved samples by a constant and by a control signal, which has one channel or one for each channel of the audio.
pub fn modulate(samples: &mut [f32], channels: usize, control: &[f32], width: usize, factor: f64) {
    let frames = samples.chunks_exact_mut(channels.max(1)).zip(control.chunks_exact(width.max(1)));
    for (frame, control) in frames {
        for (x, gain) in frame.iter_mut().zip(control.iter().cycle()) {
            *x = (f64::from(*x) * f64::from(*gain) * factor) as f32;
        }
    }
}

/// Writes samples times a constant to another slice of the same length.
fn scale(samples: &[f32], gain: f32, out: &mut [f32]) {
    let (blocks, rest) = samples.as_chunks::<LANES>();
    let (out_blocks, out_rest) = out.as_chunks_mut::<LANES>();
    // The compiler unrolls a loop of constant length; `map` on such arrays remains a call.
    for (out, block) in out_blocks.iter_mut().zip(blocks) {
        for (out, x) in out.iter_mut().zip(block) {
            *out = x * gain;
        }
    }
    for (out, x) in out_rest.iter_mut().zip(rest) {
        *out = x * gain;
    }
}

/// A gain that reaches each new target along a linear ramp of a fixed number of frames.
///
/// The gain of a frame is computed from the number of frames since the start of the ramp, not accumulated, so it reaches the target
/// exactly.
#[derive(Clone, Debug)]
pub struct Gain {
    from: f64,
    target: f64,
    ramp: u64,
    elapsed: u64,
    channels: usize,
}
impl_state!(Gain { from, target, elapsed });

impl Gain {
    /// Creates a constant gain `linear`. Later ramps last `ramp` frames; 0 is a step.
    #[must_use]
    pub fn new(linear: f64, ramp: u64, channels: usize) -> Self {
        Self { from: linear, target: linear, ramp, elapsed: ramp, channels: channels.max(1) }
    }

    /// Returns the gain of the next frame.
    #[must_use]
    pub fn current(&self) -> f64 {
        if self.elapsed >= self.ramp {
            self.target
        } else {
            self.from + (self.target - self.from) * (self.elapsed as f64 / self.ramp as f64)
        }
    }

    /// Starts a ramp from the current gain to a new target.
    pub fn set_target(&mut self, linear: f64) {
        self.from = self.current();
        self.target = linear;
        self.elapsed = 0;
    }

    /// Starts a ramp from another gain to the current target.
    pub fn start_from(&mut self, linear: f64) {
        self.from = linear;
        self.elapsed = 0;
    }

    /// Returns true during a ramp.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.elapsed < self.ramp
    }

    /// Returns the gain of the next frame and advances by one frame.
    pub fn advance(&mut self) -> f64 {
        let gain = self.current();
        self.elapsed = self.elapsed.saturating_add(1);
        gain
    }

    /// Applies the gain to interleaved samples in place.
    pub fn process(&mut self, samples: &mut [f32]) {
        let moving = self.moving_samples(samples.len());
        let (ramp, constant) = samples.split_at_mut(moving);
        for frame in ramp.chunks_exact_mut(self.channels) {
            let gain = self.advance() as f32;
            frame.iter_mut().for_each(|x| *x *= gain);
        }
        let gain = self.target as f32;
        constant.iter_mut().for_each(|x| *x *= gain);
    }

    /// Writes interleaved samples times the gain to another slice of the same length.
    #[inline]
    pub fn apply(&mut self, samples: &[f32], out: &mut [f32]) {
        if self.is_moving() {
            out.copy_from_slice(samples);
            self.process(out);
        } else {
            // The common case: a constant gain.
            scale(samples, self.target as f32, out);
        }
    }

    /// Adds interleaved samples times the gain to another slice; of two lengths the shorter counts.
    #[inline]
    pub fn add(&mut self, samples: &[f32], out: &mut [f32]) {
        let moving = self.moving_samples(samples.len().min(out.len()));
        let ((ramp, constant), (out_ramp, out_constant)) =
            (samples.split_at(moving), out.split_at_mut(moving));
        let frames = ramp.chunks_exact(self.channels).zip(out_ramp.chunks_exact_mut(self.channels));
        for (frame, out) in frames {
            let gain = self.advance() as f32;
            out.iter_mut().zip(frame).for_each(|(out, x)| *out += gain * x);
        }
        let gain = self.target as f32;
        out_constant.iter_mut().zip(constant).for_each(|(out, x)| *out += gain * x);
    }

    /// As [`add`](Self::add) of one signal after the other, to the bit, and faster while the gains are constant.
    #[inline]
    pub fn add_all(gains: &mut [Self; 4], signals: [&[f32]; 4], out: &mut [f32]) {
        let len = signals.iter().fold(out.len(), |len, signal| len.min(signal.len()));
        if gains.iter().any(Self::is_moving) || signals.iter().any(|signal| signal.len() != len) {
            gains.iter_mut().zip(signals).for_each(|(gain, signal)| gain.add(signal, out));
            return;
        }
        let [a, b, c, d] = signals;
        let [ga, gb, gc, gd] = gains.each_ref().map(|gain| gain.target as f32);
        let signals = a.iter().zip(b).zip(c.iter().zip(d));
        for (out, ((a, b), (c, d))) in out.iter_mut().zip(signals) {
            *out = *out + ga * a + gb * b + gc * c + gd * d;
        }
    }

    /// Returns the number of the next samples that belong to the ramp.
    fn moving_samples(&self, samples: usize) -> usize {
        let left = self.ramp.saturating_sub(self.elapsed);
        if left == 0 {
            return 0;
        }
        let frames = samples / self.channels;
        usize::try_from(left).map_or(frames, |left| left.min(frames)) * self.channels
    }
}

/// Frames over which a gain that changes during a run reaches its new value: 10 ms.
pub(crate) fn ramp_frames(rate: Rate) -> u64 {
    nearest_items(rate, 0.010) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dsp::testing::{assert_block_invariant, signal};
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
    fn signals_added_at_once_give_the_bits_of_one_after_the_other() {
        let signals: [Vec<f32>; 4] = std::array::from_fn(|k| signal(300 + k, 1));
        for (moving, lens) in [(false, [257; 4]), (true, [257; 4]), (false, [257, 200, 0, 31])] {
            let mut gains = [0.3, -1.7, 1.0, 0.01].map(|gain| Gain::new(gain, 100, 1));
            if moving {
                gains[2].set_target(0.5);
            }
            let mut right_gains = gains.clone();
            let signals: [&[f32]; 4] = std::array::from_fn(|k| &signals[k][k..k + lens[k]]);
            let (mut out, mut right) = ([0.125; 257], [0.125; 257]);
            Gain::add_all(&mut gains, signals, &mut out);
            right_gains.iter_mut().zip(signals).for_each(|(gain, signal)| gain.add(signal, &mut right));
            assert_eq!(out, right);
            assert_eq!(gains.map(|gain| gain.elapsed), right_gains.map(|gain| gain.elapsed));
        }
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
}
