//! Isophotes as `IsophotesFile` reads them: rejected, or valid to write and read again. The corpus starts with an
//! example:
//! `mkdir -p fuzz/corpus/isophotes; cargo +nightly fuzz run isophotes fuzz/corpus/isophotes graphs/assets/images`.
#![no_main]

use foley_nodes::texture::{decode_isophotes, encode_isophotes};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(found) = decode_isophotes(bytes) {
        assert!(decode_isophotes(&encode_isophotes(&found)).is_ok());
    }
});
