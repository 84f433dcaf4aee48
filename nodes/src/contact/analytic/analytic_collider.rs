//! The node `AnalyticCollider`.

use std::sync::Arc;

use super::collider::{self, Collider, Pose, insert_contacts};
use crate::contact::item::{Contacts, ContactsFormat};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::Tick;
use crate::mesh::{Materials, Mesh};
use crate::spatial::Poses;
use crate::spatial::motion::interpolation::{frames_per_item, items_on_frames, pose_at};
use crate::{archive_state, choices, params, ports};

choices! {
    /// Shape of a collider.
    pub enum ColliderForm {
        /// The half-space behind a plane: a floor, a wall.
        Plane,
        /// A sphere of `size`: a head, a ball.
        Sphere,
        /// All points within `size` of a segment of `length`: an arm, a leg, a rail.
        Capsule,
    }
}

params! {
    /// Adds the contacts of a cloth with a plane, a sphere or a capsule to its other contacts.
    ///
    /// Such a body is exact and perfectly smooth, and costs less than a mesh of it. It takes the slot of a contact that is farther
    /// from the vertex. Each node is one body; for several bodies link the nodes in series. Slides are measured in the frame of the
    /// body and along its surface, so cloth that moves with the body does not slide.
    ///
    /// # Source
    /// An addition to An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012),
    /// whose bodies are all meshes.
    pub struct AnalyticColliderParams {
        /// Shape of the body.
        form: ColliderForm = ColliderForm::Plane;
        /// Radius of the sphere or of the capsule.
        size: f64 = 0.1, unit "m", range 0.0..=1000.0;
        /// Length of the segment of the capsule, without its round ends.
        length: f64 = 0.5, unit "m", range 0.0..=1000.0;
        /// A point of the plane, or the centre of the body, if `pose` is not linked.
        position: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Outward normal of the plane or axis of the capsule, of any length, if `pose` is not linked.
        axis: [f64; 3] = [0.0, 0.0, 1.0], unit "", range -100_000.0..=100_000.0;
        /// Largest distance of a contact, as in `ContactDetector`.
        radius: f32 = 0.05, unit "m", range 0.00001..=10.0;
        /// Material of the body, for `MaterialRouter`.
        material: Text = "".into();
    }
}

ports! {
    pub struct AnalyticColliderPorts / AnalyticColliderIo {
        in {
            /// Contacts of the cloth with other surfaces.
            contacts: Stream<Contacts>,
            /// The cloth, the same as `mesh` of `ContactDetector`.
            mesh: Stream<Mesh>,
            /// Pose of the body, in place of `position` and `axis`: its own z is the axis.
            pose: Option<Stream<Poses>>,
        }
        out {
            /// All contacts, those with the body included.
            merged: Stream<Contacts>,
        }
    }
}

/// The node `AnalyticCollider`.
pub struct AnalyticCollider {
    shape: collider::Shape,
    /// Pose if none is linked.
    fixed_pose: Pose,
    /// Index of the body among the surfaces.
    surface: u32,
    radius: f32,
    frames: u64,
    contacts: u64,
}

fn shape(p: &AnalyticColliderParams) -> collider::Shape {
    match p.form {
        ColliderForm::Plane => collider::Shape::Plane,
        ColliderForm::Sphere => collider::Shape::Sphere { radius: p.size },
        ColliderForm::Capsule => collider::Shape::Capsule { half_length: 0.5 * p.length, radius: p.size },
    }
}

fn fixed_pose(p: &AnalyticColliderParams) -> Result<Pose, Reject> {
    Pose::along(p.position, p.axis).ok_or_else(|| {
        let message = format!("`axis` is {:?}, which has no direction", p.axis);
        Reject::new("F067", message).at("axis").help("write [0, 0, 1] for a floor")
    })
}

/// Surfaces of the incoming contacts, the cloth itself at least.
fn surfaces(format: &ContactsFormat) -> Vec<Arc<Materials>> {
    let surfaces = format.surfaces.to_vec();
    if surfaces.is_empty() { vec![Arc::default()] } else { surfaces }
}

impl Node for AnalyticCollider {
    type Params = AnalyticColliderParams;
    type Ports = AnalyticColliderPorts;
    const NAME: &'static str = "AnalyticCollider";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 50.0;

