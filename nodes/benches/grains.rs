//! Time of cutting recordings into grains, of correlating recordings with grains, and of grains that play.
//!
//! Run with `cargo bench -p foley-nodes -- grains`. The case of the paper (Picard et al. 2009) is 94 recordings of 7.3 million samples and
//! 5171 grains, which took 11 minutes and 4 hours. By default every eighth recording is correlated; `FOLEY_GRAINS_WHOLE=1` does all.
//! Real recordings are those of the data beside the repository, or at `FOLEY_DATA`.

use super::common::{folder, load};
use foley_nodes::core::computation::NotStored;
use foley_nodes::core::random::Rng;
use foley_nodes::grain::correlation::{CorrelateRules, correlate, memory};
use foley_nodes::grain::dictionary::{ExtractRules, extract};
use foley_nodes::grain::recording::{Component, GrainRecording, GrainRecordings, Part, SourceKind};
use foley_nodes::grain::synthesis::{GrainSegment, GrainStep, segments};
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::time::Instant;

const RATE: f64 = 44_100.0;
const RECORDINGS: usize = 94;
const SAMPLES: usize = 7_300_000;

/// Impacts at random times, each of a few modes and a burst of noise.
fn recording(rng: &mut Rng, n: usize, k: usize) -> GrainRecording {
    let mut x = vec![0.0_f32; n];
    let mut at = 0;
    while at < n {
        let gain = rng.between(0.05, 0.6);
        let modes: Vec<[f64; 3]> = (0..6)
            .map(|_| {
                [rng.between(300.0, 9000.0) * TAU / RATE, rng.between(20.0, 200.0) / RATE, rng.uniform()]
            })
            .collect();
        let decay = rng.between(30.0, 200.0) / RATE;
        for (i, y) in x[at..].iter_mut().take(12_000).enumerate() {
            let t = i as f64;
            let ring: f64 = modes.iter().map(|[w, d, a]| a * (-d * t).exp() * (w * t).sin()).sum();
            *y += (gain * (0.3 * ring + (-decay * t).exp() * rng.between(-1.0, 1.0))) as f32;
        }
        at += 500 + rng.below(9000);
    }
    GrainRecording {
        name: format!("{k}.wav"),
        kind: SourceKind::Impulsive,
        parts: vec![Part { component: Component::Whole, channels: vec![x] }],
        ..GrainRecording::default()
    }
}

/// Recordings of impacts and contacts of the data, at the rate.
fn real_recordings() -> GrainRecordings {
    let files = ["recordings/impact", "recordings/contact"].map(folder).map(std::fs::read_dir);
    let mut paths: Vec<PathBuf> =
        files.into_iter().flatten().flatten().flatten().map(|entry| entry.path()).collect();
    paths.sort();
    let recording = |path: PathBuf| {
        let name = path.file_name()?.to_string_lossy().into_owned();
        let (rate, x) = load(path)?;
        let part = Part { component: Component::Whole, channels: vec![x] };
        (rate == RATE).then(|| GrainRecording { name, parts: vec![part], ..GrainRecording::default() })
    };
    GrainRecordings { rate: RATE, recordings: paths.into_iter().filter_map(recording).collect() }
}

/// Real recordings with and without pruning, on one thread.
fn pruning() {
    let all = real_recordings();
    let (dictionary, _) = extract(&all, &ExtractRules::at_rate(RATE));
    let samples: usize = all.recordings.iter().map(GrainRecording::len).sum();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut found = Vec::new();
    for prune in [false, true] {
        let start = Instant::now();
        let rules = CorrelateRules { prune, ..CorrelateRules::default() };
        found.push(pool.install(|| correlate(&all, &dictionary, &rules, &|_| false, &NotStored)));
        println!(
            "{} real recordings, {samples} samples, with their {} grains, one thread, {} pruning: {:.1} s",
            all.recordings.len(),
            dictionary.len(),
            if prune { "with" } else { "without" },
            start.elapsed().as_secs_f64()
        );
    }
    println!("the same patterns: {}", found[0] == found[1]);
}

pub fn bench() {
    pruning();
    let threads = rayon::current_num_threads();
    let mut rng = Rng::new(1);
    let recordings: Vec<GrainRecording> =
        (0..RECORDINGS).map(|k| recording(&mut rng, SAMPLES / RECORDINGS, k)).collect();
    let all = GrainRecordings { rate: RATE, recordings };

    let mut rules = ExtractRules::at_rate(RATE);
    // Grains of about the mean length of the paper's, 1126 samples.
    rules.segments.sigma = 4.5;
    let start = Instant::now();
    let (dictionary, _) = extract(&all, &rules);
    println!(
        "segmentation and extraction of 165 s: {:.2} s on {threads} threads; {} grains, mean {:.0} samples, {:.1} MB",
        start.elapsed().as_secs_f64(),
        dictionary.len(),
        dictionary.mean_len(),
        dictionary.bytes() as f64 / 1e6
    );

    let whole = std::env::var_os("FOLEY_GRAINS_WHOLE").is_some();
    let part = GrainRecordings {
        rate: RATE,
        recordings: all.recordings.iter().step_by(if whole { 1 } else { 8 }).cloned().collect(),
    };
    let samples: usize = part.recordings.iter().map(GrainRecording::len).sum();
    for threads in [1, threads] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let start = Instant::now();
        let patterns = pool
            .install(|| correlate(&part, &dictionary, &CorrelateRules::default(), &|_| false, &NotStored));
        let seconds = start.elapsed().as_secs_f64();
        let peaks: usize = patterns.iter().flat_map(|p| &p.patterns).map(|p| p.peaks.len()).sum();
        let products = samples as f64 * dictionary.len() as f64;
        println!(
            "correlation of {samples} samples with {} grains, {threads} thread(s): {seconds:.1} s, {peaks} peaks; at this rate 7.3 million samples with 5171 grains take {:.0} s; memory {:.1} MB",
            dictionary.len(),
            seconds / products * 7.3e6 * 5171.0,
            memory(&dictionary, samples / part.recordings.len(), threads) as f64 / 1e6
        );
    }

    // Chained grains, one voice after the other.
    let steps: Vec<GrainStep> = (0..dictionary.len())
        .scan(0, |t, grain| {
            let step = GrainStep { grain: grain as u32, t: *t, gain: 1.0 };
            *t += dictionary.grains[grain].window_len() as i64 - i64::from(dictionary.grains[grain].taper[1]);
            Some(step)
        })
        .take(400)
        .collect();
    let chain = segments(&dictionary, &steps);
    let frames = chain.iter().map(GrainSegment::end).max().unwrap_or(0) as usize;
    let mut out = vec![0.0_f32; 512];
    for (name, ratio) in [("as recorded", 1.0), ("shifted in frequency", 1.3)] {
        let chain: Vec<GrainSegment> = chain.iter().map(|s| GrainSegment { ratio, ..*s }).collect();
        let start = Instant::now();
        for first in (0..frames).step_by(512) {
            let from = chain.partition_point(|s| s.end() <= first as i64);
            for segment in chain[from..].iter().take_while(|s| s.start < (first + 512) as i64) {
                segment.add(&dictionary, first as i64, 1, &mut out);
            }
        }
        let seconds = start.elapsed().as_secs_f64();
        println!("voices of grains in real time on one core, {name}: {:.0}", frames as f64 / RATE / seconds);
    }
}
