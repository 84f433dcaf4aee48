//! Finer meshes from coarse ones, the same way in every frame.
//!
//! # Source
//! Loop, "Smooth subdivision surfaces based on triangles" (master's thesis, University of Utah, 1987), with the boundary
//! rules of Hoppe et al., "Piecewise smooth surface reconstruction" (SIGGRAPH 1994).

use std::f64::consts::TAU;

use super::{Materials, MeshError, Topology};

/// Where the vertices of a finer mesh lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scheme {
    /// On Loop's smooth surface, near the coarse one; boundaries become smooth curves.
    #[default]
    Loop,
    /// On the coarse mesh itself: old vertices stay, new ones halve the edges.
    Linear,
}

/// A topology whose triangles are split into four, once or several times, and what carries positions over to it.
///
/// Each vertex is a fixed weighted mean of coarse ones, so any frame of the coarse mesh gives one of the fine mesh. After one
/// level the vertices of the level before come first, in their order, then one per edge, the edges in ascending order of
/// their lower and then of their higher vertex. Triangle `k = (a, b, c)` becomes `4 k` at `a`, `4 k + 1` at `b`, `4 k + 2` at
/// `c` and `4 k + 3` in the middle, all wound as it was.
///
/// An edge is smooth where two triangles share it; one that belongs to one triangle, or to three or more, is treated as a
/// boundary. A vertex where two boundary edges meet follows them alone; one where another number of them meets stays.
#[derive(Clone, Debug, PartialEq)]
pub struct Subdivision {
    topology: Topology,
    rows: Rows,
    levels: u32,
}

/// Weighted means, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
struct Rows {
    /// Where each mean begins, and the end of the last.
    starts: Vec<usize>,
    weights: Vec<(u32, f64)>,
}

impl Rows {
    fn identity(vertices: usize) -> Self {
        let weights = (0..vertices as u32).map(|v| (v, 1.0)).collect();
        Self { starts: (0..=vertices).collect(), weights }
    }

    fn row(&self, k: usize) -> &[(u32, f64)] {
        let (from, to) = (self.starts.get(k).copied(), self.starts.get(k + 1).copied());
        from.zip(to).and_then(|(from, to)| self.weights.get(from..to)).unwrap_or_default()
    }

    fn iter(&self) -> impl Iterator<Item = &[(u32, f64)]> {
        (0..self.starts.len().saturating_sub(1)).map(|k| self.row(k))
    }

