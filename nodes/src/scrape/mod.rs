//! A contact that moves over a surface: its path at audio rate, and the force that the surface answers with.
//!
//! Contacts arrive a few dozen times a second. A [`PathPiece`] is the way from one arrival to the next as a formula, which the
//! excitations evaluate at every audio sample; any number of contacts travels on one link.

mod bands;
mod frame;
mod hermite;
mod isophote;
mod isophote_ends;
mod isophote_index;
mod isophote_near;
pub mod isophote_node;
mod isophote_piece;
mod isophote_trail;
mod item;
mod law;
mod levels;
pub mod levels_node;
mod lod;
pub mod lod_node;
mod map;
pub mod map_node;
#[cfg(test)]
mod map_tests;
mod meet;
pub mod meet_node;
mod noise;
pub mod noise_node;
pub mod other_node;
mod pair;
pub mod pair_levels_node;
pub mod pair_node;
mod past;
pub mod path_node;
mod plane;
mod profile;
pub mod profile_node;
mod pulses;
mod queue;
mod relief;
mod resize;
mod slew;
mod strength;
mod stroke;
pub mod stroke_node;
#[cfg(test)]
mod testing;
mod track;
#[cfg(test)]
mod track_tests;
mod voices;

pub use bands::{NoiseBands, NoiseInterp};
pub use frame::{PathRules, Sample};
pub use isophote::{IsophoteForce, IsophoteVoice, PULSE, Reading};
pub use isophote_ends::Strip;
pub use isophote_index::{IsophoteIndex, Tile};
pub use isophote_piece::Piece;
pub use item::PathPiece;
pub use law::{AT_REST, FADE, Heading, Law, Moves};
pub use levels::StandardStroke;
pub use lod::{Chooser, LodRules};
pub use map::{MapForce, MapVoice, SurfaceMap};
pub use meet::{MeetForce, MeetVoice};
pub use noise::{NoiseForce, NoiseVoice};
pub use pair::PairForce;
pub use plane::{Interp, Plane};
pub use profile::{Met, PathProfile};
pub use pulses::Pulses;
pub use queue::Queue;
pub use relief::{Relief, ball_map, heights, rolled_over};
pub use resize::Resize;
pub use slew::{SLEW, Slew};
pub use strength::{SpeedCurve, Strength};
pub use stroke::{Knot, Pen, circle, lines, pieces, through};
pub use track::{JUMP, LOST, Tracker};
pub use voices::{CELL, Cell, Stretch, Voices};
