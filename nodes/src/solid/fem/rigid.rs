//! Motions of rigid bodies, which are modes of frequency 0.

use super::super::mesh::error::TetMeshError;
use super::super::mesh::quality::components;
use super::super::mesh::tet_mesh::TetMesh;
use super::assembly::Discretisation;
use super::block_matrix::BlockMatrix;
use faer::Mat;

/// Translations along and rotations about the three axes, for each part of the mesh, orthonormal in the mass.
///
/// # Shapes
/// `[3 nodes, 6 parts]`.
///
/// # Errors
/// Parts that touch at a corner or an edge only: these have further motions without energy.
pub fn rigid_motions(
    mesh: &TetMesh,
    space: &Discretisation,
    matrix: &BlockMatrix,
) -> Result<Mat<f64>, TetMeshError> {
    let (mut part, parts) = components(mesh.nodes.len(), &mesh.tets)?;
    // A mid-edge node belongs to the part of its edge.
    part.resize(space.nodes.len(), 0);
    for element in &space.elements {
        let owner = part[element[0] as usize];
        element[..space.order.nodes()].iter().for_each(|c| part[*c as usize] = owner);
    }
    let mut centre = vec![([0.0; 3], 0.0); parts];
    for (p, part) in space.nodes.iter().zip(&part) {
        let (sum, count) = &mut centre[*part as usize];
        (0..3).for_each(|k| sum[k] += p[k]);
        *count += 1.0;
    }
    let mut motions = Mat::zeros(3 * space.nodes.len(), 6 * parts);
    for (i, (p, part)) in space.nodes.iter().zip(&part).enumerate() {
        let (sum, count) = centre[*part as usize];
        let [x, y, z] = std::array::from_fn(|k| p[k] - sum[k] / count);
        let columns = 6 * *part as usize;
        let rotations = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
        for (k, rotation) in rotations.iter().enumerate() {
            motions[(3 * i + k, columns + k)] = 1.0;
            (0..3).for_each(|a| motions[(3 * i + a, columns + 3 + k)] = rotation[a]);
        }
    }
    for _ in 0..2 {
        for j in 0..motions.ncols() {
            for k in j - j % 6..j {
                let mass = matrix.mass_times(motions.as_ref().subcols(k, 1));
                let share = inner(&mass, 0, &motions, j);
                for i in 0..motions.nrows() {
                    motions[(i, j)] -= share * motions[(i, k)];
                }
            }
            let mass = matrix.mass_times(motions.as_ref().subcols(j, 1));
            let length = inner(&mass, 0, &motions, j).sqrt();
            (0..motions.nrows()).for_each(|i| motions[(i, j)] /= length);
        }
    }
    Ok(motions)
}

fn inner(a: &Mat<f64>, i: usize, b: &Mat<f64>, j: usize) -> f64 {
    a.col(i).iter().zip(b.col(j).iter()).map(|(x, y)| x * y).sum()
}
