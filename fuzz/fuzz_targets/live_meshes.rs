//! Frames of meshes: refused and counted, or positions that a mesh can have.
#![no_main]

use foley::live::input::{Hub, read_frames};
use foley_nodes::core::input::Inputs;
use libfuzzer_sys::fuzz_target;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

fuzz_target!(|bytes: &[u8]| {
    let hub = Hub::new();
    let mut inbox = hub.open_frames("sheet", 6).unwrap();
    let taken = read_frames(bytes, &hub, &AtomicBool::new(false));
    let counted = hub.malformed.load(Relaxed) + hub.unclaimed.load(Relaxed);
    assert!(taken.is_ok() || counted > 0);
    let mut shown = [0.0; 6];
    inbox.latest(i64::MAX, &mut shown);
    assert!(shown.iter().all(|x| x.abs() <= 1e9));
});
