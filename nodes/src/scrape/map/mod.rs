//! Excitation from a map: a padded map is read along the path of a contact.

pub mod map_excitation;
pub(super) mod map_force;
pub(super) mod padded_map;
pub mod path_profile;
mod profile;
pub(super) mod surface_map;

pub use map_force::{MapForce, MapVoice};
pub use padded_map::{Interp, PaddedMap};
pub use profile::{ContactProfile, PathProfile};
pub use surface_map::SurfaceMap;
