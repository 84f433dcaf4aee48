//! Correspondences from RON: refused, or such that they can be shown and kept.
#![no_main]

mod common;

use foley_nodes::warp::correspondence::correspondence_set::Correspondences;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = common::value_of::<Correspondences>(bytes);
});
