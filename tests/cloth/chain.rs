//! The chain from a target to recorded units on sounds whose causes are known: friction gets friction, crumples get
//! crumples, silence gets silence, in time, and a warp holds for another target of the same kind. The targets are synthetic sounds, and
//! that of a motion whose slips and snaps are known.

use crate::common;
use crate::common::{npy, scene, wav};
use foley_nodes::core::random::Random;
use foley_nodes::friction::FrictionModel;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

const RATE: u32 = 48_000;
const UNIT: usize = 200;

/// Samples of a number of seconds.
fn samples(seconds: f64) -> usize {
    (seconds * f64::from(RATE)) as usize
}

/// Dull noise whose level goes up and down twice a second.
fn friction(seed: u64, seconds: f64, gain: f64, colour: f64) -> Vec<f32> {
    let random = Random::new(seed, "friction");
    let mut low = 0.0;
    (0..samples(seconds))
        .map(|i| {
            let time = i as f64 / f64::from(RATE);
            low += colour * (random.uniform(0, i as u64, 0) - 0.5 - low);
            let level = 10f64.powf(0.8 * ((TAU * 2.0 * time + seed as f64).sin() - 1.0));
            (gain * level * low) as f32
        })
        .collect()
}

/// A bright burst of 12.5 ms.
fn burst(random: &Random, number: u64, gain: f64) -> impl Iterator<Item = f32> {
    let noise = move |k: u64| random.uniform(2, number * 1000 + k, 0) - 0.5;
    let mut last = 0.0;
    (0..600).map(move |k| {
        let step = noise(k) - last;
        last += step;
        (gain * (-0.012 * k as f64).exp() * step) as f32
    })
}

/// Bright bursts, about thirty a second, few of them strong.
fn crumples(seed: u64, seconds: f64, gain: f64) -> Vec<f32> {
    let random = Random::new(seed, "crumples");
    let mut out = vec![0.0; samples(seconds)];
    for number in 0..(30.0 * seconds) as u64 {
        let start = (random.uniform(1, number, 0) * out.len() as f64) as usize;
        let energy = (1.0 - random.uniform(1, number, 1)).powf(-0.4).min(6.0);
        out.iter_mut().skip(start).zip(burst(&random, number, gain * energy)).for_each(|(x, y)| *x += y);
    }
    out
}

fn hush(seed: u64, seconds: f64) -> Vec<f32> {
    let random = Random::new(seed, "hush");
    (0..samples(seconds)).map(|i| (4e-4 * (random.uniform(0, i as u64, 0) - 0.5)) as f32).collect()
}

fn write(folder: &Path, name: &str, samples: &[f32]) {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: RATE,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(folder.join(name), spec).unwrap();
    samples.iter().for_each(|&x| writer.write_sample(x).unwrap());
    writer.finalize().unwrap();
}

/// Friction, silence, crumples, silence.
fn target(seed: u64) -> Vec<f32> {
    let silence = vec![0.0; samples(0.9)];
    [friction(seed, 1.6, 3.0, 0.12), silence.clone(), crumples(seed, 1.6, 0.1), silence].concat()
}

/// A graph whose target some nodes make, between other parts of it.
fn graph(subs: &str, target: &str, warp: &str) -> String {
    format!(
        "#![schema = \"foley:graph/1\"]
        Graph(use: {{ {subs} }}, nodes: {{
            \"database\": UnitDatabase(
                recordings: [\"friction.wav\", \"crumple.wav\", \"silence.wav\"],
                tags: [\"friction\", \"crumple\", \"silence\"],
                widths: [10, 10, 10],
                augment: Some(false),
            ),
            {target}
            \"mfcc\": Mfcc(audio: \"target\"),
            \"features\": TemporalGaussian(features: \"mfcc.features\", widths: [10, 10, 10]),
            {warp}
            \"warped\": TpsWarp(features: \"features\", warp: \"warp\"),
            \"selector\": UnitSelector(features: \"warped\", database: \"database\", d_max: 3.0),
            \"audio\": UnitConcatenator(picks: \"selector\", database: \"database\", target: \"target\"),
            \"out\": WavOut(audio: \"audio\", path: \"out.wav\", format: Float32),
        }})"
    )
}

const RECORDED: &str = "\"target\": WavIn(path: \"target.wav\"),";

const FITTED: &str = "\"pairs\": CorrespondenceSet(path: \"pairs.ron\"),
    \"warp\": TpsFit(features: \"features\", database: \"database\", pairs: \"pairs\", lambda: 100.0),";

/// Moments by their sound: loud, middling and soft friction, strong crumples, silence.
const PAIRS: &str = "Correspondences(pairs: [
    (target: 0.08, source: 0, database: 0.08, duration: 0.1),
    (target: 0.2, source: 0, database: 0.2, duration: 0.1),
    (target: 0.33, source: 0, database: 0.33, duration: 0.1),
    (target: 2.7, source: 1, database: 0.5, duration: 0.2),
    (target: 3.3, source: 1, database: 1.5, duration: 0.2),
    (target: 2.0, source: 2, database: 0.5, duration: 0.1),
])";

