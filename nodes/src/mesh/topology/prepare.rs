//! Analysis of a topology before the first frame: winding, edges, boundary and components.

use std::collections::VecDeque;

use super::DisjointSets;
use super::area::vertex_areas;
use super::{MeshError, Topology};

/// A topology with consistent winding, its edges, its boundary and its components.
///
/// Vertices are never merged: two vertices at one position stay two.
///
/// # Source
/// Specification of cloth sound, section 3.1 (`MeshPrepare`).
#[derive(Clone, Debug, PartialEq)]
pub struct MeshPrepare {
    triangles: Vec<[u32; 3]>,
    edges: Vec<[u32; 2]>,
    boundary: Vec<bool>,
    non_manifold: Vec<bool>,
    vertex_component: Vec<u32>,
    triangle_component: Vec<u32>,
    components: usize,
    rest_areas: Vec<f32>,
    flipped: usize,
}

/// A side of a triangle: the edge, the triangle, and true if the triangle runs from the lower vertex to the higher one.
type Side = ([u32; 2], u32, bool);

/// Up to three neighbours of a triangle across edges of two triangles: the other triangle, and true if both run the
/// edge in the same direction.
type Neighbours = [Option<(u32, bool)>; 3];

impl MeshPrepare {
    /// Orients the triangles and finds edges, boundary, components and areas.
    ///
    /// Winding spreads by breadth-first search over edges with two triangles. Each patch takes the winding of the
    /// majority of its triangles (on a tie, of its first triangle). An edge with more than two triangles connects
    /// components, but winding does not cross it and its vertices are non-manifold.
    ///
    /// # Errors
    /// [`MeshError::NonOrientable`] names the component, [`MeshError::FaceIndex`] a triangle outside of the mesh.
    ///
    /// # Complexity
    /// O(T log T) time, O(V + T) memory.
    pub fn new(topology: &Topology) -> Result<Self, MeshError> {
        let vertices = topology.vertex_count();
        let mut triangles = topology.triangles.clone();
        let mut sides: Vec<Side> = Vec::with_capacity(3 * triangles.len());
        for (face, t) in triangles.iter().enumerate() {
            if let Some(&v) = t.iter().find(|&&v| v as usize >= vertices) {
                return Err(MeshError::FaceIndex { face, vertex: i64::from(v), vertices });
            }
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                if a != b {
                    sides.push(([a.min(b), a.max(b)], face as u32, a < b));
                }
            }
        }
        sides.sort_unstable();
        let (mut boundary, mut non_manifold) = (vec![false; vertices], vec![false; vertices]);
        let mut edges = Vec::new();
        let mut neighbours: Vec<Neighbours> = vec![[None; 3]; triangles.len()];
        let mut sets = DisjointSets::new(vertices);
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            let edge = group[0].0;
            edges.push(edge);
            sets.join(edge[0], edge[1]);
            match group {
                [_] => edge.iter().for_each(|&v| boundary[v as usize] = true),
                [a, b] if a.1 != b.1 => {
                    let same_direction = a.2 == b.2;
                    add_neighbour(&mut neighbours, a.1, (b.1, same_direction));
                    add_neighbour(&mut neighbours, b.1, (a.1, same_direction));
                }
                _ => edge.iter().for_each(|&v| non_manifold[v as usize] = true),
            }
        }
        let (vertex_component, components) = sets.number();
        let triangle_component: Vec<u32> =
            triangles.iter().map(|t| vertex_component[t[0] as usize]).collect();
        let flipped = orient(&mut triangles, &neighbours, &triangle_component)?;
        let rest_areas = vertex_areas(&topology.rest, &triangles);
        Ok(Self {
            triangles,
            edges,
            boundary,
            non_manifold,
            vertex_component,
            triangle_component,
            components,
            rest_areas,
            flipped,
        })
    }

    /// Triangles in the order of the topology, consistently wound.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Every edge once, lower vertex first, sorted.
    #[must_use]
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Per vertex: true if it lies on an edge with one triangle.
    #[must_use]
    pub fn boundary(&self) -> &[bool] {
        &self.boundary
    }

    /// Per vertex: true if it lies on an edge with more than two triangles, where curvature is undefined.
    #[must_use]
    pub fn non_manifold(&self) -> &[bool] {
        &self.non_manifold
    }

    /// Per vertex: index of its component; components are ordered by their first vertices.
    #[must_use]
    pub fn vertex_component(&self) -> &[u32] {
        &self.vertex_component
    }

    /// Per triangle: index of its component.
    #[must_use]
    pub fn triangle_component(&self) -> &[u32] {
        &self.triangle_component
    }

    /// Number of components; a vertex without triangles is a component of its own.
    #[must_use]
    pub fn component_count(&self) -> usize {
        self.components
    }

    /// Per vertex: a third of the areas of its triangles in the rest pose, m^2.
    #[must_use]
    pub fn rest_areas(&self) -> &[f32] {
        &self.rest_areas
    }

    /// Number of triangles whose winding was reversed.
    #[must_use]
    pub fn flipped(&self) -> usize {
        self.flipped
    }
}

fn add_neighbour(neighbours: &mut [Neighbours], triangle: u32, neighbour: (u32, bool)) {
    if let Some(slot) = neighbours[triangle as usize].iter_mut().find(|s| s.is_none()) {
        *slot = Some(neighbour);
    }
}

