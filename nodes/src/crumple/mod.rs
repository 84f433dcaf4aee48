//! Crumpling: every time a fold of cloth snaps from one side to the other, a recorded micro-sound.
//! In the order of the data: [`buckle`] finds the vertices that snap, [`events`] joins them, [`extract`] cuts recordings into a
//! [`bank`], [`calibration`] and [`matching`] bring the energies of both together, [`player`] plays.

pub mod bank;
pub mod bank_nodes;
pub mod binaural_player_node;
pub mod buckle;
pub mod buckle_node;
pub mod calibration;
pub mod calibration_nodes;
mod components;
pub mod events;
pub mod events_node;
pub mod extract;
mod figure;
mod histogram;
mod item;
pub mod matcher_node;
pub mod matching;
pub mod picture;
mod playback;
pub mod player;
pub mod player_node;

pub use bank::{BankError, CrumpleBank};
pub use buckle::{Buckle, BuckleDetector};
pub use calibration::{EnergyCalibration, Floor};
pub(crate) use events::digest as mesh_digest;
pub use events::{CrumpleEvents, CrumpleParams};
pub use item::{Buckles, Crumple, MatchedCrumple, Weight};