/// Runs `graph.ron` of a folder, which gets the picks as `picks.npy`.
fn run(folder: &Path, more: &[&str]) -> serde_json::Value {
    let graph = folder.join("graph.ron").display().to_string();
    let picks = format!("selector={}", folder.join("picks.npy").display());
    common::foley(folder, &[&["run", &graph, "--tap", &picks], more].concat())
}

/// The chosen units: the first of the numbers of each item.
fn picks(folder: &Path) -> Vec<usize> {
    npy(&fs::read(folder.join("picks.npy")).unwrap()).iter().map(|item| item[0] as usize).collect()
}

fn heard(folder: &Path) -> Vec<f32> {
    wav(&folder.join("out.wav"))
}

/// The recordings of both causes and of silence: 720, 720 and 360 units.
fn record(folder: &Path) {
    write(folder, "friction.wav", &friction(1, 3.0, 0.6, 0.2));
    write(folder, "crumple.wav", &crumples(1, 3.0, 0.03));
    write(folder, "silence.wav", &hush(1, 1.5));
}

fn decibels(x: &[f32]) -> f64 {
    let square: f64 = x.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
    10.0 * (square / x.len() as f64 + 1e-12).log10()
}

/// Share of the picks of a stretch of the target that lie in a stretch of units, where the target is above a level.
fn share(target: &[f32], picks: &[usize], time: [f64; 2], level: f64, units: std::ops::Range<usize>) -> f64 {
    let [from, to] = time.map(|t| samples(t) / UNIT);
    // Between two bursts there is silence, and it may be followed by silence.
    let sounds = |i: &usize| decibels(&target[(i - 2) * UNIT..(i + 3) * UNIT]) >= level;
    let stretch: Vec<usize> = (from..to).filter(sounds).map(|i| picks[i]).collect();
    stretch.iter().filter(|unit| units.contains(unit)).count() as f64 / stretch.len() as f64
}

/// Milliseconds by which one sound's level lags behind another's.
fn lag(target: &[f32], out: &[f32]) -> f64 {
    let step = samples(0.001);
    let level = |x: &[f32]| -> Vec<f64> { x.windows(20 * step).step_by(step).map(decibels).collect() };
    let (a, b) = (level(target), level(out));
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (ma, mb) = (mean(&a), mean(&b));
    let at = |lag: i32| -> f64 {
        let pair = |i: i32| Some((a.get(i as usize)?, b.get(usize::try_from(i + lag).ok()?)?));
        (100..a.len() as i32 - 100).filter_map(pair).map(|(x, y)| (x - ma) * (y - mb)).sum()
    };
    (-80..80).max_by(|&x, &y| at(x).total_cmp(&at(y))).map_or(f64::NAN, f64::from)
}