/// Winds each patch of triangles consistently and returns the number of reversed triangles.
fn orient(
    triangles: &mut [[u32; 3]],
    neighbours: &[Neighbours],
    component: &[u32],
) -> Result<usize, MeshError> {
    let mut flip: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut queue = VecDeque::new();
    let mut patch = Vec::new();
    let mut flipped = 0;
    for start in 0..triangles.len() {
        if flip[start].is_some() {
            continue;
        }
        flip[start] = Some(false);
        queue.push_back(start);
        patch.clear();
        while let Some(face) = queue.pop_front() {
            patch.push(face);
            let own = flip[face].unwrap_or(false);
            for &(other, same_direction) in neighbours[face].iter().flatten() {
                let other = other as usize;
                let wanted = own != same_direction;
                match flip[other] {
                    None => {
                        flip[other] = Some(wanted);
                        queue.push_back(other);
                    }
                    Some(found) if found != wanted => {
                        return Err(MeshError::NonOrientable {
                            component: component[face] as usize,
                            faces: [face, other],
                        });
                    }
                    Some(_) => {}
                }
            }
        }
        let count = patch.iter().filter(|&&f| flip[f] == Some(true)).count();
        let majority = 2 * count > patch.len();
        for &face in &patch {
            if flip[face] != Some(majority) {
                triangles[face].swap(1, 2);
                flipped += 1;
            }
        }
    }
    Ok(flipped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Cylinder, FlatSheet, Synthetic};
    use proptest::prelude::*;

    fn strip(n: u32, closing: [u32; 2]) -> Topology {
        let mut triangles = Vec::new();
        for k in 0..n {
            let (a, b) = (2 * k, 2 * k + 1);
            let [c, d] = if k + 1 == n { closing } else { [a + 2, a + 3] };
            triangles.extend([[a, c, b], [b, c, d]]);
        }
        Topology {
            rest: (0..2 * n).map(|k| [k as f32, (k * k % 7) as f32, (k % 3) as f32]).collect(),
            triangles,
        }
    }

    #[test]
    fn a_moebius_strip_is_rejected_and_a_band_is_not() {
        assert!(matches!(
            MeshPrepare::new(&strip(6, [1, 0])),
            Err(MeshError::NonOrientable { component: 0, .. })
        ));
        assert_eq!(MeshPrepare::new(&strip(6, [0, 1])).unwrap().flipped(), 0);
    }

    #[test]
    fn vertices_of_an_edge_with_three_triangles_are_non_manifold() {
        let topology = Topology {
            rest: vec![
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, -1.0, 0.0],
                [0.0, 0.0, 1.0],
                [9.0; 3],
            ],
            triangles: vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]],
        };
        let p = MeshPrepare::new(&topology).unwrap();
        assert_eq!(p.non_manifold(), [true, true, false, false, false, false]);
        assert_eq!(p.boundary(), [true, true, true, true, true, false]);
        assert_eq!((p.component_count(), p.vertex_component()[5]), (2, 1));
    }

    #[test]
    fn the_vertex_areas_of_a_sheet_add_up_and_its_border_is_its_boundary() {
        let sheet = FlatSheet { vertices: [5, 4], size: [2.0, 3.0], velocity: [0.0; 3] }.topology();
        let p = MeshPrepare::new(&sheet).unwrap();
        assert!((p.rest_areas().iter().sum::<f32>() - 6.0).abs() < 1e-5);
        assert_eq!(p.boundary().iter().filter(|b| **b).count(), 14);
        // Euler: V - E + F = 1 for a disc.
        assert_eq!(20 - p.edges().len() as i64 + p.triangles().len() as i64, 1);
    }

    proptest! {
        #[test]
        fn reversed_triangles_are_wound_consistently(reversed in prop::collection::vec(any::<bool>(), 48)) {
            let tube = Cylinder { vertices: [8, 4], radius: 1.0, length: 1.0, twist: 0.0, frequency: 0.0 }.topology();
            let mut mixed = tube.clone();
            for (t, &reverse) in mixed.triangles.iter_mut().zip(&reversed) {
                if reverse {
                    t.swap(1, 2);
                }
            }
            let p = MeshPrepare::new(&mixed).unwrap();
            let count = reversed.iter().filter(|t| **t).count();
            prop_assert_eq!(p.flipped(), count.min(48 - count));
            // Every inner edge is run once in each direction.
            let mut runs: Vec<[u32; 2]> =
                p.triangles().iter().flat_map(|t| (0..3).map(|k| [t[k], t[(k + 1) % 3]])).collect();
            runs.sort_unstable();
            let n = runs.len();
            runs.dedup();
            prop_assert_eq!(runs.len(), n);
        }

        #[test]
        fn any_triangles_are_prepared_or_rejected(faces in prop::collection::vec(prop::array::uniform3(0u32..7), 0..20)) {
            let topology = Topology { rest: vec![[0.0; 3]; 6], triangles: faces };
            if let Ok(p) = MeshPrepare::new(&topology) {
                prop_assert_eq!(p.triangles().len(), topology.triangles.len());
            }
        }
    }
}
