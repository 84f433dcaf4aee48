//! Where curvature has a meaning: at vertices whose triangles form one closed fan.

use crate::mesh::MeshPrepare;

/// Per vertex: whether its triangles close into a single fan around it.
///
/// Boundary, isolated and non-manifold vertices do not: the cotangent sum there holds the conormal of the hem, or the difference of
/// two sheets that meet in a point.
///
/// # Complexity
/// O(V + T) for bounded valence.
pub(crate) fn closed_fans(mesh: &MeshPrepare, vertices: usize) -> Vec<bool> {
    // The sides opposite to each vertex, one after the other: vertex `v` has those of `starts[v]..starts[v + 1]`.
    let mut starts = vec![0_usize; vertices + 1];
    for &v in mesh.triangles().iter().flatten() {
        starts[v as usize + 1] += 1;
    }
    for v in 0..vertices {
        starts[v + 1] += starts[v];
    }
    let mut next = starts.clone();
    let mut sides = vec![[0_u32; 2]; starts[vertices]];
    for t in mesh.triangles() {
        for k in 0..3 {
            let at = &mut next[t[k] as usize];
            sides[*at] = [t[(k + 1) % 3], t[(k + 2) % 3]];
            *at += 1;
        }
    }
    (0..vertices)
        .map(|v| {
            let sides = &sides[starts[v]..starts[v + 1]];
            !mesh.boundary()[v] && !mesh.non_manifold()[v] && is_one_ring(sides)
        })
        .collect()
}

/// Whether oriented sides follow each other in one ring.
fn is_one_ring(sides: &[[u32; 2]]) -> bool {
    let Some(first) = sides.first() else { return false };
    let mut at = first[1];
    for steps in 1..=sides.len() {
        if at == first[0] {
            return steps == sides.len();
        }
        match sides.iter().find(|side| side[0] == at) {
            Some(side) => at = side[1],
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

    fn valid(topology: &Topology) -> Vec<bool> {
        closed_fans(&MeshPrepare::new(topology).unwrap(), topology.vertex_count())
    }

    #[test]
    fn all_vertices_of_a_sphere_and_the_inner_ones_of_a_sheet_have_closed_fans() {
        let sphere = icosphere(2);
        assert!(valid(&sphere.topology()).iter().all(|v| *v));
        let sheet = grid(5, 4, true, |u, v| [u, v, 0.0]);
        assert_eq!(valid(&sheet.topology()).iter().filter(|v| **v).count(), 3 * 2);
    }

    #[test]
    fn lone_vertices_and_fins_and_points_where_two_sheets_meet_have_none() {
        let mut sphere = icosphere(1);
        sphere.points.push([9.0; 3]);
        let lone = sphere.points.len() - 1;
        // A third triangle on an edge of the sphere.
        sphere.triangles.push([sphere.triangles[0][0], sphere.triangles[0][1], lone as u32]);
        let found = valid(&sphere.topology());
        assert!(!found[lone] && !found[sphere.triangles[0][0] as usize]);
        // Two tetrahedra that share one corner: closed, edge-manifold, yet no surface in that point.
        let tetra = |a: u32, b: u32, c: u32, d: u32| [[a, b, c], [a, c, d], [a, d, b], [b, d, c]];
        let triangles = [tetra(0, 1, 2, 3), tetra(0, 4, 5, 6)].concat();
        let rest = (0..7).map(|k| [k as f32, (k * k) as f32, (k % 3) as f32]).collect();
        let found = valid(&Topology { rest, triangles });
        assert_eq!(found, [false, true, true, true, true, true, true]);
    }
}
