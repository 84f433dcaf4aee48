//! A graph that is edited while it plays.

use super::stand::{OUT, Stand, graph, material, offline};
use crate::common;
use foley::graph::{DirFiles, Limits, LoadOptions, load_text};
use foley::live::{LiveGraph, Options, Player, Reloaded};
use foley::plan::PlanOptions;
use foley_nodes::core::input::NoInputs;
use foley_nodes::core::random::Rng;
use std::fs::File;

/// The frames from one time to another, in seconds.
fn part(heard: &[f32], from: f64, to: f64) -> &[f32] {
    assert!(heard.len() as f64 / 44_100.0 >= to, "only {} samples", heard.len());
    &heard[(from * 44_100.0) as usize..(to * 44_100.0) as usize]
}

fn greatest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn greatest_step(heard: &[f32]) -> f32 {
    heard.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
}

#[test]
fn a_number_that_changes_moves_the_node_that_plays() {
    let with = |gain: f64| {
        graph(&format!(
            "\"a\": Tone(frequency: 200.0, rate: 44100, level: 0.5), \"last\": Gain(audio: \"a\", gain: {gain}), {OUT}"
        ))
    };
    let mut stand = Stand::new(&with(1.0), 128);
    stand.play(10_000, 128);
    let Reloaded::Edit(edit) = stand.load(&with(0.25)) else { panic!("nothing changed") };
    assert_eq!((edit.kept, edit.retuned), (2, vec!["last".to_owned()]));
    stand.play(10_000, 128);
    let (a, b) = (offline(&with(1.0), 0.5), offline(&with(0.25), 0.5));
    assert_eq!(stand.heard[..10_000], a[..10_000]);
    assert_eq!(stand.heard[11_000..20_000], b[11_000..20_000]);
    assert!(greatest_step(&stand.heard) < 0.5 * 0.0285 + 0.002);
    assert!(matches!(stand.load(&with(0.25)), Reloaded::Unchanged));
}

#[test]
fn a_node_that_is_put_between_two_others_is_not_heard() {
    let plain = graph(&format!(
        "\"a\": Noise(rate: 44100), \"b\": HighPass(audio: \"a\", cutoff: 90.0), \
         \"last\": Delay(audio: \"b\", seconds: 0.1), {OUT}"
    ));
    let longer = plain.replace("audio: \"b\"", "audio: \"c\"");
    let longer = longer.replace("\"b\": High", "\"c\": Gain(audio: \"b\", gain: 1.0), \"b\": High");
    let mut stand = Stand::new(&plain, 64);
    stand.play(20_000, 64);
    let Reloaded::Edit(edit) = stand.load(&longer) else { panic!("nothing changed") };
    assert_eq!((edit.kept, edit.added, edit.relinked), (3, vec!["c".to_owned()], vec!["last".to_owned()]));
    stand.settle();
    stand.play(20_000, 64);
    // And away again.
    stand.load(&plain);
    stand.settle();
    stand.play(4000, 64);
    let wanted = offline(&plain, 1.2);
    let first = stand.heard.iter().zip(&wanted).position(|(a, b)| (a - b).abs() > 1e-6);
    assert_eq!(first, None, "of {}", stand.heard.len());
}

#[test]
fn one_sound_fades_into_another_without_a_step() {
    let tone = |f: f64| graph(&format!("\"last\": Tone(frequency: {f}, rate: 44100, level: 0.5), {OUT}"));
    let mut stand = Stand::new(&tone(100.0), 128);
    stand.play(22_050, 128);
    let Reloaded::Edit(edit) = stand.load(&tone(150.0)) else { panic!("nothing changed") };
    assert_eq!(edit.rebuilt, ["last"]);
    stand.settle();
    stand.play(22_050, 128);
    let after = offline(&tone(150.0), 1.2);
    assert_eq!(
        part(&stand.heard, 0.6, 1.0),
        part(&after, 0.6, 1.0),
        "the new tone is where it would have been"
    );
    assert!(greatest_step(&stand.heard) < 0.5 * 0.0214 * 1.5, "{}", greatest_step(&stand.heard));
}

