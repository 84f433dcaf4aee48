//! Fades whose gain is a function of the position alone.

use std::f64::consts::FRAC_PI_2;

/// Shape of a fade.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FadeLaw {
    /// Straight: in and out add up to 1, right for equal or correlated material.
    Linear,
    /// Sine and cosine: the squares add up to 1, right for uncorrelated material.
    EqualPower,
}

impl FadeLaw {
    /// Gains (out, in) at `way` in [0, 1] of a cross-fade.
    #[must_use]
    pub fn gains(self, way: f64) -> (f64, f64) {
        let way = way.clamp(0.0, 1.0);
        match self {
            Self::Linear => (1.0 - way, way),
            Self::EqualPower if way >= 1.0 => (0.0, 1.0),
            Self::EqualPower => ((FRAC_PI_2 * way).cos(), (FRAC_PI_2 * way).sin()),
        }
    }
}

/// A fade that begins at frame `start` and lasts `frames`: gain 0 (or 1) before, 1 (or 0) from its end on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fade {
    /// Shape.
    pub law: FadeLaw,
    /// Whether the sound comes in.
    pub rising: bool,
    /// First frame of the fade.
    pub start: i64,
    /// Frames from one end to the other; 0 is a cut.
    pub frames: u64,
}

impl Fade {
    /// The gain of a frame.
    #[must_use]
    pub fn gain_at(&self, frame: i64) -> f64 {
        let passed = i128::from(frame) - i128::from(self.start);
        let way = if passed >= i128::from(self.frames) { 1.0 } else { passed as f64 / self.frames as f64 };
        let (out, into) = self.law.gains(way);
        if self.rising { into } else { out }
    }

    /// Fades interleaved samples, the first of which belong to frame `first`, in place.
    pub fn process(&self, first: i64, samples: &mut [f32], channels: usize) {
        for (frame, samples) in (first..).zip(samples.chunks_exact_mut(channels.max(1))) {
            let gain = self.gain_at(frame);
            for x in samples {
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
    fn laws_keep_their_sums() {
        for i in 0..=20 {
            let way = f64::from(i) / 20.0;
            let (out, into) = FadeLaw::Linear.gains(way);
            assert!((out + into - 1.0).abs() < 1e-15);
            let (out, into) = FadeLaw::EqualPower.gains(way);
            assert!((out * out + into * into - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn a_fade_has_both_ends_exact() {
        let fade = Fade { law: FadeLaw::EqualPower, rising: false, start: 10, frames: 4 };
        assert_eq!([i64::MIN, 10, 14, i64::MAX].map(|n| fade.gain_at(n)), [1.0, 1.0, 0.0, 0.0]);
        let cut = Fade { law: FadeLaw::Linear, rising: true, start: 3, frames: 0 };
        assert_eq!([2, 3].map(|n| cut.gain_at(n)), [0.0, 1.0]);
    }

    #[test]
    fn blocks_do_not_change_a_bit() {
        let fade = Fade { law: FadeLaw::EqualPower, rising: true, start: 30, frames: 2000 };
        assert_block_invariant(&signal(2500, 2), 2, || fade, |f, at, x| f.process(at, x, 2));
    }
}
