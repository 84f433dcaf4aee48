//! Cost of live use: time from a saved file to its sound, the callback around a swap, and an idle graph per node.
//!
//! `cargo bench -p foley -- live`

use foley::graph::{DirFiles, Limits, LoadOptions, load};
use foley::live::device::{self, Device};
use foley::live::{LiveGraph, Options, Player, PlayerEvent, Reloaded};
use foley::watch::FileWatcher;
use foley_nodes::core::input::NoInputs;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// Tones through gains into a mix: `nodes` nodes in all; `edit` changes one of them.
fn text(nodes: usize, edit: usize) -> String {
    let mut text = String::from("#![schema = \"foley:graph/1\"]\nGraph(nodes: {\n");
    let chains = (nodes - 2) / 3;
    for k in 0..chains {
        let frequency = if k == 0 { 200 + edit % 50 } else { 100 + k };
        let _ = writeln!(text, "\"t{k}\": Tone(frequency: {frequency}.0, rate: 48000, level: 0.01),");
        let _ = writeln!(text, "\"f{k}\": LowPass(audio: \"t{k}\", cutoff: 2000.0),");
        let _ = writeln!(text, "\"g{k}\": Gain(audio: \"f{k}\", gain: 0.5),");
    }
    let ends: Vec<String> = (0..chains).map(|k| format!("\"g{k}\"")).collect();
    let _ = writeln!(text, "\"mix\": Mix(inputs: [{}]),", ends.join(", "));
    let _ = writeln!(text, "\"out\": WavOut(audio: \"mix\", path: \"o.wav\"),\n}})");
    text
}

fn material(path: &Path) -> (LiveGraph, foley::graph::Asked) {
    let loaded = load(path, &LoadOptions::default());
    let files = DirFiles::new(loaded.root, Limits::default());
    let graph = loaded.graph.expect("the graph of this bench is valid");
    let asked = files.asked();
    (LiveGraph { seed: graph.seed, graph, files, memo: None, inputs: Arc::new(NoInputs) }, asked)
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

fn saves() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("main.ron");
    std::fs::write(&path, text(100, 0)).expect("the graph can be written");
    let (first, asked) = material(&path);
    let options = Options { quantum: 128, metered: false, ..Options::default() };
    let (mut player, callback) = Player::start(first, options).expect("the graph can play");
    let shared = Arc::clone(player.shared());
    let running = device::start(&Device::Null, callback).map_err(|e| e.1).expect("the clock starts");
    let mut watcher = FileWatcher::new(None);
    watcher.watch(&asked, true);
    std::thread::sleep(Duration::from_millis(300));
    let usual = shared.meter.callback.quantile(0.5);
    shared.meter.callback.clear();
    let (mut heard, mut loads) = (Vec::new(), Vec::new());
    for edit in 1..=60 {
        while player.is_busy() {
            player.tick();
            std::thread::sleep(Duration::from_millis(2));
        }
        std::thread::sleep(Duration::from_millis(37));
        let saved = Instant::now();
        let temporary = folder.path().join("main.ron~");
        std::fs::write(&temporary, text(100, edit)).expect("the graph can be written");
        std::fs::rename(&temporary, &path).expect("the graph can be renamed");
        while watcher.changed().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        let start = Instant::now();
        let (next, _) = material(&path);
        let reported = player.load(next).expect("the graph can be loaded");
        assert!(matches!(reported, Reloaded::Edit(_)));
        loads.push(start.elapsed().as_secs_f64() * 1e3);
        while !player.tick().iter().any(|reported| matches!(reported, PlayerEvent::Swapped)) {
            std::thread::sleep(Duration::from_micros(300));
        }
        heard.push(saved.elapsed().as_secs_f64() * 1e3);
    }
    let _ = running.stop();
    heard.sort_by(f64::total_cmp);
    loads.sort_by(f64::total_cmp);
    println!("100 nodes, quantum 128 at 48 kHz, clock without a card, 60 saves by rename:");
    println!(
        "  file saved -> new audio out: median {:.1} ms, p95 {:.1} ms",
        quantile(&heard, 0.5),
        quantile(&heard, 0.95)
    );
    println!(
        "  of which load, check, plan, build, swap laid out: median {:.1} ms, p95 {:.1} ms",
        quantile(&loads, 0.5),
        quantile(&loads, 0.95)
    );
    let meter = &shared.meter;
    println!(
        "  callback: median {:.1} us before the edits; with them median {:.1} us, worst {:.1} us of {:.0} us; missed {}, overruns {}",
        usual.as_secs_f64() * 1e6,
        meter.callback.quantile(0.5).as_secs_f64() * 1e6,
        meter.callback.worst().as_secs_f64() * 1e6,
        128.0 / 48_000.0 * 1e6,
        meter.missed.load(Relaxed),
        meter.overruns.load(Relaxed)
    );
}

/// The callback around a swap, without a clock that other work can disturb.
fn swaps() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("main.ron");
    let load_text = |edit: usize| {
        std::fs::write(&path, text(100, edit)).expect("the graph can be written");
        material(&path).0
    };
    let options = Options { quantum: 128, threads: 0, ..Options::default() };
    let (mut player, mut callback) = Player::start(load_text(0), options).expect("the graph can play");
    let mut block = vec![0.0; 128 * callback.channels()];
    let (mut usual, mut swapping) = (Vec::new(), Vec::new());
    for edit in 1..=200 {
        for _ in 0..20 {
            let start = Instant::now();
            callback.fill(&mut block);
            usual.push(start.elapsed().as_secs_f64() * 1e6);
        }
        player.load(load_text(edit)).expect("the graph can be loaded");
        while player.is_busy() {
            let start = Instant::now();
            callback.fill(&mut block);
            swapping.push(start.elapsed().as_secs_f64() * 1e6);
            player.tick();
        }
    }
    usual.sort_by(f64::total_cmp);
    swapping.sort_by(f64::total_cmp);
    println!("callback of 100 nodes, 128 frames, 200 edits:");
    for (what, times) in [("between edits", &usual), ("from edit to settled", &swapping)] {
        println!(
            "  {what}: median {:.1} us, p99 {:.1} us, worst {:.1} us",
            quantile(times, 0.5),
            quantile(times, 0.99),
            quantile(times, 1.0)
        );
    }
}

fn idle() {
    for nodes in [101, 1001] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("main.ron");
        let mut text = String::from(
            "#![schema = \"foley:graph/1\"]\nGraph(nodes: {\n\"g0\": Tone(frequency: 0.0, rate: 48000, level: 0.0),\n",
        );
        for k in 1..nodes {
            let _ = writeln!(text, "\"g{k}\": Gain(audio: \"g{}\"),", k - 1);
        }
        let _ = writeln!(text, "\"out\": WavOut(audio: \"g{}\", path: \"o.wav\"),\n}})", nodes - 1);
        std::fs::write(&path, text.replace("frequency: 0.0", "frequency: 1.0"))
            .expect("the graph can be written");
        let options = Options { quantum: 128, threads: 0, ..Options::default() };
        let (_player, mut callback) = Player::start(material(&path).0, options).expect("the graph can play");
        let mut block = vec![0.0; 128 * callback.channels()];
        let best = (0..2000)
            .map(|_| {
                let start = Instant::now();
                callback.fill(&mut block);
                start.elapsed().as_secs_f64()
            })
            .fold(f64::INFINITY, f64::min);
        println!(
            "idle graph of {nodes} nodes: {:.1} ns per node and window of 128 frames",
            best * 1e9 / nodes as f64
        );
    }
}

pub fn bench() {
    swaps();
    idle();
    saves();
}
