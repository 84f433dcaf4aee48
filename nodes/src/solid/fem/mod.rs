//! Finite elements of linear elasticity: stiffness, mass, and the modes of free vibration.

pub mod assembly;
pub mod block_matrix;
mod dense;
pub mod eigen;
pub mod elements;
mod factor;
mod lanczos;
pub mod rigid;

#[cfg(test)]
mod tests;
