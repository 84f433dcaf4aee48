//! The node `ContactDetector`.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::detector::{Detection, Detector, DetectorParams};
use crate::contact::broad_phase::exclusion::Exclude;
use crate::contact::item::{Contact, Contacts, ContactsFormat};
use crate::contact::slip::SlipMode;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{In, Many, Stream};
use crate::core::shape::{Build, Ends, Incoming, Shape};
use crate::core::time::Rate;
use crate::mesh::{Mesh, MeshFormat, vertex_areas};
use crate::{archive_state, choices, params, ports};

choices! { @param SlipMode {
    /// Distance along the triangle, exactly zero under any rigid motion of the pair.
    Exact,
    /// Displacement relative to the closest point, the literal reading of the paper. It includes the component along the normal,
    /// and a rotation of the pair counts as sliding at the angular velocity times the gap. For comparison.
    Naive,
} }

params! {
    /// Detects the triangles that the vertices of a cloth touch, and the distance that they slide along them until the next frame.
    ///
    /// For each vertex of `mesh` it finds the closest points over all triangles of the cloth itself and of `others` that are nearer
    /// than `radius`. The slide is measured along the same triangle in both frames with unclamped in-plane coordinates, so that it
    /// is exactly zero under any rigid motion of the pair. The last frame has no successor: its slides are 0.
    ///
    /// A static mesh among `others` can have any rate; a moving one must have the rate of `mesh`. Meshes that end before `mesh`
    /// stay at their last frame.
    ///
    /// A frame in which the surfaces are crowded, such as a cloth that has collapsed into one point, has no contacts: everything
    /// would touch everything. While a graph plays, late frames have none either.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2. The
    /// paper specifies neither the exclusion of a vertex's own neighbourhood nor the point that the speed is relative to.
    pub struct ContactDetectorParams {
        /// Largest distance of a contact. Solvers keep layers apart: about twice their collision distance finds these contacts.
        radius: f32 = 0.05, unit "m", range 0.00001..=10.0;
        /// Distance along the rest edges within which a vertex does not touch triangles of its own cloth. 0 excludes incident
        /// triangles only; None is the larger of twice the radius and the longest rest edge at the vertex.
        exclude: Option<f32> = None, unit "m", range 0.0..=100.0;
        /// Largest number of contacts per vertex, nearest first; the paper has one.
        max_contacts: usize = 1, unit "contacts", range 1..=16;
        /// If true, triangles are touched from behind as well.
        two_sided: bool = true;
        /// If true, the cloth can touch itself.
        self_contact: bool = true;
        /// Measure of a slide.
        slip: SlipMode = SlipMode::Exact;
    }
}

