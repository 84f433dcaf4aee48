//! Where curvature has a meaning: at vertices whose triangles form one closed fan.

use crate::mesh::MeshPrepare;

/// How the triangles around a vertex lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fan {
    /// They close into a single fan, and only there curvature has a meaning.
    Closed,
    /// They end at a hem: the cotangent sum holds its conormal.
    Hem,
    /// An edge has more than two of them: there is no one surface.
    Shared,
    /// Several fans touch in this point alone: the sum holds the difference of sheets.
    Pinched,
    /// There is none.
    Lone,
}

/// How the triangles around each vertex lie.
///
/// # Complexity
/// O(V + T) for bounded valence.
pub(crate) fn fans(mesh: &MeshPrepare, vertices: usize) -> Vec<Fan> {
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
            if sides.is_empty() {
                Fan::Lone
            } else if mesh.non_manifold()[v] {
                Fan::Shared
            } else if mesh.boundary()[v] {
                Fan::Hem
            } else if is_one_ring(sides) {
                Fan::Closed
            } else {
                Fan::Pinched
            }
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

    fn found(topology: &Topology) -> Vec<Fan> {
        fans(&MeshPrepare::new(topology).unwrap(), topology.vertex_count())
    }

    #[test]
    fn all_vertices_of_a_sphere_and_the_inner_ones_of_a_sheet_have_closed_fans() {
        let sphere = icosphere(2);
        assert!(found(&sphere.topology()).iter().all(|fan| *fan == Fan::Closed));
        let sheet = found(&grid(5, 4, true, |u, v| [u, v, 0.0]).topology());
        let count = |fan| sheet.iter().filter(|f| **f == fan).count();
        assert_eq!((count(Fan::Closed), count(Fan::Hem)), (3 * 2, 5 * 4 - 3 * 2));
    }

    #[test]
    fn lone_vertices_and_fins_and_points_where_two_sheets_meet_have_none() {
        let mut sphere = icosphere(1);
        sphere.points.extend([[9.0; 3]; 2]);
        let lone = sphere.points.len() - 1;
        // A third triangle on an edge of the sphere.
        let [a, b, _] = sphere.triangles[0];
        sphere.triangles.push([a, b, lone as u32 - 1]);
        let fin = found(&sphere.topology());
        assert_eq!((fin[a as usize], fin[b as usize]), (Fan::Shared, Fan::Shared));
        assert_eq!(fin[lone - 1..], [Fan::Hem, Fan::Lone]);
        // Two tetrahedra that share one corner: closed, edge-manifold, yet no surface in that point.
        let tetra = |a: u32, b: u32, c: u32, d: u32| [[a, b, c], [a, c, d], [a, d, b], [b, d, c]];
        let triangles = [tetra(0, 1, 2, 3), tetra(0, 4, 5, 6)].concat();
        let rest = (0..7).map(|k| [k as f32, (k * k) as f32, (k % 3) as f32]).collect();
        let pair = found(&Topology { rest, triangles });
        assert_eq!(pair[0], Fan::Pinched);
        assert!(pair[1..].iter().all(|fan| *fan == Fan::Closed));
    }
}
