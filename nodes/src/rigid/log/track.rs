//! The motion of a contact point over the surfaces of two bodies.

use super::circulation::{Circulation, travel};
use super::poses::Motion;
use super::row::Row;
use crate::contact::vector::{Vec3, add, cross, dot, norm, rotate_back, scale, sub};
use crate::core::time::Tick;

/// Time constant of the velocity over a surface and of the decay of the extent, s.
const SMOOTHING: f64 = 0.02;
/// Time for which a contact retains its extent without an observation of it, s.
const EXTENT_HOLD: f64 = 1.0;

/// One contact in one frame, before it is matched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observation {
    pub row: Row,
    pub force: f64,
    pub velocity: Vec3,
    pub motion: [Motion; 2],
    /// Largest distance between its points, m.
    pub extent: f64,
    /// True if the speed of approach follows from the poses, and not from the log.
    pub is_derived: bool,
}

/// A contact that continues from frame to frame.
#[derive(Clone, Debug)]
pub(super) struct Track {
    pub id: u64,
    /// Number of the contact in the log.
    pub log_id: Option<u64>,
    pub pair: [u32; 2],
    pub last_tick: Tick,
    /// Index of its latest frame.
    pub frame_index: usize,
    /// True if the time at which the contact began is known from the poses.
    pub has_age: bool,
    pub point: Vec3,
    pub normal: Vec3,
    /// Smoothed position of the contact.
    pub anchor: Vec3,
    /// Distance between its points, m.
    pub extent: f64,
    /// Time since the extent was observed, s.
    pub extent_age: f64,
    /// Velocities over the surfaces of a and b.
    pub travel: Option<[Vec3; 2]>,
    /// Velocities of the material of a and b at the contact.
    pub material: [Vec3; 2],
    /// Chords of the contact point on a and on b.
    pub circulation: [Circulation; 2],
    /// Contact point and outward normal in the frames of a and b.
    pub local: [[Vec3; 2]; 2],
    /// True if the point moved over a curved surface in the latest frame.
    pub is_on_curve: bool,
}

/// Largest radius of curvature of a surface that is no face, m.
const MAX_RADIUS: f64 = 5.0;
/// Smallest cosine of the angle between the changes of point and normal on a curved surface.
const MIN_CURVE_COSINE: f64 = 0.7;
/// Smallest rate of the normal on it, rad/s: below it a face trembles.
const MIN_CURVE_RATE: f64 = 0.5;

/// Returns true if a contact point moved over a curved surface within a frame: it moves with its outward normal, as on a rim, however far. On a
/// face it jumps from corner to corner under one normal.
fn follows_curve([point_0, normal_0]: [Vec3; 2], [point, normal]: [Vec3; 2], time: f64) -> bool {
    let (dp, dn) = (sub(point, point_0), sub(normal, normal_0));
    let (moved, turned) = (norm(dp), norm(dn));
    moved < MAX_RADIUS * turned
        && dot(dp, dn) >= MIN_CURVE_COSINE * moved * turned
        && turned > MIN_CURVE_RATE * time
}

impl Track {
    /// Moves the contact to a new observation.
    ///
    /// An engine logs a few points of a touching face, different ones from frame to frame, so that their mean jumps although
    /// nothing moves. The contact therefore moves with the moving body, and is pulled to the observed point only by the amount by which their
    /// distance exceeds the extent of the contact. A single point, as of a ball, has an extent of 0.
    pub fn advance(&mut self, new: &Observation, time: f64, jump: f64) {
        self.observe_chords(new, time);
        let material = new.motion.map(|motion| motion.velocity_at(new.row.point));
        let last_material = std::mem::replace(&mut self.material, material);
        if let Some(travel) = self.circulating_travel(new, time) {
            self.travel = Some(travel);
            (self.anchor, self.point, self.normal) = (new.row.point, new.row.point, new.row.normal);
            self.extent *= (-time / SMOOTHING).exp();
            return;
        }
        // Velocities are means over the frame: that of the point, and those of the material.
        let mean = [0, 1].map(|k| scale(add(material[k], last_material[k]), 0.5));
        let body_velocity = if norm(mean[0]) > norm(mean[1]) { mean[0] } else { mean[1] };
        let jumped = norm(sub(new.row.point, add(self.point, scale(body_velocity, time))));
        let jumps = jumped > jump + 2.0 * norm(new.velocity) * time && !self.is_on_curve;
        let jumped = if jumps { jumped } else { 0.0 };
        let observed_extent = new.extent.max(jumped);
        if observed_extent >= 0.7 * self.extent {
            self.extent_age = 0.0;
        }
        self.extent = self.extent.max(observed_extent);
        let moved = add(self.anchor, scale(body_velocity, time));
        let pulled = |extent: f64| {
            let offset = sub(new.row.point, moved);
            let distance = norm(offset);
            add(moved, scale(offset, if distance > extent { 1.0 - extent / distance } else { 0.0 }))
        };
        let velocity = scale(sub(pulled(self.extent), self.anchor), 1.0 / time);
        let part = 1.0 - (-time / SMOOTHING).exp();
        let over = |k: usize| {
            let travel = sub(velocity, mean[k]);
            sub(travel, scale(new.row.normal, dot(travel, new.row.normal)))
        };
        self.travel = Some(match self.travel {
            None => [over(0), over(1)],
            Some(old) => [0, 1].map(|k| add(old[k], scale(sub(over(k), old[k]), part))),
        });
        // A contact without recent jumps is not a face: its extent decays, which moves the anchor but is no travel.
        self.extent_age += time;
        if self.extent_age > EXTENT_HOLD || (self.is_on_curve && new.extent == 0.0) {
            self.extent *= (-time / SMOOTHING).exp();
        }
        let anchor = pulled(self.extent);
        self.anchor = anchor;
        self.point = new.row.point;
        self.normal = new.row.normal;
    }

