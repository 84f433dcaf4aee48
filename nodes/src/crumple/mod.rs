//! Crumpling: a recorded micro-sound for every fold of cloth that buckles.
//!
//! In the order of the data: [`buckling`] detects the vertices that buckle, [`events`] joins them, [`bank`] holds the
//! samples cut out of recordings, [`matching`] chooses a sample for each event, [`playback`] plays it.

pub mod bank;
pub mod buckling;
pub mod events;
pub mod matching;
pub mod playback;

pub use bank::{BankError, CrumpleBank};
pub use buckling::{Buckle, BuckleDetector, Buckles};
pub(crate) use events::mesh_digest;
pub use events::{Crumple, CrumpleEvents, CrumpleParams, Weight};
pub use matching::{EnergyCalibration, EnergyMap, Floor, Mapping, MatchedCrumple};
