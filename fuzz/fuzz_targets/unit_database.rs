//! Databases of units from their own files: rejected, or valid for taps and the cache.
#![no_main]

mod common;

use foley_nodes::unit::database::unit_database_file::UnitDatabaseFile;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = common::value_of::<UnitDatabaseFile>(bytes);
});
