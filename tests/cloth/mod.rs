//! Cloth: from the animation to the sound.

mod chain;
mod data;
mod figures;
mod follows;
mod friction;
mod motion;
pub mod stored;
mod zip;
