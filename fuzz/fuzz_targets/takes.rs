//! Lists of takes from CSV: rejected, or takes with a path each.
#![no_main]

use foley_nodes::modal::read_takes;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(takes) = read_takes(bytes) {
        assert!(!takes.is_empty() && takes.iter().all(|take| !take.file.is_empty()));
    }
});
