//! Calibrations of crumple energies from JSON: rejected, or valid for taps and the cache.
#![no_main]

mod common;

use foley_nodes::crumple::matching::energy_calibration_file::EnergyCalibrationFile;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = common::value_of::<EnergyCalibrationFile>(bytes);
});
