//! Tetrahedral meshes: readers of their formats, and the checks that finite elements require.

pub mod formats;
pub mod quality;
pub mod shapes;
pub mod tet_mesh;
pub mod tet_mesh_file;
