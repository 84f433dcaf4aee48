//! A log of contacts and, after a zero byte, poses of the bodies: refused, or finite and in the order of time.
#![no_main]

use foley_nodes::rigid::{LogOptions, Manifold, read_contacts};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut parts = bytes.splitn(2, |b| *b == 0);
    let (contacts, poses) = (parts.next().unwrap_or_default(), parts.next());
    for manifold in [Manifold::Centroid, Manifold::Points] {
        let options = LogOptions { manifold, masses: vec![0.0, 0.5], ..LogOptions::default() };
        if let Ok(track) = read_contacts(contacts, poses, &options) {
            assert!(track.frames.is_sorted_by_key(|(time, frame)| (*time, frame.contact)));
            assert!(track.frames.iter().all(|(_, frame)| frame.force.is_finite() && frame.force >= 0.0));
        }
    }
});
