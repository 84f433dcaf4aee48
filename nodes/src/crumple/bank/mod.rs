//! Banks of micro-sounds: the samples and their energies, and how they are cut out of recordings ([`extraction`]).

mod crumple_bank;
pub mod crumple_bank_file;
pub mod crumple_extractor;
pub mod extraction;
mod report;

pub(super) use crumple_bank::trial_bank;
pub use crumple_bank::{BANK_VERSION, BankError, CrumpleBank, Cut, Origin, Recorded};
pub use extraction::Extraction;
