//! JSON lines from standard input: counted as malformed, or delivered.
#![no_main]

use foley::live::input::{Hub, read_lines};
use foley_nodes::core::input::Inputs;
use libfuzzer_sys::fuzz_target;
use std::sync::atomic::Ordering::Relaxed;

fuzz_target!(|bytes: &[u8]| {
    let hub = Hub::new();
    let inbox = hub.open("hits");
    let mut reports = 0_u64;
    read_lines(bytes, &hub, |_, _| reports += 1);
    assert_eq!(reports, hub.malformed.load(Relaxed));
    drop(inbox);
});
