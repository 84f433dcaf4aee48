//! Cells of a grid inside of a closed surface, as tetrahedra.

use super::closed_surface::{ClosedSurface, SurfaceError};
use super::error::TetMeshError;
use super::shapes::grid;
use super::tet_mesh::TetMesh;
use crate::mesh::topology::DisjointSets;
use thiserror::Error;

/// Triangles from which rays measure the thickness of walls.
const RAYS: usize = 1000;

/// Error in the tetrahedra of a surface.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum VoxelError {
    /// An unusable surface.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// Unusable tetrahedra.
    #[error(transparent)]
    Mesh(#[from] TetMeshError),
}

/// Tetrahedra of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Voxels {
    /// The mesh, of the volume of the surface.
    pub mesh: TetMesh,
    /// Edge of a cell before the volume was corrected, m.
    pub cell: f64,
    /// Number of cells.
    pub cells: usize,
    /// Cells that are not connected to the largest part, and left out.
    pub dropped: usize,
    /// Factor of the size that corrects the volume.
    pub scale: f64,
    /// Thickness of the wall below which 5 % of the surface lie, m.
    pub thickness: f64,
}

/// Fills a closed surface with cubes, each of six tetrahedra.
///
/// A cell is filled if its centre is inside by two of three axes; `across` cells lie along the longest edge of the bounding box. The result
/// is scaled about its middle to the volume of the surface.
///
/// # Errors
/// Walls of less than `min_wall` cells.
///
/// # Complexity
/// O(cells + triangles * cells behind each).
pub fn voxels(surface: &ClosedSurface, across: usize, min_wall: usize) -> Result<Voxels, VoxelError> {
    let axis = |k: usize, start: f64, pick: fn(f64, f64) -> f64| {
        surface.vertices.iter().map(|p| p[k]).fold(start, pick)
    };
    let low = [0, 1, 2].map(|k| axis(k, f64::INFINITY, f64::min));
    let high = [0, 1, 2].map(|k| axis(k, f64::NEG_INFINITY, f64::max));
    let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let cell = longest / across.max(1) as f64;
    if cell <= 0.0 {
        return Err(SurfaceError::Empty.into());
    }
    let thickness = surface.thickness(RAYS);
    if thickness * (1.0 + 1e-9) < min_wall as f64 * cell {
        return Err(SurfaceError::ThinWall { thickness, cells: thickness / cell, needed: min_wall }.into());
    }
    // The grid is centred on the bounding box.
    let counts = [0, 1, 2].map(|k| (((high[k] - low[k]) / cell).ceil() as usize).clamp(1, across.max(1)));
    let origin: [f64; 3] = std::array::from_fn(|k| 0.5 * (low[k] + high[k]) - 0.5 * cell * counts[k] as f64);
    let [nx, ny, nz] = counts;
    let index = |c: [usize; 3]| c[0] + nx * (c[1] + ny * c[2]);
    let mut votes = vec![0_u8; nx * ny * nz];
    for axis in 0..3 {
        inside(surface, axis, counts, origin, cell, |c| votes[index(c)] += 1);
    }
    let filled: Vec<bool> = votes.iter().map(|v| *v >= 2).collect();
    let (filled, cells, dropped) = largest_part(filled, counts);
    if cells == 0 {
        return Err(SurfaceError::Empty.into());
    }
    let position = |p: [usize; 3]| std::array::from_fn(|k| origin[k] + cell * p[k] as f64);
    let (nodes, tets) = grid(counts, |c| filled[index(c)], position);
    let mut mesh = TetMesh::new(nodes, tets)?;
    let (volume, enclosed) = (mesh.volume(), surface.volume());
    let scale = (enclosed / volume).cbrt();
    if !(0.7..=1.4).contains(&scale) {
        return Err(SurfaceError::Volume { cells: volume, surface: enclosed }.into());
    }
    let [low, high] = mesh.bounds();
    for p in &mut mesh.nodes {
        for k in 0..3 {
            let middle = 0.5 * (low[k] + high[k]);
            p[k] = middle + scale * (p[k] - middle);
        }
    }
    Ok(Voxels { mesh, cell, cells, dropped, scale, thickness })
}

/// Calls `fill` for the cells whose centres are inside by the parity of crossings along an axis.
fn inside(
    surface: &ClosedSurface,
    axis: usize,
    counts: [usize; 3],
    origin: [f64; 3],
    cell: f64,
    mut fill: impl FnMut([usize; 3]),
) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let centre = |k: usize, i: usize| origin[k] + cell * (i as f64 + 0.5);
    let mut crossings = vec![Vec::new(); counts[u] * counts[v]];
    for triangle in &surface.triangles {
        let p = surface.corners(triangle);
        // Cells whose centres may lie behind the triangle.
        let range = |k: usize| {
            let low = p.iter().map(|q| q[k]).fold(f64::INFINITY, f64::min);
            let high = p.iter().map(|q| q[k]).fold(f64::NEG_INFINITY, f64::max);
            let first = ((low - origin[k]) / cell - 0.5).floor().max(0.0) as usize;
            let end = ((high - origin[k]) / cell + 1.5).ceil().max(0.0) as usize;
            first..end.min(counts[k])
        };
        for i in range(u) {
            for j in range(v) {
                let at = [centre(u, i), centre(v, j)];
                if covers(triangle, &p, [u, v], at) {
                    crossings[i + counts[u] * j].push(depth(&p, [axis, u, v], at));
                }
            }
        }
    }
    for j in 0..counts[v] {
        for i in 0..counts[u] {
            let line = &mut crossings[i + counts[u] * j];
            line.sort_by(f64::total_cmp);
            for k in 0..counts[axis] {
                let before = line.partition_point(|x| *x < centre(axis, k));
                if before % 2 == 1 {
                    let mut at = [0; 3];
                    (at[axis], at[u], at[v]) = (k, i, j);
                    fill(at);
                }
            }
        }
    }
}