    /// Adds the chords since the previous frame.
    pub fn observe_chords(&mut self, new: &Observation, time: f64) {
        let local = new.motion.map(|motion| motion.to_local(new.row.point));
        self.is_on_curve = false;
        for k in [0, 1] {
            let rate = norm(self.turn(new, k, time));
            let outward = scale(new.row.normal, if k == 0 { 1.0 } else { -1.0 });
            let normal = rotate_back(new.motion[k].rotation, outward);
            self.circulation[k].observe([local[k], normal, local[1 - k]], rate, time);
            let old = std::mem::replace(&mut self.local[k], [local[k], normal]);
            self.is_on_curve |= time > 0.0 && follows_curve(old, self.local[k], time);
        }
    }

    /// Rate of a body's turn under the normal, rad/s: its angular velocity times the normal, without the rate of the normal itself.
    ///
    /// The normal turns with the other body, or as observed from frame to frame, whichever is less.
    fn turn(&self, new: &Observation, side: usize, time: f64) -> Vec3 {
        let normal = new.row.normal;
        let with_other = cross(new.motion[1 - side].angular_velocity, normal);
        let observed = scale(sub(normal, self.normal), 1.0 / time.max(1e-6));
        let rate = if norm(with_other) <= norm(observed) { with_other } else { observed };
        sub(cross(new.motion[side].angular_velocity, normal), rate)
    }

    /// Velocities over the surfaces of a contact point that circulates.
    fn circulating_travel(&self, new: &Observation, time: f64) -> Option<[Vec3; 2]> {
        let radius = [0, 1].map(|k| self.circulation[k].radius());
        let side = if radius[1].is_some() { 1 } else { 0 };
        let along = |v: Vec3| sub(v, scale(new.row.normal, dot(v, new.row.normal)));
        Some(travel(side, radius[side]?, along(self.turn(new, side, time)), along(new.velocity)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rim_is_followed_however_far_and_a_face_is_not() {
        // Contact point and outward normal of a disc of radius 0.1 m at a tilt of 20 degrees.
        let tilt = 20f64.to_radians();
        let rim = |angle: f64| -> [Vec3; 2] {
            let (sin, cos) = angle.sin_cos();
            [[0.1 * cos, 0.1 * sin, 0.0], [tilt.sin() * cos, tilt.sin() * sin, -tilt.cos()]]
        };
        for angle in [0.1, 1.0, 3.0, 6.0] {
            assert!(follows_curve(rim(0.0), rim(angle), 1.0 / 60.0), "{angle}");
        }
        // A box whose point jumps from corner to corner while it trembles, and one that tips over an edge.
        let down = [0.0, 0.0, -1.0];
        assert!(!follows_curve([[0.1, 0.1, 0.0], down], [[-0.1, 0.1, 0.0], [1e-3, 0.0, -1.0]], 1.0 / 60.0));
        let tipped = [0.05, 0.0, -1.0];
        assert!(!follows_curve([[0.1, 0.1, 0.0], down], [[0.1, -0.1, 0.0], tipped], 1.0 / 60.0));
        assert!(!follows_curve([[0.1, 0.1, 0.0], down], [[0.1, 0.1, 0.0], down], 1.0 / 60.0));
    }
}
