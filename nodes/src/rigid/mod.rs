//! Rigid bodies that touch: what a physics engine logs of it, and what kind of contact it is.

mod item;

pub use item::{ContactFrame, ContactState, State};