#[test]
fn every_cause_is_followed_by_its_own_recordings_in_time() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    record(folder);
    write(folder, "target.wav", &target(1));
    fs::write(folder.join("pairs.ron"), PAIRS).unwrap();
    fs::write(folder.join("graph.ron"), graph("", RECORDED, FITTED)).unwrap();
    let known = format!("warp={}", folder.join("known.json").display());
    let report = run(folder, &["--tap", &known, "--threads", "1"]);
    let (chosen, out) = (picks(folder), heard(folder));

    let reported = format!("{report:#}");
    let right = [
        share(&target(1), &chosen, [0.05, 1.55], -60.0, 0..720),
        share(&target(1), &chosen, [1.7, 2.4], -200.0, 1440..1800),
        share(&target(1), &chosen, [2.55, 4.05], -40.0, 720..1440),
    ];
    assert!(right.iter().all(|share| *share >= 0.9), "{right:?}\n{reported}");

    // In time, where the level rises and falls.
    let lag = lag(&target(1)[..samples(1.6)], &out[..samples(1.6)]);
    assert!(lag.abs() <= 10.0, "{lag} ms");

    // Silence is at the level of the recordings' own at first, and nothing at all after half a second.
    let floor = decibels(&hush(1, 1.5));
    let early = decibels(&out[samples(1.75)..samples(2.05)]);
    assert!((early - floor).abs() < 6.0, "{early} dB, the recordings have {floor} dB");
    assert!(out[samples(2.2)..samples(2.48)].iter().all(|&x| x == 0.0));

    // Another number of threads, the same bits.
    run(folder, &["--threads", "2"]);
    assert!(heard(folder).iter().map(|x| x.to_bits()).eq(out.iter().map(|x| x.to_bits())));

    // The warp holds for another target of the same kind.
    write(folder, "target.wav", &target(7));
    fs::write(folder.join("graph.ron"), graph("", RECORDED, "\"warp\": WarpFile(path: \"known.json\"),"))
        .unwrap();
    let report = run(folder, &[]);
    let fallbacks = report["nodes"]["selector"]["summary"]["fallback_share"].as_f64().unwrap();
    assert!(fallbacks < 0.1, "{fallbacks}");
    let chosen = picks(folder);
    let right = [
        share(&target(7), &chosen, [0.05, 1.55], -60.0, 0..720),
        share(&target(7), &chosen, [2.55, 4.05], -40.0, 720..1440),
    ];
    assert!(right.iter().all(|share| *share >= 0.9), "{right:?}");
}

/// Sound of the motion, with both of its parts as files of their own; crumples begin with their frame.
fn scene_graph() -> String {
    let graphs = common::graphs().display().to_string();
    let subs = format!(
        "\"moved\": Sub(path: \"{graphs}/lib/target.ron\", params: {{
            \"mesh\": \"cloth\", \"bodies\": [\"floor\"], \"model\": \"model\", \"bank\": \"bank\", \"radius\": 0.016,
        }}),"
    );
    let target = format!(
        "\"cloth\": MeshSequence(path: \"cloth.pc2\", fps: 60),
        \"floor\": MeshSequence(path: \"floor.obj\"),
        \"model\": FrictionModelFile(path: \"{graphs}/assets/cloth/cotton.friction.json\"),
        \"bank\": CrumpleExtractor(recordings: [\"clicks.wav\"], threshold: 0.00001, window: 0.002),
        \"target\": Mix(inputs: [\"moved.sound\"]),
        \"slides\": WavOut(audio: \"moved.friction\", path: \"slides.wav\", format: Float32),
        \"snaps\": WavOut(audio: \"moved.crumple\", path: \"snaps.wav\", format: Float32),"
    );
    graph(&subs, &target, FITTED)
}

/// Moments of the scene: the three speeds, snaps, and stillness.
const SCENE_PAIRS: &str = "Correspondences(pairs: [
    (target: 0.65, source: 0, database: 0.33, duration: 0.1),
    (target: 1.05, source: 0, database: 0.2, duration: 0.1),
    (target: 1.45, source: 0, database: 0.08, duration: 0.1),
    (target: 2.8, source: 1, database: 0.5, duration: 0.2),
    (target: 3.4, source: 1, database: 1.5, duration: 0.2),
    (target: 2.1, source: 2, database: 0.5, duration: 0.1),
])";

/// Eight bursts, apart, each stronger than the last.
fn clicks() -> Vec<f32> {
    let random = Random::new(1, "clicks");
    let apart = |k: u64| burst(&random, k, 0.05 * 1.3_f64.powi(k as i32)).chain(vec![0.0; samples(0.1)]);
    (0..8).flat_map(apart).collect()
}

