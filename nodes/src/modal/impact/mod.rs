//! Impacts, and the forces they make.

pub mod event;
pub mod force_ring;
pub mod impact_file;
pub mod impact_force;
pub mod pulse;
pub mod reader;
