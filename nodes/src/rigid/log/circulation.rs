//! Contact points that circulate: the rim of a coin that settles, at any number of turns per frame.

use crate::contact::vector::{Vec3, add, dot, scale, sub};

/// Time between two observations that are compared, s: shorter frames are left out.
const CHORD: f64 = 1.0 / 240.0;
/// Time constant of the observed chords, s; at least [`MIN_CHORDS`] of them.
const MEMORY: f64 = 0.05;
/// Smallest number of chords.
const MIN_CHORDS: u32 = 4;
/// Smallest mean change of the normal in a chord, rad: below it a body at rest trembles.
const MIN_TURN: f64 = 1e-3;
/// Smallest correlation of the chords of the point with those of the normal.
const MIN_CORRELATION: f64 = 0.95;
/// Smallest product of the two variances of the chords over the square of their sum; 0 on a straight path, 0.25 on whole turns.
const MIN_ROUNDNESS: f64 = 0.03;
/// Smallest square of the mean rate of the normal over its mean square: a body that rocks turns in jerks.
const MIN_STEADINESS: f64 = 0.8;

/// Observed chords of a contact point on one body, and the radius of curvature that they have in common.
///
/// As a disc rolls on its rim, the contact point and the normal turn together in the frame of the disc. A chord of the point
/// over the chord of the normal is the radius of curvature of the surface along the path, `R / sin(tilt)` for a disc of radius
/// R, however far the point went round between the frames. The speed of the point over the surface is this radius times the
/// rate of the normal, which the angular velocity gives at each instant.
///
/// A face whose reported points jump from corner to corner has no such correlation. A ball on a straight path needs no radius.
///
/// # Source
/// Montana, "The Kinematics of Contact and Grasp" (Int. J. Robotics Research 7(3), 1988): the velocity of a contact point over a
/// surface from its curvature and the relative angular velocity.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Circulation {
    /// Point and outward normal in the frame of the body, and the point in that of the other body.
    start: Option<[Vec3; 3]>,
    elapsed: f64,
    chords: u32,
    /// Weights of the chords, and weighted sums of the squares and products of those of point and normal.
    weight: f64,
    points: f64,
    normals: f64,
    products: f64,
    /// Weighted sums of the rate of the normal and of its square.
    rates: [f64; 2],
    /// Weighted sum of the outer products of the chords on the other body: xx, yy, zz, xy, yz, zx.
    spread: [f64; 6],
}

impl Circulation {
    /// Adds an observation, a time after the previous one: point and outward normal in the frame of the body, the point in that of the
    /// other body, and the rate of the normal in rad/s.
    pub fn observe(&mut self, [point, normal, on_other]: [Vec3; 3], rate: f64, time: f64) {
        self.elapsed += time;
        let Some([point_0, normal_0, other_0]) = self.start else {
            self.start = Some([point, normal, on_other]);
            self.elapsed = 0.0;
            return;
        };
        // Half a frame of tolerance, so that frames of CHORD with jitter are all used.
        if self.elapsed + 0.5 * time < CHORD {
            return;
        }
        let (dp, dn, [x, y, z]) = (sub(point, point_0), sub(normal, normal_0), sub(on_other, other_0));
        let decay = (-self.elapsed / MEMORY.max(f64::from(MIN_CHORDS) * self.elapsed)).exp();
        let accumulate = |sum: &mut f64, term: f64| *sum = *sum * decay + term;
        accumulate(&mut self.weight, 1.0);
        accumulate(&mut self.points, dot(dp, dp));
        accumulate(&mut self.normals, dot(dn, dn));
        accumulate(&mut self.products, dot(dp, dn));
        accumulate(&mut self.rates[0], rate);
        accumulate(&mut self.rates[1], rate * rate);
        for (sum, term) in self.spread.iter_mut().zip([x * x, y * y, z * z, x * y, y * z, z * x]) {
            accumulate(sum, term);
        }
        self.chords = self.chords.saturating_add(1);
        (self.start, self.elapsed) = (Some([point, normal, on_other]), 0.0);
    }

    /// Radius of curvature along the path, m, negative for a hollow surface; `None` if the contact point does not circulate.
    pub fn radius(&self) -> Option<f64> {
        let [xx, yy, zz, xy, yz, zx] = self.spread;
        let trace = xx + yy + zz;
        let minors = xx * yy - xy * xy + yy * zz - yz * yz + zz * xx - zx * zx;
        let circulates = self.chords >= MIN_CHORDS
            && self.normals >= self.weight * MIN_TURN * MIN_TURN
            && self.products.abs() >= MIN_CORRELATION * (self.points * self.normals).sqrt()
            && self.rates[0] * self.rates[0] >= MIN_STEADINESS * self.weight * self.rates[1]
            && minors >= MIN_ROUNDNESS * trace * trace
            && trace > 0.0;
        circulates.then(|| self.products / self.normals)
    }
}

