//! Time of sample rate conversion of a minute of sound, in windows of 20 ms as in a run.
//!
//! Run with `cargo bench -p foley-nodes -- resample`.

use foley_nodes::core::time::Rate;
use foley_nodes::dsp::{Quality, Resampler};
use std::time::Instant;

const SECONDS: i64 = 60;

pub fn bench() {
    let sound: Vec<f32> = (0..100_000).map(|k| (k % 101) as f32 * 0.01 - 0.5).collect();
    // 0.84 times the speed, as of variants of recordings, has too many phases for a table of them all.
    for (name, from, to) in [
        ("44.1 to 48 kHz", 44_100, 48_000),
        ("96 to 44.1 kHz", 96_000, 44_100),
        ("0.84 times", 40_320, 48_001),
    ] {
        for quality in [Quality::Standard, Quality::High] {
            for channels in [1, 2, 6] {
                let Ok(resampler) = Resampler::new(Rate::hz(from), Rate::hz(to), quality) else { continue };
                let window = i64::from(to) / 50;
                let mut out = vec![0.0; window as usize * channels];
                let start = Instant::now();
                for first in (0..SECONDS * i64::from(to)).step_by(window as usize) {
                    let needed = resampler.inputs(first..first + window);
                    let samples = (needed.end - needed.start) as usize * channels;
                    if resampler.process(first, &sound[..samples], needed.start, channels, &mut out).is_err()
                    {
                        println!("{name}: refused");
                    }
                }
                let seconds = start.elapsed().as_secs_f64();
                println!(
                    "{name}, {quality:?}, {channels} channel(s): {:.0} ms for {SECONDS} s, {:.0} times real time",
                    1e3 * seconds,
                    SECONDS as f64 / seconds
                );
            }
        }
    }
}
