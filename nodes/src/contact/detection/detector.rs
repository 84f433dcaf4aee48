//! The triangles that cloth vertices touch, frame by frame.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicUsize};

use fearless_simd::Level;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::frame::{Frame, check_finite};
use super::query::{Candidate, Scene, Scratch};
use crate::contact::broad_phase::bvh::{Bvh, sort_by_locality};
use crate::contact::broad_phase::exclusion::{Exclude, Exclusion};
use crate::contact::broad_phase::{CLUSTER, ExcludedLeaves};
use crate::contact::error::ContactError;
use crate::contact::item::Contact;
use crate::contact::slip::{SlipMode, in_plane, naive, slide};
use crate::contact::triangle::closest_point;
use crate::contact::vector::{narrow, widen};
use crate::core::fault::Fault;
use crate::core::pool;
use crate::core::state::{StateArchive, Stateful};
use crate::mesh::Topology;

/// Parameters of contact detection.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectorParams {
    /// Largest distance of a contact, metres.
    pub radius: f32,
    /// Triangles of its own neighbourhood that a vertex cannot touch.
    pub exclude: Exclude,
    /// Largest number of contacts per vertex, nearest first; the paper has 1.
    pub max_contacts: usize,
    /// If false, a vertex behind a triangle's plane does not touch it.
    pub two_sided: bool,
    /// If true, the cloth can touch itself.
    pub self_contact: bool,
    /// Measure of a slide.
    pub slip: SlipMode,
}

impl Default for DetectorParams {
    fn default() -> Self {
        Self {
            radius: 0.05,
            exclude: Exclude::Auto,
            max_contacts: 1,
            two_sided: true,
            self_contact: true,
            slip: SlipMode::Exact,
        }
    }
}

/// Counts of one frame of detection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Detection {
    /// Number of contacts.
    pub contacts: usize,
    /// Number of contacts with a degenerate triangle, whose slide is 0.
    pub degenerate: usize,
    /// Number of surfaces whose triangles were sorted again because their boxes had grown.
    pub rebuilt: usize,
    /// True if the surfaces are crowded, so that there are no contacts.
    pub crowded: bool,
}

/// Mean number of leaves that overlap the box of a cluster of vertices at which a frame counts as crowded. Cloth in a heap has tens.
const CROWDED_LEAVES: usize = 256;
/// Leaves that a search visits beyond the average of a crowded frame before it finds out whether the frame is.
const JUDGED_LEAVES: usize = 2048;
/// Leaves that overlap the boxes of all clusters together, up to which no frame is crowded.
const FEW_LEAVES: usize = 16_384;
/// Parts of the clusters that are searched in parallel. In a crowded frame at least one of them visits more than its share, as
/// `PARTS * JUDGED_LEAVES` is no more than `FEW_LEAVES`.
const PARTS: usize = 8;
/// Vertices whose contacts one thread measures at a time.
const MEASURED: usize = 256;

/// Search for the closest triangles of all surfaces within a radius of each cloth vertex.
///
/// Among equally near triangles the one of the lower surface comes first, then the lower triangle. The result is exact
/// and depends on the frame alone; state from earlier frames affects only the speed. A frame is crowded if more than 256 leaves
/// of 4 triangles overlap the boxes of 16 neighbouring vertices on average, and more than 16,384 in total: such as all vertices in
/// one place. It has no contacts, so that no frame takes a time that grows with the product of vertices and triangles.
///
/// # Source
/// An, James and Marschner, *Motion-driven Concatenative Synthesis of Cloth Sounds*, SIGGRAPH 2012, section 2.
#[derive(Clone, Debug)]
pub struct Detector {
    params: DetectorParams,
    vertices: Vec<usize>,
    triangles: Vec<Vec<[u32; 3]>>,
    /// Hierarchies of all surfaces, the cloth's first.
    hierarchies: Vec<Bvh>,
    exclusion: Exclusion,
    /// Exclusions of each cluster in the cloth's own hierarchy.
    excluded_leaves: ExcludedLeaves,
    /// Cloth vertices, neighbours together; clusters are consecutive chunks.
    order: Vec<u32>,
    /// Place of each cloth vertex in `order`.
    places: Vec<u32>,
    /// Contacts of the previous frame, in the order of `order`.
    previous: Vec<Candidate>,
    /// Memory of each part.
    scratch: Vec<Scratch>,
}

