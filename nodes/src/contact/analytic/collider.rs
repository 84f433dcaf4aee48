//! Shape, pose and contacts of colliders defined by a formula, which are cheaper than meshes and perfectly smooth.

use serde::{Deserialize, Serialize};

use crate::contact::detection::check_finite;
use crate::contact::error::ContactError;
use crate::contact::item::Contact;
use crate::contact::vector::{Vec3, add, dot, narrow, norm, rotate_back, scale, sub, widen};
use crate::spatial;
use crate::spatial::pose::unit;

/// Shape of a collider in its own frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Shape {
    /// The plane z = 0, with the outside at z > 0.
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

/// Position and orientation of a collider: x_world = rotation x_local + position.
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
        // The quaternion of a stream is of length 1 to single precision only, which would scale the body.
        let length = rotation.iter().map(|x| x * x).sum::<f64>().sqrt();
        let rotation = if length > 0.0 { rotation.map(|x| x / length) } else { Self::default().rotation };
        Self { rotation, position: widen(pose.position) }
    }
}

impl Pose {
    /// Pose at a position whose own z points along `axis`, by the shortest rotation; `None` if `axis` has no direction.
    #[must_use]
    pub fn along(position: [f64; 3], axis: [f64; 3]) -> Option<Self> {
        let [x, y, z] = unit(axis)?;
        let rotation = if z > -1.0 + 1e-9 {
            // The quaternion half-way between the identity and twice the rotation from z to the axis.
            let length = (2.0 * (1.0 + z)).sqrt();
            [1.0 + z, -y, x, 0.0].map(|x| x / length)
        } else {
            [0.0, 1.0, 0.0, 0.0]
        };
        Some(Self { rotation, position })
    }

    /// Converts a world point to the collider's frame.
    #[must_use]
    pub fn to_local(self, x: [f64; 3]) -> [f64; 3] {
        rotate_back(self.rotation, sub(x, self.position))
    }
}

impl Shape {
    /// Returns the signed distance of a local point from the surface and the outward normal there; none on a centre or an axis.
    #[must_use]
    pub fn distance_and_normal(&self, x: [f64; 3]) -> Option<(f64, [f64; 3])> {
        let (offset, radius): (Vec3, f64) = match *self {
            Self::Plane => return Some((x[2], [0.0, 0.0, 1.0])),
            Self::Sphere { radius } => (x, radius),
            Self::Capsule { half_length, radius } => {
                let z = x[2].max(-half_length).min(half_length);
                ([x[0], x[1], x[2] - z], radius)
            }
        };
        let length = norm(offset);
        (length > 0.0).then(|| (length - radius, scale(offset, 1.0 / length)))
    }

    /// Returns the distance that a vertex slides over the collider between two frames, and the change of its distance, metres.
    ///
    /// The slide is the displacement in the collider's frame without its component along the normal at the mean point.
    #[must_use]
    pub fn slide(&self, x0: [f64; 3], pose0: &Pose, x1: [f64; 3], pose1: &Pose) -> Option<(f64, f64)> {
        let (x0, x1) = (pose0.to_local(x0), pose1.to_local(x1));
        let (_, normal) = self.distance_and_normal(scale(add(x0, x1), 0.5))?;
        let displacement = sub(x1, x0);
        let tangential = sub(displacement, scale(normal, dot(displacement, normal)));
        let (d0, _) = self.distance_and_normal(x0)?;
        let (d1, _) = self.distance_and_normal(x1)?;
        Some((norm(tangential), d1.abs() - d0.abs()))
    }
}

/// An analytic collider at a frame and at the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collider {
    /// Its shape.
    pub shape: Shape,
    /// Its pose at this frame.
    pub pose: Pose,
    /// Its pose at the next frame.
    pub next: Pose,
}