/// Velocities over the surfaces of bodies a and b of a contact whose point circulates on body `side`.
///
/// `turn` is the relative angular velocity of the body `side` times the normal, with the rate of the normal itself subtracted, in
/// the world; `slip` is the velocity of b relative to a along the surface.
pub(super) fn travel(side: usize, radius: f64, turn: Vec3, slip: Vec3) -> [Vec3; 2] {
    // The outward normal of a is the normal, that of b its opposite.
    if side == 0 {
        let over_a = scale(turn, -radius);
        [over_a, sub(over_a, slip)]
    } else {
        let over_b = scale(turn, radius);
        [add(over_b, slip), over_b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::vector::{cross, norm};
    use crate::core::random::Rng;

    /// Contact of a disc on a floor, `turns` rad after the start: point, outward normal, and point on the floor.
    fn rim(radius: f64, tilt: f64, turns: f64) -> [Vec3; 3] {
        let (s, c) = turns.sin_cos();
        let point = [radius * c, radius * s, 0.0];
        let normal = [tilt.sin() * c, tilt.sin() * s, -tilt.cos()];
        [point, normal, [radius * tilt.cos() * c, radius * tilt.cos() * s, 0.0]]
    }

    #[test]
    fn the_radius_of_a_rim_is_exact_at_any_number_of_turns_per_frame() {
        for (rate, speed) in [(60.0, 20.0), (60.0, 300.0), (60.0, 900.0), (240.0, 100.0), (1200.0, 60.0)] {
            let mut circulation = Circulation::default();
            for k in 0..(rate * 0.2) as u32 {
                let observed = rim(0.013, 0.1, speed * f64::from(k) / rate);
                circulation.observe(observed, speed * 0.1_f64.sin(), 1.0 / rate);
            }
            let radius = circulation.radius().unwrap();
            assert!((radius * 0.1_f64.sin() / 0.013 - 1.0).abs() < 1e-9, "{radius} at {rate} Hz");
        }
    }

    #[test]
    fn corners_of_a_face_at_rest_a_rocking_box_and_a_ball_on_a_line_do_not_circulate() {
        let mut rng = Rng::new(5);
        let [mut face, mut box_, mut ball] = [Circulation::default(); 3];
        for k in 0..200 {
            let t = f64::from(k) / 60.0;
            let corner = [[-0.1, 0.1][rng.below(2)], [-0.1, 0.1][rng.below(2)], 0.0];
            let trembling = [rng.between(-0.01, 0.01), rng.between(-0.01, 0.01), -1.0];
            face.observe([corner, trembling, corner], 0.1, 1.0 / 60.0);
            assert_eq!(face.radius(), None);
            let tilt = 0.02 * (30.0 * t).sin();
            let edge = [0.1 * tilt.signum(), 0.0, 0.0];
            box_.observe([edge, [tilt, 0.0, -1.0], edge], 0.6 * (30.0 * t).cos().abs(), 1.0 / 60.0);
            assert_eq!(box_.radius(), None);
            let (s, c) = (70.0 * t).sin_cos();
            ball.observe([[0.01 * s, 0.0, -0.01 * c], [s, 0.0, -c], [0.7 * t, 0.0, 0.0]], 70.0, 1.0 / 60.0);
            assert_eq!(ball.radius(), None);
        }
    }

    #[test]
    fn a_rolling_disc_travels_alike_over_both_bodies_and_slip_is_the_difference() {
        // Disc b on floor a: the normal is up, the disc turns about y and rolls along x.
        let turn = cross([0.0, 5.0, 0.0], [0.0, 0.0, 1.0]);
        let [over_a, over_b] = travel(1, 0.1, turn, [0.2, 0.0, 0.0]);
        assert!(norm(sub(over_b, [0.5, 0.0, 0.0])) + norm(sub(over_a, [0.7, 0.0, 0.0])) < 1e-12);
        // The same with the disc as body a: normal and slip are reversed.
        let turn = cross([0.0, 5.0, 0.0], [0.0, 0.0, -1.0]);
        let [over_a, over_b] = travel(0, 0.1, turn, [-0.2, 0.0, 0.0]);
        assert!(norm(sub(over_a, [0.5, 0.0, 0.0])) + norm(sub(over_b, [0.7, 0.0, 0.0])) < 1e-12);
    }
}
