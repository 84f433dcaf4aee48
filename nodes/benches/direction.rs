//! Sound textures that follow a weight.
//!
//! Run with `cargo bench -p foley-nodes -- direction`. The recording is one of the data beside the repository, or at `FOLEY_DATA`.

use super::common::{folder, load};
use super::soundtrack::{SEEDS, model, statistics, synthesise_by};
use foley_nodes::soundtrack::synthesis::SynthesisRules;

pub fn bench() {
    let Some((rate, x)) = load(folder("recordings/texture").join("traffic_city.flac")) else {
        println!("traffic_city.flac: not found, skipped");
        return;
    };
    let source = statistics(&x, rate);
    let model = model(rate, x);
    println!(
        "weight of 5 to 12 s of traffic_city.flac, {SEEDS} times 100 s: share of the time, and mean difference of the statistics of the first from the recording"
    );
    for weight in [-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 0.9, 1.0] {
        let score = format!(
            "SoundScore(sources: [(name: \"a\", segments: [(5, 12)])], targets: [(source: \"a\", from: 0, to: 101, weight: {weight:?})])"
        );
        let of = |seed| synthesise_by(&model, &score, 100.0, SynthesisRules::default(), seed);
        let (from, to) = ((5.0 * rate / 2.0) as u32, (12.0 * rate / 2.0) as u32);
        let share = |leaves: &[u32]| {
            leaves.iter().filter(|m| (from..to).contains(*m)).count() as f64 / leaves.len() as f64
        };
        let shares = (1..=SEEDS).map(|seed| share(&of(seed).1)).sum::<f64>() / SEEDS as f64;
        let s = statistics(&of(1).0, rate);
        let difference = s.iter().zip(&source).map(|(a, b)| (a - b).abs()).sum::<f64>() / s.len() as f64;
        println!("{weight:5.2}: {:5.1} %, {difference:.2} dB", 100.0 * shares);
    }
}
