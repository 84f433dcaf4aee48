//! Noise profiles: rejected, or valid for taps and the cache.
#![no_main]

mod common;

use foley_nodes::texture::noise::noise_profile_file::NoiseProfileFile;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = common::value_of::<NoiseProfileFile>(bytes);
});
