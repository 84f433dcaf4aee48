//! Frames of meshes: refused and counted, or positions that a mesh can have.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| foley::live::checks::check_frames(bytes));