/// Times in s at which a sound follows 5 ms of silence.
fn onsets(x: &[f32]) -> Vec<f64> {
    let (mut found, mut silent) = (Vec::new(), usize::MAX);
    for (n, x) in x.iter().enumerate() {
        if *x != 0.0 && silent >= samples(0.005) {
            found.push(n as f64 / f64::from(RATE));
        }
        silent = if *x == 0.0 { silent.saturating_add(1) } else { 0 };
    }
    found
}

/// A part of a sound.
fn between(x: &[f32], from: f64, to: f64) -> &[f32] {
    &x[samples(from)..samples(to).min(x.len())]
}

#[test]
fn a_motion_is_heard_when_it_slips_and_snaps_as_loud_as_it_is_fast_and_not_at_all_while_it_is_still() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    scene::write(folder);
    record(folder);
    write(folder, "clicks.wav", &clicks());
    fs::write(folder.join("pairs.ron"), SCENE_PAIRS).unwrap();
    fs::write(folder.join("graph.ron"), scene_graph()).unwrap();
    let graphs = common::graphs();
    let report =
        run(folder, &["--set", "moved.crumple.jitter=Off", "--allow-read", graphs.to_str().unwrap()]);
    let [slides, snaps, out] = ["slides.wav", "snaps.wav", "out.wav"].map(|file| wav(&folder.join(file)));

    // Nothing but the slide is friction, and nothing but snaps is crumples. A clip of 50 ms is taken at its middle.
    let still = |x: &[f32], from: f64, to: f64| between(x, from, to).iter().all(|x| *x == 0.0);
    assert!(still(&slides, 0.0, 0.45) && still(&slides, 1.75, 5.0));
    let times: Vec<f64> = scene::snaps().iter().map(|frame| *frame as f64 / scene::FPS).collect();
    let found = onsets(&snaps);
    assert_eq!(found.len(), times.len(), "{found:?}, {times:?}");
    let late = found.iter().zip(&times).map(|(found, time)| 1e3 * (found - time));
    let late = late.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)]);
    println!("{} snaps are heard {:.2} to {:.2} ms late", times.len(), late[0], late[1]);
    assert!(late.iter().all(|ms| ms.abs() <= 10.0), "{late:?}");

    // Friction is as loud as the model has the area of the patch at each speed.
    let model = fs::read(graphs.join("assets/cloth/cotton.friction.json")).unwrap();
    let model: FrictionModel = serde_json::from_slice(&model).unwrap();
    for ([from, to], speed) in scene::SLIDES {
        let level = decibels(between(&slides, from + 0.05, to - 0.05));
        let wanted = 10.0 * (scene::AREA / 1e-4 * model.power(speed)).log10();
        println!("at {speed} m/s {level:.2} dB, the model has {wanted:.2} dB");
        assert!((level - wanted).abs() < 1.0, "{speed} m/s: {level} dB, not {wanted} dB");
    }

    // The concatenated sound: each cause has its own recordings, in time.
    let chosen = picks(folder);
    let right = [
        share(&slides, &chosen, [0.1, 4.9], -60.0, 0..720),
        share(&snaps, &chosen, [0.1, 4.9], -50.0, 720..1440),
    ];
    let lags = [(&slides, 0.3, 1.9), (&snaps, 2.4, 4.4)]
        .map(|(cause, from, to)| lag(between(cause, from, to), between(&out, from, to)));
    println!("shares of their own recordings {right:.3?}, late by {lags:?} ms");
    assert!(right.iter().all(|share| *share >= 0.9), "{right:?}\n{report:#}");
    assert!(lags.iter().all(|ms| ms.abs() <= 10.0), "{lags:?}");

    // Stillness has the level of the recordings' own at first, and is nothing at all after half a second.
    assert!(still(&out, 0.1, 0.4) && still(&out, 2.28, 2.5) && still(&out, 4.9, 5.0));
    let (early, floor) = (decibels(between(&out, 1.9, 2.15)), decibels(&hush(1, 1.5)));
    assert!((early - floor).abs() < 6.0, "{early} dB, the recordings have {floor} dB");
}
