//! Contacts of rigid bodies: logs of physics engines, and the classification of their contacts.
//!
//! [`read_contacts`] reads contact logs of several engines; each contact has a [`ContactFrame`] per frame of the physics.
//! [`Classifier`] separates impacts from continuous contacts, and classifies these as static, sliding or rolling.

pub mod classification;
mod item;
pub mod log;
#[cfg(test)]
pub(crate) mod testing;

pub use classification::{Classifier, ImpactObjects, PowerLaw, Rules};
pub use item::{ContactFrame, ContactState, State};
pub use log::{
    Bodies, ContactTrack, KEYS, LogError, LogFault, LogOptions, MAX_BODIES, MAX_ROWS, Manifold, read_contacts,
};
