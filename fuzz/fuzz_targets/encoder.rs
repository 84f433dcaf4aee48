//! Any bytes as the table of a shaft encoder, and the motion that it describes.
#![no_main]

use foley_nodes::friction::EncoderTrack;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(track) = EncoderTrack::from_csv(data) else { return };
    if let Ok(motion) = track.motion(0.0425) {
        for t in [-1.0, 0.0, 0.5, 1e9] {
            let _ = motion.speed_at(t);
            let (low, high) = motion.speed_range(t, t + 0.05);
            assert!(low <= high || low.is_nan() || high.is_nan());
        }
    }
});