impl Stateful for Detector {
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        archive.each(&mut self.hierarchies)?;
        if let Some(own) = self.hierarchies.first().filter(|_| archive.restores()) {
            self.excluded_leaves.update(self.order.len(), &self.exclusion, own);
        }
        Ok(())
    }
}

impl Detector {
    /// Prepares exclusion, hierarchies and scratch memory for a cloth and the surfaces that it can touch.
    ///
    /// # Errors
    /// [`ContactError`] for a radius that is not positive and finite, no contacts per vertex, a negative exclusion
    /// distance, triangles with absent vertices, rest positions that are not finite, and exclusion patches about as large as
    /// a cloth of many vertices.
    ///
    /// # Complexity
    /// O(F log F + V p log p) for exclusion patches of p vertices; memory O(V + F) plus the runs of the patches.
    pub fn new(cloth: &Topology, others: &[&Topology], params: DetectorParams) -> Result<Self, ContactError> {
        check_params(&params)?;
        let surfaces: Vec<&Topology> = std::iter::once(cloth).chain(others.iter().copied()).collect();
        for (surface, topology) in surfaces.iter().enumerate() {
            check_topology(surface, topology)?;
        }
        let hierarchies: Vec<Bvh> = surfaces
            .iter()
            .enumerate()
            .map(|(surface, t)| {
                let unused = surface == 0 && !params.self_contact;
                Bvh::new(&t.rest, if unused { &[] } else { &t.triangles })
            })
            .collect();
        let exclusion = if params.self_contact {
            Exclusion::new(cloth, hierarchies[0].order(), params.radius, params.exclude)?
        } else {
            Exclusion::new(
                &Topology { rest: cloth.rest.clone(), triangles: Vec::new() },
                &[],
                0.0,
                params.exclude,
            )?
        };
        let mut order: Vec<u32> = (0..cloth.vertex_count() as u32).collect();
        sort_by_locality(&mut order, &cloth.rest);
        let mut places = vec![0; order.len()];
        (0..).zip(&order).for_each(|(place, &v)| places[v as usize] = place);
        let runs = order.par_chunks(CLUSTER).map(|cluster| exclusion.of_cluster(cluster)).collect();
        let excluded_leaves = ExcludedLeaves::new(order.len(), &exclusion, runs, &hierarchies[0]);
        Ok(Self {
            vertices: surfaces.iter().map(|t| t.vertex_count()).collect(),
            triangles: surfaces.iter().map(|t| t.triangles.clone()).collect(),
            scratch: (0..PARTS).map(|_| Scratch::new(&hierarchies, params.max_contacts)).collect(),
            hierarchies,
            exclusion,
            excluded_leaves,
            previous: vec![Candidate::NONE; order.len() * params.max_contacts],
            order,
            places,
            params,
        })
    }

    /// Returns the parameters of the detector.
    #[must_use]
    pub fn params(&self) -> &DetectorParams {
        &self.params
    }

    /// Returns the triangles that each cloth vertex cannot touch.
    #[must_use]
    pub fn exclusion(&self) -> &Exclusion {
        &self.exclusion
    }

    /// Finds the contacts of one frame; slides and approaches are 0.
    ///
    /// # Shapes
    /// `cloth` holds one position per cloth vertex and `others` one slice per other surface. `out` holds `max_contacts`
    /// slots per vertex, nearest contact first.
    ///
    /// # Errors
    /// [`ContactError`] for wrong lengths and for positions that are not finite; `out` is then unchanged.
    ///
    /// # Complexity
    /// Expected O(F + V log F), the second part divided by the threads of the pool that it is called in. Never allocates.
    pub fn detect(
        &mut self,
        cloth: &[[f32; 3]],
        others: &[&[[f32; 3]]],
        out: &mut [Contact],
    ) -> Result<Detection, ContactError> {
        let now = Frame { cloth, others };
        self.check_frame(now)?;
        self.check_out(out)?;
        Ok(self.run(now, None, out))
    }