    fn shape(p: &AnalyticColliderParams, s: &mut Shape<'_, '_, AnalyticColliderPorts>) -> Result<(), Reject> {
        type Port = AnalyticColliderPorts;
        let (contacts, mesh) = (s.input(Port::contacts), s.input(Port::mesh));
        if mesh.rate != contacts.rate {
            let message = format!("`mesh` has {} frames per second, `contacts` {}", mesh.rate, contacts.rate);
            s.wrong(Reject::new("F072", message).at("mesh").help("link the mesh that the contacts are of"));
        }
        let (in_contacts, in_mesh) = (contacts.format.areas.len(), mesh.format.topology.vertex_count());
        if in_contacts != in_mesh {
            let message = format!("`contacts` has {in_contacts} vertices, `mesh` has {in_mesh}");
            s.wrong(Reject::new("F067", message).at("mesh").help("link the mesh that the contacts are of"));
        }
        s.check(fixed_pose(p));
        s.when_ended(Port::contacts, Ends::Stop);
        s.lookaround(Port::mesh, 0, 1);
        s.when_ended(Port::mesh, Ends::Hold);
        if let Some(poses) = s.optional(Port::pose) {
            let poses_per_frame = frames_per_item(mesh.rate, poses.rate);
            // A pose between two others is on a cubic through two more.
            let cubic = if items_on_frames(mesh.rate, poses.rate) { 0 } else { 2 };
            s.lookaround(Port::pose, 2, poses_per_frame + cubic);
        }
        s.when_ended(Port::pose, Ends::Hold);
        let mut surfaces = surfaces(&contacts.format);
        surfaces.push(Arc::new(Materials::one(&p.material.0)));
        let format = ContactsFormat { surfaces: surfaces.into(), ..contacts.format };
        s.output(Port::merged, contacts.rate, format);
        s.ends(contacts.end);
        Ok(())
    }

    fn build(p: &AnalyticColliderParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let contacts = cx.input(AnalyticColliderPorts::contacts);
        Ok(Self {
            shape: shape(p),
            fixed_pose: fixed_pose(p)?,
            surface: surfaces(&contacts.format).len() as u32,
            radius: p.radius,
            frames: 0,
            contacts: 0,
        })
    }

    fn run(&mut self, mut io: AnalyticColliderIo<'_>) -> Result<(), Fault> {
        let (first, rate, width) = (io.merged.first(), io.merged.rate(), io.merged.width().max(1));
        io.merged.items().copy_from_slice(io.contacts.items());
        let (fixed, poses) = (self.fixed_pose, io.pose);
        let pose_at_tick = |tick: Tick| poses.as_ref().map_or(fixed, |poses| pose_at(poses, tick).into());
        for (k, out) in io.merged.items().chunks_exact_mut(width).enumerate() {
            let (frame, k) = (first + k as i64, k as isize);
            let (pose, next) = (pose_at_tick(rate.tick(frame)), pose_at_tick(rate.tick(frame + 1)));
            let body = Collider { shape: self.shape, pose, next };
            let (cloth, cloth_next) = (io.mesh.item(k), io.mesh.item(k + 1));
            let inserted = insert_contacts(cloth, cloth_next, &[body], self.surface, self.radius, out);
            self.contacts += inserted.map_err(|e| e.fault().when(rate.tick(frame)))? as u64;
            self.frames += 1;
        }
        Ok(())
    }

    fn retune(&mut self, new: &AnalyticColliderParams) -> Retune {
        let Ok(pose) = fixed_pose(new) else { return Retune::Rebuild };
        (self.shape, self.fixed_pose, self.radius) = (shape(new), pose, new.radius);
        Retune::Done
    }

    fn finish(&mut self, _: AnalyticColliderIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("contacts_per_frame", (self.contacts as f64 / self.frames.max(1) as f64).into())])
    }

    archive_state!(frames, contacts);

    fn trial(rng: &mut Rng) -> (AnalyticColliderParams, MemoryFiles) {
        // Near the small meshes of trials.
        let mut vector = || [0; 3].map(|_| rng.between(-0.1, 0.1));
        let (position, axis) = (vector(), vector());
        let size = rng.between(0.0, 0.5);
        let params = AnalyticColliderParams {
            position,
            axis,
            size,
            length: rng.between(0.0, 0.5),
            radius: rng.between(0.1, 5.0) as f32,
            ..AnalyticColliderParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
