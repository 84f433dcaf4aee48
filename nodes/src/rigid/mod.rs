//! Rigid bodies that touch: what a physics engine logs of it, and what kind of contact it is.
//!
//! [`read_contacts`] reads logs of contacts, whatever engine wrote them; each contact has a [`ContactFrame`] per frame of the physics.
//! [`Classifier`] tells blows from contacts that last, and these by whether they rest, slide or roll.

mod bodies;
mod classify;
pub mod classify_node;
mod columns;
mod error;
mod history;
mod item;
mod join;
mod log;
pub mod log_node;
mod pace;
mod poses;
mod row;
mod table;
#[cfg(test)]
pub(crate) mod testing;

pub use bodies::{Bodies, MAX_BODIES};
pub use classify::{Classifier, PowerLaw, Rules, Struck};
pub use error::{LogError, LogFault};
pub use item::{ContactFrame, ContactState, State};
pub use join::Manifold;
pub use log::{ContactTrack, LogOptions, read_contacts};
pub use row::{KEYS, MAX_ROWS};
