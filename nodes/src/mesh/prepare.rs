//! What the motion analyses need of a topology before the first frame.

use super::{MeshError, Topology};

/// A topology with consistent winding, its edges, its boundary and its components.
///
/// Vertices are never joined: two at one place stay two.
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

/// A side of a triangle: the edge, the triangle and whether the triangle runs it upward.
type Side = ([u32; 2], u32, bool);

impl MeshPrepare {
    /// Orients the triangles and finds edges, boundary, components and areas.
    ///
    /// Winding spreads by breadth-first search over edges with two triangles; each patch keeps the winding that most
    /// of its triangles have (on a tie, that of its first). An edge with more triangles joins components, but winding
    /// does not cross it and its vertices are non-manifold.
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
        // Neighbours across edges with two triangles: the other triangle, and whether both run the edge alike.
        let mut links: Vec<[Option<(u32, bool)>; 3]> = vec![[None; 3]; triangles.len()];
        let mut groups = Union::new(vertices);
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            let edge = group[0].0;
            edges.push(edge);
            groups.join(edge[0], edge[1]);
            match group {
                [_] => edge.iter().for_each(|&v| boundary[v as usize] = true),
                [a, b] if a.1 != b.1 => {
                    let alike = a.2 == b.2;
                    link(&mut links, a.1, (b.1, alike));
                    link(&mut links, b.1, (a.1, alike));
                }
                _ => edge.iter().for_each(|&v| non_manifold[v as usize] = true),
            }
        }
        let (vertex_component, components) = groups.number();
        let triangle_component: Vec<u32> =
            triangles.iter().map(|t| vertex_component[t[0] as usize]).collect();
        let flipped = orient(&mut triangles, &links, &triangle_component)?;
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

    /// Per vertex: whether it lies on an edge with one triangle.
    #[must_use]
    pub fn boundary(&self) -> &[bool] {
        &self.boundary
    }

    /// Per vertex: whether it lies on an edge with more than two triangles; curvature has no meaning there.
    #[must_use]
    pub fn non_manifold(&self) -> &[bool] {
        &self.non_manifold
    }

    /// Per vertex: number of its component, from 0 in the order of the first vertices.
    #[must_use]
    pub fn vertex_component(&self) -> &[u32] {
        &self.vertex_component
    }

    /// Per triangle: number of its component.
    #[must_use]
    pub fn triangle_component(&self) -> &[u32] {
        &self.triangle_component
    }

    /// Number of components; a vertex without triangles is one of its own.
    #[must_use]
    pub fn component_count(&self) -> usize {
        self.components
    }

    /// Per vertex: a third of the areas of its triangles in the rest pose, m^2.
    #[must_use]
    pub fn rest_areas(&self) -> &[f32] {
        &self.rest_areas
    }

    /// Number of triangles whose winding was turned.
    #[must_use]
    pub fn flipped(&self) -> usize {
        self.flipped
    }
}

fn link(links: &mut [[Option<(u32, bool)>; 3]], at: u32, to: (u32, bool)) {
    if let Some(slot) = links[at as usize].iter_mut().find(|s| s.is_none()) {
        *slot = Some(to);
    }
}

fn orient(
    triangles: &mut [[u32; 3]],
    links: &[[Option<(u32, bool)>; 3]],
    component: &[u32],
) -> Result<usize, MeshError> {
    let mut flip: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut queue = std::collections::VecDeque::new();
    let mut patch = Vec::new();
    let mut turned = 0;
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
            for &(other, alike) in links[face].iter().flatten() {
                let other = other as usize;
                let wanted = own != alike;
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
        let other_way = 2 * count > patch.len();
        for &face in &patch {
            if flip[face] != Some(other_way) {
                triangles[face].swap(1, 2);
                turned += 1;
            }
        }
    }
    Ok(turned)
}

