//! OSC packets from a socket: counted as malformed, or delivered. A packet is at most one datagram.
#![no_main]

use foley::live::input::{Hub, read_packet};
use foley_nodes::core::input::Inputs;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let hub = Hub::new();
    let inbox = hub.open("hits");
    read_packet(bytes, &hub);
    drop(inbox);
});
