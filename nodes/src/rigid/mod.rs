//! Contacts of rigid bodies: logs of physics engines, and the classification of their contacts.
//!
//! [`read_contacts`] reads contact logs of several engines; each contact has a [`ContactFrame`] per frame of the physics.
//! [`Classifier`] separates impacts from continuous contacts, and classifies these as static, sliding or rolling.

#[cfg(feature = "impact")]
pub mod classification;
mod item;
#[cfg(feature = "impact")]
pub mod log;
#[cfg(all(test, feature = "impact"))]
pub(crate) mod testing;

#[cfg(feature = "impact")]
pub use classification::{Classifier, ImpactObjects, PowerLaw, Rules};
pub use item::{ContactFrame, ContactState, State};
#[cfg(feature = "impact")]
pub use log::{
    Bodies, ContactTrack, KEYS, LogError, LogFault, LogOptions, MAX_BODIES, MAX_ROWS, Manifold, read_contacts,
};
