//! Modes from JSON or CSV: rejected, or valid when checked again.
#![no_main]

use foley_nodes::modal::read_modes;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(modes) = read_modes(bytes) {
        assert!(modes.validate().is_ok());
    }
});
