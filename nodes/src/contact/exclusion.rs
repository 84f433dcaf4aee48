//! Which triangles of its own cloth a vertex must not be in contact with.
//!
//! Without exclusion every vertex of a flat sheet whose edges are shorter than the radius touches its own neighbourhood.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

use rayon::prelude::*;

use super::detector::Exclude;
use super::error::ContactError;
use super::vector::{norm, sub, widen};
use crate::mesh::Topology;

/// Vertices that one parallel piece of work handles.
const PIECE: usize = 512;

/// Most vertices in all patches together: 40 million take 3.3 s on two cores, 73 million 8 s.
const MOST: usize = 50_000_000;

/// Vertices whose patches stand for all.
const SAMPLES: usize = 16;

/// How far from a vertex its triangles are excluded.
fn reach(graph: &EdgeGraph, v: usize, radius: f32, exclude: Exclude) -> f64 {
    match exclude {
        Exclude::Auto => graph.longest_edge(v).max(2.0 * f64::from(radius)),
        Exclude::Distance(d) => f64::from(d),
        Exclude::IncidentOnly => 0.0,
    }
}

/// Vertices of a patch, on the mean of a few spread over the cloth.
fn typical_patch(graph: &EdgeGraph, vertices: usize, radius: f32, exclude: Exclude) -> usize {
    let mut walk = Walk::new(vertices);
    let spread = (0..vertices).step_by(vertices.div_ceil(SAMPLES).max(1));
    let (sum, count) = spread.fold((0, 0), |(sum, count), v| {
        walk.patch(graph, v, reach(graph, v, radius, exclude));
        (sum + walk.touched.len(), count + 1)
    });
    sum / count.max(1)
}

/// For each cloth vertex the set of its excluded triangles, as runs of ranks.
///
/// A rank is a triangle's place in an order in which neighbours stand close together, so that a patch of hundreds of
/// triangles is a few dozen runs.
///
/// # Shapes
/// One list of disjoint, ascending, half-open runs per vertex.
#[derive(Clone, Debug)]
pub struct Exclusion {
    /// Rank of each triangle.
    rank: Vec<u32>,
    offsets: Vec<u32>,
    runs: Vec<[u32; 2]>,
}

impl Exclusion {
    /// Finds each vertex's incident triangles and, unless `exclude` says otherwise, those with a corner nearer than the
    /// exclusion distance along the edges of the rest shape.
    ///
    /// `order` lists all triangles so that neighbours stand close together. It decides memory, not the answer.
    ///
    /// # Errors
    /// [`ContactError::Patches`] where patches hold so many vertices of so many that finding them would take minutes.
    ///
    /// # Complexity
    /// A bounded Dijkstra per vertex: O(V p log p) for patches of p vertices, in parallel.
    pub fn new(cloth: &Topology, order: &[u32], radius: f32, exclude: Exclude) -> Result<Self, ContactError> {
        let mut rank = vec![0; cloth.triangles.len()];
        for (place, &triangle) in order.iter().enumerate() {
            rank[triangle as usize] = place as u32;
        }
        let graph = EdgeGraph::new(cloth);
        let vertices = cloth.vertex_count();
        let patch = typical_patch(&graph, vertices, radius, exclude);
        if patch.saturating_mul(vertices) > MOST {
            return Err(ContactError::Patches { vertices, patch });
        }
        let pieces: Vec<(Vec<u32>, Vec<[u32; 2]>)> = (0..vertices.div_ceil(PIECE))
            .into_par_iter()
            .map_init(
                || Walk::new(vertices),
                |walk, piece| {
                    let (mut ends, mut runs) = (Vec::new(), Vec::new());
                    for v in piece * PIECE..((piece + 1) * PIECE).min(vertices) {
                        walk.patch(&graph, v, reach(&graph, v, radius, exclude));
                        walk.runs(&graph, &rank, &mut runs);
                        ends.push(runs.len() as u32);
                    }
                    (ends, runs)
                },
            )
            .collect();
        let mut table = Self { rank, offsets: vec![0], runs: Vec::new() };
        for (ends, runs) in pieces {
            let base = table.runs.len() as u32;
            table.offsets.extend(ends.iter().map(|end| base + end));
            table.runs.extend(runs);
        }
        Ok(table)
    }

    /// Whether a vertex may not touch a triangle.
    ///
    /// # Complexity
    /// O(log runs of the vertex).
    #[must_use]
    pub fn is_excluded(&self, vertex: usize, triangle: usize) -> bool {
        let rank = self.rank[triangle];
        covers(self.runs_of(vertex), rank..rank + 1)
    }

    /// Number of triangles excluded for a vertex.
    #[must_use]
    pub fn count(&self, vertex: usize) -> usize {
        self.runs_of(vertex).iter().map(|r| (r[1] - r[0]) as usize).sum()
    }

    /// Bytes held by the runs of all vertices.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.runs.len() * size_of::<[u32; 2]>() + self.offsets.len() * size_of::<u32>()
    }

    #[inline]
    pub(crate) fn rank(&self, triangle: u32) -> u32 {
        self.rank[triangle as usize]
    }

    #[inline]
    fn runs_of(&self, vertex: usize) -> &[[u32; 2]] {
        &self.runs[self.offsets[vertex] as usize..self.offsets[vertex + 1] as usize]
    }

    /// The exclusions of up to 16 neighbouring vertices at once, as ascending runs of ranks.
    pub(crate) fn of_cluster(&self, vertices: &[u32]) -> Vec<SharedRun> {
        let mut edges: Vec<(u32, u16)> = Vec::new();
        for (i, &v) in vertices.iter().enumerate() {
            edges.extend(self.runs_of(v as usize).iter().flatten().map(|&rank| (rank, 1 << i)));
        }
        edges.sort_unstable();
        let (mut shared, mut members): (Vec<SharedRun>, u16) = (Vec::new(), 0);
        for (k, &(start, vertex)) in edges.iter().enumerate() {
            // A vertex enters at the start of its run and leaves at the end.
            members ^= vertex;
            let Some(&(end, _)) = edges.get(k + 1) else { break };
            if start == end || members == 0 {
                continue;
            }
            match shared.last_mut() {
                Some(last) if last.end == start && last.members == members => last.end = end,
                _ => shared.push(SharedRun { start, end, members }),
            }
        }
        shared
    }
}

