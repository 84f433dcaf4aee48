//! Tests of the complete search: known scenes, and comparison with brute force.

mod crowded;
mod moving;
mod scenes;
mod soups;

use crate::mesh::Topology;

/// A flat grid of `n` by `n` vertices, `edge` apart, at height `z`, with parallel diagonals.
fn grid(n: usize, edge: f32, z: f32) -> Topology {
    let mut mesh = Topology::default();
    for j in 0..n {
        for i in 0..n {
            mesh.rest.push([i as f32 * edge, j as f32 * edge, z]);
        }
    }
    for j in 0..n - 1 {
        for i in 0..n - 1 {
            let at = |i: usize, j: usize| (j * n + i) as u32;
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh
}
