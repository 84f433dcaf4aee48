//! Things that are struck: impacts, the forces they make, and the modes that ring.
//!
//! An [`Impact`] is one blow; [`force`] turns blows into force at audio rate; a [`Bank`] rings [`Modes`], which come from a
//! file, from a recording of one blow ([`mod@extract`]), or from a sheet that is pulled tight ([`Membrane`]).

pub mod bank;
pub mod bank_node;
mod coefficients;
pub mod extract;
pub mod force;
pub mod force_node;
pub mod from_recording;
pub mod impact;
pub mod impact_file;
pub mod impact_file_node;
mod kernel;
pub mod membrane;
pub mod membrane_node;
pub mod modes;
pub mod modes_file;

pub use bank::Bank;
pub use extract::{ExtractError, ExtractParams, Extracted, Partial, extract};
pub use force::{ForceRing, Law, PulseShape, contact_time};
pub use impact::{Body, Impact};
pub use impact_file::{Defaults, ImpactError, read_impacts};
pub use membrane::Membrane;
pub use modes::{Modes, ModesError};
pub use modes_file::read_modes;
