//! Cloth that is pulled tight: flags and whipped sheets.
//!
//! [`Tightness`] follows how far each part of a cloth is stretched, and tells where one that was slack is caught; a membrane rings
//! under that ([`Membrane`](crate::modal::Membrane)).

pub mod node;
pub mod taut;

pub use taut::{Snap, TautParams, Tightness};
