//! A contact that moves over a surface: its path at audio rate, and the force that the surface answers with.
//!
//! Contacts arrive a few dozen times a second. A [`PathPiece`] is the way from one arrival to the next as a formula, which the
//! excitations evaluate at every audio sample; any number of contacts travels on one link.

mod item;

pub use item::PathPiece;
