//! Banks of crumples from JSON: rejected, or valid for taps and the cache.
#![no_main]

mod common;

use foley_nodes::crumple::bank::crumple_bank_file::CrumpleBankFile;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = common::value_of::<CrumpleBankFile>(bytes);
});
