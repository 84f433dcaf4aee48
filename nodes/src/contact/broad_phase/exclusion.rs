//! Triangles of its own cloth that a vertex must not touch.
//!
//! Without exclusion every vertex of a flat sheet whose edges are shorter than the radius would touch its own neighbourhood.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::contact::error::ContactError;
use crate::contact::vector::{norm, sub, widen};
use crate::mesh::Topology;

/// Vertices per parallel chunk.
const CHUNK: usize = 512;

/// Largest number of vertices in all patches together: 40 million take 3.3 s on two cores, 73 million 8 s.
const MAX_PATCH_VERTICES: usize = 50_000_000;

/// Vertices by whose patches the mean patch is estimated.
const SAMPLES: usize = 16;

/// Triangles of its own cloth that a vertex cannot touch. Incident triangles are always excluded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Exclude {
    /// Triangles with a corner nearer along the rest edges than twice the radius or the longest rest edge at the vertex.
    #[default]
    Auto,
    /// Triangles with a corner nearer along the rest edges than this distance, metres.
    Distance(f32),
    /// Only the incident ones.
    IncidentOnly,
}

/// Distance from a vertex within which triangles are excluded, metres.
fn exclusion_distance(graph: &EdgeGraph, v: usize, radius: f32, exclude: Exclude) -> f64 {
    match exclude {
        Exclude::Auto => graph.longest_edge(v).max(2.0 * f64::from(radius)),
        Exclude::Distance(d) => f64::from(d),
        Exclude::IncidentOnly => 0.0,
    }
}

/// Mean number of vertices in a patch, from samples spread over the cloth.
fn mean_patch(graph: &EdgeGraph, vertices: usize, radius: f32, exclude: Exclude) -> usize {
    let mut search = BoundedDijkstra::new(vertices);
    let samples = (0..vertices).step_by(vertices.div_ceil(SAMPLES).max(1));
    let (sum, count) = samples.fold((0, 0), |(sum, count), v| {
        search.patch(graph, v, exclusion_distance(graph, v, radius, exclude));
        (sum + search.visited.len(), count + 1)
    });
    sum / count.max(1)
}

