//! JSON lines from standard input: counted as malformed, or delivered.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| foley::live::checks::check_lines(bytes));