/// Ranks that are excluded for the same vertices of a cluster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SharedRun {
    start: u32,
    end: u32,
    /// One bit per vertex of the cluster.
    members: u16,
}

impl SharedRun {
    #[inline]
    pub(crate) fn ranks(&self) -> Range<usize> {
        self.start as usize..self.end as usize
    }

    #[inline]
    pub(crate) fn members(&self) -> u16 {
        self.members
    }
}

/// Whether one run holds the whole range of ranks.
#[inline]
fn covers(runs: &[[u32; 2]], ranks: Range<u32>) -> bool {
    let after = runs.partition_point(|run| run[0] <= ranks.start);
    after > 0 && ranks.end <= runs[after - 1][1]
}

/// Neighbours and incident triangles of every vertex, with rest lengths.
struct EdgeGraph {
    neighbour_offsets: Vec<u32>,
    neighbours: Vec<(u32, f64)>,
    triangle_offsets: Vec<u32>,
    triangles: Vec<u32>,
}

impl EdgeGraph {
    fn new(cloth: &Topology) -> Self {
        let vertices = cloth.vertex_count();
        let mut edges: Vec<(u32, u32)> = Vec::with_capacity(cloth.triangles.len() * 6);
        let mut corners: Vec<(u32, u32)> = Vec::with_capacity(cloth.triangles.len() * 3);
        for (triangle, t) in cloth.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                if a != b {
                    edges.extend([(a, b), (b, a)]);
                }
                corners.push((a, triangle as u32));
            }
        }
        edges.par_sort_unstable();
        edges.dedup();
        corners.par_sort_unstable();
        corners.dedup();
        let length = |a: u32, b: u32| norm(sub(widen(cloth.rest[a as usize]), widen(cloth.rest[b as usize])));
        Self {
            neighbour_offsets: offsets(vertices, edges.iter().map(|e| e.0)),
            neighbours: edges.iter().map(|&(a, b)| (b, length(a, b))).collect(),
            triangle_offsets: offsets(vertices, corners.iter().map(|c| c.0)),
            triangles: corners.iter().map(|c| c.1).collect(),
        }
    }

    fn neighbours(&self, v: usize) -> &[(u32, f64)] {
        &self.neighbours[self.neighbour_offsets[v] as usize..self.neighbour_offsets[v + 1] as usize]
    }

    fn triangles(&self, v: usize) -> &[u32] {
        &self.triangles[self.triangle_offsets[v] as usize..self.triangle_offsets[v + 1] as usize]
    }

    fn longest_edge(&self, v: usize) -> f64 {
        self.neighbours(v).iter().map(|n| n.1).fold(0.0, f64::max)
    }
}

/// Where each vertex's entries start in a list sorted by vertex.
fn offsets(vertices: usize, sorted: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut offsets = vec![0; vertices + 1];
    for v in sorted {
        offsets[v as usize + 1] += 1;
    }
    for v in 0..vertices {
        offsets[v + 1] += offsets[v];
    }
    offsets
}

/// A bounded shortest-path search that is used again for one vertex after the other.
struct Walk {
    distance: Vec<f64>,
    touched: Vec<u32>,
    /// Distances are never negative, so their bits sort like the numbers.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    ranks: Vec<u32>,
}

impl Walk {
    fn new(vertices: usize) -> Self {
        Self {
            distance: vec![f64::INFINITY; vertices],
            touched: Vec::new(),
            queue: BinaryHeap::new(),
            ranks: Vec::new(),
        }
    }

    /// Leaves in `touched` the start and all vertices nearer to it than `limit`.
    fn patch(&mut self, graph: &EdgeGraph, start: usize, limit: f64) {
        for &v in &self.touched {
            self.distance[v as usize] = f64::INFINITY;
        }
        self.touched.clear();
        self.queue.clear();
        self.distance[start] = 0.0;
        self.touched.push(start as u32);
        self.queue.push(Reverse((0, start as u32)));
        while let Some(Reverse((bits, v))) = self.queue.pop() {
            let here = f64::from_bits(bits);
            if here > self.distance[v as usize] {
                continue;
            }
            for &(next, length) in graph.neighbours(v as usize) {
                let there = here + length;
                let known = &mut self.distance[next as usize];
                if there < limit && there < *known {
                    if *known == f64::INFINITY {
                        self.touched.push(next);
                    }
                    *known = there;
                    self.queue.push(Reverse((there.to_bits(), next)));
                }
            }
        }
    }

    /// Appends the triangles around the patch as runs of ranks.
    fn runs(&mut self, graph: &EdgeGraph, rank: &[u32], runs: &mut Vec<[u32; 2]>) {
        self.ranks.clear();
        for &v in &self.touched {
            self.ranks.extend(graph.triangles(v as usize).iter().map(|&t| rank[t as usize]));
        }
        self.ranks.sort_unstable();
        let first = runs.len();
        for &r in &self.ranks {
            match runs[first..].last_mut() {
                Some(run) if r <= run[1] => run[1] = run[1].max(r + 1),
                _ => runs.push([r, r + 1]),
            }
        }
    }
}
