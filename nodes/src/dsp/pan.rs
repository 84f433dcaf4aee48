//! Placing sound between two loudspeakers.

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
