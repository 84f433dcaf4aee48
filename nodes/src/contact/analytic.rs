//! Colliders given by a formula: a plane, a sphere, a capsule. They are cheaper than meshes and perfectly smooth.

use serde::{Deserialize, Serialize};

use super::detector::{Contact, check_finite, narrow};
use super::error::ContactError;
use super::vector::{Vec3, add, cross, dot, norm, scale, sub, widen};
use crate::spatial;
use crate::spatial::pose::unit;

/// A collider in its own frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Shape {
    /// The plane z = 0, its outside above.
    Plane,
    /// A sphere around the origin.
    Sphere {
        /// Radius, metres.
        radius: f64,
    },
    /// A capsule around the segment from z = -half_length to z = half_length.
    Capsule {
        /// Half the length of the segment, metres.
        half_length: f64,
        /// Radius, metres.
        radius: f64,
    },
}

/// Where a collider stands in a frame: x_world = rotation x_local + position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Unit quaternion w, x, y, z.
    pub rotation: [f64; 4],
    /// Position of the origin, metres.
    pub position: [f64; 3],
}

impl Default for Pose {
    fn default() -> Self {
        Self { rotation: [1.0, 0.0, 0.0, 0.0], position: [0.0; 3] }
    }
}

impl From<spatial::Pose> for Pose {
    fn from(pose: spatial::Pose) -> Self {
        let rotation = pose.rotation.map(f64::from);
        // In double precision the quaternion of a stream is not quite of length 1, which would make the body breathe.
        let length = rotation.iter().map(|x| x * x).sum::<f64>().sqrt();
        let rotation = if length > 0.0 { rotation.map(|x| x / length) } else { Self::default().rotation };
        Self { rotation, position: widen(pose.position) }
    }
}

impl Pose {
    /// A collider at a place whose own z points along `axis`, by the shortest turn; `None` where that has no direction.
    #[must_use]
    pub fn along(position: [f64; 3], axis: [f64; 3]) -> Option<Self> {
        let [x, y, z] = unit(axis)?;
        let rotation = if z > -1.0 + 1e-9 {
            // The quaternion half-way between no turn and twice the turn from z to the axis.
            let length = (2.0 * (1.0 + z)).sqrt();
            [1.0 + z, -y, x, 0.0].map(|part| part / length)
        } else {
            [0.0, 1.0, 0.0, 0.0]
        };
        Some(Self { rotation, position })
    }

    /// A world point in the collider's frame.
    #[must_use]
    pub fn to_local(self, x: [f64; 3]) -> [f64; 3] {
        let [w, i, j, k] = self.rotation;
        // The conjugate turns back: x + 2 w (u x x) + 2 u x (u x x) with u = -(i, j, k).
        let u = [-i, -j, -k];
        let x = sub(x, self.position);
        let once = scale(cross(u, x), 2.0);
        add(x, add(scale(once, w), cross(u, once)))
    }
}

impl Shape {
    /// Signed distance of a local point from the surface and the outward normal there; none on a centre or an axis.
    #[must_use]
    pub fn distance_and_normal(&self, x: [f64; 3]) -> Option<(f64, [f64; 3])> {
        let (away, radius): (Vec3, f64) = match *self {
            Self::Plane => return Some((x[2], [0.0, 0.0, 1.0])),
            Self::Sphere { radius } => (x, radius),
            Self::Capsule { half_length, radius } => {
                let along = x[2].max(-half_length).min(half_length);
                ([x[0], x[1], x[2] - along], radius)
            }
        };
        let length = norm(away);
        (length > 0.0).then(|| (length - radius, scale(away, 1.0 / length)))
    }

    /// How far a vertex slides over the collider between two frames, tangentially and in distance, metres.
    ///
    /// The difference is taken in the collider's frame, without its part along the normal at the mean point.
    #[must_use]
    pub fn slide(&self, x0: [f64; 3], pose0: &Pose, x1: [f64; 3], pose1: &Pose) -> Option<(f64, f64)> {
        let (x0, x1) = (pose0.to_local(x0), pose1.to_local(x1));
        let (_, normal) = self.distance_and_normal(scale(add(x0, x1), 0.5))?;
        let step = sub(x1, x0);
        let along = sub(step, scale(normal, dot(step, normal)));
        let (d0, _) = self.distance_and_normal(x0)?;
        let (d1, _) = self.distance_and_normal(x1)?;
        Some((norm(along), d1.abs() - d0.abs()))
    }
}

/// An analytic collider at a frame and at the frame that follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moving {
    /// The collider.
    pub shape: Shape,
    /// Its pose at this frame.
    pub pose: Pose,
    /// Its pose at the next.
    pub next: Pose,
}

