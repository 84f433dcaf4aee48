//! Grouping of buckling vertices into events, over space and optionally over time.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

use super::components::{Component, Components, OneRings, Sums};
use super::crumple::{Crumple, Weight};
use super::mesh_digest::mesh_digest;
use crate::crumple::buckling::Buckle;
use crate::curvature::Method;
use crate::impl_state;
use crate::mesh::{MeshError, Topology};

/// Parameters of [`CrumpleEvents`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CrumpleParams {
    /// Weight of a vertex in energies.
    pub weight: Weight,
    /// Number of frames after the first frame of an event that may join it; 0 as in the paper.
    pub merge_frames: usize,
    /// Energy below which events are dropped.
    pub e_min: f64,
    /// Index of the only material with events; `None` for all materials.
    pub only: Option<u16>,
}

/// An event that later frames may join: its sums per frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct OpenEvent {
    id: u32,
    sign: i8,
    material: u16,
    first: i64,
    frames: Vec<(i64, Sums)>,
    /// Index of the event that it was merged into.
    merged_into: Option<usize>,
}

/// Groups buckling vertices into events.
///
/// Neighbours along an edge that buckle to the same side in the same frame are one event, unless their materials
/// differ. A single vertex is an event too. The energy is `E = (sum dH)^2`, or `(sum A dH)^2` with [`Weight::Area`],
/// for changes of curvature `dH` and areas `A`. All terms of a component have the same sign, so this equals the paper's
/// other form, the squared 1-norm.
///
/// With `merge_frames` above 0 an event continues while, in the next frame, its vertices or their neighbours buckle to
/// the same side. `E` is then that of all changes together, and the event has the time and the position of its
/// strongest frame.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3 and
/// equation 4. Area weights and merging over time are additions: the paper's energy increases 16 times when a mesh is
/// refined once, and halving the time step splits an event into several.
#[derive(Clone, Debug)]
pub struct CrumpleEvents {
    params: CrumpleParams,
    mesh: OneRings,
    digest: u32,
    materials: Vec<u16>,
    components: Components,
    /// Events that later frames may join.
    open: Vec<OpenEvent>,
    /// Index in `open` of the event of each vertex of the previous frame.
    event_of_vertex: Vec<Option<u32>>,
    /// Vertices with an entry in `event_of_vertex`.
    previous_vertices: Vec<u32>,
    /// Finished events, in order.
    ready: VecDeque<(i64, Crumple)>,
    dropped: u64,
    /// Method of the curvature measurement and dead band of the last frame.
    method: Method,
    h_eps: f32,
}
impl_state!(CrumpleEvents { open, event_of_vertex, previous_vertices, ready, dropped, method, h_eps });

impl CrumpleEvents {
    /// Prepares for a mesh. `materials` holds the index of the material of each vertex, or is empty.
    ///
    /// # Errors
    /// When the mesh cannot be prepared.
    pub fn new(topology: &Topology, materials: &[u16], params: CrumpleParams) -> Result<Self, MeshError> {
        let mesh = OneRings::new(topology)?;
        let vertices = mesh.vertices();
        Ok(Self {
            params,
            digest: mesh_digest(topology),
            materials: materials.to_vec(),
            components: Components::new(vertices),
            open: Vec::new(),
            event_of_vertex: vec![None; vertices],
            previous_vertices: Vec::with_capacity(vertices),
            ready: VecDeque::with_capacity(1024),
            dropped: 0,
            method: Method::default(),
            h_eps: 0.0,
            mesh,
        })
    }

    /// Adds the next frame, one [`Buckle`] per vertex. Frames are added in order without gaps.
    ///
    /// # Complexity
    /// O(V), and O(n) for n buckling vertices. Without merging only finished events can allocate.
    pub fn add_frame(&mut self, frame: i64, labels: &[Buckle]) {
        self.components.find(labels, &self.mesh, &self.materials);
        if let Some(first) = labels.first() {
            (self.method, self.h_eps) = (first.method, first.h_eps);
        }
        if self.params.merge_frames == 0 {
            for k in 0..self.components.found.len() {
                let Component { id, sign, material, sums } = self.components.found[k];
                self.emit(frame, id, sign, material, &sums, &sums);
            }
            return;
        }
        self.extend(frame);
        self.close(|event| event.frames.last().is_none_or(|f| f.0 < frame));
        let merge = self.params.merge_frames as i64;
        self.close(|event| frame - event.first >= merge);
    }

    /// Ends all events.
    pub fn finish(&mut self) {
        self.close(|_| true);
    }

    /// Returns the next event before frame `frame`, in the order of frames and then of lowest vertices.
    ///
    /// All events of a frame are finished once [`CrumpleEvents::add_frame`] was called for the frame `merge_frames`
    /// later. Their `interval` is 0.
    pub fn next_before(&mut self, frame: i64) -> Option<(i64, Crumple)> {
        (self.ready.front()?.0 < frame).then(|| self.ready.pop_front()).flatten()
    }

