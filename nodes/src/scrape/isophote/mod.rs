//! Excitation from isophotes: a contact crosses curves or passes near them; an index finds these curves.

mod chords;
pub(super) mod curve_piece;
mod end_points;
mod history;
pub(super) mod index;
pub mod isophote_excitation;
pub(super) mod isophote_force;
mod nearest;

pub use curve_piece::CurvePiece;
pub use end_points::Strip;
pub use index::{IsophoteIndex, Tile};
pub use isophote_force::{IsophoteForce, IsophoteVoice, Reading};
