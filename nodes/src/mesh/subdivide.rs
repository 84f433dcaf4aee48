//! Subdivision of triangle meshes with weights that are the same in all frames.
//!
//! # Source
//! Loop, "Smooth subdivision surfaces based on triangles" (master's thesis, University of Utah, 1987), with the boundary
//! rules of Hoppe et al., "Piecewise smooth surface reconstruction" (SIGGRAPH 1994).

use std::f64::consts::TAU;

use super::{Materials, MeshError, Topology};

/// Positions of the vertices of a subdivided mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scheme {
    /// On Loop's smooth surface, close to the coarse mesh; boundaries become smooth curves.
    #[default]
    Loop,
    /// On the coarse mesh: coarse vertices do not move, new ones are midpoints of the edges.
    Linear,
}

/// A topology whose triangles are split into four, once or several times, with the stencils of its vertices.
///
/// Each fine vertex is a fixed weighted mean of coarse vertices, so that each coarse frame has one fine frame. In each
/// level the vertices of the previous level come first in their order, then one per edge, in ascending order of the
/// lower and then of the higher vertex of the edge. Triangle `k = (a, b, c)` becomes `4 k` at `a`, `4 k + 1` at `b`,
/// `4 k + 2` at `c` and `4 k + 3` in the middle, all with the same winding.
///
/// An edge of two triangles is smooth; an edge of one triangle, or of three or more, is a boundary. A vertex of two
/// boundary edges depends on these edges only; a vertex of any other number of boundary edges does not move.
#[derive(Clone, Debug, PartialEq)]
pub struct Subdivision {
    topology: Topology,
    stencils: Stencils,
    levels: u32,
}

/// A stencil: the vertices of a weighted mean with their weights.
type Stencil = Vec<(u32, f64)>;

/// Stencils in one list.
#[derive(Clone, Debug, Default, PartialEq)]
struct Stencils {
    /// Start of each stencil in `weights`, and the end of the last one.
    starts: Vec<usize>,
    weights: Vec<(u32, f64)>,
}

impl Stencils {
    fn identity(vertices: usize) -> Self {
        let weights = (0..vertices as u32).map(|v| (v, 1.0)).collect();
        Self { starts: (0..=vertices).collect(), weights }
    }

    fn stencil(&self, k: usize) -> &[(u32, f64)] {
        let (from, to) = (self.starts.get(k).copied(), self.starts.get(k + 1).copied());
        from.zip(to).and_then(|(from, to)| self.weights.get(from..to)).unwrap_or_default()
    }

    fn iter(&self) -> impl Iterator<Item = &[(u32, f64)]> {
        (0..self.starts.len().saturating_sub(1)).map(|k| self.stencil(k))
    }

    /// Composes stencils over the vertices of `self` into stencils over the coarse vertices.
    fn compose(&self, finer: &[Stencil]) -> Self {
        let mut out = Self { starts: vec![0], weights: Vec::new() };
        let mut sum = Stencil::new();
        for stencil in finer {
            sum.clear();
            for &(from, weight) in stencil {
                sum.extend(self.stencil(from as usize).iter().map(|&(v, w)| (v, weight * w)));
            }
            sum.sort_by_key(|&(v, _)| v);
            for same in sum.chunk_by(|a, b| a.0 == b.0) {
                out.weights.push((same[0].0, same.iter().map(|&(_, w)| w).sum()));
            }
            out.starts.push(out.weights.len());
        }
        out
    }
}

/// An edge of the mesh.
struct Edge {
    /// Its vertices, the lower one first.
    vertices: [u32; 2],
    /// The opposite corners, if exactly two triangles share the edge.
    opposite: Option<[u32; 2]>,
}

/// The edges in ascending order, and the indices of the three edges of each triangle.
fn edges(triangles: &[[u32; 3]]) -> (Vec<Edge>, Vec<[u32; 3]>) {
    let mut sides: Vec<([u32; 2], u32, u8, u32)> = Vec::with_capacity(3 * triangles.len());
    for (face, &[a, b, c]) in (0..).zip(triangles) {
        for (k, (p, q, opposite)) in (0..).zip([(a, b, c), (b, c, a), (c, a, b)]) {
            sides.push(([p.min(q), p.max(q)], face, k, opposite));
        }
    }
    sides.sort_unstable();
    let mut triangle_edges = vec![[0; 3]; triangles.len()];
    let mut edges = Vec::new();
    for group in sides.chunk_by(|a, b| a.0 == b.0) {
        for &(_, face, k, _) in group {
            triangle_edges[face as usize][usize::from(k)] = edges.len() as u32;
        }
        let opposite = match group {
            [one, other] => Some([one.3, other.3]),
            _ => None,
        };
        edges.push(Edge { vertices: group[0].0, opposite });
    }
    (edges, triangle_edges)
}

/// Loop's weight for each of the `n` neighbours of an interior vertex.
fn beta(n: usize) -> f64 {
    let n = n as f64;
    (0.625 - (0.375 + 0.25 * libm::cos(TAU / n)).powi(2)) / n
}

