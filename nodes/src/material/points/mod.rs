//! Points of damping over frequency, from features or from a table.

pub mod damping_points;
pub mod damping_points_file;
pub mod feature_gate;
pub mod gate;
