//! Which units of a database together sound most like a whole target, and go on most like it: global selection.
//!
//! The best path through all units costs the distances of its units from the target, and a price for every jump. [`exact()`] finds
//! it, [`beam()`] searches where joins cost what is heard of them, and [`FixedLag`] decides a little after the target.

mod beam;
mod cool_off;
mod exact;
mod fixed_lag;
mod path;
mod programme;
mod repair;
mod row;
mod table;

pub use beam::{BeamParams, Joins, beam};
pub use exact::exact;
pub use fixed_lag::FixedLag;
pub use path::{GlobalParams, MAX_SWITCH_COST, Path, difference, distance_cap};
pub use table::Table;

#[cfg(test)]
mod tests;
