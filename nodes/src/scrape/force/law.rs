//! The law of force and speed that all excitations share.

use super::approximation::power;
use super::motion::Motion;
use super::ramp::Ramp;
use super::segment::{CELL, Cell, Segment};
use super::speed_curve::SpeedCurve;

/// Amplitude `kappa (f/f_ref)^a (v/v_ref)^b` with `f_ref` = 1 N and `v_ref` = 1 m/s. Every parameter can change while
/// it sounds.
///
/// # Source
/// Picard, Tsingos and Faure (VRIPHYS 2008), section 4, use position, force and velocity; the law is a choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// Factor.
    pub kappa: Ramp,
    /// Exponent of the force.
    pub a: Ramp,
    /// Exponent of the speed.
    pub b: Ramp,
    /// Multiplier of the factor at each speed, if it was measured.
    pub curve: Option<SpeedCurve>,
}

impl Law {
    /// A law with constant parameters.
    #[must_use]
    pub fn new([kappa, a, b]: [f64; 3], rate: f64) -> Self {
        Self { kappa: Ramp::new(kappa, rate), a: Ramp::new(a, rate), b: Ramp::new(b, rate), curve: None }
    }

    /// Starts a ramp to another law at a sample.
    pub fn ramp_to(&mut self, [kappa, a, b]: [f64; 3], sample: i64) {
        self.kappa.ramp_to(kappa, sample);
        self.a.ramp_to(a, sample);
        self.b.ramp_to(b, sample);
    }

    /// Multiplier at a speed on a surface of a size: a surface of twice the size passes half as fast, but the law
    /// counts the whole speed; a relief is twice as high.
    #[inline]
    #[must_use]
    pub fn bend(&self, speed: f32, size: f64, sample: i64) -> f32 {
        let Some(curve) = &self.curve else { return 1.0 };
        let size = size as f32;
        curve.at(speed / size) * power(size, curve.growth - self.b.at(sample) as f32)
    }

    /// Multiplies `out` by the amplitude over a segment: law, amplitude of the piece, and rest. `sizes` are those of the surface at
    /// the first and the last sample of the cell.
    #[inline(always)]
    pub fn apply(&self, segment: &Segment, motion: &Motion, sizes: [f64; 2], out: &mut Cell) {
        if self.curve.is_some() {
            // Within 64 samples a speed changes so little that a straight line will do.
            let [a, b] = [(0, sizes[0]), (CELL - 1, sizes[1])]
                .map(|(n, size)| self.bend(motion.speed[n], size, segment.anchor + n as i64));
            let step = (b - a) / (CELL - 1) as f32;
            for (n, out) in out.iter_mut().enumerate() {
                *out *= a + n as f32 * step;
            }
        }
        let (mut force, mut gain) = ([0.0; CELL], [0.0; CELL]);
        segment.force(&mut force);
        segment.gain(&mut gain);
        let from = segment.anchor;
        let settled = [self.kappa, self.a, self.b].map(|ramp| ramp.settled(from));
        if let [Some(kappa), Some(a), Some(b)] = settled {
            raise(&mut force, a as f32);
            // At rest it is the gate that falls.
            let mut speed = if b == 0.0 { [1.0; CELL] } else { motion.speed };
            raise(&mut speed, b as f32);
            let kappa = kappa as f32;
            for n in 0..CELL {
                out[n] *= kappa * gain[n] * force[n] * speed[n] * motion.gate[n];
            }
            return;
        }
        for n in segment.from..segment.to.min(CELL) {
            let at = from + n as i64;
            let [kappa, a, b] = [self.kappa, self.a, self.b].map(|ramp| ramp.at(at) as f32);
            let speed = if b == 0.0 { 1.0 } else { power(motion.speed[n], b) };
            out[n] *= kappa * gain[n] * power(force[n], a) * speed * motion.gate[n];
        }
    }
}

/// Raises all numbers to a power; 0 stays 0, also to the power of 0.
#[inline(always)]
fn raise(x: &mut Cell, exponent: f32) {
    if exponent == 1.0 {
    } else if exponent == 0.5 {
        x.iter_mut().for_each(|x| *x = x.sqrt());
    } else if exponent == 0.0 {
        x.iter_mut().for_each(|x| *x = if *x > 0.0 { 1.0 } else { 0.0 });
    } else {
        x.iter_mut().for_each(|x| *x = power(*x, exponent));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::time::Rate;
    use crate::scrape::force::motion::Heading;
    use crate::scrape::force::voices::Voices;
    use crate::scrape::path::PathPiece;
    use crate::scrape::testing::piece;

    /// Output of `law` for ones over pieces of 0.1 s each.
    fn over(pieces: &[PathPiece], law: Law) -> Vec<f32> {
        let rate = Rate::hz(10_000);
        let mut voices = Voices::new(2, rate, Heading::default());
        let events: Vec<_> = (0..).map(|k| rate.tick(1000 * k)).zip(pieces.iter().copied()).collect();
        let mut out = vec![0.0; 1000 * pieces.len()];
        let mut motion = Motion::new();
        voices.play(
            &events,
            None,
            0,
            &mut out,
            |_| Heading::default(),
            |heading, segment, out| {
                motion.follow(segment, &segment.path(), [1.0; 2], heading);
                let mut cell = [1.0; CELL];
                law.apply(segment, &motion, [1.0; 2], &mut cell);
                out.iter_mut().zip(segment.part(&mut cell)).for_each(|(out, x)| *out += *x);
            },
        );
        out
    }

    #[test]
    fn force_and_speed_enter_by_their_exponents() {
        let fast = PathPiece { force: [4.0; 2], ..piece([0.0; 2], [0.09, 0.0], 0.1) };
        let out = over(&[fast], Law::new([2.0, 0.5, 0.5], 10_000.0));
        assert!((out[500] - 2.0 * 2.0 * 0.3).abs() < 1e-5, "{}", out[500]);
        let mut law = Law::new([2.0, 1.0, 0.0], 10_000.0);
        assert!((over(&[fast], law)[500] - 8.0).abs() < 1e-5);
        law.ramp_to([1.0, 0.5, 0.0], 400);
        let out = over(&[fast], law);
        assert!((out[399] - 8.0).abs() < 1e-4 && (out[600] - 2.0).abs() < 1e-4);
        assert!(out.windows(2).all(|w| (w[1] - w[0]).abs() < 0.05), "no step");
    }

    #[test]
    fn rest_and_no_force_are_silent_after_five_milliseconds() {
        let go = piece([0.0; 2], [0.1, 0.0], 0.1);
        let rest = PathPiece { position: [go.position_at(1.0), [0.0; 2], [0.0; 2], [0.0; 2]], ..go };
        let out = over(&[go, rest], Law::new([1.0, 1.0, 0.0], 10_000.0));
        assert!((out[1024] - 0.5).abs() < 0.03 && out[1051..].iter().all(|x| *x == 0.0));
        let lifted = PathPiece { force: [0.0; 2], ..go };
        assert!(over(&[lifted], Law::new([1.0, 0.0, 0.0], 10_000.0)).iter().all(|x| *x == 0.0));
    }
}
