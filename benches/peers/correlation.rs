//! Item 6: Normalised cross-correlation of 5171 grains of 700 to 3000 samples with 94 recordings, 82 s at 44.1 kHz.
//!
//! Some of the grains are correlated with all recordings, and the time is scaled to all. foley's includes the transforms of the recordings,
//! which the others compute before; with all grains they would be a fiftieth of their share here. The others take the greatest value of each
//! grain and recording, foley the four best peaks in each interval as long as a grain, which it computes again in double precision.

use super::data::{Rng, noise};
use super::measure::{Item, Times};
use foley_nodes::core::computation::NotStored;
use foley_nodes::grain::correlation::{CorrelateRules, correlate};
use foley_nodes::grain::dictionary::{GRAINS_VERSION, GrainSource, Run};
use foley_nodes::grain::recording::{Component, Part};
use foley_nodes::grain::{Grain, GrainDictionary, GrainRecording, GrainRecordings};

const RATE: f64 = 44_100.0;
const RECORDINGS: usize = 94;
const GRAINS: usize = 5171;
/// Grains that are correlated.
const SOME: usize = 100;

fn recordings(rng: &mut Rng) -> GrainRecordings {
    let lengths: Vec<f64> = (0..RECORDINGS).map(|_| rng.between(0.5, 1.5)).collect();
    let scale = 82.0 * RATE / lengths.iter().sum::<f64>();
    let recording = |(k, length): (usize, &f64)| GrainRecording {
        name: format!("{k}.wav"),
        parts: vec![Part {
            component: Component::Whole,
            channels: vec![noise(600 + k as u64, (scale * length) as usize)],
        }],
        ..GrainRecording::default()
    };
    GrainRecordings { rate: RATE, recordings: lengths.iter().enumerate().map(recording).collect() }
}

/// Grains of noise without tapers.
fn dictionary(rng: &mut Rng) -> GrainDictionary {
    let mut samples: Vec<f32> = Vec::new();
    let (mut grains, mut runs) = (Vec::new(), Vec::new());
    for k in 0..SOME as u32 {
        let (offset, len) = (samples.len() as u64, rng.between(700.0, 3001.0) as u32);
        samples.extend(noise(7000 + u64::from(k), len as usize));
        grains.push(Grain { len, gain: 1.0, power: 1.0, run: k, ..Grain::default() });
        runs.push(Run { offset, frames: len, channels: 1 });
    }
    GrainDictionary {
        version: GRAINS_VERSION,
        rate: RATE,
        symmetric_tapers: false,
        bits: 0,
        sources: vec![GrainSource::default()],
        grains,
        runs,
        steps: Vec::new(),
        samples,
        tracks: None,
    }
}

pub fn bench(item: Item) {
    let mut rng = Rng(6);
    let (recordings, dictionary) = (recordings(&mut rng), dictionary(&mut rng));
    let rules = CorrelateRules::default();
    let found =
        || correlate(&recordings, &dictionary, &rules, &|_| false, &NotStored).expect("nothing stops it");
    let peaks: usize = found().patterns.iter().map(|pattern| pattern.peaks.len()).sum();
    item.print(&format!("{SOME}-grains.peaks"), peaks as f64, "peaks");
    let [wall, cpu] = Times::of(found).medians();
    let all = GRAINS as f64 / SOME as f64;
    item.print(&format!("{SOME}-grains-x-94"), wall, "s");
    item.print("whole-extrapolated", all * wall, "s");
    item.print("whole-extrapolated.cpu", all * cpu, "s");
}
