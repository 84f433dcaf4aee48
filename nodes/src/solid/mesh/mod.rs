//! Tetrahedral meshes: readers of their formats, and the checks that finite elements require.

pub mod closed_surface;
pub(in crate::solid) mod element;
pub mod error;
pub mod formats;
pub mod isoparametric;
pub mod quality;
pub mod revolution;
pub mod revolved_mesh;
pub mod shapes;
pub mod surface_to_tets;
pub mod tet_mesh;
pub mod tet_mesh_file;
pub mod voxels;
