//! Poses from CSV: refused with a line, or finite and turned by a unit quaternion at any time.
#![no_main]

use foley_nodes::spatial::read_poses;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(track) = read_poses(bytes) else { return };
    for tick in [0, track.end() / 3, track.end(), track.end() + 1] {
        let pose = track.at(tick);
        assert!(pose.position.iter().all(|x| x.is_finite()));
        let length = pose.rotation.iter().map(|x| x * x).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-3, "{length}");
    }
});
