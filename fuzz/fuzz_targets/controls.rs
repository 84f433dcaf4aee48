//! Any numbers to a control: a graph of filters plays on as before.
#![no_main]

use foley::live::checks::ControlCheck;
use libfuzzer_sys::fuzz_target;
use std::sync::Mutex;

static CHECK: Mutex<Option<ControlCheck>> = Mutex::new(None);

fuzz_target!(|bytes: &[u8]| {
    let mut check = CHECK.lock().unwrap();
    check.get_or_insert_with(|| ControlCheck::new().unwrap()).check(bytes);
});
