//! Tests of input that arrives while a graph plays and that becomes audible: contacts and meshes.

use super::stand::{OUT, Stand, graph};
use crate::common;
use foley::graph::{DirFiles, Limits, LoadOptions, Override, load, load_text};
use foley::live::input::{Hub, Refusal, listen_to_meshes};
use foley::live::{LiveGraph, Options, Player};
use foley_nodes::core::input::{Inbox, Inputs, Message, MessageKind};
use foley_nodes::core::time::{Tick, ticks};
use foley_nodes::live_input::{ContactMessage, contact_to_message};
use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

/// Messages of one channel whose times are known, as if they came then.
struct Script(&'static str, Vec<(Tick, Message)>);

struct ScriptInbox(std::vec::IntoIter<(Tick, Message)>);

impl Inbox for ScriptInbox {
    fn next(&mut self, before: Tick) -> Option<(Tick, Message)> {
        let due = self.0.as_slice().first().is_some_and(|(tick, _)| *tick < before);
        if due { self.0.next() } else { None }
    }
}

impl Inputs for Script {
    fn open(&self, channel: &str, _: MessageKind, _: usize) -> Option<Box<dyn Inbox>> {
        (channel == self.0).then(|| Box::new(ScriptInbox(self.1.clone().into_iter())) as Box<dyn Inbox>)
    }
}

/// A body that slides over the floor in x at speeds in m/s from times in s on, and is lifted at a last time: 60 frames a second.
fn slide(speeds: &[(f64, f64)], end: f64) -> Vec<(Tick, Message)> {
    // It sets off just before a joint of the tiles.
    let (frame, mut x) = (1.0 / 60.0, 0.034);
    let start = speeds[0].0;
    let frames = ((end - start) / frame).round() as usize;
    let mut all: Vec<_> = (0..frames)
        .map(|k| {
            let time = start + k as f64 * frame;
            let speed = speeds.iter().rev().find(|(from, _)| *from <= time + 1e-9).map_or(0.0, |s| s.1);
            x += speed * frame;
            let sent = ContactMessage {
                id: 7,
                bodies: [0, 1],
                point: [x, 0.03, 0.0],
                normal: [0.0, 0.0, 1.0],
                force: 2.5,
                velocity: [speed, 0.0, 0.0],
                approach: Some(0.0),
                depth: None,
                mass: None,
                travel: Some([speed, 0.0, 0.0]),
                step: Some(frame),
                ends: false,
            };
            (ticks(time), contact_to_message(&sent).unwrap())
        })
        .collect();
    let last = ContactMessage::from_numbers(&[7.0]).unwrap();
    all.push((ticks(end), contact_to_message(&last).unwrap()));
    all
}

/// Output of `graphs/texture/live.ron` for messages, without its own sounds, from their audible start.
fn scraped(messages: Vec<(Tick, Message)>, distance: &str, seconds: f64) -> Vec<f32> {
    // Levels at one speed, which are quick to make.
    let numbers =
        [("bell.gain", "0.0"), ("level", "1.0"), ("distance", distance), ("equal.by_speed", "false")];
    let given = numbers.map(|(key, value)| Override { target: key.into(), value: value.into() });
    let loaded = load(&common::graphs().join("texture/live.ron"), &LoadOptions::default().overrides(given));
    let shown = foley::diag::render(&loaded.diagnostics, &loaded.sources, false);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{shown}"));
    let material = LiveGraph {
        seed: graph.seed,
        graph,
        files: DirFiles::new(loaded.root, Limits::default()),
        memo: None,
        inputs: std::sync::Arc::new(Script("ball", messages)),
    };
    let options = Options { quantum: 128, threads: 0, metered: true, ..Options::default() };
    let (player, callback) = Player::start(material, options).unwrap();
    let mut stand = Stand { player, callback, heard: Vec::new() };
    let late = stand.callback.rate().first_at(stand.player.plan().latency) as usize;
    stand.play((seconds * 44_100.0) as usize + late, 128);
    let channels = stand.callback.channels();
    stand.heard[late * channels..].iter().step_by(channels).copied().collect()
}

fn level(heard: &[f32], from: f64, to: f64) -> f64 {
    let part = &heard[(from * 44_100.0) as usize..(to * 44_100.0) as usize];
    (part.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / part.len() as f64).sqrt()
}

#[test]
fn contacts_that_come_in_scrape_from_their_first_to_their_last_and_by_their_speed() {
    let heard = scraped(slide(&[(0.5, 0.15)], 1.0), "1.0", 1.0);
    let first = heard.iter().position(|x| x.abs() > 1e-5).unwrap() as f64 / 44_100.0;
    println!("begins at {first} s");
    // A contact scrapes when it is known to slide: after four frames and 50 ms.
    assert!((0.5..0.64).contains(&first), "{first}");
    // Heights change in proportion to the speed, but their power spreads over more frequencies than the floor has modes for.
    let heard = scraped(slide(&[(0.5, 0.15), (1.5, 0.9)], 2.5), "20.0", 3.5);
    let levels = [(0.7, 1.4), (1.6, 2.4), (3.0, 3.5)].map(|(a, b)| level(&heard, a, b));
    println!("levels {levels:?}");
    assert!(levels[1] > 1.3 * levels[0] && levels[0] > 1e-4, "faster is louder: {levels:?}");
    assert!(levels[2] < 1e-2 * levels[1], "it only rings on: {levels:?}");
    // A contact at rest is silent.
    let heard = scraped(slide(&[(0.5, 0.5), (1.5, 0.0)], 3.0), "1.0", 3.0);
    assert!(level(&heard, 2.5, 3.0) < 0.05 * level(&heard, 0.7, 1.4));
    assert!(scraped(Vec::new(), "1.0", 0.5).iter().all(|x| *x == 0.0), "nobody touches the floor");
}

#[test]
fn contacts_that_come_in_are_as_fine_as_their_own_distance_says() {
    // The same slide near the listener, at the level of noise, and beyond all levels.
    let [near, far, away] =
        ["1.0", "20.0", "300.0"].map(|distance| scraped(slide(&[(0.3, 0.5)], 1.5), distance, 1.5));
    let [a, b, c] = [&near, &far, &away].map(|heard| level(heard, 0.5, 1.4));
    println!("near {a}, at the level of noise {b}, away {c}");
    assert!(c == 0.0 && a > 1e-4 && (0.5..2.0).contains(&(b / a)), "{a} {b} {c}");
    assert_ne!(near, far);
}

/// A sheet of 5 by 5 vertices, 0.4 m wide and 5 mm above a floor.
fn sheet_at(x: f64) -> Vec<[f32; 3]> {
    (0..25).map(|v| [(x + 0.1 * f64::from(v / 5)) as f32, 0.1 * (v % 5) as f32, 0.005]).collect()
}

/// A graph that plays the friction of a received sheet, and a folder with its files.
fn sent_sheet() -> (tempfile::TempDir, String) {
    let dir = tempfile::tempdir().unwrap();
    let mut sheet = String::new();
    sheet_at(0.0).iter().for_each(|[x, y, z]| sheet += &format!("v {x} {y} {z}\n"));
    for v in (0..20).filter(|v| v % 5 < 4) {
        sheet += &format!("f {} {} {} {}\n", v + 1, v + 6, v + 7, v + 2);
    }
    std::fs::write(dir.path().join("sheet.obj"), sheet).unwrap();
    let floor = "v -3 -3 0\nv 3 -3 0\nv 3 3 0\nv -3 3 0\nf 1 2 3 4\n";
    std::fs::write(dir.path().join("floor.obj"), floor).unwrap();
    let model = common::graphs().join("assets/cloth/cotton.friction.json");
    std::fs::copy(model, dir.path().join("cotton.friction.json")).unwrap();
    let text = graph(&format!(
        "\"sheet\": LiveMesh(channel: \"sheet\", path: \"sheet.obj\"), \
         \"floor\": MeshSequence(path: \"floor.obj\"), \
         \"contacts\": ContactDetector(mesh: \"sheet.mesh\", others: [\"floor\"], radius: 0.01, self_contact: false), \
         \"speed\": SlidingSpeed(contacts: \"contacts\", age: \"sheet.age\", gate: Causal, between: Hold), \
         \"cotton\": FrictionModelFile(path: \"cotton.friction.json\"), \
         \"last\": IftNoise(speeds: \"speed\", model: \"cotton\", rate: 48000, motion_at: Start), {OUT}"
    ));
    (dir, text)
}

#[test]
fn a_mesh_that_comes_in_is_heard_goes_on_while_frames_are_late_falls_silent_and_comes_back() {
    let (dir, text) = sent_sheet();
    let loaded = load_text("test", &text, &dir.path().join("main.ron"), &LoadOptions::default());
    let shown = foley::diag::render(&loaded.diagnostics, &loaded.sources, false);
    let hub = Arc::new(Hub::new());
    let material = LiveGraph {
        graph: loaded.graph.unwrap_or_else(|| panic!("{shown}")),
        files: DirFiles::new(loaded.root, Limits::default()),
        seed: 5,
        memo: None,
        inputs: Arc::clone(&hub) as _,
    };
    // Five windows in each frame of the sender.
    let options = Options { quantum: 160, threads: 0, ..Options::default() };
    let (player, callback) = Player::start(material, options).unwrap();
    hub.set_clock(Arc::clone(player.shared()), callback.rate(), callback.quantum(), player.depth());
    // The first frame is shown by the first window that has not been made yet, and is audible after the latency.
    let begun = (player.depth() * 160) as usize + callback.rate().first_at(player.plan().latency) as usize;
    let mut stand = Stand { player, callback, heard: Vec::new() };
    let listening =
        listen_to_meshes("127.0.0.1:0".parse().unwrap(), Arc::clone(&hub), |message| panic!("{message}"))
            .unwrap();
    let mut sender = TcpStream::connect(listening.at).unwrap();
    let mut bytes = [&b"foleymsh"[..], &1_u32.to_le_bytes(), &5_u32.to_le_bytes(), b"sheet"].concat();
    bytes.extend(25_u32.to_le_bytes());
    sender.write_all(&bytes).unwrap();
    // 0.3 m/s for a second; for 300 ms no frame comes; 0.3 m/s again, which it has not left in between.
    let mut sent = 0;
    for frame in 0..120 {
        if !(60..78).contains(&frame) {
            let time = f64::from(frame) / 60.0;
            let mut bytes = (1e6 + time).to_le_bytes().to_vec();
            sheet_at(0.3 * time).as_flattened().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
            sender.write_all(&bytes).unwrap();
            sent += 1;
            for _ in 0..5000 {
                if hub.delivered.load(Relaxed) == sent {
                    break;
                }
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
            assert_eq!(hub.delivered.load(Relaxed), sent, "frame {frame}");
        }
        stand.play(800, 160);
    }
    stand.play(begun, 160);
    let heard = &stand.heard[begun..];
    let part = |from: f64, to: f64| &heard[(from * 48_000.0) as usize..(to * 48_000.0) as usize];
    let level = |from, to| {
        let part = part(from, to);
        (part.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / part.len() as f64).sqrt()
    };
    let peak = |from, to| part(from, to).iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    // The last frame before the gap is shown from 0.983 s on, held to 1.083 s and silent from 1.183 s on, and a clip sounds on for 50 ms.
    let last = 59.0 / 60.0;
    let (moving, held) = (level(0.2, 0.9), level(last + 0.02, last + 0.09));
    let (silent, back) = (level(last + 0.27, last + 0.31), level(1.4, 1.9));
    println!("moving {moving}, held {held}, silent {silent}, back {back}");
    assert!(moving > 1e-5 && stand.heard[..begun].iter().all(|x| *x == 0.0));
    assert!((0.5..2.0).contains(&(held / moving)), "{held} {moving}");
    assert!(silent < 1e-3 * moving, "{silent} {moving}");
    assert!((0.7..1.4).contains(&(back / moving)), "{back} {moving}");
    // The frame that catches up moves by 9 cm in one item.
    assert!(peak(1.28, 1.4) < 1.5 * peak(0.2, 0.9), "{} {}", peak(1.28, 1.4), peak(0.2, 0.9));
    assert_eq!(Refusal::ALL.map(|refusal| hub.refusals.count(refusal)), [0; 6]);
}
