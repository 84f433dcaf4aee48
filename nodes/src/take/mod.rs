//! Takes: the useful parts of raw recordings.
//!
//! A raw recording has rumble, room noise between its sounds, and a level of its own. [`cut`] finds its [`Takes`], which
//! [`mod@take_cutter`] passes to unit databases, friction models and crumple banks.

pub mod cutting;
mod figure;
pub mod take_cutter;
pub mod takes;

pub use cutting::{Cutting, TakeRules, cut};
pub use takes::{CutRecording, Takes};
