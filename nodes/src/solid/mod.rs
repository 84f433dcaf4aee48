//! Solid objects: from the shape and the material to the modes.
//!
//! A [`TetMesh`] fills the object with tetrahedra. The finite elements of [`fem`] give stiffness and mass, and the eigenvalue problem its
//! modes of vibration, which a [`ModalModel`] holds.

pub mod fem;
pub mod mesh;
pub mod model;

pub use fem::eigen::{EigenError, Request};
pub use fem::elements::{Isotropic, Order};
pub use mesh::error::TetMeshError;
pub use mesh::formats::read_tets;
pub use mesh::tet_mesh::TetMesh;
pub use model::modal_model::ModalModel;