/// The stencils of one level: of the old vertices, then of the edges.
fn level_stencils(vertices: usize, edges: &[Edge], scheme: Scheme) -> Vec<Stencil> {
    let midpoint = |e: &Edge| e.vertices.map(|v| (v, 0.5)).to_vec();
    if scheme == Scheme::Linear {
        return (0..vertices as u32).map(|v| vec![(v, 1.0)]).chain(edges.iter().map(midpoint)).collect();
    }
    let (mut smooth, mut boundary) = (vec![Vec::new(); vertices], vec![Vec::new(); vertices]);
    for edge in edges {
        let [a, b] = edge.vertices;
        let lists = if edge.opposite.is_some() { &mut smooth } else { &mut boundary };
        lists[a as usize].push(b);
        lists[b as usize].push(a);
    }
    let old = (0..vertices).map(|v| {
        let (smooth, boundary, own) = (&smooth[v], &boundary[v], v as u32);
        match (smooth.len(), &boundary[..]) {
            (_, &[a, b]) => vec![(own, 0.75), (a, 0.125), (b, 0.125)],
            (0, _) => vec![(own, 1.0)],
            (n, []) => {
                let each = beta(n);
                let neighbours = smooth.iter().map(|&w| (w, each));
                std::iter::once((own, 1.0 - n as f64 * each)).chain(neighbours).collect()
            }
            _ => vec![(own, 1.0)],
        }
    });
    let new = edges.iter().map(|e| match (e.vertices, e.opposite) {
        ([a, b], Some([c, d])) => vec![(a, 0.375), (b, 0.375), (c, 0.125), (d, 0.125)],
        _ => midpoint(e),
    });
    old.chain(new).collect()
}

impl Subdivision {
    /// Splits the triangles of a mesh `levels` times.
    ///
    /// Triangles that name a vertex twice have no area and are left out. Each other triangle becomes `4^levels` fine ones.
    ///
    /// # Errors
    /// [`MeshError::FaceIndex`] for a triangle of an absent vertex.
    ///
    /// # Complexity
    /// O(4^levels F log F) time and memory.
    pub fn new(coarse: &Topology, levels: u32, scheme: Scheme) -> Result<Self, MeshError> {
        let vertices = coarse.vertex_count();
        for (face, t) in coarse.triangles.iter().enumerate() {
            if let Some(&v) = t.iter().find(|&&v| v as usize >= vertices) {
                return Err(MeshError::FaceIndex { face, vertex: i64::from(v), vertices });
            }
        }
        let mut triangles: Vec<[u32; 3]> = coarse.triangles.iter().copied().filter(is_proper).collect();
        let (mut count, mut stencils) = (vertices, Stencils::identity(vertices));
        for _ in 0..levels {
            let (edges, triangle_edges) = edges(&triangles);
            stencils = stencils.compose(&level_stencils(count, &edges, scheme));
            let first = count as u32;
            triangles = triangles
                .iter()
                .zip(&triangle_edges)
                .flat_map(|(&[a, b, c], edges)| {
                    let [ab, bc, ca] = edges.map(|edge| first + edge);
                    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
                })
                .collect();
            count += edges.len();
        }
        let mut fine =
            Self { topology: Topology { rest: vec![[0.0; 3]; count], triangles }, stencils, levels };
        let mut rest = std::mem::take(&mut fine.topology.rest);
        fine.refine(&coarse.rest, &mut rest);
        fine.topology.rest = rest;
        Ok(fine)
    }

    /// The fine mesh; its rest pose is the refined coarse one.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// Materials of the fine triangles, from those of the coarse ones.
    #[must_use]
    pub fn materials(&self, coarse: &Topology, materials: &Materials) -> Materials {
        if materials.names().len() < 2 {
            return materials.clone();
        }
        let mut fine = Materials::default();
        for (k, _) in (0..).zip(&coarse.triangles).filter(|(_, t)| is_proper(t)) {
            let name = materials.name(materials.of_triangle(k));
            (0..4_usize.pow(self.levels)).for_each(|_| fine.push(name));
        }
        fine
    }

    /// Computes the fine positions of one frame from the coarse ones.
    ///
    /// # Shapes
    /// `coarse` has one position per coarse vertex, `fine` one per vertex of [`Subdivision::topology`]. Absent coarse
    /// positions count as the origin.
    ///
    /// # Complexity
    /// O(fine vertices); each depends on a few coarse ones. Does not allocate.
    pub fn refine(&self, coarse: &[[f32; 3]], fine: &mut [[f32; 3]]) {
        for (out, stencil) in fine.iter_mut().zip(self.stencils.iter()) {
            let mut sum = [0.0_f64; 3];
            for &(v, weight) in stencil {
                let p = coarse.get(v as usize).copied().unwrap_or_default();
                sum = std::array::from_fn(|k| sum[k] + weight * f64::from(p[k]));
            }
            // The mean of numbers near the limit of f32 can round to infinity.
            *out = sum.map(|x| (x as f32).clamp(f32::MIN, f32::MAX));
        }
    }
}

/// Returns true if the three corners differ.
fn is_proper(&[a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

#[cfg(test)]
mod tests;
