//! Narrow phase of the proximity search: the closest triangles of each vertex by exact distance, and the slide along them.

pub mod contact_detector;
pub mod detector;
mod frame;
mod query;
pub mod reference;

#[cfg(test)]
mod tests;

pub use detector::{Detection, Detector, DetectorParams};
pub(super) use frame::check_finite;
