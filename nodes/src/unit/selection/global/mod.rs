//! Global selection: the path of units that is most similar to a target in sound and continuity.
//!
//! A path costs the distances of its units from the target, and a price for every jump. [`exact()`] finds the cheapest path,
//! [`beam()`] adds the costs of audible differences at joins, and [`FixedLag`] decides with a fixed lag.

mod beam;
mod exact;
mod fixed_lag;
mod front;
mod path;
mod programme;
mod repair;
mod row;
mod table;

pub use beam::{BeamParams, Joins, beam};
pub use exact::exact;
pub use fixed_lag::FixedLag;
pub use path::{GlobalParams, MAX_SWITCH_COST, Path, PathCostParams, difference, distance_cap};
pub use table::Table;

#[cfg(test)]
mod tests;