/// The area that each vertex stands for, m^2: a third of each of its triangles.
///
/// A triangle that names an absent vertex counts for nothing.
///
/// # Complexity
/// O(V + T).
#[must_use]
pub fn vertex_areas(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<f32> {
    let mut areas = vec![0.0f64; positions.len()];
    for t in triangles.iter().filter(|t| t.iter().all(|&v| (v as usize) < positions.len())) {
        let [a, b, c] = t.map(|v| positions[v as usize].map(f64::from));
        let (u, v): ([f64; 3], [f64; 3]) =
            (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let third = n.iter().map(|x| x * x).sum::<f64>().sqrt() / 6.0;
        t.iter().for_each(|&v| areas[v as usize] += third);
    }
    areas.into_iter().map(|a| a as f32).collect()
}

/// Disjoint sets of vertices.
struct Union(Vec<u32>);

impl Union {
    fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    fn root(&mut self, mut v: u32) -> u32 {
        while self.0[v as usize] != v {
            let up = self.0[self.0[v as usize] as usize];
            self.0[v as usize] = up;
            v = up;
        }
        v
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // The lower vertex leads, so that numbers follow the order of vertices.
        self.0[a.max(b) as usize] = a.min(b);
    }

    fn number(mut self) -> (Vec<u32>, usize) {
        let mut numbers = vec![0; self.0.len()];
        let mut next = 0;
        for v in 0..self.0.len() as u32 {
            let root = self.root(v);
            numbers[v as usize] = if root == v {
                next += 1;
                next - 1
            } else {
                numbers[root as usize]
            };
        }
        (numbers, next as usize)
    }
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
    fn a_moebius_strip_is_refused_and_a_band_is_not() {
        assert!(matches!(
            MeshPrepare::new(&strip(6, [1, 0])),
            Err(MeshError::NonOrientable { component: 0, .. })
        ));
        assert_eq!(MeshPrepare::new(&strip(6, [0, 1])).unwrap().flipped(), 0);
    }

    #[test]
    fn a_third_triangle_on_an_edge_marks_its_vertices() {
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
    fn the_areas_of_a_sheet_add_up_and_its_hem_is_its_boundary() {
        let sheet = FlatSheet { vertices: [5, 4], size: [2.0, 3.0], velocity: [0.0; 3] }.topology();
        let p = MeshPrepare::new(&sheet).unwrap();
        assert!((p.rest_areas().iter().sum::<f32>() - 6.0).abs() < 1e-5);
        assert_eq!(p.boundary().iter().filter(|b| **b).count(), 14);
        // Euler: V - E + F = 1 for a disc.
        assert_eq!(20 - p.edges().len() as i64 + p.triangles().len() as i64, 1);
    }

    proptest! {
        #[test]
        fn turned_triangles_are_turned_back(turned in prop::collection::vec(any::<bool>(), 48)) {
            let tube = Cylinder { vertices: [8, 4], radius: 1.0, length: 1.0, twist: 0.0, frequency: 0.0 }.topology();
            let mut mixed = tube.clone();
            for (t, &turn) in mixed.triangles.iter_mut().zip(&turned) {
                if turn {
                    t.swap(1, 2);
                }
            }
            let p = MeshPrepare::new(&mixed).unwrap();
            let count = turned.iter().filter(|t| **t).count();
            prop_assert_eq!(p.flipped(), count.min(48 - count));
            // Every inner edge is run once each way.
            let mut runs: Vec<[u32; 2]> =
                p.triangles().iter().flat_map(|t| (0..3).map(|k| [t[k], t[(k + 1) % 3]])).collect();
            runs.sort_unstable();
            let n = runs.len();
            runs.dedup();
            prop_assert_eq!(runs.len(), n);
        }

        #[test]
        fn any_triangles_are_prepared_or_refused(faces in prop::collection::vec(prop::array::uniform3(0u32..7), 0..20)) {
            let topology = Topology { rest: vec![[0.0; 3]; 6], triangles: faces };
            if let Ok(p) = MeshPrepare::new(&topology) {
                prop_assert_eq!(p.triangles().len(), topology.triangles.len());
            }
        }
    }
}
