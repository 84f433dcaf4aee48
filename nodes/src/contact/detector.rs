//! Finds the triangles that cloth vertices touch, frame by frame.

use fearless_simd::Level;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::boxes::CLUSTER;
use super::error::ContactError;
use super::exclusion::Exclusion;
use super::neighbourhood::Neighbourhoods;
use super::query::{Candidate, Scene, Scratch};
use super::slip::{SlipMode, in_plane, naive, slide};
use super::tree::{Tree, sort_by_locality};
use super::triangle::closest_point;
use super::vector::widen;
use crate::core::fault::Fault;
use crate::core::state::{StateArchive, Stateful};
use crate::mesh::Topology;

/// A cloth vertex that touches a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Surface touched: 0 is the cloth itself, 1 and up the others; [`Contact::NONE`] when nothing is.
    pub surface: u32,
    /// Triangle of that surface.
    pub triangle: u32,
    /// Distance to the closest point of the triangle, metres.
    pub distance: f32,
    /// In-plane coordinates at this frame, not clamped to the triangle: x = a + b0 (b - a) + b1 (c - a) + height n.
    /// Over a degenerate triangle, the weights of the closest point.
    pub beta: [f32; 2],
    /// Metres moved along the triangle until the next frame.
    pub slide: f32,
    /// Change of the distance from the triangle's plane until the next frame, metres; negative while approaching.
    pub approach: f32,
}

impl Contact {
    /// The surface of a slot that holds no contact.
    pub const NONE: u32 = u32::MAX;

    /// Whether the slot holds a contact.
    #[must_use]
    pub fn is_some(&self) -> bool {
        self.surface != Self::NONE
    }
}

impl Default for Contact {
    fn default() -> Self {
        Self { surface: Self::NONE, triangle: 0, distance: 0.0, beta: [0.0; 2], slide: 0.0, approach: 0.0 }
    }
}

/// Which triangles of its own cloth a vertex can't touch. Incident triangles are always excluded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Exclude {
    /// Those with a corner nearer along the rest edges than twice the radius or the longest rest edge at the vertex.
    #[default]
    Auto,
    /// Those with a corner nearer along the rest edges than this many metres.
    Distance(f32),
    /// Only the incident ones.
    IncidentOnly,
}

/// What counts as a contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectorParams {
    /// Largest distance of a contact, metres.
    pub radius: f32,
    /// Exclusion of a vertex's own neighbourhood.
    pub exclude: Exclude,
    /// Contacts kept per vertex, nearest first; the paper keeps 1.
    pub max_contacts: usize,
    /// Whether triangles are touched from behind as well. If not, a vertex below a triangle's plane doesn't touch it.
    pub two_sided: bool,
    /// Whether the cloth touches itself.
    pub self_contact: bool,
    /// How a slide is measured.
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

/// What one frame of detection found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Detection {
    /// Number of contacts.
    pub contacts: usize,
    /// Contacts with a degenerate triangle, whose slide counts as 0.
    pub degenerate: usize,
    /// Surfaces whose tree was sorted anew because its boxes had grown.
    pub rebuilt: usize,
}

/// Finds for each cloth vertex the closest triangles of all surfaces within a radius.
///
/// Of equally near triangles the one of the lower surface comes first, then the lower triangle. The answer is exact and
/// depends on the frame alone; what is kept from frame to frame only makes it quick.
///
/// # Source
/// An, James and Marschner, *Motion-driven Concatenative Synthesis of Cloth Sounds*, SIGGRAPH 2012, section 2.
#[derive(Clone, Debug)]
pub struct Detector {
    params: DetectorParams,
    vertices: Vec<usize>,
    triangles: Vec<Vec<[u32; 3]>>,
    trees: Vec<Tree>,
    exclusion: Exclusion,
    /// Where the exclusions of each cluster stand in the cloth's own tree.
    neighbourhoods: Neighbourhoods,
    /// Cloth vertices, neighbours together; clusters are consecutive pieces.
    order: Vec<u32>,
    /// Last frame's contacts in the order of `order`.
    warm: Vec<Candidate>,
    scratch: Scratch,
}

impl Stateful for Detector {
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        archive.each(&mut self.trees)?;
        if let Some(own) = self.trees.first().filter(|_| archive.restores()) {
            self.neighbourhoods.follow(self.order.len(), &self.exclusion, own);
        }
        Ok(())
    }
}

impl Detector {
    /// Prepares exclusion, trees and scratch memory for a cloth and the surfaces it can touch.
    ///
    /// # Errors
    /// [`ContactError`] for a radius that is not positive and finite, no contacts per vertex, a negative exclusion
    /// distance, triangles that name absent vertices, rest positions that are not finite, and exclusion patches as large as
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
        let trees: Vec<Tree> = surfaces
            .iter()
            .enumerate()
            .map(|(surface, t)| {
                let unused = surface == 0 && !params.self_contact;
                Tree::new(&t.rest, if unused { &[] } else { &t.triangles })
            })
            .collect();
        let exclusion = if params.self_contact {
            Exclusion::new(cloth, trees[0].order(), params.radius, params.exclude)?
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
        let shared = order.par_chunks(CLUSTER).map(|cluster| exclusion.of_cluster(cluster)).collect();
        let neighbourhoods = Neighbourhoods::new(order.len(), &exclusion, shared, &trees[0]);
        Ok(Self {
            vertices: surfaces.iter().map(|t| t.vertex_count()).collect(),
            triangles: surfaces.iter().map(|t| t.triangles.clone()).collect(),
            scratch: Scratch::new(&trees, params.max_contacts),
            trees,
            exclusion,
            neighbourhoods,
            warm: vec![Candidate::NONE; order.len() * params.max_contacts],
            order,
            params,
        })
    }

