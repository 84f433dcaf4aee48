//! Sliding contact: the triangle that a vertex touches, and the speed at which it slides along it.
//!
//! Data flows through the rooms in this order: [`broad_phase`] and [`detection`] find the contacts, measured by [`triangle`] and
//! [`slip`]; [`analytic`] adds colliders defined by a formula, [`material_router`] selects contacts by material;
//! [`sliding`] turns slides into the sliding speed that a friction sound follows. [`skinned`] approximates both for
//! cloth that was not simulated.

pub mod analytic;
pub mod broad_phase;
pub mod detection;
mod error;
mod item;
pub mod material_router;
pub mod skinned;
pub mod sliding;
pub mod slip;
pub mod triangle;
pub(crate) mod vector;

pub use broad_phase::Exclude;
pub use detection::{Detection, Detector, DetectorParams};
pub use error::ContactError;
pub use item::{Contact, Contacts, ContactsFormat, Pressures, Speeds};
pub use slip::SlipMode;
