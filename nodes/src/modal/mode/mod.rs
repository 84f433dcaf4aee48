//! Modes of an object: from a file, or of a stretched membrane.

pub mod damping_curve;
pub mod membrane;
pub mod membrane_modes;
pub mod modes;
pub mod modes_file;
