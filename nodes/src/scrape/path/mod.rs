//! Paths of contacts over a surface, as polynomials: from contacts of a physics engine, or drawn.

pub mod contact_path;
pub(super) mod force_filter;
mod hermite;
pub(super) mod knots;
pub mod other_surface;
pub(super) mod piece;
pub(super) mod queue;
pub(super) mod sample;
pub mod stroke;
pub(super) mod tracker;

pub use knots::{Knot, StrokeContact, circle, lines, pieces, through};
pub use piece::PathPiece;
pub use queue::Queue;
pub use sample::{ContactSample, PathRules};
pub use tracker::{END_FADE, JUMP_FADE, Tracker};
