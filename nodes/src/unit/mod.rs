//! Concatenative synthesis: a sound is put together from short units of recordings that sound most like it.
//!
//! A [`UnitDatabase`] holds the units and their features ([`mod@builder`]), a [`Selector`] chooses among them for each unit
//! of a target, or [`mod@global`] for all of them together, and a [`Concatenator`] joins what was chosen.

pub mod builder;
pub mod concatenator;
pub mod concatenator_node;
pub mod database;
pub mod database_node;
pub mod global;
pub mod global_node;
pub mod item;
pub mod kdtree;
pub mod online_node;
pub mod report;
pub mod selector;
pub mod selector_node;
mod sleep;

pub use builder::{BuildError, Gap, Take, build};
pub use concatenator::{Blend, Concatenator, Doze, Join, SILENT, Sleep, join};
pub use database::{DatabaseError, Segment, UnitDatabase, UnitSource};
pub use item::{Pick, PickFormat, Picks};
pub use report::{ChannelReport, SelectionReport};
pub use selector::{Choice, NotFinite, Selector, SelectorParams, Units, selector};