/// True if a point lies in the projection of a triangle.
///
/// An edge is always computed from its vertex of the lower number, so that both of its triangles agree on which side a point lies: every line
/// crosses a closed surface an even number of times, even through vertices and edges.
fn covers(triangle: &[u32; 3], p: &[[f64; 3]; 3], [u, v]: [usize; 2], at: [f64; 2]) -> bool {
    let mut odd = false;
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let (i, j) = if triangle[i] < triangle[j] { (i, j) } else { (j, i) };
        let (a, b) = (p[i], p[j]);
        if (a[v] <= at[1]) != (b[v] <= at[1]) {
            let x = a[u] + (at[1] - a[v]) / (b[v] - a[v]) * (b[u] - a[u]);
            odd ^= x > at[0];
        }
    }
    odd
}

/// Coordinate along the axis at which a line meets the plane of a triangle.
fn depth(p: &[[f64; 3]; 3], [axis, u, v]: [usize; 3], at: [f64; 2]) -> f64 {
    let edge = |k: usize, q: usize| p[k][q] - p[0][q];
    let determinant = edge(1, u) * edge(2, v) - edge(2, u) * edge(1, v);
    let (x, y) = (at[0] - p[0][u], at[1] - p[0][v]);
    let s = (x * edge(2, v) - y * edge(2, u)) / determinant;
    let t = (y * edge(1, u) - x * edge(1, v)) / determinant;
    let found = p[0][axis] + s * edge(1, axis) + t * edge(2, axis);
    // A triangle along the axis is crossed at its corners' mean.
    if found.is_finite() { found } else { p.iter().map(|q| q[axis]).sum::<f64>() / 3.0 }
}

/// The largest part of cells that share faces, its size, and the number of other cells.
fn largest_part(filled: Vec<bool>, [nx, ny, nz]: [usize; 3]) -> (Vec<bool>, usize, usize) {
    let mut sets = DisjointSets::new(filled.len());
    let step = [1, nx, nx * ny];
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let here = x + nx * (y + ny * z);
                let more = [x + 1 < nx, y + 1 < ny, z + 1 < nz];
                for k in (0..3).filter(|k| more[*k]) {
                    if filled[here] && filled[here + step[k]] {
                        sets.join(here as u32, (here + step[k]) as u32);
                    }
                }
            }
        }
    }
    let (part, count) = sets.number();
    let mut sizes = vec![0; count];
    filled.iter().zip(&part).filter(|(f, _)| **f).for_each(|(_, part)| sizes[*part as usize] += 1);
    let all: usize = sizes.iter().sum();
    let size = sizes.iter().copied().max().unwrap_or(0);
    let largest = sizes.iter().position(|s| *s == size).unwrap_or(0) as u32;
    let filled = filled.into_iter().zip(part).map(|(f, part)| f && part == largest).collect();
    (filled, size, all - size)
}

#[cfg(test)]
mod tests {
    use super::super::shapes::{ball, block};
    use super::*;

    fn surface(mesh: &TetMesh) -> ClosedSurface {
        ClosedSurface::new(mesh.nodes.clone(), mesh.surface().unwrap()).unwrap()
    }

    #[test]
    fn a_ball_is_filled_to_its_volume() {
        let mut mesh = ball(0.05, 12);
        mesh.nodes.iter_mut().for_each(|p| (0..3).for_each(|k| p[k] += [0.3, -0.1, 2.0][k]));
        let surface = surface(&mesh);
        let found = voxels(&surface, 20, 2).unwrap();
        assert!((found.mesh.volume() / surface.volume() - 1.0).abs() < 1e-12);
        assert!((found.scale - 1.0).abs() < 0.02, "{}", found.scale);
        assert_eq!((found.mesh.tets.len(), found.dropped), (6 * found.cells, 0));
        assert!((found.thickness - 0.09).abs() < 0.011, "{}", found.thickness);
    }

    #[test]
    fn centres_on_edges_and_vertices_are_counted_once() {
        // Cells of half the size of those of the block: centres of every other one lie on diagonals of its faces.
        let mesh = block([0.4, 0.2, 0.1], [4, 2, 1]);
        for across in [4, 8, 12, 16] {
            let found = voxels(&surface(&mesh), across, 1).unwrap();
            // across * (across / 2) * (across / 4)
            assert_eq!(found.cells, across.pow(3) / 8, "{across}");
            assert!((found.scale - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn holes_and_thin_walls_are_errors() {
        let mesh = block([0.4, 0.2, 0.01], [4, 2, 1]);
        let e = voxels(&surface(&mesh), 24, 2).unwrap_err().to_string();
        assert!(e.contains("0.01000 m thick") && e.contains("raise `cells`"), "{e}");
        let mut faces = mesh.surface().unwrap();
        faces.pop();
        let open = ClosedSurface::new(mesh.nodes, faces).unwrap_err();
        assert!(matches!(open, SurfaceError::Open { open: 3, .. }), "{open}");
    }
}