    /// The parameters that the detector was made with.
    #[must_use]
    pub fn params(&self) -> &DetectorParams {
        &self.params
    }

    /// The triangles that each cloth vertex can't touch.
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
    /// Expected O(F + V log F). Never allocates.
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

    /// Finds the contacts of one frame, and how far each slides until the next.
    ///
    /// # Shapes
    /// As [`Detector::detect`], with the positions of the frame that follows in `cloth_next` and `others_next`.
    ///
    /// # Errors
    /// As [`Detector::detect`], for both frames.
    ///
    /// # Complexity
    /// Expected O(F + V log F). Never allocates.
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
        for (surface, tree) in self.trees.iter_mut().enumerate() {
            let rebuilt = tree.update(now.surface(surface));
            detection.rebuilt += usize::from(rebuilt);
            if rebuilt && surface == 0 {
                self.neighbourhoods.follow(self.order.len(), &self.exclusion, tree);
            }
        }
        let slots = self.params.max_contacts;
        let scene = Scene {
            now,
            triangles: &self.triangles,
            trees: &self.trees,
            neighbourhoods: &self.neighbourhoods,
            squared_radius: f64::from(self.params.radius).powi(2),
            two_sided: self.params.two_sided,
            level: Level::new(),
            extent: self.trees.iter().map(Tree::extent).fold(0.0, f64::max),
        };
        let clusters = self.order.chunks(CLUSTER).zip(self.warm.chunks_mut(CLUSTER * slots));
        for (cluster, (vertices, warm)) in clusters.enumerate() {
            scene.query(cluster, vertices, warm, &mut self.scratch);
            for (&v, found) in vertices.iter().zip(warm.chunks(slots)) {
                let v = v as usize;
                for (slot, candidate) in out[v * slots..].iter_mut().zip(found) {
                    *slot = if candidate.is_some() {
                        let corners = scene.corners(candidate);
                        measure(v, candidate, corners, (now, next), self.params.slip, &mut detection)
                    } else {
                        Contact::default()
                    };
                }
            }
        }
        detection
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

/// The positions of all surfaces at one time.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    cloth: &'a [[f32; 3]],
    others: &'a [&'a [[f32; 3]]],
}

impl<'a> Frame<'a> {
    #[inline]
    pub(super) fn surface(&self, surface: usize) -> &'a [[f32; 3]] {
        if surface == 0 { self.cloth } else { self.others[surface - 1] }
    }

    /// A cloth vertex.
    #[inline]
    pub(super) fn vertex(&self, v: usize) -> [f32; 3] {
        self.cloth[v]
    }

    #[inline]
    pub(super) fn triangle(&self, surface: usize, corners: [u32; 3]) -> [[f32; 3]; 3] {
        let positions = self.surface(surface);
        let [a, b, c] = corners;
        [positions[a as usize], positions[b as usize], positions[c as usize]]
    }
}

/// The contact that a candidate stands for, with its motion until the next frame.
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
    let moved = next.map(|next| {
        let (x_next, triangle_next) = at(next);
        let mut moved = slide(x, triangle, x_next, triangle_next);
        if mode == SlipMode::Naive && !moved.degenerate {
            moved.tangential = naive(x, triangle, x_next, triangle_next);
        }
        moved
    });
    let beta = moved.filter(|m| !m.degenerate).map(|m| m.beta).or_else(|| in_plane(x, triangle));
    detection.degenerate += usize::from(beta.is_none() || moved.is_some_and(|m| m.degenerate));
    let beta = beta.unwrap_or_else(|| {
        let [_, b, c] = closest_point(x, triangle).barycentric;
        [b, c]
    });
    let moved = moved.unwrap_or_default();
    Contact {
        surface: candidate.surface,
        triangle: candidate.triangle,
        distance: narrow(candidate.squared_distance.sqrt()),
        beta: beta.map(narrow),
        slide: narrow(moved.tangential),
        approach: narrow(moved.normal),
    }
}

/// Single precision, finite also for motions across all of its range.
pub(super) fn narrow(x: f64) -> f32 {
    x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
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

/// Farthest coordinate of a vertex, m: the squares of distances stay finite in single precision.
const FARTHEST: f32 = 1e15;

pub(super) fn check_finite(surface: usize, positions: &[[f32; 3]]) -> Result<(), ContactError> {
    // No branch between the coordinates: this is done for each vertex of each frame.
    let near = |p: &[f32; 3]| (p[0].abs() <= FARTHEST) & (p[1].abs() <= FARTHEST) & (p[2].abs() <= FARTHEST);
    match positions.iter().position(|p| !near(p)) {
        Some(vertex) => Err(ContactError::NotFinite { surface, vertex }),
        None => Ok(()),
    }
}
