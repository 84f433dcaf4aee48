//! Tests of subdivision against analytic results and values of trimesh.

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

/// Number of edges of a mesh by sorting all sides.
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
fn each_level_adds_a_vertex_per_edge_and_keeps_order_and_winding() {
    for scheme in [Scheme::Loop, Scheme::Linear] {
        let coarse = sheet();
        let fine = Subdivision::new(&coarse, 1, scheme).unwrap();
        let t = fine.topology();
        assert_eq!(t.vertex_count(), coarse.vertex_count() + edge_count(&coarse));
        assert_eq!(t.triangles.len(), 4 * coarse.triangles.len());
        for (k, corners) in coarse.triangles.iter().enumerate() {
            assert_eq!([0, 1, 2].map(|c| t.triangles[4 * k + c][0]), *corners, "a corner keeps its index");
        }
        let prepared = MeshPrepare::new(t).unwrap();
        assert_eq!((prepared.component_count(), prepared.flipped()), (1, 0));
        let twice = Subdivision::new(t, 1, scheme).unwrap();
        let both = Subdivision::new(&coarse, 2, scheme).unwrap();
        assert_eq!(both.topology().triangles, twice.topology().triangles);
        let differs = |a: &[f32; 3], b: &[f32; 3]| (0..3).any(|k| (a[k] - b[k]).abs() > 1e-7);
        let rest = both.topology().rest.iter().zip(&twice.topology().rest);
        assert!(!rest.clone().any(|(a, b)| differs(a, b)), "two levels equal one level twice");
    }
}

#[test]
fn linear_subdivision_keeps_the_surface_and_loop_subdivision_keeps_a_plane() {
    let coarse = sheet();
    let linear = Subdivision::new(&coarse, 3, Scheme::Linear).unwrap();
    assert_eq!(linear.topology().rest[..coarse.vertex_count()], coarse.rest[..]);
    assert!((area(linear.topology()) / area(&coarse) - 1.0).abs() < 1e-6);
    let smooth = Subdivision::new(&coarse, 3, Scheme::Loop).unwrap();
    assert!(smooth.topology().rest.iter().all(|p| p[2] == 0.0));
    // Straight boundaries remain straight; only the corners are rounded.
    let [mut low, mut high] = [[f32::MAX; 3], [f32::MIN; 3]];
    for p in &smooth.topology().rest {
        (low, high) = ([0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k])));
    }
    assert!((high[0] - low[0] - 0.4).abs() < 1e-6 && (high[1] - low[1] - 0.3).abs() < 1e-6);
    assert!(area(smooth.topology()) < area(&coarse) && area(smooth.topology()) > 0.97 * area(&coarse));
}

/// Loop's masks on a regular patch: a vertex with six neighbours at height 1 moves to 5/8, the midpoint of each of its
/// edges to 3/8 and that of each opposite edge to 1/8.
#[test]
fn a_raised_vertex_spreads_as_in_the_masks_of_loop() {
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
    assert_eq!((heights(0.125), heights(0.0625)), (6, 6), "the opposite edges, and the neighbours");
    assert!((beta(6) - 0.0625).abs() < 1e-15 && (beta(3) - 0.1875).abs() < 1e-15);
}

/// From tests/oracles/loop.py (trimesh): old vertices, then edges in order.
const TRIMESH: [[f64; 3]; 24] = [
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
fn an_open_irregular_mesh_is_subdivided_as_by_trimesh() {
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
    assert_eq!(fine.topology().vertex_count(), TRIMESH.len());
    for (found, wanted) in fine.topology().rest.iter().zip(TRIMESH) {
        assert!((0..3).all(|k| (f64::from(found[k]) - wanted[k]).abs() < 1e-6), "{found:?} {wanted:?}");
    }
}

/// The limit of Loop's surface at a vertex of an octahedron with corners at distance 1: by symmetry the limit mask
/// (1 - n l) v + l sum of neighbours with l = 1 / (3 / (8 beta) + n) is 1 - 4 l.
#[test]
fn an_octahedron_converges_to_the_limit_of_loop() {
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
    // 162 vertices: the surface is slightly inside of its control mesh and almost round.
    assert!(high / low < 1.004 && high < 0.5 && low > 0.485, "{low} to {high}");
    let t = fine.topology();
    assert_eq!(t.vertex_count() + t.triangles.len(), edge_count(t) + 2, "Euler's formula");
}

#[test]
fn fine_triangles_have_the_materials_of_coarse_ones_and_those_without_area_are_left_out() {
    let coarse = Topology {
        rest: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
        triangles: vec![[0, 1, 2], [1, 1, 2], [2, 1, 3]],
    };
    let mut materials = Materials::default();
    ["wool", "silk", "linen"].iter().for_each(|name| materials.push(name));
    let fine = Subdivision::new(&coarse, 1, Scheme::Loop).unwrap();
    assert_eq!(fine.topology().triangles.len(), 8);
    let fine_materials = fine.materials(&coarse, &materials);
    let names: Vec<&str> = (0..8).map(|k| fine_materials.name(fine_materials.of_triangle(k))).collect();
    assert_eq!(names, ["wool", "wool", "wool", "wool", "linen", "linen", "linen", "linen"]);
    let wrong = Topology { triangles: vec![[0, 1, 9]], ..coarse };
    assert!(matches!(Subdivision::new(&wrong, 1, Scheme::Loop), Err(MeshError::FaceIndex { .. })));
}

proptest! {
    /// For any triangles, fine vertices are convex combinations of coarse ones and translate with them.
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
        for stencil in fine.stencils.iter() {
            prop_assert!((stencil.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-12);
            prop_assert!(stencil.iter().all(|(_, w)| *w >= 0.0));
        }
        let moved: Vec<[f32; 3]> = rest.iter().map(|p| [0, 1, 2].map(|k| p[k] + shift[k])).collect();
        let mut out = vec![[0.0; 3]; t.vertex_count()];
        fine.refine(&moved, &mut out);
        for (a, b) in t.rest.iter().zip(&out) {
            prop_assert!((0..3).all(|k| (a[k] + shift[k] - b[k]).abs() < 1e-5));
        }
    }
}