/// Set of excluded triangles of each cloth vertex, as runs of ranks.
///
/// A rank is a triangle's index in an order in which neighbours are close together, so that a patch of hundreds of triangles
/// is a few dozen runs.
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
    /// Finds each vertex's incident triangles and, except with [`Exclude::IncidentOnly`], those with a corner nearer than the
    /// exclusion distance along the edges of the rest shape.
    ///
    /// `order` lists all triangles, neighbours close together. It determines the memory used, not the result.
    ///
    /// # Errors
    /// [`ContactError::Patches`] if the patches together have more than 50 million vertices, which would take minutes to find.
    ///
    /// # Complexity
    /// A bounded Dijkstra per vertex: O(V p log p) for patches of p vertices, in parallel.
    pub fn new(cloth: &Topology, order: &[u32], radius: f32, exclude: Exclude) -> Result<Self, ContactError> {
        let mut rank = vec![0; cloth.triangles.len()];
        for (index, &triangle) in order.iter().enumerate() {
            rank[triangle as usize] = index as u32;
        }
        let graph = EdgeGraph::new(cloth);
        let vertices = cloth.vertex_count();
        let patch = mean_patch(&graph, vertices, radius, exclude);
        if patch.saturating_mul(vertices) > MAX_PATCH_VERTICES {
            return Err(ContactError::Patches { vertices, patch });
        }
        let chunks: Vec<(Vec<u32>, Vec<[u32; 2]>)> = (0..vertices.div_ceil(CHUNK))
            .into_par_iter()
            .map_init(
                || BoundedDijkstra::new(vertices),
                |search, chunk| {
                    let (mut ends, mut runs) = (Vec::new(), Vec::new());
                    for v in chunk * CHUNK..((chunk + 1) * CHUNK).min(vertices) {
                        search.patch(&graph, v, exclusion_distance(&graph, v, radius, exclude));
                        search.append_runs(&graph, &rank, &mut runs);
                        ends.push(runs.len() as u32);
                    }
                    (ends, runs)
                },
            )
            .collect();
        let mut table = Self { rank, offsets: vec![0], runs: Vec::new() };
        for (ends, runs) in chunks {
            let base = table.runs.len() as u32;
            table.offsets.extend(ends.iter().map(|end| base + end));
            table.runs.extend(runs);
        }
        Ok(table)
    }

    /// Returns true if a vertex must not touch a triangle.
    ///
    /// # Complexity
    /// O(log runs of the vertex).
    #[must_use]
    pub fn is_excluded(&self, vertex: usize, triangle: usize) -> bool {
        let rank = self.rank[triangle];
        contains(self.runs_of(vertex), rank)
    }

    /// Returns the number of triangles excluded for a vertex.
    #[must_use]
    pub fn count(&self, vertex: usize) -> usize {
        self.runs_of(vertex).iter().map(|r| (r[1] - r[0]) as usize).sum()
    }

    /// Returns the memory of the runs of all vertices, bytes.
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

    /// Exclusions of up to 16 neighbouring vertices together, as ascending runs of ranks.
    pub(crate) fn of_cluster(&self, vertices: &[u32]) -> Vec<SharedRun> {
        let mut edges: Vec<(u32, u16)> = Vec::new();
        for (i, &v) in vertices.iter().enumerate() {
            edges.extend(self.runs_of(v as usize).iter().flatten().map(|&rank| (rank, 1 << i)));
        }
        edges.sort_unstable();
        let (mut shared, mut members): (Vec<SharedRun>, u16) = (Vec::new(), 0);
        for (k, &(start, vertex)) in edges.iter().enumerate() {
            // The bit of a vertex is set at the start of its run and cleared at the end.
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

/// Returns true if one of the runs contains the rank.
#[inline]
fn contains(runs: &[[u32; 2]], rank: u32) -> bool {
    let after = runs.partition_point(|run| run[0] <= rank);
    after > 0 && rank < runs[after - 1][1]
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

/// Start of each vertex's entries in a list sorted by vertex, and the end of the last.
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

/// A bounded shortest-path search, reused for one vertex after another.
struct BoundedDijkstra {
    distance: Vec<f64>,
    /// Vertices with a finite distance.
    visited: Vec<u32>,
    /// Bits of distances and vertices. Distances are never negative, so their bits sort like the numbers.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    ranks: Vec<u32>,
}

impl BoundedDijkstra {
    fn new(vertices: usize) -> Self {
        Self {
            distance: vec![f64::INFINITY; vertices],
            visited: Vec::new(),
            queue: BinaryHeap::new(),
            ranks: Vec::new(),
        }
    }

    /// Sets `visited` to the start and all vertices nearer to it than `limit`.
    fn patch(&mut self, graph: &EdgeGraph, start: usize, limit: f64) {
        for &v in &self.visited {
            self.distance[v as usize] = f64::INFINITY;
        }
        self.visited.clear();
        self.queue.clear();
        self.distance[start] = 0.0;
        self.visited.push(start as u32);
        self.queue.push(Reverse((0, start as u32)));
        while let Some(Reverse((bits, v))) = self.queue.pop() {
            let distance = f64::from_bits(bits);
            if distance > self.distance[v as usize] {
                continue;
            }
            for &(next, length) in graph.neighbours(v as usize) {
                let through = distance + length;
                let shortest = &mut self.distance[next as usize];
                if through < limit && through < *shortest {
                    if *shortest == f64::INFINITY {
                        self.visited.push(next);
                    }
                    *shortest = through;
                    self.queue.push(Reverse((through.to_bits(), next)));
                }
            }
        }
    }

    /// Appends the triangles around the patch as runs of ranks.
    fn append_runs(&mut self, graph: &EdgeGraph, rank: &[u32], runs: &mut Vec<[u32; 2]>) {
        self.ranks.clear();
        for &v in &self.visited {
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