#[test]
fn a_surface_takes_another_image_size_strength_and_material_without_a_click() {
    let with = |image: &str, scale: f64, kappa: f64, recording: &str| {
        graph(&format!(
            "\"s\": ImageLuma(path: \"../assets/images/{image}.png\"), \"m\": SobelMap(luma: \"s\"), \
             \"k\": LevelMatcher(map: \"m\", kappa: {kappa}), \
             \"w\": Stroke(shape: Circle, from: (0.3, 0.3), radius: 0.1, laps: 40.0, speed: 0.5), \
             \"f\": MapExcitation(paths: \"w\", map: \"m\", kappa: \"k.full\", scale: {scale}, rate: 44100), \
             \"r\": ModalFromRecording(recording: \"../assets/recordings/{recording}.flac\"), \
             \"last\": ModalBank(forces: [\"f\"], modes: \"r\", gain: 10.0), {OUT}"
        ))
    };
    let edits = [
        with("sk_brick", 1.3, 1.0, "drum_cowbell"),
        with("sk_brick", 1.3, 0.4, "drum_cowbell"),
        with("sk_gravel", 1.3, 0.4, "drum_cowbell"),
        with("sk_gravel", 1.3, 0.4, "glass_hit_a1"),
    ];
    let mut stand = Stand::new(&with("sk_brick", 1.0, 1.0, "drum_cowbell"), 128);
    stand.play(22_050, 128);
    for edit in &edits {
        let at = stand.heard.len();
        let Reloaded::Edit(_) = stand.load(edit) else { panic!("nothing changed") };
        stand.settle();
        let settled = stand.heard.len();
        stand.play(22_050, 128);
        let around = greatest_step(&stand.heard[at - 20_000..at]).max(greatest_step(&stand.heard[settled..]));
        let during = greatest_step(&stand.heard[at - 128..settled + 128]);
        assert!(around > 0.0 && during < 4.0 * around, "{during} against {around}\n{edit}");
    }
}

#[test]
fn what_is_read_ahead_goes_on_over_an_edit() {
    let with = |cutoff: f64, start: f64| {
        graph(&format!(
            "\"a\": WavIn(path: \"../assets/recordings/clothing_rustle_land.flac\", start: {start}), \
             \"m\": Mono(audio: \"a\"), \"last\": LowPass(audio: \"m\", cutoff: {cutoff}), {OUT}"
        ))
    };
    let mut stand = Stand::new(&with(900.0, 0.0), 128);
    stand.play(2000, 128);
    stand.load(&with(500.0, 0.0));
    stand.settle();
    stand.play(4000, 128);
    let wanted = offline(&with(500.0, 0.0), 1.0);
    let to = stand.heard.len() as f64 / 44_100.0;
    let (a, b) = (part(&stand.heard, to - 0.05, to), part(&wanted, to - 0.05, to));
    assert!(greatest_difference(a, b) < 1e-4);
    // The reader is built again and begins in the middle.
    stand.load(&with(500.0, 0.05));
    stand.settle();
    stand.play(2500, 128);
    let wanted = offline(&with(500.0, 0.05), 1.0);
    let to = stand.heard.len() as f64 / 44_100.0;
    let (a, b) = (part(&stand.heard, to - 0.03, to), part(&wanted, to - 0.03, to));
    assert!(greatest_difference(a, b) < 1e-4);
    assert_eq!(stand.player.shared().meter.missed.load(std::sync::atomic::Ordering::Relaxed), 0);
}

