//! Coded maps: rejected, or valid for taps and the cache.
#![no_main]

mod common;

use foley_nodes::texture::map_code::map_file::MapFile;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = common::value_of::<MapFile>(bytes);
});