    /// Finds the contacts of one frame, and their slides until the next.
    ///
    /// # Shapes
    /// As [`Detector::detect`], with the positions of the frame that follows in `cloth_next` and `others_next`.
    ///
    /// # Errors
    /// As [`Detector::detect`], for both frames.
    ///
    /// # Complexity
    /// Expected O(F + V log F), the second part divided by the threads of the pool that it is called in. Never allocates.
    pub fn detect_and_slide(
        &mut self,
        cloth: &[[f32; 3]],
        cloth_next: &[[f32; 3]],
        others: &[&[[f32; 3]]],
        others_next: &[&[[f32; 3]]],
        out: &mut [Contact],
    ) -> Result<Detection, ContactError> {
        let (now, next) = (Frame { cloth, others }, Frame { cloth: cloth_next, others: others_next });
        self.check_frame(now)?;
        self.check_frame(next)?;
        self.check_out(out)?;
        Ok(self.run(now, Some(next), out))
    }

    fn run(&mut self, now: Frame<'_>, next: Option<Frame<'_>>, out: &mut [Contact]) -> Detection {
        let mut detection = Detection::default();
        for (surface, bvh) in self.hierarchies.iter_mut().enumerate() {
            let sorted = bvh.update(now.surface(surface));
            detection.rebuilt += usize::from(sorted);
            if sorted && surface == 0 {
                self.excluded_leaves.update(self.order.len(), &self.exclusion, bvh);
            }
        }
        let slots = self.params.max_contacts;
        let scene = Scene {
            now,
            triangles: &self.triangles,
            hierarchies: &self.hierarchies,
            excluded_leaves: &self.excluded_leaves,
            squared_radius: f64::from(self.params.radius).powi(2),
            two_sided: self.params.two_sided,
            level: Level::new(),
            extent: self.hierarchies.iter().map(Bvh::extent).fold(0.0, f64::max),
        };
        let clusters = self.order.len().div_ceil(CLUSTER);
        let part = clusters.div_ceil(PARTS).max(1);
        for judged in [false, true] {
            let suspicious = AtomicBool::new(false);
            let search = |(k, ((vertices, candidates), scratch)): (
                usize,
                ((&[u32], &mut [Candidate]), &mut Scratch),
            )| {
                let mut visited = 0;
                let of_part = vertices.chunks(CLUSTER).zip(candidates.chunks_mut(CLUSTER * slots));
                for (cluster, (vertices, candidates)) in of_part.enumerate() {
                    visited += scene.query(k * part + cluster, vertices, candidates, scratch);
                    if !judged && visited > JUDGED_LEAVES + CROWDED_LEAVES * (cluster + 1) {
                        suspicious.store(true, Relaxed);
                    }
                    if suspicious.load(Relaxed) {
                        return;
                    }
                }
            };
            let size = part * CLUSTER;
            let parts = self.order.par_chunks(size).zip(self.previous.par_chunks_mut(size * slots));
            pool::for_each(parts.zip(&mut self.scratch).enumerate(), search);
            if !suspicious.into_inner() {
                break;
            }
            let limit = FEW_LEAVES + CROWDED_LEAVES * clusters;
            if scene.overlaps(&self.order, limit, &mut self.scratch[0]) > limit {
                out.fill(Contact::default());
                self.previous.fill(Candidate::NONE);
                return Detection { crowded: true, ..detection };
            }
        }
        let (contacts, degenerate) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let measure_part = |(k, out): (usize, &mut [Contact])| {
            let mut counts = Detection::default();
            for (v, out) in (k * MEASURED..).zip(out.chunks_mut(slots)) {
                let candidates = &self.previous[self.places[v] as usize * slots..][..slots];
                for (slot, candidate) in out.iter_mut().zip(candidates) {
                    *slot = if candidate.is_some() {
                        let corners = scene.corners(candidate);
                        measure(v, candidate, corners, (now, next), self.params.slip, &mut counts)
                    } else {
                        Contact::default()
                    };
                }
            }
            contacts.fetch_add(counts.contacts, Relaxed);
            degenerate.fetch_add(counts.degenerate, Relaxed);
        };
        pool::for_each(out.par_chunks_mut(MEASURED * slots).enumerate(), measure_part);
        Detection { contacts: contacts.into_inner(), degenerate: degenerate.into_inner(), ..detection }
    }

