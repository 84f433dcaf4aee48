//! Positions with orientations, and interpolation between them.

use serde::{Deserialize, Serialize};

use crate::contact::vector::{Vec3, add, cross, dot, norm, scale, sub, widen};
use crate::mesh::UpAxis;

/// Largest coordinate of a pose that is read from a file, in m.
pub(crate) const MAX_COORDINATE: f32 = 1e6;

/// Position and orientation.
///
/// The local axes are x to the front, y to the left and z up, as in AES69 and in ambisonics. `rotation` is the unit quaternion
/// `(w, x, y, z)` from local axes to scene axes. Without rotation a head looks along the x axis of the scene, with z above it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position in metres.
    pub position: [f32; 3],
    /// Unit quaternion from local axes to scene axes.
    pub rotation: [f32; 4],
}

impl Default for Pose {
    fn default() -> Self {
        Self::at([0.0; 3])
    }
}

impl Pose {
    /// Creates a pose at a position that looks along x.
    #[must_use]
    pub fn at(position: [f32; 3]) -> Self {
        Self { position, rotation: [1.0, 0.0, 0.0, 0.0] }
    }

    /// Creates a pose that looks along `look` with `up` above. Returns `None` if the two do not define an orientation.
    ///
    /// `up` need not be perpendicular to `look`.
    #[must_use]
    pub fn looking(position: [f64; 3], look: [f64; 3], up: [f64; 3]) -> Option<Self> {
        let front = unit(look)?;
        let left = unit(cross(unit(up)?, front))?;
        let rotation = quaternion([front, left, cross(front, left)]).map(|x| x as f32);
        let position = position.map(|x| x as f32);
        let finite = position.iter().chain(&rotation).all(|x| x.is_finite());
        finite.then_some(Self { position, rotation })
    }

    /// Creates the pose of an object of a file, from its position, front and top in the axes of the file. Returns `None` if front and top do
    /// not define an orientation.
    ///
    /// `up` is the axis that points upward in the file, `unit` the length of its unit in m.
    pub(crate) fn of_file(position: Vec3, [front, top]: [Vec3; 2], up: UpAxis, unit: f64) -> Option<Self> {
        let [position, front, top] = [position, front, top].map(|v| up.rotated(UpAxis::Z, v));
        Self::looking(scale(position, unit), front, top)
    }

    /// Returns true if no coordinate exceeds [`MAX_COORDINATE`].
    pub(crate) fn is_near(&self) -> bool {
        self.position.iter().all(|x| x.abs() <= MAX_COORDINATE)
    }

    /// Converts a point from scene axes to local axes.
    #[must_use]
    pub fn to_local(self, point: [f64; 3]) -> [f64; 3] {
        let [w, x, y, z] = self.rotation.map(f64::from);
        rotate([w, -x, -y, -z], sub(point, widen(self.position)))
    }

    /// Converts a point from local axes to scene axes.
    #[must_use]
    pub fn to_scene(self, point: [f64; 3]) -> [f64; 3] {
        add(widen(self.position), rotate(self.rotation.map(f64::from), point))
    }

    /// Interpolates between the second and the third of four equally spaced poses, at `t` from 0 to 1.
    ///
    /// Positions lie on a Catmull-Rom spline, whose velocity is continuous, so Doppler shifts have no steps. Orientations are
    /// interpolated by slerp along the shorter arc.
    #[must_use]
    pub fn interpolate(around: [Self; 4], t: f64) -> Self {
        let [before, from, to, after] = around;
        let position = std::array::from_fn(|k| {
            let [p, a, b, q] = [before, from, to, after].map(|pose| f64::from(pose.position[k]));
            let curvature = (2.0 * p - 5.0 * a + 4.0 * b - q) + t * (3.0 * (a - b) + q - p);
            (a + 0.5 * t * ((b - p) + t * curvature)) as f32
        });
        Self { position, rotation: slerp(from.rotation, to.rotation, t) }
    }
}

/// Normalises a vector. Returns `None` if it has no direction.
pub(crate) fn unit(v: Vec3) -> Option<Vec3> {
    // Scaled by the largest component first, so that neither huge nor tiny vectors lose their direction.
    let largest = v.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let v = v.map(|x| x / largest);
    let length = norm(v);
    let unit = v.map(|x| x / length);
    (length > 1e-9).then_some(unit)
}

fn rotate([w, x, y, z]: [f64; 4], v: Vec3) -> Vec3 {
    let axis = [x, y, z];
    let doubled = scale(cross(axis, v), 2.0);
    add(add(v, scale(doubled, w)), cross(axis, doubled))
}

