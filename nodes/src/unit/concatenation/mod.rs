//! Chosen units played one after the other, joined at zero crossings.

pub mod concatenator;
mod repeats;
pub mod unit_concatenator;

pub use concatenator::{Blend, Concatenator, Join, join};
