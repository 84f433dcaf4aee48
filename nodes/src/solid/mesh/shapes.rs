//! Meshes of simple bodies.

use super::element::signed_volume;
use super::tet_mesh::TetMesh;
use crate::contact::vector::{norm, scale};
use crate::core::item::Data;
use crate::core::random::Rng;
use std::collections::BTreeSet;

/// The six tetrahedra of a cube, over its corners `x + 2 y + 4 z`: all share one diagonal, so the cells of a grid fit together.
///
/// # Source
/// Kuhn, "Some combinatorial lemmas in topology" (IBM J. Res. Dev. 4, 1960).
pub const KUHN: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// The six tetrahedra of each of some cells of a grid, over all nodes of the grid.
///
/// # Shapes
/// `cells` is the number of cells along each axis; `filled` returns true for the cells to fill, and `position` the position of a node.
pub(in crate::solid) fn grid(
    cells: [usize; 3],
    filled: impl Fn([usize; 3]) -> bool,
    position: impl Fn([usize; 3]) -> [f64; 3],
) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let [nx, ny, nz] = cells.map(|n| n + 1);
    let node = |x: usize, y: usize, z: usize| (x + nx * (y + ny * z)) as u32;
    let mut nodes = Vec::with_capacity(nx * ny * nz);
    let mut tets = Vec::new();
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                nodes.push(position([x, y, z]));
            }
        }
    }
    for z in 0..cells[2] {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                if filled([x, y, z]) {
                    let corner = |k: usize| node(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2));
                    tets.extend(KUHN.map(|tet| tet.map(corner)));
                }
            }
        }
    }
    (nodes, tets)
}

/// A block of `cells` cells along each edge, with a corner at the origin.
#[must_use]
pub fn block(size: [f64; 3], cells: [usize; 3]) -> TetMesh {
    let cells = cells.map(|n| n.max(1));
    let position = |p: [usize; 3]| [0, 1, 2].map(|k| size[k] * p[k] as f64 / cells[k] as f64);
    let (nodes, tets) = grid(cells, |_| true, position);
    oriented(nodes, tets)
}

/// A ball around the origin: a cube of `cells` cells along each edge, each shell of which is moved onto a sphere.
#[must_use]
pub fn ball(radius: f64, cells: usize) -> TetMesh {
    let n = (2 * cells.div_ceil(2)).max(2);
    let position = |p: [usize; 3]| {
        let q = p.map(|i| 2.0 * i as f64 / n as f64 - 1.0);
        let largest = q.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        // Shells are cubes near the middle and spheres at the surface.
        let factor = if length > 0.0 { 1.0 + largest * (largest / length - 1.0) } else { 0.0 };
        q.map(|x| radius * factor * x)
    };
    let (nodes, tets) = grid([n; 3], |_| true, position);
    oriented(nodes, tets)
}

/// The [`ball`] with curved edges: the nodes in the middle of the edges of its surface are on the sphere.
#[must_use]
pub fn round_ball(radius: f64, cells: usize) -> TetMesh {
    let mut mesh = ball(radius, cells);
    let surface: BTreeSet<[u32; 2]> = mesh
        .surface()
        .unwrap_or_default()
        .iter()
        .flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]].map(|[p, q]| [*p.min(q), *p.max(q)]))
        .collect();
    let curve = |ends: [u32; 2]| {
        let middle = mesh.middle(ends);
        (ends, scale(middle, radius / norm(middle)))
    };
    mesh.curves = surface.into_iter().map(curve).collect();
    mesh
}

fn oriented(nodes: Vec<[f64; 3]>, mut tets: Vec<[u32; 4]>) -> TetMesh {
    for tet in &mut tets {
        if signed_volume(&tet.map(|c| nodes[c as usize])) < 0.0 {
            tet.swap(2, 3);
        }
    }
    TetMesh { nodes, tets, curves: Vec::new() }
}

impl Data for TetMesh {
    const NAME: &'static str = "tetrahedral mesh";

    fn trial(rng: &mut Rng) -> Self {
        let cells = [1 + rng.below(2), 1 + rng.below(2), 1 + rng.below(2)];
        let size = [0.0; 3].map(|_| rng.between(0.05, 0.1));
        block(size, cells)
    }
}
