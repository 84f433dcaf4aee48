//! Matching: a sample of the bank for each event, chosen by the rank of its energy.
//!
//! The energies of the events come from a whole take ([`calibration`]) or from the recent events ([`rolling`]).

pub mod calibration;
pub mod energy_calibration;
pub mod energy_calibration_file;
mod energy_map;
mod histogram;
pub mod histogram_matcher;
mod matched_crumple;
mod nearest_sample;
pub mod rolling;
#[cfg(test)]
mod testing;

pub use calibration::{CalibrationError, EnergyCalibration, EnergyMeter, Floor};
pub use energy_map::{EnergyMap, Mapping};
pub use matched_crumple::MatchedCrumple;
pub use nearest_sample::Nearest;
pub use rolling::Rolling;