/// Adds contacts with analytic colliders to those that a [`super::Detector`] found with meshes.
///
/// Collider k is surface `first_surface + k` and triangle 0 of it; beta stays 0. A collider wins over a mesh only if it is
/// nearer in single precision, since its surface id is the higher one. Returns the number of contacts put in.
///
/// # Shapes
/// One position per vertex in `cloth` and `next`; `out` holds the same number of slots for each, nearest first.
///
/// # Errors
/// [`ContactError`] when the lengths don't fit, and for positions that are not finite.
///
/// # Complexity
/// O(V colliders slots). Never allocates.
pub fn merge(
    cloth: &[[f32; 3]],
    next: &[[f32; 3]],
    colliders: &[Moving],
    first_surface: u32,
    radius: f32,
    out: &mut [Contact],
) -> Result<usize, ContactError> {
    if next.len() != cloth.len() {
        return Err(ContactError::Length {
            what: "the next frame",
            found: next.len(),
            expected: cloth.len(),
        });
    }
    let slots = if cloth.is_empty() { 1 } else { out.len() / cloth.len() };
    if slots == 0 || out.len() != slots * cloth.len() {
        let expected = slots.max(1) * cloth.len();
        return Err(ContactError::Length { what: "the output", found: out.len(), expected });
    }
    check_finite(0, cloth)?;
    check_finite(0, next)?;
    let mut added = 0;
    for ((x0, x1), kept) in cloth.iter().zip(next).zip(out.chunks_mut(slots)) {
        let (x0, x1) = (widen(*x0), widen(*x1));
        for (k, collider) in colliders.iter().enumerate() {
            let Some((height, _)) = collider.shape.distance_and_normal(collider.pose.to_local(x0)) else {
                continue;
            };
            let distance = narrow(height.abs());
            let nearer = |c: &Contact| c.is_some() && c.distance <= distance;
            let place = kept.partition_point(nearer);
            if distance > radius || place == kept.len() {
                continue;
            }
            let (slide, approach) =
                collider.shape.slide(x0, &collider.pose, x1, &collider.next).unwrap_or((0.0, 0.0));
            kept[place..].rotate_right(1);
            kept[place] = Contact {
                surface: first_surface + k as u32,
                triangle: 0,
                distance,
                beta: [0.0; 2],
                slide: narrow(slide),
                approach: narrow(approach),
            };
            added += 1;
        }
    }
    Ok(added)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(axis: usize, angle: f64, position: Vec3) -> Pose {
        let mut rotation = [(0.5 * angle).cos(), 0.0, 0.0, 0.0];
        rotation[axis + 1] = (0.5 * angle).sin();
        Pose { rotation, position }
    }

    #[test]
    fn a_pose_turned_by_a_right_angle_sees_x_where_y_was() {
        let local = turned(2, std::f64::consts::FRAC_PI_2, [1.0, 0.0, 0.0]).to_local([1.0, 2.0, 3.0]);
        assert!(norm(sub(local, [2.0, 0.0, 3.0])) < 1e-15, "{local:?}");
    }

    #[test]
    fn a_vertex_at_rest_over_a_spinning_sphere_slides_at_omega_times_its_distance_from_the_axis() {
        let sphere = Shape::Sphere { radius: 0.5 };
        let (omega, dt) = (2.0, 1e-3);
        let (slid, approach) = sphere
            .slide([0.51, 0.0, 0.0], &Pose::default(), [0.51, 0.0, 0.0], &turned(2, omega * dt, [0.0; 3]))
            .unwrap();
        assert!((slid / dt - omega * 0.51).abs() < 1e-6, "{}", slid / dt);
        assert!(approach.abs() < 1e-12);
    }

    #[test]
    fn a_vertex_carried_along_by_a_capsule_does_not_slide() {
        let capsule = Shape::Capsule { half_length: 0.2, radius: 0.1 };
        let x = [0.0, 0.11, 0.05];
        // A turn about x by 90 degrees takes (x, y, z) to (x, -z, y).
        let carried = [1.0, -0.05 + 2.0, 0.11];
        let pose = turned(0, std::f64::consts::FRAC_PI_2, [1.0, 2.0, 0.0]);
        let (slid, approach) = capsule.slide(x, &Pose::default(), carried, &pose).unwrap();
        assert!(slid < 1e-15 && approach.abs() < 1e-15);
    }

    #[test]
    fn an_axis_is_where_the_own_z_points() {
        for axis in [[0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.3, -0.5, -0.4], [0.0, 0.0, -1.0], [1e-6, 0.0, -1.0]]
        {
            let tip = add([1.0, 2.0, 3.0], unit(axis).unwrap());
            let local = Pose::along([1.0, 2.0, 3.0], axis).unwrap().to_local(tip);
            assert!(norm(sub(local, [0.0, 0.0, 1.0])) < 1e-5, "{axis:?}: {local:?}");
        }
        assert_eq!(Pose::along([0.0; 3], [0.0; 3]), None);
    }

    #[test]
    fn falling_onto_a_plane_is_approach_and_no_slide() {
        let found =
            Shape::Plane.slide([0.0, 0.0, 0.03], &Pose::default(), [0.0, 0.0, 0.01], &Pose::default());
        let (slid, approach) = found.unwrap();
        assert!(slid == 0.0 && (approach + 0.02).abs() < 1e-15);
    }

    #[test]
    fn a_nearer_collider_takes_the_slot_of_a_mesh_and_a_farther_one_does_not() {
        let mesh = Contact { surface: 0, distance: 0.02, ..Contact::default() };
        let plane = Moving { shape: Shape::Plane, pose: Pose::default(), next: Pose::default() };
        let cloth = [[0.0, 0.0, 0.01], [0.0, 0.0, 0.03], [0.0, 0.0, 0.06]];
        let mut out = [mesh, mesh, Contact::default()];
        assert_eq!(merge(&cloth, &cloth, &[plane], 1, 0.05, &mut out), Ok(1));
        assert_eq!(out.map(|c| c.surface), [1, 0, Contact::NONE]);
        assert!(merge(&cloth, &cloth[1..], &[plane], 1, 0.05, &mut out).is_err());
        assert!(merge(&cloth, &cloth, &[plane], 1, 0.05, &mut out[..2]).is_err());
    }
}
