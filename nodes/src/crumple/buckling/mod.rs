//! Buckling: the vertices of a cloth whose mean curvature changes sign from one frame to the next.

pub mod buckle;
pub mod buckle_detector;
pub mod buckle_figure;
mod buckles;

pub use buckle::{Buckle, BuckleDetector};
pub use buckles::Buckles;
