//! Correspondences from RON: rejected, or valid for taps and the cache.
#![no_main]

mod common;

use foley_nodes::warp::correspondence::correspondence_set::Correspondences;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = common::value_of::<Correspondences>(bytes);
});