/// Returns the unit quaternion that rotates x, y and z to three orthonormal vectors. It starts from the largest component, which is free
/// of cancellation.
fn quaternion([f, l, u]: [Vec3; 3]) -> [f64; 4] {
    let trace = f[0] + l[1] + u[2];
    let squares = [1.0 + trace, 1.0 + 2.0 * f[0] - trace, 1.0 + 2.0 * l[1] - trace, 1.0 + 2.0 * u[2] - trace];
    let largest = (0..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let products = [l[2] - u[1], u[0] - f[2], f[1] - l[0]];
    let sums = [f[1] + l[0], u[0] + f[2], l[2] + u[1]];
    let quaternion = [
        [squares[0], products[0], products[1], products[2]],
        [products[0], squares[1], sums[0], sums[1]],
        [products[1], sums[0], squares[2], sums[2]],
        [products[2], sums[1], sums[2], squares[3]],
    ][largest];
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    quaternion.map(|x| x / length)
}

fn slerp(a: [f32; 4], b: [f32; 4], t: f64) -> [f32; 4] {
    if a == b {
        return a;
    }
    let (a, b) = (a.map(f64::from), b.map(f64::from));
    let cosine: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
    let sign = if cosine < 0.0 { -1.0 } else { 1.0 };
    let angle = libm::acos(cosine.abs().min(1.0));
    let (p, q) = if angle < 1e-6 {
        (1.0 - t, t)
    } else {
        (libm::sin((1.0 - t) * angle) / libm::sin(angle), libm::sin(t * angle) / libm::sin(angle))
    };
    let mixed: [f64; 4] = std::array::from_fn(|k| p * a[k] + q * sign * b[k]);
    let length = mixed.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 { mixed.map(|x| (x / length) as f32) } else { a.map(|x| x as f32) }
}

/// Returns lateral angle and elevation of a direction in local axes, in interaural-polar coordinates. Both are in radians, in
/// `[-pi/2, pi/2]`; directions behind the head are mirrored to the front.
pub(crate) fn interaural(direction: Vec3) -> (f64, f64) {
    let [front, left, up] = direction;
    let lateral =
        libm::asin((left / dot(direction, direction).sqrt().max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0));
    (lateral, libm::atan2(up, front.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Vec3, b: Vec3) -> bool {
        a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-6)
    }

    #[test]
    fn a_head_without_rotation_has_the_axes_of_the_scene() {
        assert_eq!(Pose::looking([0.0; 3], [2.0, 0.0, 0.0], [0.0, 0.0, 0.5]), Some(Pose::default()));
        assert_eq!(Pose::default().to_local([1.0, 2.0, 3.0]), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn the_look_direction_is_the_local_x_axis() {
        let looks =
            [[0.0, 0.0, -1.0], [1.0, 1.0, 0.2], [-1.0, 0.0, 0.0], [0.0, -3.0, 1.0], [-0.1, 0.2, -5.0]];
        for look in looks {
            let position = [0.5, -1.0, 2.0];
            let pose = Pose::looking(position, look, [0.0, 1.0, 0.1]).unwrap();
            assert!(close(pose.to_local(add(position, look)), [norm(look), 0.0, 0.0]), "{look:?} {pose:?}");
            assert!(pose.to_local(add(position, [0.0, 1.0, 0.1]))[2] > 0.0);
            assert!(close(pose.to_local(pose.to_scene([0.3, 0.4, 0.5])), [0.3, 0.4, 0.5]));
        }
        assert_eq!(Pose::looking([0.0; 3], [0.0, 0.0, 1.0], [0.0, 0.0, 2.0]), None);
        assert_eq!(Pose::looking([0.0; 3], [0.0; 3], [0.0, 0.0, 2.0]), None);
        assert_eq!(Pose::looking([f64::INFINITY; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]), None);
    }

    #[test]
    fn uniform_motion_is_preserved_between_frames() {
        let pose = |k: f32| Pose::at([k, 2.0 * k, -k]);
        for t in [0.0, 0.25, 0.5, 1.0] {
            let found = Pose::interpolate([0.0, 1.0, 2.0, 3.0].map(pose), t);
            assert!(close(widen(found.position), widen(pose(1.0 + t as f32).position)), "{t}");
        }
    }

    #[test]
    fn orientations_turn_uniformly_along_the_shorter_arc() {
        let turned = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Pose::looking([0.0; 3], [cos, sin, 0.0], [0.0, 0.0, 1.0]).unwrap()
        };
        let (a, mut b) = (turned(10.0), turned(70.0));
        b.rotation = b.rotation.map(|x| -x);
        for (t, degrees) in [(0.0, 10.0), (0.5, 40.0), (0.25, 25.0), (1.0, 70.0)] {
            let found = Pose::interpolate([a, a, b, b], t).to_scene([1.0, 0.0, 0.0]);
            assert!(close(found, turned(degrees).to_scene([1.0, 0.0, 0.0])), "{t}: {found:?}");
        }
    }

    #[test]
    fn a_source_behind_is_mirrored_to_the_front_for_its_elevation() {
        let (lateral, elevation) = interaural([-1.0, 0.0, 1.0]);
        assert!(lateral == 0.0 && (elevation - 45_f64.to_radians()).abs() < 1e-12);
        let (lateral, elevation) = interaural([0.0, -1.0, 0.0]);
        assert!((lateral + 90_f64.to_radians()).abs() < 1e-12 && elevation == 0.0);
        assert_eq!(interaural([0.0; 3]), (0.0, 0.0));
    }
}
