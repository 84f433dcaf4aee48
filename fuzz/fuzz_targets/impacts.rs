//! Impacts from CSV or JSON lines: rejected, or in the order of time.
#![no_main]

use foley_nodes::modal::{Body, Defaults, read_impacts};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let body = Body { mass: 0.05, restitution: 0.5 };
    let defaults = Defaults { body, hardness: 0.5, objects: vec!["bell".into(), "box".into()] };
    if let Ok(impacts) = read_impacts(bytes, &defaults) {
        assert!(impacts.is_sorted_by_key(|(time, _)| *time));
        assert!(impacts.iter().all(|(_, impact)| (impact.object as usize) < defaults.objects.len()));
    }
});
