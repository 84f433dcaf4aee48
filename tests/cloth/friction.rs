//! The friction of `graphs/cloth/friction.ron`, compared with the sliding that causes it.

use crate::common::{foley, npy, wav};
use foley_nodes::friction::FrictionModel;
use foley_nodes::statistics::ranks::spearman;
use std::sync::LazyLock;

/// Samples from one sliding speed to the next: 48 kHz at 40 speeds a second.
const HOP: usize = 1200;

/// One take of the example.
struct Take {
    /// Sliding speeds of all vertices, clip by clip.
    speeds: Vec<Vec<f32>>,
    audio: Vec<f32>,
    model: FrictionModel,
}

/// The example with a second of standing still before its motion and after it.
static TAKE: LazyLock<Take> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let [speeds, model] = ["speed.npy", "model.json"].map(|file| folder.path().join(file));
    let taps = [format!("speed={}", speeds.display()), format!("cotton.friction={}", model.display())];
    let mut arguments = vec!["run", "graphs/cloth/friction.ron", "--set", "out.format=Float32"];
    taps.iter().for_each(|tap| arguments.extend(["--tap", tap]));
    let sets: Vec<String> = ["sheet", "wall1", "wall2"]
        .iter()
        .flat_map(|mesh| [format!("{mesh}.start=-1.0"), format!("{mesh}.duration=9.0")])
        .collect();
    sets.iter().for_each(|set| arguments.extend(["--set", set]));
    foley(folder.path(), &arguments);
    Take {
        speeds: npy(&std::fs::read(&speeds).unwrap()),
        audio: wav(&folder.path().join("friction.wav")),
        model: serde_json::from_slice(&std::fs::read(&model).unwrap()).unwrap(),
    }
});

/// A sound between two neighbouring speeds is made of the clips of both and of no other.
fn between() -> impl Iterator<Item = ([&'static [f32]; 2], &'static [f32])> {
    let speeds = TAKE.speeds.windows(2).map(|w| [&w[0][..], &w[1][..]]);
    speeds.zip(TAKE.audio.chunks_exact(HOP))
}

fn power(x: &[f32]) -> f64 {
    x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len() as f64
}

#[test]
fn friction_is_exactly_silent_where_nothing_slides_and_sounds_wherever_something_does() {
    let mut counts = [0; 2];
    for (k, (speeds, heard)) in between().enumerate() {
        let slides = speeds.iter().any(|clip| clip.iter().any(|s| *s > 0.0));
        counts[usize::from(slides)] += 1;
        let silent = heard.iter().all(|x| *x == 0.0);
        assert_eq!(slides, !silent, "from {} s", k as f64 / 40.0);
    }
    println!("{} stretches of silence, {} of sound", counts[0], counts[1]);
    assert!(counts[0] >= 70 && counts[1] >= 250, "the take holds both: {counts:?}");
}

#[test]
fn the_level_of_friction_follows_the_sliding_speed() {
    let slides = |speeds: &[&[f32]; 2]| speeds.iter().flat_map(|clip| clip.iter()).any(|s| *s > 0.0);
    let moving = || between().filter(|(speeds, _)| slides(speeds));
    let sum = |clip: &[f32]| clip.iter().map(|s| f64::from(*s)).sum::<f64>();
    let slid: Vec<f64> = moving().map(|(speeds, _)| speeds.map(sum).iter().sum()).collect();
    let heard: Vec<f64> = moving().map(|(_, heard)| power(heard)).collect();
    let in_time = spearman(&slid, &heard);
    // A tenth of a second late it is a worse account of the motion, and backwards it is none.
    let late = spearman(&slid[4..], &heard[..heard.len() - 4]);
    let backwards: Vec<f64> = heard.iter().rev().copied().collect();
    let none = spearman(&slid, &backwards);
    println!("level against speed: {in_time:.3}, {late:.3} a tenth of a second late, {none:.3} backwards");
    assert!(in_time > 0.92 && late < in_time - 0.01 && none < 0.3, "{in_time} {late} {none}");
}

#[test]
fn the_level_of_friction_is_that_of_the_model_for_the_area_that_slides() {
    // The sheet of 1.4 m by 1.4 m at the level of the example; overlapping clips are half of each.
    let area = 1.4 * 1.4 / TAKE.speeds[0].len() as f64 / 1e-4;
    let of_clip = |clip: &[f32]| {
        let sliding = clip.iter().filter(|s| **s > 0.0);
        sliding.map(|s| TAKE.model.power(f64::from(*s))).sum::<f64>()
    };
    let mut off: Vec<f64> = between()
        .map(|(speeds, heard)| (0.25 * area * 0.5 * speeds.map(of_clip).iter().sum::<f64>(), power(heard)))
        .filter(|(wanted, _)| *wanted > 0.0)
        .map(|(wanted, heard)| 10.0 * (heard / wanted).log10())
        .collect();
    off.sort_by(f64::total_cmp);
    let (low, middle, high) = (off[0], off[off.len() / 2], off[off.len() - 1]);
    println!("level against the model: {low:.1} to {high:.1} dB, {middle:.2} dB in the middle");
    assert!(low > -3.0 && high < 3.0 && middle.abs() < 0.4, "{low} {middle} {high}");
}

/// Level of two sheets that slide on each other at 0.3 m/s, dB, with a number of vertices to a side.
fn planes(vertices: usize) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let side = vertices.to_string();
    let graph = format!(
        "#![schema = \"foley:graph/1\"]
Graph(seed: 1, nodes: {{
    \"planes\": MeshGenerator(kind: Planes, vertices: ({side}, {side}), speed: 0.3, duration: 2.0),
    \"contacts\": ContactDetector(mesh: \"planes\", radius: 0.02),
    \"speed\": SlidingSpeed(contacts: \"contacts\", rate: 40),
    \"model\": FrictionModelFile(path: \"cotton.friction.json\"),
    \"friction\": IftNoise(speeds: \"speed\", model: \"model\", rate: 48000),
    \"out\": WavOut(audio: \"friction\", path: \"planes.wav\", format: Float32),
}})"
    );
    std::fs::write(folder.path().join("planes.ron"), graph).unwrap();
    std::fs::copy("graphs/assets/cloth/cotton.friction.json", folder.path().join("cotton.friction.json"))
        .unwrap();
    foley(folder.path(), &["run", folder.path().join("planes.ron").to_str().unwrap()]);
    let audio = wav(&folder.path().join("planes.wav"));
    10.0 * power(&audio[4800..audio.len() - 4800]).log10()
}

#[test]
fn a_mesh_of_four_times_as_many_vertices_is_as_loud() {
    let [coarse, fine] = [planes(21), planes(41)];
    assert!((coarse - fine).abs() < 0.5, "{coarse} dB, refined {fine} dB");
}
