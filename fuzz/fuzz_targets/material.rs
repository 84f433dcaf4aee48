//! Materials from RON: rejected, or the same when they are written and read again.
#![no_main]

use foley_nodes::material::{read_material, write_material};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(material) = read_material(bytes) {
        assert_eq!(read_material(write_material(&material, &[]).as_bytes()).unwrap(), material);
    }
});
