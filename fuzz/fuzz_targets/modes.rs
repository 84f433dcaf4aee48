//! Modes from JSON or CSV: refused, or such that they pass the check again.
#![no_main]

use foley_nodes::modal::read_modes;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(modes) = read_modes(bytes) {
        assert!(modes.validate().is_ok());
    }
});