    /// Returns the number of events below the minimum energy.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Joins the components of this frame to open events, or opens new ones.
    fn extend(&mut self, frame: i64) {
        let Self { components, open, event_of_vertex, mesh, .. } = self;
        let mut events: Vec<Option<usize>> = vec![None; components.found.len()];
        for &v in &components.labelled {
            let index = components.of(v);
            let Component { sign, material, .. } = components.found[index];
            for &w in std::iter::once(&v).chain(mesh.of(v)) {
                let Some(old) = event_of_vertex[w as usize].map(|k| root(open, k as usize)) else { continue };
                if (open[old].sign, open[old].material) != (sign, material) {
                    continue;
                }
                events[index] = Some(match events[index].map(|k| root(open, k)) {
                    Some(other) if other != old => merge(open, other, old),
                    _ => old,
                });
            }
        }
        for (component, event) in components.found.iter().zip(&mut events) {
            let Component { id, sign, material, sums } = *component;
            let index = match event.map(|k| root(open, k)) {
                Some(index) => index,
                None => {
                    open.push(OpenEvent {
                        id,
                        sign,
                        material,
                        first: frame,
                        frames: Vec::new(),
                        merged_into: None,
                    });
                    open.len() - 1
                }
            };
            *event = Some(index);
            add(&mut open[index].frames, frame, &sums);
        }
        self.previous_vertices.drain(..).for_each(|v| event_of_vertex[v as usize] = None);
        for &v in &components.labelled {
            event_of_vertex[v as usize] = events[components.of(v)].map(|k| k as u32);
        }
        self.previous_vertices.extend_from_slice(&components.labelled);
    }

    /// Emits the events for which `ended` returns true, and removes those that were merged into others.
    fn close(&mut self, ended: impl Fn(&OpenEvent) -> bool) {
        let mut new_indices: Vec<Option<u32>> = Vec::with_capacity(self.open.len());
        let mut still_open = Vec::new();
        // Indices of merged events are resolved first, because indices change below.
        for &v in &self.previous_vertices {
            let index = &mut self.event_of_vertex[v as usize];
            *index = index.map(|k| root(&self.open, k as usize) as u32);
        }
        for event in std::mem::take(&mut self.open) {
            if event.merged_into.is_some() {
                new_indices.push(None);
            } else if ended(&event) {
                new_indices.push(None);
                self.emit_open(&event);
            } else {
                new_indices.push(Some(still_open.len() as u32));
                still_open.push(event);
            }
        }
        self.open = still_open;
        for &v in &self.previous_vertices {
            let index = &mut self.event_of_vertex[v as usize];
            *index = index.and_then(|k| new_indices.get(k as usize).copied().flatten());
        }
    }

    /// Emits an open event at its strongest frame.
    fn emit_open(&mut self, event: &OpenEvent) {
        let strength = |s: &Sums| match self.params.weight {
            Weight::None => s.change.abs(),
            Weight::Area => s.weighted.abs(),
        };
        let mut all = Sums::default();
        let mut peak: Option<&(i64, Sums)> = None;
        for part in &event.frames {
            all.join(&part.1);
            if peak.is_none_or(|p| strength(&part.1) > strength(&p.1)) {
                peak = Some(part);
            }
        }
        if let Some((frame, sums)) = peak.copied() {
            self.emit(frame, event.id, event.sign, event.material, &all, &sums);
        }
    }

    /// Emits an event of this frame unless it is too weak, with the energy of `all` and the position of `peak`.
    fn emit(&mut self, frame: i64, id: u32, sign: i8, material: u16, all: &Sums, peak: &Sums) {
        if self.params.only.is_some_and(|only| only != material) {
            return;
        }
        debug_assert!(all.change.abs() == all.magnitude, "one component, one sign");
        let weight = self.params.weight;
        let area = match weight {
            Weight::Area if peak.area > 0.0 => Some(peak.area),
            _ => None,
        };
        let energy = match weight {
            Weight::None => all.change * all.change,
            Weight::Area => all.weighted * all.weighted,
        };
        if energy < self.params.e_min {
            self.dropped += 1;
            return;
        }
        let position = match area {
            Some(area) => peak.weighted_position.map(|x| (x / area) as f32),
            None => peak.position.map(|x| (x / f64::from(peak.count.max(1))) as f32),
        };
        let length = peak.normal.iter().map(|x| x * x).sum::<f64>().sqrt();
        let normal = peak.normal.map(|x| if length > 0.0 { (x / length) as f32 } else { 0.0 });
        let event = Crumple {
            id,
            sign,
            energy,
            weight,
            vertices: all.count,
            area: all.area as f32,
            material,
            position,
            normal,
            interval: 0,
            mesh: self.digest,
            method: Some(self.method),
            h_eps: self.h_eps,
        };
        let index = self.ready.partition_point(|(f, e)| (*f, e.id, e.sign) < (frame, id, sign));
        self.ready.insert(index, (frame, event));
    }
}

/// Adds the sums of a frame, in order of frames.
fn add(frames: &mut Vec<(i64, Sums)>, frame: i64, sums: &Sums) {
    let index = frames.partition_point(|f| f.0 < frame);
    match frames.get_mut(index) {
        Some((found, part)) if *found == frame => part.join(sums),
        _ => frames.insert(index, (frame, *sums)),
    }
}

/// Returns the event that an event was finally merged into.
fn root(open: &[OpenEvent], mut k: usize) -> usize {
    while let Some(next) = open[k].merged_into {
        k = next;
    }
    k
}

/// Merges two open events into the one that began first, or of those the one with the lowest vertex, and returns its
/// index.
fn merge(open: &mut [OpenEvent], a: usize, b: usize) -> usize {
    let rank = |k: usize| (open[k].first, open[k].id);
    let (target, other) = if rank(a) <= rank(b) { (a, b) } else { (b, a) };
    for (frame, sums) in std::mem::take(&mut open[other].frames) {
        add(&mut open[target].frames, frame, &sums);
    }
    open[other].merged_into = Some(target);
    target
}

#[cfg(test)]
mod tests;
