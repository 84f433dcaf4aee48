//! The contact detector as a node.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::slip::SlipMode;
use super::{ContactError, Contacts, ContactsFormat, Detection, Detector, DetectorParams, Exclude};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{In, Many, Stream};
use crate::core::shape::{Build, Ends, Incoming, Shape};
use crate::core::time::Rate;
use crate::mesh::{Mesh, MeshFormat, vertex_areas};
use crate::{archive_state, choices, params, ports};

choices! { @param SlipMode {
    /// Along the triangle, and exactly zero under any rigid motion of the pair.
    Exact,
    /// The displacement against the closest point, as the paper can be read: it keeps the part along the normal, and hears
    /// a rotation of the pair as sliding at the angle per second times the gap. For comparison.
    Naive,
} }

params! {
    /// Which triangles the vertices of a cloth touch, and how far they slide along them until the next frame.
    ///
    /// For each vertex of `mesh`: the closest points over all triangles of the cloth itself and of `others`, where nearer
    /// than `radius`. The slide is measured along the same triangle in both frames with unclamped in-plane coordinates,
    /// which makes it exactly zero under any rigid motion of the pair. The last frame has no successor: its slides are 0.
    ///
    /// A still mesh among `others` may come at any rate; one that moves must have the rate of `mesh`. The motion of
    /// `others` holds where they end before `mesh`.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2. The
    /// paper names neither the exclusion of a vertex's own neighbourhood nor the point that the speed is relative to.
    pub struct ContactDetectorParams {
        /// Largest distance of a contact. Solvers keep layers apart: about twice their collision distance sees them touch.
        radius: f32 = 0.05, unit "m", range 0.00001..=10.0;
        /// Triangles of the own cloth with a corner nearer than this along the rest edges are not touched; 0 excludes
        /// incident ones only; None takes twice the radius or the longest rest edge at the vertex.
        exclude: Option<f32> = None, unit "m", range 0.0..=100.0;
        /// Contacts kept per vertex, nearest first; the paper keeps one.
        max_contacts: usize = 1, unit "contacts", range 1..=16;
        /// Whether triangles are touched from behind as well.
        two_sided: bool = true;
        /// Whether the cloth touches itself.
        self_contact: bool = true;
        /// How a slide is measured.
        slip: SlipMode = SlipMode::Exact;
    }
}

ports! {
    pub struct ContactDetectorPorts / ContactDetectorIo {
        in {
            /// The cloth.
            mesh: Stream<Mesh>,
            /// Whatever else the cloth can touch: bodies, floors, other cloths.
            others: Many<Stream<Mesh>>,
        }
        out {
            /// Contacts per vertex of the cloth, at the rate of `mesh`.
            contacts: Stream<Contacts>,
        }
    }
}

/// The node over [`Detector`].
pub struct ContactDetector {
    detector: Detector,
    others: Vec<Other>,
    /// Room for the positions of all others in this frame and the next; empty but while a frame is looked at.
    lists: [Vec<&'static [[f32; 3]]>; 2],
    total: Total,
}

/// One of the others, in this frame and in the next.
struct Other {
    now: Pose,
    next: Pose,
}

/// Positions of the vertices; those of a mesh that stands still are never changed.
struct Pose {
    vertices: Vec<[f32; 3]>,
    still: bool,
}

impl Pose {
    fn copy_from(&mut self, moving: &In<'_, Mesh>, frame: isize) {
        if !self.still {
            self.vertices.copy_from_slice(moving.item(frame));
        }
    }
}

/// An empty list that borrows from somewhere else, in the memory of the old one.
fn emptied<'a>(mut list: Vec<&[[f32; 3]]>) -> Vec<&'a [[f32; 3]]> {
    list.clear();
    // Collecting from a list of items of the same size keeps its memory.
    list.into_iter().map(|_| -> &[[f32; 3]] { &[] }).collect()
}

#[derive(Default, Serialize, Deserialize)]
struct Total {
    frames: u64,
    contacts: u64,
    most: usize,
    degenerate: u64,
    rebuilt: u64,
}

impl Total {
    fn add(&mut self, found: Detection) {
        self.frames += 1;
        self.contacts += found.contacts as u64;
        self.most = self.most.max(found.contacts);
        self.degenerate += found.degenerate as u64;
        self.rebuilt += found.rebuilt as u64;
    }
}

fn detector_params(p: &ContactDetectorParams) -> DetectorParams {
    DetectorParams {
        radius: p.radius,
        exclude: match p.exclude {
            None => Exclude::Auto,
            Some(0.0) => Exclude::IncidentOnly,
            Some(distance) => Exclude::Distance(distance),
        },
        max_contacts: p.max_contacts,
        two_sided: p.two_sided,
        self_contact: p.self_contact,
        slip: p.slip,
    }
}

/// The field that an error of the contacts is about.
pub(super) fn fault(error: &ContactError) -> Fault {
    let field = match error {
        ContactError::Corner { surface, .. }
        | ContactError::Size { surface, .. }
        | ContactError::Positions { surface, .. }
        | ContactError::NotFinite { surface, .. }
            if *surface > 0 =>
        {
            "others"
        }
        ContactError::Parameter { name, .. } => name,
        ContactError::Patches { .. } => "radius",
        _ => "mesh",
    };
    let fault = Fault::new("F073", error.to_string()).at(field);
    match error {
        ContactError::Patches { .. } => {
            fault.help("make `radius` small beside the cloth, or set `exclude`, in metres along it")
        }
        _ => fault,
    }
}

fn same_rate(rate: Rate, k: usize, other: &Incoming<Mesh>) -> Result<(), Reject> {
    if other.format.is_static || other.rate == rate {
        return Ok(());
    }
    let shown = |rate: Rate| crate::core::params::Param::write(&rate).to_string();
    Err(Reject::new(
        "F072",
        format!(
            "a moving mesh in `others` has {} frames per second, `mesh` has {}",
            shown(other.rate),
            shown(rate)
        ),
    )
    .at(format!("others[{k}]"))
    .help(format!("set `fps: {}` on the node that gives it", shown(rate))))
}

impl Node for ContactDetector {
    type Params = ContactDetectorParams;
    type Ports = ContactDetectorPorts;
    const NAME: &'static str = "ContactDetector";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 1000.0;

