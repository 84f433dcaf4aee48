//! A collider given by a formula, as a node.

use std::sync::Arc;

use super::analytic::{Moving, Pose, Shape as Form, merge};
use super::detector_node::fault;
use super::{Contacts, ContactsFormat};
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
    /// The form of a collider.
    pub enum ColliderForm {
        /// All below a plane: a floor, a wall.
        Plane,
        /// A sphere of `size`: a head, a ball.
        Sphere,
        /// A rod of `length` with round ends, all within `size` of its middle line: an arm, a leg, a rail.
        Capsule,
    }
}

params! {
    /// Adds what a cloth touches of a plane, a sphere or a capsule to its contacts.
    ///
    /// Such a body is exact and perfectly smooth, and costs less than a mesh of it. It takes a slot of a vertex where it is
    /// nearer than what the slot holds. One node is one body; several follow each other, each on the contacts of the one
    /// before. Slides are measured in the frame of the body and along its surface, so cloth that is carried along by it does
    /// not slide.
    ///
    /// # Source
    /// An addition to An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012),
    /// whose bodies are all meshes.
    pub struct AnalyticColliderParams {
        /// Its form.
        form: ColliderForm = ColliderForm::Plane;
        /// Radius of the sphere or of the capsule.
        size: f64 = 0.1, unit "m", range 0.0..=1000.0;
        /// Length of the middle line of the capsule, without its round ends.
        length: f64 = 0.5, unit "m", range 0.0..=1000.0;
        /// A point of the plane, or the middle of the body, where no link gives its pose.
        position: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Where the outside of the plane is, or along what the capsule lies, where no link gives its pose: a direction of
        /// any length.
        axis: [f64; 3] = [0.0, 0.0, 1.0], unit "", range -100_000.0..=100_000.0;
        /// Largest distance of a contact, as of `ContactDetector`.
        radius: f32 = 0.05, unit "m", range 0.00001..=10.0;
        /// What it is made of, for `MaterialRouter`.
        material: Text = "".into();
    }
}

ports! {
    pub struct AnalyticColliderPorts / AnalyticColliderIo {
        in {
            /// Contacts of the cloth with all else.
            contacts: Stream<Contacts>,
            /// The cloth, as `ContactDetector` gets it.
            mesh: Stream<Mesh>,
            /// Where the body is, in place of the parameters: its own z is the `axis`.
            pose: Option<Stream<Poses>>,
        }
        out {
            /// Contacts with the body among them.
            merged: Stream<Contacts>,
        }
    }
}

/// The node over [`merge`].
pub struct AnalyticCollider {
    form: Form,
    still: Pose,
    /// The number of this body among the surfaces.
    surface: u32,
    radius: f32,
    frames: u64,
    contacts: u64,
}

fn form(p: &AnalyticColliderParams) -> Form {
    match p.form {
        ColliderForm::Plane => Form::Plane,
        ColliderForm::Sphere => Form::Sphere { radius: p.size },
        ColliderForm::Capsule => Form::Capsule { half_length: 0.5 * p.length, radius: p.size },
    }
}

fn still(p: &AnalyticColliderParams) -> Result<Pose, Reject> {
    Pose::along(p.position, p.axis).ok_or_else(|| {
        let message = format!("`axis` is {:?}, which has no direction", p.axis);
        Reject::new("F067", message).at("axis").help("write [0, 0, 1] for a floor")
    })
}