/// Inserts contacts with analytic colliders among those that a [`Detector`](crate::contact::Detector) found with meshes.
///
/// Collider k is surface `first_surface + k` and triangle 0 of it; beta is 0. A collider precedes a mesh only if it is nearer in
/// single precision, since its surface id is the higher one. Returns the number of contacts inserted.
///
/// # Shapes
/// One position per vertex in `cloth` and `next`; `out` has the same number of slots for each, nearest first.
///
/// # Errors
/// [`ContactError`] for wrong lengths, and for positions that are not finite.
///
/// # Complexity
/// O(V colliders slots). Never allocates.
pub fn insert_contacts(
    cloth: &[[f32; 3]],
    next: &[[f32; 3]],
    colliders: &[Collider],
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
    let mut inserted = 0;
    for ((x0, x1), nearest) in cloth.iter().zip(next).zip(out.chunks_mut(slots)) {
        let (x0, x1) = (widen(*x0), widen(*x1));
        for (k, collider) in colliders.iter().enumerate() {
            let Some((signed_distance, _)) = collider.shape.distance_and_normal(collider.pose.to_local(x0))
            else {
                continue;
            };
            let distance = narrow(signed_distance.abs());
            let nearer = |c: &Contact| c.is_some() && c.distance <= distance;
            let index = nearest.partition_point(nearer);
            if distance > radius || index == nearest.len() {
                continue;
            }
            let (slide, approach) =
                collider.shape.slide(x0, &collider.pose, x1, &collider.next).unwrap_or((0.0, 0.0));
            nearest[index..].rotate_right(1);
            nearest[index] = Contact {
                surface: first_surface + k as u32,
                triangle: 0,
                distance,
                beta: [0.0; 2],
                slide: narrow(slide),
                approach: narrow(approach),
            };
            inserted += 1;
        }
    }
    Ok(inserted)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotated(axis: usize, angle: f64, position: Vec3) -> Pose {
        let mut rotation = [(0.5 * angle).cos(), 0.0, 0.0, 0.0];
        rotation[axis + 1] = (0.5 * angle).sin();
        Pose { rotation, position }
    }

    #[test]
    fn a_right_angle_about_z_makes_y_the_local_x() {
        let local = rotated(2, std::f64::consts::FRAC_PI_2, [1.0, 0.0, 0.0]).to_local([1.0, 2.0, 3.0]);
        assert!(norm(sub(local, [2.0, 0.0, 3.0])) < 1e-15, "{local:?}");
    }

    #[test]
    fn a_vertex_at_rest_over_a_spinning_sphere_slides_at_omega_times_its_distance_from_the_axis() {
        let sphere = Shape::Sphere { radius: 0.5 };
        let (omega, dt) = (2.0, 1e-3);
        let (slid, approach) = sphere
            .slide([0.51, 0.0, 0.0], &Pose::default(), [0.51, 0.0, 0.0], &rotated(2, omega * dt, [0.0; 3]))
            .unwrap();
        assert!((slid / dt - omega * 0.51).abs() < 1e-6, "{}", slid / dt);
        assert!(approach.abs() < 1e-12);
    }

    #[test]
    fn a_vertex_that_moves_with_a_capsule_does_not_slide() {
        let capsule = Shape::Capsule { half_length: 0.2, radius: 0.1 };
        let x = [0.0, 0.11, 0.05];
        // A rotation about x by 90 degrees maps (x, y, z) to (x, -z, y).
        let x1 = [1.0, -0.05 + 2.0, 0.11];
        let pose = rotated(0, std::f64::consts::FRAC_PI_2, [1.0, 2.0, 0.0]);
        let (slid, approach) = capsule.slide(x, &Pose::default(), x1, &pose).unwrap();
        assert!(slid < 1e-15 && approach.abs() < 1e-15);
    }

    #[test]
    fn the_local_z_points_along_the_axis() {
        for axis in [[0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.3, -0.5, -0.4], [0.0, 0.0, -1.0], [1e-6, 0.0, -1.0]]
        {
            let tip = add([1.0, 2.0, 3.0], unit(axis).unwrap());
            let local = Pose::along([1.0, 2.0, 3.0], axis).unwrap().to_local(tip);
            assert!(norm(sub(local, [0.0, 0.0, 1.0])) < 1e-5, "{axis:?}: {local:?}");
        }
        assert_eq!(Pose::along([0.0; 3], [0.0; 3]), None);
    }

    #[test]
    fn falling_onto_a_plane_is_approach_without_slide() {
        let found =
            Shape::Plane.slide([0.0, 0.0, 0.03], &Pose::default(), [0.0, 0.0, 0.01], &Pose::default());
        let (slid, approach) = found.unwrap();
        assert!(slid == 0.0 && (approach + 0.02).abs() < 1e-15);
    }

    #[test]
    fn a_nearer_collider_takes_the_slot_of_a_mesh_and_a_farther_one_does_not() {
        let mesh = Contact { surface: 0, distance: 0.02, ..Contact::default() };
        let plane = Collider { shape: Shape::Plane, pose: Pose::default(), next: Pose::default() };
        let cloth = [[0.0, 0.0, 0.01], [0.0, 0.0, 0.03], [0.0, 0.0, 0.06]];
        let mut out = [mesh, mesh, Contact::default()];
        assert_eq!(insert_contacts(&cloth, &cloth, &[plane], 1, 0.05, &mut out), Ok(1));
        assert_eq!(out.map(|c| c.surface), [1, 0, Contact::NONE]);
        assert!(insert_contacts(&cloth, &cloth[1..], &[plane], 1, 0.05, &mut out).is_err());
        assert!(insert_contacts(&cloth, &cloth, &[plane], 1, 0.05, &mut out[..2]).is_err());
    }
}
