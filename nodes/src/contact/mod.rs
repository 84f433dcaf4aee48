//! Sliding contact: which triangle a vertex touches, and how fast it slides along it.
//! Read in the order of the data: [`triangle`], [`exclusion`], [`tree`] and [`detector`] find the contacts, [`slip`] measures
//! them, [`gate`], [`spline`] and [`speed`] turn the measurements into the sliding speed that a friction sound follows.

pub mod analytic;
pub mod analytic_node;
mod boxes;
pub mod detector;
pub mod detector_node;
mod error;
pub mod exclusion;
pub mod gate;
mod item;
pub mod late;
mod neighbourhood;
mod query;
pub mod reference;
pub mod router;
mod sieve;
pub mod skinned;
pub mod skinned_node;
pub mod sliding;
pub mod slip;
pub mod speed;
pub mod speed_nodes;
pub mod spline;
pub mod tree;
pub mod triangle;
pub(crate) mod vector;

#[cfg(test)]
mod tests;

pub use detector::{Contact, Detection, Detector, DetectorParams, Exclude};
pub use error::ContactError;
pub use item::{Contacts, ContactsFormat, Speeds};