/// What is touched so far, the cloth itself at least.
fn surfaces(format: &ContactsFormat) -> Vec<Arc<Materials>> {
    let all = format.surfaces.to_vec();
    if all.is_empty() { vec![Arc::default()] } else { all }
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
        let (touch, stand) = (contacts.format.areas.len(), mesh.format.topology.vertex_count());
        if touch != stand {
            let message = format!("`contacts` has {touch} vertices, `mesh` has {stand}");
            s.wrong(Reject::new("F067", message).at("mesh").help("link the mesh that the contacts are of"));
        }
        s.check(still(p));
        s.when_ended(Port::contacts, Ends::Stop);
        s.lookaround(Port::mesh, 0, 1);
        s.when_ended(Port::mesh, Ends::Hold);
        if let Some(poses) = s.optional(Port::pose) {
            let near = frames_per_item(mesh.rate, poses.rate);
            // Between frames poses lie on a cubic through two more.
            let next = if items_on_frames(mesh.rate, poses.rate) { 0 } else { 2 };
            s.lookaround(Port::pose, 2, near + next);
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
            form: form(p),
            still: still(p)?,
            surface: surfaces(&contacts.format).len() as u32,
            radius: p.radius,
            frames: 0,
            contacts: 0,
        })
    }

    fn run(&mut self, mut io: AnalyticColliderIo<'_>) -> Result<(), Fault> {
        let (first, rate, width) = (io.merged.first(), io.merged.rate(), io.merged.width().max(1));
        io.merged.items().copy_from_slice(io.contacts.items());
        let (still, poses) = (self.still, io.pose);
        let place = |tick: Tick| poses.as_ref().map_or(still, |poses| pose_at(poses, tick).into());
        for (k, out) in io.merged.items().chunks_exact_mut(width).enumerate() {
            let (frame, k) = (first + k as i64, k as isize);
            let (pose, next) = (place(rate.tick(frame)), place(rate.tick(frame + 1)));
            let body = Moving { shape: self.form, pose, next };
            let (mesh, after) = (io.mesh.item(k), io.mesh.item(k + 1));
            let added = merge(mesh, after, &[body], self.surface, self.radius, out);
            self.contacts += added.map_err(|e| fault(&e).when(rate.tick(frame)))? as u64;
            self.frames += 1;
        }
        Ok(())
    }

    fn retune(&mut self, new: &AnalyticColliderParams) -> Retune {
        let Ok(still) = still(new) else { return Retune::Rebuild };
        (self.form, self.still, self.radius) = (form(new), still, new.radius);
        Retune::Done
    }

    fn finish(&mut self, _: AnalyticColliderIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("contacts_per_frame", (self.contacts as f64 / self.frames.max(1) as f64).into())])
    }

    archive_state!(frames, contacts);

    fn trial(rng: &mut Rng) -> (AnalyticColliderParams, MemoryFiles) {
        // Near the small meshes of trials.
        let mut near = || [0; 3].map(|_| rng.between(-0.1, 0.1));
        let (position, axis) = (near(), near());
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
mod tests {
    use super::*;
    use crate::contact::Contact;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Rate, TICKS_PER_SECOND, ticks};
    use crate::mesh::{MeshFormat, Topology};
    use crate::spatial;

    type Port = AnalyticColliderPorts;

    fn params() -> AnalyticColliderParams {
        AnalyticColliderParams::read(&|_| None).unwrap()
    }

    /// Three vertices at heights 0.01, 0.03 and 0.2 m over the origin that move along x at 0.3 m/s, touching nothing else.
    fn standalone(p: AnalyticColliderParams) -> Standalone {
        let heights = [0.01_f32, 0.03, 0.2];
        let frames = (0..30).flat_map(|k| heights.map(|z| [0.005 * k as f32, 0.0, z])).collect();
        let topology = Topology { rest: heights.map(|z| [0.0, 0.0, z]).to_vec(), triangles: vec![] };
        Standalone::new::<AnalyticCollider>(p)
            .input(
                Port::contacts,
                Rate::hz(60),
                ContactsFormat::plain(vec![1e-4; 3].into(), 1),
                vec![Contact::default(); 90],
            )
            .input(Port::mesh, Rate::hz(60), MeshFormat::moving(topology), frames)
    }

    fn merged(standalone: &Standalone) -> Vec<Contact> {
        standalone.run().unwrap().stream(Port::merged)
    }

    #[test]
    fn cloth_slides_over_a_still_floor_by_its_own_speed_where_it_is_near() {
        let found = merged(&standalone(params()));
        for frame in found.chunks(3).take(29) {
            assert_eq!([0, 1, 2].map(|v| frame[v].surface), [1, 1, Contact::NONE]);
            assert!(frame[..2].iter().all(|c| (c.slide * 60.0 - 0.3).abs() < 1e-4 && c.approach == 0.0));
            assert!((frame[1].distance - 0.03).abs() < 1e-6);
        }
    }

    #[test]
    fn cloth_does_not_slide_over_a_body_that_carries_it_along() {
        let poses = |rate: f64, seconds: f64| {
            let count = (rate * seconds) as usize;
            let place = |k: usize| spatial::Pose::at([(0.3 * k as f64 / rate) as f32, 0.0, 0.0]);
            (0..count).map(place).collect::<Vec<_>>()
        };
        for rate in [60, 100, 24] {
            let carried =
                standalone(params()).optional(Port::pose, Rate::hz(rate), (), poses(rate.into(), 1.0));
            let found = merged(&carried);
            // The cubic between the first two poses has no pose before it to go by.
            let steady = &found[3 * 6..3 * 29];
            assert!(steady.iter().all(|c| c.slide * 60.0 < 1e-3), "{rate}: {steady:?}");
        }
    }

    #[test]
    fn a_turning_sphere_slides_under_cloth_at_rest_and_a_capsule_reaches_along_its_axis() {
        let sphere = AnalyticColliderParams {
            form: ColliderForm::Sphere,
            position: [0.0, 0.0, -0.1],
            radius: 0.02,
            ..params()
        };
        assert_eq!(merged(&standalone(sphere.clone()))[..3].iter().filter(|c| c.is_some()).count(), 1);
        // Half a turn a second about x under a vertex 0.11 m from the axis.
        let turn = |k: i32| {
            let angle = 0.5 * std::f32::consts::PI * k as f32 / 60.0;
            spatial::Pose { position: [0.0, 0.0, -0.1], rotation: [angle.cos(), angle.sin(), 0.0, 0.0] }
        };
        let turning = standalone(sphere).optional(Port::pose, Rate::hz(60), (), (0..30).map(turn).collect());
        let speed = 60.0 * merged(&turning)[0].slide;
        let wanted = 0.3_f32.hypot(std::f32::consts::PI * 0.11);
        assert!((speed - wanted).abs() < 0.01 * wanted, "{speed} {wanted}");
        let capsule = AnalyticColliderParams {
            form: ColliderForm::Capsule,
            size: 0.05,
            length: 0.4,
            position: [0.25, 0.0, 0.0],
            axis: [-1.0, 0.0, 0.0],
            ..params()
        };
        let near = merged(&standalone(capsule))[0];
        let gap = 0.05_f32.hypot(0.01) - 0.05;
        assert!((near.distance - gap).abs() < 1e-6, "the round end is nearest: {near:?}");
    }

    #[test]
    fn windows_of_any_length_give_the_same_contacts() {
        let turn = |k: i32| spatial::Pose::at([0.01 * k as f32, 0.0, 0.001 * (k % 5) as f32]);
        let run = |window| {
            let moving =
                standalone(params()).optional(Port::pose, Rate::hz(37), (), (0..18).map(turn).collect());
            merged(&moving.window(window))
        };
        let whole = run(TICKS_PER_SECOND);
        for window in [ticks(0.001), ticks(0.0123), Rate::hz(60).tick(7)] {
            assert_eq!(run(window), whole);
        }
    }

    #[test]
    fn an_axis_without_direction_and_another_mesh_are_refused() {
        let reject = standalone(AnalyticColliderParams { axis: [0.0; 3], ..params() }).shape().unwrap_err();
        assert_eq!((reject.code, reject.field.as_deref()), ("F067", Some("axis")));
        let other = Standalone::new::<AnalyticCollider>(params())
            .input(
                Port::contacts,
                Rate::hz(60),
                ContactsFormat::plain(vec![1e-4; 2].into(), 1),
                vec![Contact::default(); 4],
            )
            .input(
                Port::mesh,
                Rate::hz(60),
                MeshFormat::moving(Topology { rest: vec![[0.0; 3]], triangles: vec![] }),
                vec![[0.0; 3]; 2],
            );
        assert_eq!(other.shape().unwrap_err().code, "F067");
    }
}
