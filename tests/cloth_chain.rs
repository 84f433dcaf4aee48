//! The chain from a target to recorded units on synthetic sounds whose causes are known: friction gets friction, crumples get
//! crumples, silence gets silence, in time, and a warp holds for another target of the same kind.

use foley_nodes::core::random::Random;
use foley_nodes::io::AudioReader;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;
use std::process::Command;

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

/// Bright bursts, about thirty a second, few of them strong.
fn crumples(seed: u64, seconds: f64, gain: f64) -> Vec<f32> {
    let random = Random::new(seed, "crumples");
    let mut out = vec![0.0; samples(seconds)];
    for burst in 0..(30.0 * seconds) as u64 {
        let start = (random.uniform(1, burst, 0) * out.len() as f64) as usize;
        let energy = (1.0 - random.uniform(1, burst, 1)).powf(-0.4).min(6.0);
        let mut last = 0.0;
        for (k, x) in out.iter_mut().skip(start).take(600).enumerate() {
            let noise = random.uniform(2, burst * 1000 + k as u64, 0) - 0.5;
            *x += (gain * energy * (-0.012 * k as f64).exp() * (noise - last)) as f32;
            last = noise;
        }
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

fn graph(warp: &str) -> String {
    format!(
        "#![schema = \"foley:graph/1\"]
        Graph(nodes: {{
            \"database\": UnitDatabase(
                recordings: [\"friction.wav\", \"crumple.wav\", \"silence.wav\"],
                tags: [\"friction\", \"crumple\", \"silence\"],
                widths: [10, 10, 10],
            ),
            \"target\": WavIn(path: \"target.wav\"),
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

const FITTED: &str = "\"pairs\": CorrespondenceSet(path: \"pairs.ron\"),
    \"warp\": TpsFit(features: \"features\", database: \"database\", pairs: \"pairs\", lambda: 100.0),";

/// Moments by what they sound of: loud, middling and soft friction, strong crumples, silence.
const PAIRS: &str = "Correspondences(pairs: [
    (target: 0.08, source: 0, database: 0.08, duration: 0.1),
    (target: 0.2, source: 0, database: 0.2, duration: 0.1),
    (target: 0.33, source: 0, database: 0.33, duration: 0.1),
    (target: 2.7, source: 1, database: 0.5, duration: 0.2),
    (target: 3.3, source: 1, database: 1.5, duration: 0.2),
    (target: 2.0, source: 2, database: 0.5, duration: 0.1),
])";

fn run(folder: &Path, more: &[&str]) -> serde_json::Value {
    let report = folder.join("report.json");
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(folder).args(["run", "graph.ron", "--out", ".", "--no-cache", "--quiet"]);
    command.args(["--report", "report.json", "--tap", "selector=picks.npy"]).args(more);
    let ran = command.output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    serde_json::from_slice(&fs::read(report).unwrap()).unwrap()
}

/// The chosen units: the first of four numbers of each item of a NPY file.
fn picks(folder: &Path) -> Vec<usize> {
    let bytes = fs::read(folder.join("picks.npy")).unwrap();
    let head = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let number = |item: &[u8]| f32::from_le_bytes([item[0], item[1], item[2], item[3]]) as usize;
    bytes[head..].chunks_exact(16).map(number).collect()
}

fn heard(folder: &Path) -> Vec<f32> {
    let file = fs::File::open(folder.join("out.wav")).unwrap();
    AudioReader::open(Box::new(file)).unwrap().read_mono().unwrap()
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
    write(folder, "friction.wav", &friction(1, 3.0, 0.6, 0.2));
    write(folder, "crumple.wav", &crumples(1, 3.0, 0.03));
    write(folder, "silence.wav", &hush(1, 1.5));
    write(folder, "target.wav", &target(1));
    fs::write(folder.join("pairs.ron"), PAIRS).unwrap();
    fs::write(folder.join("graph.ron"), graph(FITTED)).unwrap();
    let report = run(folder, &["--tap", "warp=known.json", "--threads", "1"]);
    let (chosen, out) = (picks(folder), heard(folder));

    // 720 units of friction, 720 of crumples, 360 of silence.
    let told = format!("{report:#}");
    let right = [
        share(&target(1), &chosen, [0.05, 1.55], -60.0, 0..720),
        share(&target(1), &chosen, [1.7, 2.4], -200.0, 1440..1800),
        share(&target(1), &chosen, [2.55, 4.05], -40.0, 720..1440),
    ];
    assert!(right.iter().all(|share| *share >= 0.9), "{right:?}\n{told}");

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
    fs::write(folder.join("graph.ron"), graph("\"warp\": WarpFile(path: \"known.json\"),")).unwrap();
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
