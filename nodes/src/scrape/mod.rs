//! A contact that moves over a surface: its path, and the force that the surface exerts on it at audio rate.
//!
//! Contacts arrive a few dozen times a second. A [`PathPiece`] is the path from one arrival to the next as a polynomial, which the
//! excitations evaluate at every audio sample; one link transmits the paths of any number of contacts.
//!
//! Data flows from top to bottom: [`path`] -> [`force`] -> [`map`], [`noise`], [`isophote`] -> [`relief`], [`crossing`] -> [`level`].

pub mod crossing;
pub mod force;
pub mod isophote;
pub mod level;
pub mod map;
pub mod noise;
pub mod path;
pub mod relief;
#[cfg(test)]
mod testing;

pub use crossing::{CrossingForce, CrossingVoice};
pub use force::{
    AT_REST, CELL, Cell, ContactForceParams, FADE, ForceLawParams, Heading, Law, Motion, PULSE, Pulses,
    RAMP_TIME, Ramp, Segment, SpeedCurve, Strength, Voices,
};
pub use isophote::{CurvePiece, IsophoteForce, IsophoteIndex, IsophoteVoice, Reading, Strip, Tile};
pub use level::{LodRules, LodSelector, StandardStroke};
pub use map::{ContactProfile, Interp, MapForce, MapVoice, PaddedMap, PathProfile, SurfaceMap};
pub use noise::{NoiseBands, NoiseForce, NoiseInterp, NoiseVoice};
pub use path::{
    ContactSample, END_FADE, JUMP_FADE, Knot, PathPiece, PathRules, Queue, StrokeContact, Tracker, circle,
    lines, pieces, through,
};
pub use relief::{PairForce, Relief, SizeFade, ball_map, heights, rolled_over};
