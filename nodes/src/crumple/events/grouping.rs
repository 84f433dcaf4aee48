//! Snapping vertices to events, joined over space and, where asked for, over time.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

use super::components::{Component, Components, Neighbours, Sums};
use super::crumple::{Crumple, Weight};
use super::mesh_digest::mesh_digest;
use crate::crumple::buckling::Buckle;
use crate::curvature::Method;
use crate::impl_state;
use crate::mesh::{MeshError, Topology};

/// How events are made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CrumpleParams {
    /// What energies are a sum over.
    pub weight: Weight,
    /// Frames after an event's first that may still join it; 0 is the paper.
    pub merge_frames: usize,
    /// Energy below which an event is dropped.
    pub e_min: f64,
    /// The only material whose events are given, where not all are.
    pub only: Option<u16>,
}

/// An event under way: what each frame since its first has added.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Group {
    id: u32,
    sign: i8,
    material: u16,
    first: i64,
    frames: Vec<(i64, Sums)>,
    /// Where it went, for one that was joined to another.
    into: Option<usize>,
}

/// Turns the labels of frame after frame into events.
///
/// Neighbours along an edge that snap to the same side in the same frame are one event, unless they are of two materials; a lone
/// vertex is one too. Its energy is
/// `E = (sum dH)^2`, or with [`Weight::Area`] `(sum A dH)^2`. Since all terms of one component have one sign, the paper's other form,
/// the squared 1-norm, is the same number.
///
/// With `merge_frames` above 0, an event goes on while, in the next frame, vertices snap to the same side on it or beside it. Then
/// `E` is that of all changes together, and the event falls where the strongest frame is.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3 and equation 4. Area
/// weights and merging over time are additions: the paper's energy grows 16 times when a mesh is refined once, and halving the
/// time step splits one snap in several.
#[derive(Clone, Debug)]
pub struct CrumpleEvents {
    params: CrumpleParams,
    mesh: Neighbours,
    digest: u32,
    materials: Vec<u16>,
    components: Components,
    open: Vec<Group>,
    /// Place in `open` of the event that each vertex of the frame before belongs to.
    joined: Vec<Option<u32>>,
    marked: Vec<u32>,
    ready: VecDeque<(i64, Crumple)>,
    dropped: u64,
    /// How curvature was measured, and its dead band, in the last frame.
    method: Method,
    h_eps: f32,
}
impl_state!(CrumpleEvents { open, joined, marked, ready, dropped, method, h_eps });

impl CrumpleEvents {
    /// Prepares for a mesh; `materials` holds the number of each vertex's material, or nothing.
    ///
    /// # Errors
    /// A mesh that cannot be prepared.
    pub fn new(topology: &Topology, materials: &[u16], params: CrumpleParams) -> Result<Self, MeshError> {
        let mesh = Neighbours::new(topology)?;
        let vertices = mesh.vertices();
        Ok(Self {
            params,
            digest: mesh_digest(topology),
            materials: materials.to_vec(),
            components: Components::new(vertices),
            open: Vec::new(),
            joined: vec![None; vertices],
            marked: Vec::with_capacity(vertices),
            ready: VecDeque::with_capacity(1024),
            dropped: 0,
            method: Method::default(),
            h_eps: 0.0,
            mesh,
        })
    }

    /// Takes the next frame, one [`Buckle`] per vertex; frames follow each other.
    ///
    /// # Complexity
    /// O(V), and O(n) for n vertices that snap; without merging nothing is allocated but room for events.
    pub fn take(&mut self, frame: i64, labels: &[Buckle]) {
        self.components.find(labels, &self.mesh, &self.materials);
        if let Some(first) = labels.first() {
            (self.method, self.h_eps) = (first.method, first.h_eps);
        }
        if self.params.merge_frames == 0 {
            for k in 0..self.components.found.len() {
                let Component { id, sign, material, sums } = self.components.found[k];
                self.give(frame, id, sign, material, &sums, &sums);
            }
            return;
        }
        self.extend(frame);
        self.close(|group| group.frames.last().is_none_or(|f| f.0 < frame));
        let merge = self.params.merge_frames as i64;
        self.close(|group| frame - group.first >= merge);
    }

    /// Ends all events under way.
    pub fn finish(&mut self) {
        self.close(|_| true);
    }

    /// The next event whose frame lies before `frame`, in the order of frames and then of lowest vertices.
    ///
    /// Events of a frame are all there once [`CrumpleEvents::take`] had the frame that is `merge_frames` later. Their `interval` is left 0.
    pub fn next_before(&mut self, frame: i64) -> Option<(i64, Crumple)> {
        (self.ready.front()?.0 < frame).then(|| self.ready.pop_front()).flatten()
    }

