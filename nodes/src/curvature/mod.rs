//! Bending of cloth: signed mean curvature at every vertex of a moving mesh.
//!
//! [`mean`] is the measure, `one_ring` selects the vertices where it is defined, [`rest_noise`] measures its noise at rest.

mod angle;
mod item;
pub mod mean;
pub mod mean_curvature;
mod one_ring;
pub mod rest_noise;
#[cfg(test)]
pub(crate) mod scenes;

pub use item::{Curvature, Curvatures, Method};
pub use mean::{MeanCurvature, Point};
pub use one_ring::OneRing;
pub use rest_noise::{RestNoise, RestParams};