    fn check_frame(&self, frame: Frame<'_>) -> Result<(), ContactError> {
        if frame.others.len() + 1 != self.vertices.len() {
            let expected = self.vertices.len() - 1;
            return Err(ContactError::Length {
                what: "the list of other surfaces",
                found: frame.others.len(),
                expected,
            });
        }
        for (surface, &expected) in self.vertices.iter().enumerate() {
            let positions = frame.surface(surface);
            if positions.len() != expected {
                return Err(ContactError::Positions { surface, found: positions.len(), expected });
            }
            check_finite(surface, positions)?;
        }
        Ok(())
    }

    fn check_out(&self, out: &[Contact]) -> Result<(), ContactError> {
        let expected = self.order.len() * self.params.max_contacts;
        if out.len() == expected {
            Ok(())
        } else {
            Err(ContactError::Length { what: "the output", found: out.len(), expected })
        }
    }
}

/// The contact of a candidate, with its motion until the next frame.
fn measure(
    v: usize,
    candidate: &Candidate,
    corners: [u32; 3],
    (now, next): (Frame<'_>, Option<Frame<'_>>),
    mode: SlipMode,
    detection: &mut Detection,
) -> Contact {
    detection.contacts += 1;
    let surface = candidate.surface as usize;
    let at = |frame: Frame<'_>| {
        let [a, b, c] = frame.triangle(surface, corners);
        (widen(frame.vertex(v)), [widen(a), widen(b), widen(c)])
    };
    let (x, triangle) = at(now);
    let motion = next.map(|next| {
        let (x_next, triangle_next) = at(next);
        let mut motion = slide(x, triangle, x_next, triangle_next);
        if mode == SlipMode::Naive && !motion.degenerate {
            motion.tangential = naive(x, triangle, x_next, triangle_next);
        }
        motion
    });
    let beta = motion.filter(|m| !m.degenerate).map(|m| m.beta).or_else(|| in_plane(x, triangle));
    detection.degenerate += usize::from(beta.is_none() || motion.is_some_and(|m| m.degenerate));
    let beta = beta.unwrap_or_else(|| {
        let [_, b, c] = closest_point(x, triangle).barycentric;
        [b, c]
    });
    let motion = motion.unwrap_or_default();
    Contact {
        surface: candidate.surface,
        triangle: candidate.triangle,
        distance: narrow(candidate.squared_distance.sqrt()),
        beta: beta.map(narrow),
        slide: narrow(motion.tangential),
        approach: narrow(motion.normal),
    }
}

fn check_params(params: &DetectorParams) -> Result<(), ContactError> {
    let wrong = |name, found, expected| Err(ContactError::Parameter { name, found, expected });
    // Squares of distances up to 1e15 m stay finite in single precision.
    if !(params.radius > 0.0 && params.radius <= 1e15) {
        return wrong("radius", f64::from(params.radius), "positive, and at most 1e15 m");
    }
    if let Exclude::Distance(d) = params.exclude
        && !(d >= 0.0 && d.is_finite())
    {
        return wrong("exclude", f64::from(d), "a distance of 0 m or more");
    }
    if params.max_contacts == 0 || params.max_contacts > 1024 {
        return wrong("max_contacts", params.max_contacts as f64, "1 to 1024");
    }
    Ok(())
}

fn check_topology(surface: usize, topology: &Topology) -> Result<(), ContactError> {
    let vertices = topology.vertex_count();
    let (found, limit) = (vertices.max(topology.triangles.len()), (u32::MAX / 4) as usize);
    if found > limit {
        return Err(ContactError::Size { surface, found, limit });
    }
    for (triangle, corners) in topology.triangles.iter().enumerate() {
        if let Some(&found) = corners.iter().find(|&&c| c as usize >= vertices) {
            return Err(ContactError::Corner { surface, triangle, found, vertices });
        }
    }
    check_finite(surface, &topology.rest)
}
