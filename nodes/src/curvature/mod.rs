//! How a cloth bends: signed mean curvature at every vertex of a mesh that moves.
//! [`mean`] is the measure itself, `fans` says where it has a meaning, [`rest`] how much of it is noise.

mod angle;
mod fans;
mod item;
pub mod mean;
pub mod mean_node;
pub mod rest;
#[cfg(test)]
pub(crate) mod scenes;

pub use fans::Fan;
pub use item::{Curvature, Curvatures};
pub use mean::{MeanCurvature, Method, Point};
pub use rest::{RestNoise, RestParams};