ports! {
    pub struct ContactDetectorPorts / ContactDetectorIo {
        in {
            /// The cloth.
            mesh: Stream<Mesh>,
            /// Other surfaces that the cloth can touch: bodies, floors, other cloths.
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
    others: Vec<OtherSurface>,
    /// Memory for references to the positions of all others in this frame and the next; empty between frames.
    positions: [Vec<&'static [[f32; 3]]>; 2],
    totals: Totals,
    /// True while the windows are late, so that the contacts are not audible.
    late: bool,
}

/// Positions of another surface in this frame and in the next.
struct OtherSurface {
    now: Vec<[f32; 3]>,
    next: Vec<[f32; 3]>,
    is_static: bool,
}

impl OtherSurface {
    fn new(format: &MeshFormat) -> Self {
        let rest = &format.topology.rest;
        Self { now: rest.clone(), next: rest.clone(), is_static: format.is_static }
    }

    fn update(&mut self, mesh: &In<'_, Mesh>, frame: isize) {
        if !self.is_static {
            self.now.copy_from_slice(mesh.item(frame));
            self.next.copy_from_slice(mesh.item(frame + 1));
        }
    }
}

/// Empties a list and returns its memory with another lifetime.
fn recycled<'a>(mut list: Vec<&[[f32; 3]]>) -> Vec<&'a [[f32; 3]]> {
    list.clear();
    // Collecting from a list of items of the same size reuses its memory.
    list.into_iter().map(|_| -> &[[f32; 3]] { &[] }).collect()
}

#[derive(Default, Serialize, Deserialize)]
struct Totals {
    frames: u64,
    contacts: u64,
    max_contacts: usize,
    degenerate: u64,
    rebuilt: u64,
    crowded: u64,
}

impl Totals {
    fn add(&mut self, found: Detection) {
        self.frames += 1;
        self.contacts += found.contacts as u64;
        self.max_contacts = self.max_contacts.max(found.contacts);
        self.degenerate += found.degenerate as u64;
        self.rebuilt += found.rebuilt as u64;
        self.crowded += u64::from(found.crowded);
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

fn same_rate(rate: Rate, k: usize, other: &Incoming<Mesh>) -> Result<(), Reject> {
    if other.format.is_static || other.rate == rate {
        return Ok(());
    }
    let text = |rate: Rate| crate::core::params::Param::write(&rate).to_string();
    Err(Reject::new(
        "F072",
        format!(
            "a moving mesh in `others` has {} frames per second, `mesh` has {}",
            text(other.rate),
            text(rate)
        ),
    )
    .at(format!("others[{k}]"))
    .help(format!(
        "set `fps: {}` on the node that gives it if its file states its times, as Alembic, glTF and MDD do, or `fps: {}` on that of `mesh` if that file does; \
         a PC2 and a sequence of OBJs play at the speed that `fps` gives: leave them at their own",
        text(rate),
        text(other.rate)
    )))
}

impl Node for ContactDetector {
    type Params = ContactDetectorParams;
    type Ports = ContactDetectorPorts;
    const NAME: &'static str = "ContactDetector";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 1000.0;

    fn shape(p: &ContactDetectorParams, s: &mut Shape<'_, '_, ContactDetectorPorts>) -> Result<(), Reject> {
        let mesh = s.input(ContactDetectorPorts::mesh);
        for (k, other) in s.many(ContactDetectorPorts::others).iter().enumerate() {
            s.check(same_rate(mesh.rate, k, other));
        }
        if mesh.end.is_none() && mesh.format.is_static {
            let message = "`mesh` has one frame: it is static and never ends; an animation of at least two frames is needed";
            let help = "export the motion of the cloth, not a pose of it, or give `duration` to MeshSequence";
            s.wrong(Reject::new("F075", message).at("mesh").help(help));
        }
        s.lookaround(ContactDetectorPorts::mesh, 0, 1);
        s.lookaround(ContactDetectorPorts::others, 0, 1);
        s.when_ended(ContactDetectorPorts::mesh, Ends::Hold);
        s.when_ended(ContactDetectorPorts::others, Ends::Hold);
        let topology = &mesh.format.topology;
        let (coincident, vertices) = (topology.coincident(), topology.vertex_count());
        if 2 * coincident > vertices {
            s.note(format!(
                "{coincident} of {vertices} vertices of `mesh` coincide with another one, so that neighbouring faces touch: \
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
            Detector::new(&cloth.topology, &surfaces, detector_params(p)).map_err(|e| e.fault())?;
        let positions = [0; 2].map(|_| Vec::with_capacity(others.len()));
        let others = others.iter().map(|other| OtherSurface::new(&other.format)).collect();
        Ok(Self { detector, others, positions, totals: Totals::default(), late: false })
    }

    fn run(&mut self, mut io: ContactDetectorIo<'_>) -> Result<(), Fault> {
        let (first, rate, width) = (io.contacts.first(), io.contacts.rate(), io.contacts.width().max(1));
        for (k, out) in io.contacts.items().chunks_exact_mut(width).enumerate() {
            let k = k as isize;
            self.others.iter_mut().zip(io.others.iter()).for_each(|(other, mesh)| other.update(&mesh, k));
            if self.late {
                out.fill(Contact::default());
                continue;
            }
            let [mut now, mut next] = std::mem::take(&mut self.positions).map(recycled);
            now.extend(self.others.iter().map(|other| &other.now[..]));
            next.extend(self.others.iter().map(|other| &other.next[..]));
            let found =
                self.detector.detect_and_slide(io.mesh.item(k), io.mesh.item(k + 1), &now, &next, out);
            self.positions = [now, next].map(recycled);
            self.totals.add(found.map_err(|e| e.fault().when(rate.tick(first + k as i64)))?);
        }
        Ok(())
    }

    fn finish(&mut self, _: ContactDetectorIo<'_>) -> Result<Summary, Fault> {
        let totals = &self.totals;
        let mut summary = vec![
            ("contacts_per_frame", (totals.contacts as f64 / totals.frames.max(1) as f64).into()),
            ("contacts_at_most", totals.max_contacts.into()),
            ("degenerate", totals.degenerate.into()),
            ("rebuilt", totals.rebuilt.into()),
        ];
        if totals.crowded > 0 {
            summary.push(("crowded_frames", totals.crowded.into()));
        }
        Ok(summary)
    }

    fn set_late(&mut self, late: bool) {
        self.late = late;
    }

    archive_state!(detector, totals);
}

#[cfg(test)]
mod tests;