    /// Means of the means of `self`, as means of what those are of.
    fn then(&self, finer: &[Vec<(u32, f64)>]) -> Self {
        let mut out = Self { starts: vec![0], weights: Vec::new() };
        let mut sum: Vec<(u32, f64)> = Vec::new();
        for mean in finer {
            sum.clear();
            for &(from, weight) in mean {
                sum.extend(self.row(from as usize).iter().map(|&(v, w)| (v, weight * w)));
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

/// An edge: its vertices in order, its place in the list of edges being its number.
struct Edge {
    ends: [u32; 2],
    /// The corners opposite of it, where exactly two triangles share it.
    across: Option<[u32; 2]>,
}

/// The edges of triangles in ascending order, and those of each triangle from corner to corner.
fn edges(triangles: &[[u32; 3]]) -> (Vec<Edge>, Vec<[u32; 3]>) {
    let mut sides: Vec<([u32; 2], u32, u8, u32)> = Vec::with_capacity(3 * triangles.len());
    for (face, &[a, b, c]) in (0..).zip(triangles) {
        for (k, (p, q, opposite)) in (0..).zip([(a, b, c), (b, c, a), (c, a, b)]) {
            sides.push(([p.min(q), p.max(q)], face, k, opposite));
        }
    }
    sides.sort_unstable();
    let mut of_triangles = vec![[0; 3]; triangles.len()];
    let mut edges = Vec::new();
    for group in sides.chunk_by(|a, b| a.0 == b.0) {
        for &(_, face, k, _) in group {
            of_triangles[face as usize][usize::from(k)] = edges.len() as u32;
        }
        let across = match group {
            [one, other] => Some([one.3, other.3]),
            _ => None,
        };
        edges.push(Edge { ends: group[0].0, across });
    }
    (edges, of_triangles)
}

/// Loop's weight of each of `n` neighbours of a vertex inside the surface.
fn beta(n: usize) -> f64 {
    let n = n as f64;
    (0.625 - (0.375 + 0.25 * libm::cos(TAU / n)).powi(2)) / n
}

/// The means of one level: of old vertices, then of edges.
fn means(vertices: usize, edges: &[Edge], scheme: Scheme) -> Vec<Vec<(u32, f64)>> {
    let halves = |e: &Edge| e.ends.map(|v| (v, 0.5)).to_vec();
    if scheme == Scheme::Linear {
        return (0..vertices as u32).map(|v| vec![(v, 1.0)]).chain(edges.iter().map(halves)).collect();
    }
    let (mut around, mut border) = (vec![Vec::new(); vertices], vec![Vec::new(); vertices]);
    for edge in edges {
        let [a, b] = edge.ends;
        let lists = if edge.across.is_some() { &mut around } else { &mut border };
        lists[a as usize].push(b);
        lists[b as usize].push(a);
    }
    let old = (0..vertices).map(|v| {
        let (near, ends, own) = (&around[v], &border[v], v as u32);
        match (near.len(), &ends[..]) {
            (_, &[a, b]) => vec![(own, 0.75), (a, 0.125), (b, 0.125)],
            (0, _) => vec![(own, 1.0)],
            (n, []) => {
                let each = beta(n);
                let neighbours = near.iter().map(|&w| (w, each));
                std::iter::once((own, 1.0 - n as f64 * each)).chain(neighbours).collect()
            }
            _ => vec![(own, 1.0)],
        }
    });
    let new = edges.iter().map(|e| match (e.ends, e.across) {
        ([a, b], Some([c, d])) => vec![(a, 0.375), (b, 0.375), (c, 0.125), (d, 0.125)],
        _ => halves(e),
    });
    old.chain(new).collect()
}

impl Subdivision {
    /// Splits the triangles of a mesh `levels` times.
    ///
    /// Triangles that name a vertex twice have no area and are left out first, so `4^levels` fine triangles follow from each
    /// of the others.
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
        let mut triangles: Vec<[u32; 3]> = coarse.triangles.iter().copied().filter(has_corners).collect();
        let (mut count, mut rows) = (vertices, Rows::identity(vertices));
        for _ in 0..levels {
            let (edges, of_triangles) = edges(&triangles);
            rows = rows.then(&means(count, &edges, scheme));
            let first = count as u32;
            triangles = triangles
                .iter()
                .zip(&of_triangles)
                .flat_map(|(&[a, b, c], of)| {
                    let [ab, bc, ca] = of.map(|edge| first + edge);
                    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
                })
                .collect();
            count += edges.len();
        }
        let mut fine = Self { topology: Topology { rest: vec![[0.0; 3]; count], triangles }, rows, levels };
        let mut rest = std::mem::take(&mut fine.topology.rest);
        fine.archive_state(&coarse.rest, &mut rest);
        fine.topology.rest = rest;
        Ok(fine)
    }

    /// The fine mesh; its rest pose is the coarse one's, made finer.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// What the fine triangles are made of, from what those of the coarse mesh are.
    #[must_use]
    pub fn materials(&self, coarse: &Topology, materials: &Materials) -> Materials {
        if materials.names().len() < 2 {
            return materials.clone();
        }
        let mut fine = Materials::default();
        for (k, _) in (0..).zip(&coarse.triangles).filter(|(_, t)| has_corners(t)) {
            let name = materials.name(materials.of_triangle(k));
            (0..4_usize.pow(self.levels)).for_each(|_| fine.push(name));
        }
        fine
    }

    /// Carries positions over.
    ///
    /// # Shapes
    /// One position per coarse vertex in, one per vertex of [`Subdivision::topology`] out. Coarse positions that are absent
    /// count as the origin.
    ///
    /// # Complexity
    /// O(fine vertices); a few coarse ones each. Never allocates.
    pub fn archive_state(&self, coarse: &[[f32; 3]], fine: &mut [[f32; 3]]) {
        for (out, mean) in fine.iter_mut().zip(self.rows.iter()) {
            let mut sum = [0.0_f64; 3];
            for &(v, weight) in mean {
                let at = coarse.get(v as usize).copied().unwrap_or_default();
                sum = std::array::from_fn(|k| sum[k] + weight * f64::from(at[k]));
            }
            // The mean of numbers near the end of the range may round beyond it.
            *out = sum.map(|x| (x as f32).clamp(f32::MIN, f32::MAX));
        }
    }
}

fn has_corners(&[a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::MeshPrepare;
    use crate::mesh::generate::{FlatSheet, Sphere, Synthetic};
    use proptest::prelude::*;

    fn sheet() -> Topology {
        FlatSheet { vertices: [5, 4], size: [0.4, 0.3], velocity: [0.0; 3] }.topology()
    }

    fn icosphere(subdivisions: u32) -> Topology {
        Sphere { subdivisions, radius: 0.5, turns: 0.0 }.topology()
    }

    fn area(t: &Topology) -> f64 {
        crate::mesh::vertex_areas(&t.rest, &t.triangles).iter().map(|a| f64::from(*a)).sum()
    }

    /// Edges of a mesh, counted the slow way.
    fn edge_count(t: &Topology) -> usize {
        let mut all: Vec<[u32; 2]> = t
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)].map(|(p, q)| [p.min(q), p.max(q)]))
            .collect();
        all.sort_unstable();
        all.dedup();
        all.len()
    }

    #[test]
    fn each_level_adds_a_vertex_per_edge_and_keeps_order_winding_and_boundary() {
        for scheme in [Scheme::Loop, Scheme::Linear] {
            let coarse = sheet();
            let fine = Subdivision::new(&coarse, 1, scheme).unwrap();
            let t = fine.topology();
            assert_eq!(t.vertex_count(), coarse.vertex_count() + edge_count(&coarse));
            assert_eq!(t.triangles.len(), 4 * coarse.triangles.len());
            for (k, corners) in coarse.triangles.iter().enumerate() {
                assert_eq!(
                    [0, 1, 2].map(|c| t.triangles[4 * k + c][0]),
                    *corners,
                    "a corner keeps its number"
                );
            }
            let prepared = MeshPrepare::new(t).unwrap();
            assert_eq!((prepared.component_count(), prepared.flipped()), (1, 0));
            let twice = Subdivision::new(t, 1, scheme).unwrap();
            let both = Subdivision::new(&coarse, 2, scheme).unwrap();
            assert_eq!(both.topology().triangles, twice.topology().triangles);
            let apart = |a: &[f32; 3], b: &[f32; 3]| (0..3).any(|k| (a[k] - b[k]).abs() > 1e-7);
            let rest = both.topology().rest.iter().zip(&twice.topology().rest);
            assert!(!rest.clone().any(|(a, b)| apart(a, b)), "two levels are one after the other");
        }
    }

    #[test]
    fn linear_splits_keep_the_surface_and_loop_keeps_a_plane() {
        let coarse = sheet();
        let linear = Subdivision::new(&coarse, 3, Scheme::Linear).unwrap();
        assert_eq!(linear.topology().rest[..coarse.vertex_count()], coarse.rest[..]);
        assert!((area(linear.topology()) / area(&coarse) - 1.0).abs() < 1e-6);
        let smooth = Subdivision::new(&coarse, 3, Scheme::Loop).unwrap();
        assert!(smooth.topology().rest.iter().all(|p| p[2] == 0.0));
        // Its straight borders stay straight, and only the corners are rounded off.
        let [mut low, mut high] = [[f32::MAX; 3], [f32::MIN; 3]];
        for p in &smooth.topology().rest {
            (low, high) = ([0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k])));
        }
        assert!((high[0] - low[0] - 0.4).abs() < 1e-6 && (high[1] - low[1] - 0.3).abs() < 1e-6);
        assert!(area(smooth.topology()) < area(&coarse) && area(smooth.topology()) > 0.97 * area(&coarse));
    }

    /// Loop's rules on a regular patch: a vertex of six neighbours lifted by 1 goes to 5/8, the middle of each of its
    /// edges to 3/8 and of each edge opposite of it to 1/8.
    #[test]
    fn a_lifted_vertex_spreads_as_in_loops_masks() {
        let mut coarse = FlatSheet { vertices: [9, 9], size: [0.8, 0.8], velocity: [0.0; 3] }.topology();
        let inside = 4 * 9 + 4;
        coarse.rest[inside][2] = 1.0;
        let fine = Subdivision::new(&coarse, 1, Scheme::Loop).unwrap();
        let heights = |wanted: f32| {
            let high = |p: &&[f32; 3]| (p[2] - wanted).abs() < 1e-6;
            fine.topology().rest.iter().filter(high).count()
        };
        assert!((fine.topology().rest[inside][2] - 0.625).abs() < 1e-6);
        assert_eq!((heights(0.625), heights(0.375)), (1, 6));
        assert_eq!((heights(0.125), heights(0.0625)), (6, 6), "the edges opposite of it, and its neighbours");
        assert!((beta(6) - 0.0625).abs() < 1e-15 && (beta(3) - 0.1875).abs() < 1e-15);
    }

    /// From tests/oracles/loop.py (trimesh): old vertices, then edges in order.
    const HOOD: [[f64; 3]; 24] = [
        [0.0, 0.0, 0.73359375],
        [0.915906781, 0.0, 0.441134747],
        [0.084093219, 0.831813562, 0.408409322],
        [-0.875, 0.125, 0.4875],
        [0.125, -0.875, 0.3125],
        [1.625, 0.875, 0.0125],
        [1.75, -0.75, 0.1125],
        [-0.625, 1.625, 0.075],
        [0.375, 0.0, 0.65],
        [0.0, 0.375, 0.6625],
        [-0.375, 0.0, 0.6875],
        [0.0, -0.375, 0.625],
        [0.625, 0.5, 0.4625],
        [0.625, -0.5, 0.4375],
        [1.375, 0.375, 0.25],
        [1.375, -0.375, 0.2625],
        [-0.5, 0.625, 0.5],
        [0.75, 1.0, 0.2125],
        [-0.25, 1.25, 0.225],
        [-0.5, -0.5, 0.45],
        [-1.0, 1.0, 0.3],
        [1.0, -1.0, 0.2],
        [2.0, 0.0, 0.05],
        [0.5, 1.5, 0.0],
    ];

    #[test]
    fn an_open_mesh_of_uneven_vertices_is_split_as_by_trimesh() {
        let rest = vec![
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 0.5],
            [0.0, 1.0, 0.4],
            [-1.0, 0.0, 0.6],
            [0.0, -1.0, 0.3],
            [2.0, 1.0, 0.0],
            [2.0, -1.0, 0.1],
            [-1.0, 2.0, 0.0],
        ];
        let triangles = vec![
            [0, 1, 2],
            [0, 2, 3],
            [0, 3, 4],
            [0, 4, 1],
            [1, 5, 2],
            [1, 6, 5],
            [4, 6, 1],
            [2, 5, 7],
            [2, 7, 3],
        ];
        let fine = Subdivision::new(&Topology { rest, triangles }, 1, Scheme::Loop).unwrap();
        assert_eq!(fine.topology().vertex_count(), HOOD.len());
        for (found, wanted) in fine.topology().rest.iter().zip(HOOD) {
            assert!((0..3).all(|k| (f64::from(found[k]) - wanted[k]).abs() < 1e-6), "{found:?} {wanted:?}");
        }
    }

    /// The limit of Loop's surface at an old vertex of an octahedron with corners at 1: by its symmetry the mask
    /// (1 - n l) v + l sum of neighbours, l = 1 / (3 / (8 beta) + n), gives 1 - 4 l of it.
    #[test]
    fn an_octahedron_converges_to_loops_limit() {
        let mut rest = Vec::new();
        for k in 0..3 {
            for sign in [1.0, -1.0] {
                let mut p = [0.0; 3];
                p[k] = sign;
                rest.push(p);
            }
        }
        let triangles =
            vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        let fine = Subdivision::new(&Topology { rest, triangles }, 6, Scheme::Loop).unwrap();
        let limit = 1.0 - 4.0 / (3.0 / (8.0 * beta(4)) + 4.0);
        for v in 0..6 {
            let p = fine.topology().rest[v];
            let length = p.iter().map(|x| x * x).sum::<f32>().sqrt();
            assert!((f64::from(length) - limit).abs() < 1e-4, "{length} {limit}");
        }
    }

    #[test]
    fn a_sphere_stays_round_and_closed() {
        let coarse = icosphere(2);
        let fine = Subdivision::new(&coarse, 1, Scheme::Loop).unwrap();
        let radii = fine.topology().rest.iter().map(|p| p.iter().map(|x| x * x).sum::<f32>().sqrt());
        let (low, high) = radii.fold((f32::MAX, 0.0_f32), |(a, b), r| (a.min(r), b.max(r)));
        // 162 vertices: the surface lies a little inside of its net, and hardly ripples.
        assert!(high / low < 1.004 && high < 0.5 && low > 0.485, "{low} to {high}");
        let t = fine.topology();
        assert_eq!(t.vertex_count() + t.triangles.len(), edge_count(t) + 2, "Euler's formula");
    }

    #[test]
    fn materials_follow_their_triangles_and_those_without_area_are_left_out() {
        let coarse = Topology {
            rest: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2], [1, 1, 2], [2, 1, 3]],
        };
        let mut materials = Materials::default();
        ["wool", "silk", "linen"].iter().for_each(|name| materials.push(name));
        let fine = Subdivision::new(&coarse, 1, Scheme::Loop).unwrap();
        assert_eq!(fine.topology().triangles.len(), 8);
        let of = fine.materials(&coarse, &materials);
        let names: Vec<&str> = (0..8).map(|k| of.name(of.of_triangle(k))).collect();
        assert_eq!(names, ["wool", "wool", "wool", "wool", "linen", "linen", "linen", "linen"]);
        let wrong = Topology { triangles: vec![[0, 1, 9]], ..coarse };
        assert!(matches!(Subdivision::new(&wrong, 1, Scheme::Loop), Err(MeshError::FaceIndex { .. })));
    }

    proptest! {
        /// Any triangles at all: what comes out is a mean of what went in, so it stays within, and moves with it.
        #[test]
        fn fine_vertices_are_means_of_coarse_ones(
            triangles in prop::collection::vec(prop::array::uniform3(0_u32..7), 0..12), levels in 0_u32..3,
            shift in prop::array::uniform3(-4.0_f32..4.0), loops in any::<bool>(),
        ) {
            let rest: Vec<[f32; 3]> = (0..7).map(|k| [k as f32, (k * k % 5) as f32, (k * 3 % 4) as f32]).collect();
            let scheme = if loops { Scheme::Loop } else { Scheme::Linear };
            let coarse = Topology { rest: rest.clone(), triangles };
            let fine = Subdivision::new(&coarse, levels, scheme).unwrap();
            let t = fine.topology();
            prop_assert!(t.triangles.iter().flatten().all(|&v| (v as usize) < t.vertex_count()));
            for row in fine.rows.iter() {
                prop_assert!((row.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-12);
                prop_assert!(row.iter().all(|(_, w)| *w >= 0.0));
            }
            let moved: Vec<[f32; 3]> = rest.iter().map(|p| [0, 1, 2].map(|k| p[k] + shift[k])).collect();
            let mut out = vec![[0.0; 3]; t.vertex_count()];
            fine.archive_state(&moved, &mut out);
            for (a, b) in t.rest.iter().zip(&out) {
                prop_assert!((0..3).all(|k| (a[k] + shift[k] - b[k]).abs() < 1e-5));
            }
        }
    }
}