#[test]
fn more_look_ahead_delays_what_follows_and_nothing_else() {
    let plain = graph(&format!(
        "\"a\": Tone(frequency: 110.0, rate: 44100, level: 0.4), \"last\": Gain(audio: \"a\"), {OUT}"
    ));
    let ahead = graph(&format!(
        "\"a\": Tone(frequency: 110.0, rate: 44100, level: 0.4), \"b\": Advance(audio: \"a\", seconds: 0.03), \
         \"last\": Gain(audio: \"b\"), {OUT}"
    ));
    let mut stand = Stand::new(&plain, 128);
    stand.play(10_000, 128);
    stand.load(&ahead);
    stand.settle();
    stand.play(20_000, 128);
    // The sound that is read ahead comes when it would have come anyway, once the path has filled.
    let late = stand.callback.rate().first_at(stand.player.plan().latency) as usize;
    assert_eq!(late, 1323);
    let (from, to) = (20_000, stand.heard.len());
    let shifted = &offline(&ahead, 1.0)[from - late..to - late];
    assert!(greatest_difference(&stand.heard[from..to], shifted) < 1e-6);
    assert!(greatest_step(&stand.heard) < 0.4 * 0.0157 * 2.0, "{}", greatest_step(&stand.heard));
}

#[test]
fn a_graph_that_is_wrong_leaves_the_old_one_playing() {
    let good = graph(&format!("\"last\": Tone(frequency: 110.0, rate: 44100), {OUT}"));
    let mut stand = Stand::new(&good, 128);
    stand.play(5000, 128);
    let wrong = graph(&format!("\"last\": Tone(frequency: 110.0, rate: 48000), {OUT}"));
    let errors = stand.player.load(material(&wrong)).unwrap_err();
    assert_eq!(errors[0].code, "F045");
    let missing = graph(&format!("\"last\": WavIn(path: \"nothing.wav\"), {OUT}"));
    assert!(stand.player.load(material(&missing)).is_err());
    stand.play(5000, 128);
    assert_eq!(stand.heard, offline(&good, 0.3)[..stand.heard.len()]);
}

/// A graph of tones, filters and delays, made and edited at random.
#[derive(Clone)]
struct Sketch {
    /// Frequency of each tone and the nodes behind it.
    chains: Vec<(f64, Vec<(String, String)>)>,
    next: usize,
}

impl Sketch {
    fn new(draw: &mut Rng) -> Self {
        let mut sketch = Self { chains: Vec::new(), next: 0 };
        (0..1 + draw.below(3)).for_each(|_| sketch.add_chain(draw));
        sketch
    }

    fn add_chain(&mut self, draw: &mut Rng) {
        self.chains.push((50.0 + draw.below(200) as f64, Vec::new()));
        for _ in 0..draw.below(4) {
            let last = self.chains.len() - 1;
            self.add_node(last, draw);
        }
    }

    fn add_node(&mut self, chain: usize, draw: &mut Rng) {
        let text = match draw.below(5) {
            0 => format!("Gain(audio: \"@\", gain: {:.3})", draw.between(-1.0, 1.0)),
            1 => format!("HighPass(audio: \"@\", cutoff: {:.1})", draw.between(30.0, 300.0)),
            2 => format!("LowPass(audio: \"@\", cutoff: {:.1})", draw.between(300.0, 3000.0)),
            3 => format!("Delay(audio: \"@\", seconds: {:.4})", draw.between(0.0, 0.05)),
            _ => format!("Advance(audio: \"@\", seconds: {:.4})", draw.between(0.0, 0.02)),
        };
        let nodes = &mut self.chains[chain].1;
        let at = draw.below(nodes.len() + 1);
        nodes.insert(at, (format!("n{}", self.next), text));
        self.next += 1;
    }

