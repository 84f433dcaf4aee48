//! Warps from JSON: refused, or such that they can be shown and kept.
#![no_main]

mod common;

use foley_nodes::warp::fit::warp_file::WarpFile;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = common::value_of::<WarpFile>(bytes);
});
