//! Units of recordings with their features, made from recordings or read from a file.

pub mod builder;
mod file;
pub mod unit_database;
pub mod unit_database_file;
pub mod units;

pub use builder::{Augmentation, BuildError, Gap, Take, build, build_augmented};
pub(crate) use units::file_names;
pub use units::{DATABASE_VERSION, DatabaseError, Segment, UnitDatabase, UnitSource, Variant};