    fn edit(&mut self, draw: &mut Rng) {
        let chain = draw.below(self.chains.len());
        let nodes = self.chains[chain].1.len();
        match draw.below(6) {
            0 => self.chains[chain].0 = 50.0 + draw.below(200) as f64,
            1 if self.chains.len() < 4 => self.add_chain(draw),
            2 if self.chains.len() > 1 => drop(self.chains.remove(chain)),
            3 if nodes > 0 => drop(self.chains[chain].1.remove(draw.below(nodes))),
            4 if nodes > 0 => {
                // Another number for a node that is there.
                let at = draw.below(nodes);
                self.add_node(chain, draw);
                let made =
                    self.chains[chain].1.iter().position(|(id, _)| *id == format!("n{}", self.next - 1));
                let (_, text) = self.chains[chain].1.remove(made.unwrap());
                self.chains[chain].1[at].1 = text;
            }
            _ => self.add_node(chain, draw),
        }
    }

    fn text(&self) -> String {
        let mut nodes = String::new();
        let mut ends = Vec::new();
        for (k, (frequency, chain)) in self.chains.iter().enumerate() {
            // A chain is known by its first frequency's place; ids stay with nodes.
            let mut from = format!("tone{k}");
            nodes += &format!("\"{from}\": Tone(frequency: {frequency}, rate: 44100, level: 0.2), ");
            for (id, text) in chain {
                nodes += &format!("\"{id}\": {}, ", text.replace('@', &from));
                from.clone_from(id);
            }
            ends.push(format!("\"{from}\""));
        }
        graph(&format!("{nodes} \"last\": Mix(inputs: [{}]), {OUT}", ends.join(", ")))
    }
}

#[test]
fn after_any_edits_a_graph_plays_as_if_it_had_been_so_from_the_start() {
    for seed in 0..25 {
        let mut draw = Rng::new(seed);
        let mut sketch = Sketch::new(&mut draw);
        let mut stand = Stand::new(&sketch.text(), [32, 128, 441][draw.below(3)]);
        stand.play(draw.below(9000), 100);
        stand.play(2000, 100);
        let (mut log, begun) = (sketch.text(), stand.heard.len());
        for _ in 0..8 {
            sketch.edit(&mut draw);
            stand.settle();
            log += &format!("\n{}: {:?}", stand.heard.len(), stand.load(&sketch.text()));
            stand.play(draw.below(3000), 100);
        }
        stand.settle();
        // Filters and delays forget what was before.
        stand.play(30_000, 100);
        let late = stand.callback.rate().first_at(stand.player.plan().latency) as usize;
        let to = stand.heard.len();
        let wanted = offline(&sketch.text(), to as f64 / 44_100.0 + 0.1);
        let (a, b) = (&stand.heard[to - 2000..], &wanted[to - 2000 - late..to - late]);
        assert!(
            greatest_difference(a, b) < 1e-5,
            "seed {seed}: {}\n{}",
            greatest_difference(a, b),
            sketch.text()
        );
        // A piece may begin with a step.
        let edited = &stand.heard[begun..];
        let step = greatest_step(edited);
        let at = edited.windows(2).position(|w| (w[1] - w[0]).abs() == step);
        assert!(step < 0.12, "seed {seed}: a step of {step} at {at:?}\n{log}");
    }
}

