//! Approximate sliding and crumpling of cloth that follows its skeleton and was not simulated.

pub mod bending;
pub mod lag;
pub mod skinned_slip;
