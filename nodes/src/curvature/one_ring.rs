//! One-rings of vertices: curvature is defined where the triangles around a vertex form one closed fan.

use crate::mesh::MeshPrepare;

/// Configuration of the triangles around a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OneRing {
    /// A single closed fan, the only one with a curvature.
    Closed,
    /// A fan that ends at the boundary: the cotangent sum includes its conormal.
    Boundary,
    /// An edge with more than two triangles.
    NonManifoldEdge,
    /// Several fans that share only this vertex: the cotangent sum mixes sheets.
    NonManifoldVertex,
    /// No triangles.
    Isolated,
}

/// Determines the one-ring of each vertex.
///
/// # Complexity
/// O(V + T) for bounded valence.
pub(crate) fn one_rings(mesh: &MeshPrepare, vertices: usize) -> Vec<OneRing> {
    // Edges opposite to each vertex: vertex `v` has those of `starts[v]..starts[v + 1]`.
    let mut starts = vec![0_usize; vertices + 1];
    for &v in mesh.triangles().iter().flatten() {
        starts[v as usize + 1] += 1;
    }
    for v in 0..vertices {
        starts[v + 1] += starts[v];
    }
    let mut next = starts.clone();
    let mut edges = vec![[0_u32; 2]; starts[vertices]];
    for t in mesh.triangles() {
        for k in 0..3 {
            let index = &mut next[t[k] as usize];
            edges[*index] = [t[(k + 1) % 3], t[(k + 2) % 3]];
            *index += 1;
        }
    }
    (0..vertices)
        .map(|v| {
            let edges = &edges[starts[v]..starts[v + 1]];
            if edges.is_empty() {
                OneRing::Isolated
            } else if mesh.non_manifold()[v] {
                OneRing::NonManifoldEdge
            } else if mesh.boundary()[v] {
                OneRing::Boundary
            } else if is_single_cycle(edges) {
                OneRing::Closed
            } else {
                OneRing::NonManifoldVertex
            }
        })
        .collect()
}

/// Returns true if oriented edges form a single cycle.
fn is_single_cycle(edges: &[[u32; 2]]) -> bool {
    let Some(first) = edges.first() else { return false };
    let mut end = first[1];
    for length in 1..=edges.len() {
        if end == first[0] {
            return length == edges.len();
        }
        match edges.iter().find(|edge| edge[0] == end) {
            Some(edge) => end = edge[1],
            None => return false,
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curvature::scenes::{grid, icosphere};
    use crate::mesh::Topology;

    fn rings_of(topology: &Topology) -> Vec<OneRing> {
        one_rings(&MeshPrepare::new(topology).unwrap(), topology.vertex_count())
    }

    #[test]
    fn all_vertices_of_a_sphere_and_the_inner_ones_of_a_sheet_have_closed_one_rings() {
        let sphere = icosphere(2);
        assert!(rings_of(&sphere.topology()).iter().all(|ring| *ring == OneRing::Closed));
        let sheet = rings_of(&grid(5, 4, true, |u, v| [u, v, 0.0]).topology());
        let count = |ring| sheet.iter().filter(|r| **r == ring).count();
        assert_eq!((count(OneRing::Closed), count(OneRing::Boundary)), (3 * 2, 5 * 4 - 3 * 2));
    }

    #[test]
    fn isolated_vertices_fins_and_shared_vertices_of_two_sheets_are_not_closed() {
        let mut sphere = icosphere(1);
        sphere.points.extend([[9.0; 3]; 2]);
        let isolated = sphere.points.len() - 1;
        // A third triangle on an edge of the sphere.
        let [a, b, _] = sphere.triangles[0];
        sphere.triangles.push([a, b, isolated as u32 - 1]);
        let fin = rings_of(&sphere.topology());
        assert_eq!((fin[a as usize], fin[b as usize]), (OneRing::NonManifoldEdge, OneRing::NonManifoldEdge));
        assert_eq!(fin[isolated - 1..], [OneRing::Boundary, OneRing::Isolated]);
        // Two tetrahedra that share one corner: closed and edge-manifold, but not vertex-manifold.
        let tetra = |a: u32, b: u32, c: u32, d: u32| [[a, b, c], [a, c, d], [a, d, b], [b, d, c]];
        let triangles = [tetra(0, 1, 2, 3), tetra(0, 4, 5, 6)].concat();
        let rest = (0..7).map(|k| [k as f32, (k * k) as f32, (k % 3) as f32]).collect();
        let pair = rings_of(&Topology { rest, triangles });
        assert_eq!(pair[0], OneRing::NonManifoldVertex);
        assert!(pair[1..].iter().all(|ring| *ring == OneRing::Closed));
    }
}
