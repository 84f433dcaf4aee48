//! The zip of corduroy: a line that rises with speed, in what a roller measures, in the noise that is made of it, and in the units of
//! the roller's recording that take its place.

use crate::common;
use foley_nodes::statistics::ranks::spearman;
use std::f64::consts::TAU;
use std::fs;

const GRAPH: &str = r#"#![schema = "foley:graph/1"]
Graph(
    seed: 11,
    use: {
        "recomposed": Sub(path: "lib/recompose.ron", params: {
            "target": "friction", "takes": "takes", "correspondences": "PAIRS",
            "unit": "1/60", "widths": [20, 30, 10], "d_max": 3.0, "cool_off": 60,
        }),
    },
    nodes: {
        "takes": TakeCutter(recordings: ["roller.wav"], rate: 48000),
        "measured": FrictionModelFile(path: "roller.friction.json"),
        "planes": MeshGenerator(kind: Planes, speed: 0.1, acceleration: 0.25, duration: 4.0, size: [3.0, 0.1], vertices: [61, 3]),
        "contacts": ContactDetector(mesh: "planes", radius: 0.02),
        "speed": SlidingSpeed(contacts: "contacts", gate: Causal),
        "friction": IftNoise(speeds: "speed", model: "measured", rate: 48000, level: 0.2),
        "suggest": CorrespondenceSuggester(
            features: "recomposed.features", database: "recomposed.database", window: 6, level: 3.0, all: true, path: "SUGGESTED",
        ),
        "out": WavOut(audio: "recomposed.audio", path: "zip.wav"),
        "target": WavOut(audio: "friction", path: "target.wav"),
    },
)"#;

/// Speed and frequency of the strongest line in each tenth of a second of a sound at 48 kHz.
fn lines(sound: &[f32]) -> (Vec<f64>, Vec<f64>) {
    let power = |piece: &[f32], frequency: f64| {
        let mut sum = [0.0; 2];
        for (i, x) in piece.iter().enumerate() {
            let window = 0.5 - 0.5 * (TAU * i as f64 / piece.len() as f64).cos();
            let angle = TAU * frequency * i as f64 / 48_000.0;
            sum[0] += window * f64::from(*x) * angle.cos();
            sum[1] += window * f64::from(*x) * angle.sin();
        }
        sum[0] * sum[0] + sum[1] * sum[1]
    };
    let strongest = |piece: &[f32]| {
        let all = (2..60).map(|k| 20.0 * f64::from(k));
        let powers: Vec<(f64, f64)> = all.map(|frequency| (frequency, power(piece, frequency))).collect();
        powers.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0
    };
    let pieces = sound.chunks_exact(4800).take(39).enumerate();
    pieces.map(|(k, piece)| (0.1 + 0.025 * (k as f64 + 0.5), strongest(piece))).unzip()
}

#[test]
fn the_line_of_corduroy_rises_with_speed_in_the_target_and_in_the_units_of_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).display().to_string();
    let roller = common::graphs().join("cloth/roller_signal.ron").display().to_string();
    let taps = [
        format!("roller.audio={}", file("roller.wav")),
        format!("measured.model={}", file("roller.friction.json")),
    ];
    common::foley(folder.path(), &["run", &roller, "--tap", &taps[0], "--tap", &taps[1]]);
    fs::create_dir(folder.path().join("lib")).unwrap();
    fs::copy(common::graphs().join("lib/recompose.ron"), folder.path().join("lib/recompose.ron")).unwrap();
    let none = "assets/cloth/none.correspondences.ron";
    fs::copy(common::graphs().join(none), folder.path().join("none.ron")).unwrap();
    for [pairs, suggested] in [["none.ron", "first.ron"], ["first.ron", "second.ron"]] {
        let graph = GRAPH.replace("PAIRS", pairs).replace("SUGGESTED", suggested);
        fs::write(folder.path().join("zip.ron"), graph).unwrap();
        common::foley(folder.path(), &["run", &file("zip.ron")]);
    }
    for (name, least) in [("target.wav", 0.95), ("zip.wav", 0.75)] {
        let (speeds, frequencies) = lines(&common::wav(&folder.path().join(name)));
        let rank = spearman(&speeds, &frequencies);
        println!("{name}: rank correlation of speed and line {rank:.3}");
        assert!(rank > least, "{name}: {rank}, {frequencies:?}");
        // A wale each 1.5 mm.
        let ratios = speeds.iter().zip(&frequencies).map(|(speed, f)| f / (speed / 0.0015));
        let mut ratios: Vec<f64> = ratios.collect();
        ratios.sort_unstable_by(f64::total_cmp);
        let middle = ratios[ratios.len() / 2];
        assert!((0.7..1.4).contains(&middle), "{name}: {middle} times the frequency of the wales");
    }
}
