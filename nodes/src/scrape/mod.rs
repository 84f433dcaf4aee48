//! A contact that moves over a surface: its path at audio rate, and the force that the surface answers with.
//!
//! Contacts arrive a few dozen times a second. A [`PathPiece`] is the way from one arrival to the next as a formula, which the
//! excitations evaluate at every audio sample; any number of contacts travels on one link.

mod item;
mod law;
mod map;
pub mod map_node;
mod meter;
mod plane;
mod slew;
#[cfg(test)]
mod testing;
mod voices;

pub use item::PathPiece;
pub use law::{AT_REST, FADE, Heading, Law, Moves};
pub use map::{MapForce, MapVoice, SurfaceMap};
pub use meter::Meter;
pub use plane::{Interp, Plane};
pub use slew::{SLEW, Slew};
pub use voices::{CELL, Cell, Stretch, Voices};
