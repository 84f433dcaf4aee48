//! Cloth that is pulled tight: flags and whipped sheets.
//!
//! [`Tightness`] computes the stretch of each part of a cloth, and finds the parts that turn from slack to taut. A
//! [`Membrane`](crate::modal::Membrane) rings under these impacts.

pub mod tension_impact;
pub mod tightness;

pub use tightness::{Snap, TautParams, Tightness};
