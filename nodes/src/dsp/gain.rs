//! Gain that moves without clicks.

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

    /// Applies the gain to interleaved samples in place.
    pub fn process(&mut self, samples: &mut [f32]) {
        for frame in samples.chunks_exact_mut(self.channels) {
            let gain = self.current();
            self.passed = self.passed.saturating_add(1);
            for x in frame {
                *x = (f64::from(*x) * gain) as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_block_invariant, signal};
    use super::*;

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
}