    /// Events that were too weak, of the material that counts.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Joins the components of this frame to events under way, or begins new ones.
    fn extend(&mut self, frame: i64) {
        let Self { components, open, joined, mesh, .. } = self;
        let mut homes: Vec<Option<usize>> = vec![None; components.found.len()];
        for &v in &components.labelled {
            let place = components.of(v);
            let Component { sign, material, .. } = components.found[place];
            for &w in std::iter::once(&v).chain(mesh.of(v)) {
                let Some(old) = joined[w as usize].map(|k| home(open, k as usize)) else { continue };
                if (open[old].sign, open[old].material) != (sign, material) {
                    continue;
                }
                homes[place] = Some(match homes[place].map(|k| home(open, k)) {
                    Some(other) if other != old => unite(open, other, old),
                    _ => old,
                });
            }
        }
        for (component, at) in components.found.iter().zip(&mut homes) {
            let Component { id, sign, material, sums } = *component;
            let group = match at.map(|k| home(open, k)) {
                Some(group) => group,
                None => {
                    open.push(Group { id, sign, material, first: frame, frames: Vec::new(), into: None });
                    open.len() - 1
                }
            };
            *at = Some(group);
            add(&mut open[group].frames, frame, &sums);
        }
        self.marked.drain(..).for_each(|v| joined[v as usize] = None);
        for &v in &components.labelled {
            joined[v as usize] = homes[components.of(v)].map(|k| k as u32);
        }
        self.marked.extend_from_slice(&components.labelled);
    }

    /// Gives the events that are over, and forgets those that were joined to others.
    fn close(&mut self, over: impl Fn(&Group) -> bool) {
        let mut places: Vec<Option<u32>> = Vec::with_capacity(self.open.len());
        let mut kept = Vec::new();
        // Links to events that were joined to others are followed first: places change below.
        for &v in &self.marked {
            let joined = &mut self.joined[v as usize];
            *joined = joined.map(|k| home(&self.open, k as usize) as u32);
        }
        for group in std::mem::take(&mut self.open) {
            if group.into.is_some() {
                places.push(None);
            } else if over(&group) {
                places.push(None);
                self.give_group(&group);
            } else {
                places.push(Some(kept.len() as u32));
                kept.push(group);
            }
        }
        self.open = kept;
        for &v in &self.marked {
            let joined = &mut self.joined[v as usize];
            *joined = joined.and_then(|k| places.get(k as usize).copied().flatten());
        }
    }

    fn give_group(&mut self, group: &Group) {
        let strength = |s: &Sums| match self.params.weight {
            Weight::None => s.change.abs(),
            Weight::Area => s.weighted.abs(),
        };
        let mut all = Sums::default();
        let mut peak: Option<&(i64, Sums)> = None;
        for part in &group.frames {
            all.join(&part.1);
            if peak.is_none_or(|p| strength(&part.1) > strength(&p.1)) {
                peak = Some(part);
            }
        }
        if let Some((frame, sums)) = peak.copied() {
            self.give(frame, group.id, group.sign, group.material, &all, &sums);
        }
    }

    /// Gives an event of this frame, unless it is too weak: its energy from `all`, its place from `peak`.
    fn give(&mut self, frame: i64, id: u32, sign: i8, material: u16, all: &Sums, peak: &Sums) {
        if self.params.only.is_some_and(|only| only != material) {
            return;
        }
        debug_assert!(all.change.abs() == all.length, "one component, one sign");
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
        let place = match area {
            Some(area) => peak.weighted_place.map(|x| (x / area) as f32),
            None => peak.place.map(|x| (x / f64::from(peak.count.max(1))) as f32),
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
            position: place,
            normal,
            interval: 0,
            mesh: self.digest,
            method: Some(self.method),
            h_eps: self.h_eps,
        };
        let at = self.ready.partition_point(|(f, e)| (*f, e.id, e.sign) < (frame, id, sign));
        self.ready.insert(at, (frame, event));
    }
}

/// Adds what a frame gives; frames come in order.
fn add(frames: &mut Vec<(i64, Sums)>, frame: i64, sums: &Sums) {
    let at = frames.partition_point(|f| f.0 < frame);
    match frames.get_mut(at) {
        Some((found, part)) if *found == frame => part.join(sums),
        _ => frames.insert(at, (frame, *sums)),
    }
}

/// Where an event went in the end.
fn home(open: &[Group], mut k: usize) -> usize {
    while let Some(next) = open[k].into {
        k = next;
    }
    k
}

/// Joins two events under way; the one that began first, and of these the one with the lowest vertex, leads.
fn unite(open: &mut [Group], a: usize, b: usize) -> usize {
    let rank = |k: usize| (open[k].first, open[k].id);
    let (lead, other) = if rank(a) <= rank(b) { (a, b) } else { (b, a) };
    for (frame, sums) in std::mem::take(&mut open[other].frames) {
        add(&mut open[lead].frames, frame, &sums);
    }
    open[other].into = Some(lead);
    lead
}

#[cfg(test)]
mod tests;
