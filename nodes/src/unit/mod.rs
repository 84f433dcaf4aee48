//! Concatenative synthesis: a sound made of the short units of recordings that are most similar to a target.
//!
//! A [`UnitDatabase`] holds the units and their features ([`mod@database`]). A selector chooses one for each unit of a target
//! ([`mod@selection`]), and a [`Concatenator`] joins the chosen ones ([`mod@concatenation`]).

pub mod concatenation;
pub mod database;
pub mod selection;
pub(crate) mod silence;

#[doc(no_inline)]
pub use database::builder;
#[doc(no_inline)]
pub use selection::{global, kdtree, report};

pub use concatenation::{Blend, Concatenator, Join, join};
pub use database::{Augmentation, BuildError, DatabaseError, Gap, Segment, Take, Variant};
pub use database::{UnitDatabase, UnitSource, build, build_augmented};
pub use selection::{ChannelReport, SelectionReport};
pub use selection::{Choice, NotFinite, Selector, SelectorParams, Units, selector};
pub use selection::{Pick, PickFormat, Picks};
pub use silence::{SILENT, SilenceGate, UnitGate};