#[test]
fn a_swap_that_comes_too_late_is_tried_again() {
    let with = |k: usize| {
        let chain: String = (1..40).map(|n| format!("\"g{n}\": Gain(audio: \"g{}\"), ", n - 1)).collect();
        graph(&format!(
            "\"g0\": Tone(frequency: {}.0, rate: 44100, level: 0.5), {chain} \"last\": Gain(audio: \"g39\"), {OUT}",
            100 + k % 7
        ))
    };
    let options = Options { quantum: 16, threads: 1, ..Options::default() };
    let (mut player, mut callback) = Player::start(material(&with(0)), options).unwrap();
    let over = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let stopped = std::sync::Arc::clone(&over);
    // Faster than real time, so that the callback is often past the place of a swap before it arrives.
    let played = std::thread::spawn(move || {
        let mut block = vec![0.0; 16];
        let mut loudest = 0.0_f32;
        while !stopped.load(std::sync::atomic::Ordering::Relaxed) {
            callback.fill(&mut block);
            loudest = block.iter().fold(0.0, |m, x| m.max(x.abs()));
            std::thread::yield_now();
        }
        (callback, loudest)
    });
    let late = |player: &Player| player.shared().meter.late_swaps.load(std::sync::atomic::Ordering::Relaxed);
    // The share of late ones depends on the machine: the loop runs until one is late.
    for k in 1..4000 {
        if k > 40 && late(&player) > 0 {
            break;
        }
        while player.is_busy() {
            player.tick();
            std::thread::sleep(std::time::Duration::from_micros(100));
        }
        player.load(material(&with(k))).unwrap();
    }
    while player.is_busy() {
        player.tick();
    }
    over.store(true, std::sync::atomic::Ordering::Relaxed);
    let (mut callback, _) = played.join().expect("the callback never panics");
    let mut block = vec![0.0; 4410];
    callback.fill(&mut block);
    let loudest = block.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    assert!((loudest - 0.5).abs() < 0.01, "{loudest}");
    assert!(late(&player) > 0, "all swaps came in time, so nothing was tried");
}

#[test]
fn after_a_node_has_failed_the_next_load_plays_again() {
    let folder = tempfile::tempdir().unwrap();
    let noise = graph(
        "\"n\": Noise(rate: 44100, duration: Some(20.0)), \"o\": WavOut(audio: \"n\", path: \"o.wav\")",
    );
    let LiveGraph { graph: made, files, .. } = material(&noise);
    common::run_graph(&made, &files, &PlanOptions::default(), folder.path()).unwrap();
    let path = folder.path().join("o.wav");
    let load = |text: &str| {
        let loaded = load_text("test", text, &folder.path().join("test.ron"), &LoadOptions::default());
        let shown = foley::diag::render(&loaded.diagnostics, &loaded.sources, false);
        let graph = loaded.graph.unwrap_or_else(|| panic!("{shown}"));
        let files = DirFiles::new(loaded.root, Limits::default());
        LiveGraph { seed: graph.seed, graph, files, memo: None, inputs: std::sync::Arc::new(NoInputs) }
    };
    let text = |gain: f64| {
        graph(&format!(
            "\"a\": WavIn(path: \"o.wav\"), \"t\": Tone(frequency: 100.0, rate: 44100), \
             \"m\": Mix(inputs: [\"a\", \"t\"]), \"last\": Gain(audio: \"m\", gain: {gain}), {OUT}"
        ))
    };
    let options = Options { threads: 0, ..Options::default() };
    let (mut player, mut callback) = Player::start(load(&text(0.1)), options).unwrap();
    let mut play = |player: &mut Player, blocks: usize| {
        let (mut block, mut reported, mut loudest) = (vec![0.0; 128], Vec::new(), 0.0_f32);
        for _ in 0..blocks {
            player.pump();
            callback.fill(&mut block);
            reported.extend(player.tick());
            loudest = block.iter().fold(0.0, |m, x| m.max(x.abs()));
        }
        (reported, loudest)
    };
    play(&mut player, 100);
    let whole = std::fs::read(&path).unwrap();
    File::options().write(true).open(&path).unwrap().set_len(400_000).unwrap();
    let (reported, _) = play(&mut player, 4000);
    let failed = |reported: &[foley::live::PlayerEvent]| {
        reported
            .iter()
            .any(|t| matches!(t, foley::live::PlayerEvent::Failed(d) if d.node.as_deref() == Some("a")))
    };
    assert!(failed(&reported), "{reported:?}");
    std::fs::write(&path, whole).unwrap();
    player.load(load(&text(0.2))).unwrap();
    let (reported, loudest) = play(&mut player, 300);
    assert!(!failed(&reported) && loudest > 0.1, "{reported:?}, {loudest}");
    assert!(!player.is_busy());
}
