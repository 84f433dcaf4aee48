//! Concatenative synthesis: a sound is put together from short units of recordings that sound most like it.
//!
//! A [`UnitDatabase`] holds the units and their features.

pub mod database;

pub use database::{DatabaseError, Segment, UnitDatabase, UnitSource};
