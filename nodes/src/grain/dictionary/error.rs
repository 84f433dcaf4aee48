//! Reasons why a dictionary cannot be used.

use thiserror::Error;

/// Version of the format of [`GrainDictionary`](super::GrainDictionary).
pub const GRAINS_VERSION: u32 = 3;

/// Reasons why a dictionary cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GrainError {
    /// Another version of the format.
    #[error(
        "the grain dictionary has version {found}; this reads versions 2 and {GRAINS_VERSION}: make it again"
    )]
    Version {
        /// The version found.
        found: u32,
    },
    /// No grain.
    #[error("the grain dictionary has no grain: all recordings are silent or below the levels of `discard`")]
    Empty,
    /// A field that does not fit to the others.
    #[error("`{field}` of grain {grain} is {found}, outside its run or source")]
    Grain {
        /// Index of the grain.
        grain: usize,
        /// Name of the field.
        field: &'static str,
        /// The value found.
        found: u64,
    },
    /// A number of samples that does not fit.
    #[error("the grain dictionary has {found} {what}; {wanted} are needed")]
    Length {
        /// Name of the things counted.
        what: &'static str,
        /// The number found.
        found: usize,
        /// The number needed.
        wanted: usize,
    },
    /// A value that is not finite.
    #[error("{what} {index} of the grain dictionary is not finite")]
    NotFinite {
        /// Name of the value.
        what: &'static str,
        /// Its index.
        index: usize,
    },
}