    fn shape(p: &ContactDetectorParams, s: &mut Shape<'_, '_, ContactDetectorPorts>) -> Result<(), Reject> {
        let mesh = s.input(ContactDetectorPorts::mesh);
        for (k, other) in s.many(ContactDetectorPorts::others).iter().enumerate() {
            s.check(same_rate(mesh.rate, k, other));
        }
        if mesh.end.is_none() && mesh.format.is_static {
            let message = "`mesh` has one frame: it stands still and never ends; an animation of at least two frames is needed";
            let help = "export the motion of the cloth, not a pose of it, or give `duration` to MeshSequence";
            s.wrong(Reject::new("F075", message).at("mesh").help(help));
        }
        s.lookaround(ContactDetectorPorts::mesh, 0, 1);
        s.lookaround(ContactDetectorPorts::others, 0, 1);
        s.when_ended(ContactDetectorPorts::mesh, Ends::Hold);
        s.when_ended(ContactDetectorPorts::others, Ends::Hold);
        let topology = &mesh.format.topology;
        let (cut, all) = (topology.coincident(), topology.vertex_count());
        if 2 * cut > all {
            s.note(format!(
                "{cut} of {all} vertices of `mesh` lie where another one does, so that the faces beside each other touch: \
                 merge vertices by distance before the export"
            ));
        }
        let areas: Arc<[f32]> = vertex_areas(&topology.rest, &topology.triangles).into();
        let others = s.many(ContactDetectorPorts::others);
        let surfaces = std::iter::once(&mesh.format).chain(others.iter().map(|other| &other.format));
        let format = ContactsFormat {
            areas,
            slots: p.max_contacts,
            cloth: mesh.format.materials.of_vertices(topology).into(),
            surfaces: surfaces.map(|format| format.materials.clone()).collect(),
        };
        s.output(ContactDetectorPorts::contacts, mesh.rate, format);
        s.ends(mesh.end);
        Ok(())
    }

    fn build(p: &ContactDetectorParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let cloth = cx.input(ContactDetectorPorts::mesh).format;
        let others = cx.many(ContactDetectorPorts::others);
        let surfaces: Vec<_> = others.iter().map(|other| &*other.format.topology).collect();
        let detector =
            Detector::new(&cloth.topology, &surfaces, detector_params(p)).map_err(|e| fault(&e))?;
        let pose =
            |format: &MeshFormat| Pose { vertices: format.topology.rest.clone(), still: format.is_static };
        let lists = [0; 2].map(|_| Vec::with_capacity(others.len()));
        let others = others.iter().map(|o| Other { now: pose(&o.format), next: pose(&o.format) }).collect();
        Ok(Self { detector, others, lists, total: Total::default() })
    }

    fn run(&mut self, mut io: ContactDetectorIo<'_>) -> Result<(), Fault> {
        let (first, rate, width) = (io.contacts.first(), io.contacts.rate(), io.contacts.width().max(1));
        for (k, out) in io.contacts.items().chunks_exact_mut(width).enumerate() {
            let k = k as isize;
            for (other, moving) in self.others.iter_mut().zip(io.others.iter()) {
                other.now.copy_from(&moving, k);
                other.next.copy_from(&moving, k + 1);
            }
            let [mut now, mut next] = std::mem::take(&mut self.lists).map(emptied);
            now.extend(self.others.iter().map(|other| &other.now.vertices[..]));
            next.extend(self.others.iter().map(|other| &other.next.vertices[..]));
            let found =
                self.detector.detect_and_slide(io.mesh.item(k), io.mesh.item(k + 1), &now, &next, out);
            self.lists = [now, next].map(emptied);
            self.total.add(found.map_err(|e| fault(&e).when(rate.tick(first + k as i64)))?);
        }
        Ok(())
    }

    fn finish(&mut self, _: ContactDetectorIo<'_>) -> Result<Summary, Fault> {
        let total = &self.total;
        Ok(vec![
            ("contacts_per_frame", (total.contacts as f64 / total.frames.max(1) as f64).into()),
            ("contacts_at_most", total.most.into()),
            ("degenerate", total.degenerate.into()),
            ("rebuilt", total.rebuilt.into()),
        ])
    }

    archive_state!(detector, total);
}

#[cfg(test)]
mod tests;
