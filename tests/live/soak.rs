//! A long piece under everything that a sender, an editor and the system can do to it. Half an hour by default:
//!
//! `cargo test --release --test suite live::soak -- --include-ignored --nocapture`, and `FOLEY_SOAK_SECONDS=180` for a shorter one.

#![cfg(target_os = "linux")]

use foley_nodes::core::random::Rng;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Vertices on a side of the sheet.
const SIDE: usize = 50;

/// A recording that always sounds from a worker, the friction of a sheet that is sent, and what messages drive.
fn graph(level: f64) -> String {
    format!(
        "#![schema = \"foley:graph/1\"]
Graph(params: {{ \"level\": {level} }}, nodes: {{
    \"sheet\": LiveMesh(channel: \"sheet\", path: \"sheet.obj\"),
    \"contacts\": ContactDetector(mesh: \"sheet.mesh\", radius: 0.016),
    \"speed\": SlidingSpeed(contacts: \"contacts\", age: \"sheet.age\", gate: Causal, between: Hold, rate: 40),
    \"model\": FrictionModelFile(path: \"cotton.friction.json\"),
    \"friction\": IftNoise(speeds: \"speed\", model: \"model\", rate: 8000, motion_at: Start),
    \"hits\": LiveImpacts(channel: \"hits\"),
    \"force\": ImpactForce(impacts: \"hits\", rate: 8000),
    \"x\": LiveControl(channel: \"x\", initial: [0.1], rate: 8000),
    \"low\": HighPass(audio: \"x\", cutoff: 500.0),
    \"take\": WavIn(path: \"take.wav\"),
    \"loud\": Gain(audio: \"take\", gain: \"$level\"),
    \"all\": Mix(inputs: [\"friction\", \"force\", \"low\", \"loud\"]),
    \"out\": WavOut(audio: \"all\", path: \"o.wav\"),
}})
"
    )
}

fn project(folder: &Path, seconds: f64) {
    let mut obj = String::new();
    for k in 0..SIDE * SIDE {
        obj += &format!("v {} {} 0\n", (k % SIDE) as f64 * 0.01, (k / SIDE) as f64 * 0.01);
    }
    for j in 1..SIDE {
        for i in 1..SIDE {
            let at = |i: usize, j: usize| (j - 1) * SIDE + i;
            obj += &format!("f {} {} {} {}\n", at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
        }
    }
    fs::write(folder.join("sheet.obj"), obj).unwrap();
    let model = crate::common::graphs().join("assets/cloth/cotton.friction.json");
    fs::copy(model, folder.join("cotton.friction.json")).unwrap();
    let samples = (0..(seconds * 1.5 + 60.0) as usize * 8000).map(|k| 3000 + (k % 50) as i16 * 20);
    crate::common::write_wav(&folder.join("take.wav"), 1, 8000, samples);
    fs::write(folder.join("main.ron"), graph(0.5)).unwrap();
}

/// Resident memory, kB.
fn memory(child: &Child) -> u64 {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or("0");
    line.split_whitespace().next().and_then(|kb| kb.parse().ok()).unwrap_or(0)
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

/// A playing graph, and the programs that send to it.
struct Stage<'a> {
    folder: &'a Path,
    child: Child,
    lines: ChildStdin,
    osc: (UdpSocket, String),
    meshes: String,
    sender: Option<TcpStream>,
    /// Time of the last frame of the sender, s.
    time: f64,
    rng: Rng,
}

fn message(address: &str, numbers: &[f32]) -> Vec<u8> {
    let args = numbers.iter().map(|x| rosc::OscType::Float(*x)).collect();
    rosc::encoder::encode(&rosc::OscPacket::Message(rosc::OscMessage { addr: address.into(), args })).unwrap()
}

impl Stage<'_> {
    fn line(&mut self, text: &str) {
        let _ = self.lines.write_all(text.as_bytes()).and_then(|()| self.lines.write_all(b"\n"));
    }

    fn packet(&self, bytes: &[u8]) {
        let _ = self.osc.0.send_to(bytes, &self.osc.1);
    }

    /// Sends frames at 60 frames a second: moving, or collapsed into one place.
    fn frames(&mut self, count: usize, collapsed: bool) {
        if self.sender.is_none() {
            let mut sender = TcpStream::connect(&self.meshes).unwrap();
            sender.set_write_timeout(Some(Duration::from_millis(500))).unwrap();
            let head = [&b"foleymsh"[..], &1_u32.to_le_bytes(), &5_u32.to_le_bytes(), b"sheet"].concat();
            let _ = sender.write_all(&[&head[..], &((SIDE * SIDE) as u32).to_le_bytes()].concat());
            (self.sender, self.time) = (Some(sender), 0.0);
        }
        for _ in 0..count {
            self.time += 1.0 / 60.0;
            let mut bytes = self.time.to_le_bytes().to_vec();
            for k in 0..SIDE * SIDE {
                let (x, y) = ((k % SIDE) as f32 * 0.01, (k / SIDE) as f32 * 0.01);
                // Folded along the middle, and rubbing.
                let (x, z) = if x > 0.25 {
                    (0.5 - x + 0.02 * (9.0 * self.time as f32).sin(), 0.008)
                } else {
                    (x, 0.0)
                };
                let position = if collapsed { [0.1; 3] } else { [x, y, z] };
                position.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
            }
            if self.sender.as_mut().is_none_or(|sender| sender.write_all(&bytes).is_err()) {
                self.sender = None;
                return;
            }
            std::thread::sleep(Duration::from_millis(16));
        }
    }

    /// One thing that happens.
    fn act(&mut self) {
        match self.rng.below(14) {
            0 => fs::write(self.folder.join("main.ron"), graph(self.rng.between(0.3, 0.7))).unwrap(),
            // Half done, for a moment.
            1 => {
                let text = graph(0.5);
                fs::write(self.folder.join("main.ron"), &text[..self.rng.below(text.len())]).unwrap();
                std::thread::sleep(Duration::from_millis(self.rng.below(700) as u64));
                fs::write(self.folder.join("main.ron"), text).unwrap();
            }
            2 => {
                for k in 0..20_000 {
                    let target = ["level", "nothing", "take.path"][k % 3].to_owned() + &"x".repeat(k % 5 / 4);
                    self.line(&format!("{{\"set\": \"{target}\", \"value\": {}}}", 0.3 + k as f64 * 1e-5));
                }
                self.line("{\"set\": \"level\", \"value\": 0.5}");
            }
            3 => {
                let impact = message("/foley/impact/hits", &[1e-6, 0.5]);
                let packets = vec![impact; 900].concat();
                (0..20).for_each(|_| self.packet(&packets[..self.rng_len(packets.len())]));
                (0..3000).for_each(|_| self.packet(&message("/foley/impact/hits", &[1e-6, 0.5])));
            }
            4 => {
                let level = b"#bundle\0\0\0\0\0\0\0\0\x01\0\0\xff\0";
                self.packet(&level.repeat(3270));
            }
            5 => {
                // 3,500 s ahead, and then one that is due.
                let now =
                    std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_secs();
                let timetag = rosc::OscTime { seconds: (now + 2_208_988_800 + 3500) as u32, fractional: 0 };
                let inner = rosc::OscMessage { addr: "/foley/control/x".into(), args: vec![0.3_f32.into()] };
                let bundle = rosc::OscBundle { timetag, content: vec![rosc::OscPacket::Message(inner)] };
                let bytes = rosc::encoder::encode(&rosc::OscPacket::Bundle(bundle)).unwrap();
                (0..1100).for_each(|_| self.packet(&bytes));
                self.packet(&message("/foley/control/x", &[0.1]));
            }
            6 => {
                self.line("{\"control\": \"x\", \"values\": [1e39]}");
                self.packet(&message("/foley/control/x", &[f32::MAX]));
                std::thread::sleep(Duration::from_millis(50));
                self.line("{\"control\": \"x\", \"values\": [0.1]}");
            }
            7 => self.frames(40, true),
            8 => self.sender = None,
            9 => {
                signal(&self.child, "-STOP");
                std::thread::sleep(Duration::from_millis(self.rng.below(3000) as u64));
                signal(&self.child, "-CONT");
            }
            10 => {
                let long = "y".repeat(70_000);
                self.line(&format!("{long}{{\"set\": \"level\", \"value\": 0.0}}"));
            }
            11 => {
                for _ in 0..10 {
                    let mut silent = TcpStream::connect(&self.meshes).unwrap();
                    let _ = silent.write_all(b"foley");
                }
            }
            _ => self.frames(60, false),
        }
        std::thread::sleep(Duration::from_millis(self.rng.below(300) as u64));
    }

    fn rng_len(&self, most: usize) -> usize {
        most.min(60_000)
    }
}

/// Results of a piece.
struct Outcome {
    samples: Vec<f32>,
    /// Its standard error.
    stderr: String,
    report: serde_json::Value,
    /// Seconds, and MB in memory then.
    sizes: Vec<(f64, f64)>,
    /// Time from Ctrl-C to its end.
    ending: Duration,
}

impl Outcome {
    /// Lengths of the silences above 0.5 s, s.
    fn silences(&self) -> Vec<f64> {
        let silent = |x: &f32| x.abs() < 1e-6;
        let parts = self.samples.chunk_by(|a, b| silent(a) == silent(b)).filter(|part| silent(&part[0]));
        parts.map(|part| part.len() as f64 / 8000.0).filter(|s| *s > 0.5).collect()
    }

    /// Number of gaps that standard error reports.
    fn gaps_reported(&self) -> usize {
        self.stderr.matches("the nodes ahead of the callback have delivered nothing").count()
    }

    /// Median of the memory between two parts of the time, MB.
    fn memory(&self, seconds: f64, from: f64, to: f64) -> f64 {
        let within = self.sizes.iter().filter(|(at, _)| (from..to).contains(&(at / seconds)));
        let mut within: Vec<f64> = within.map(|(_, mb)| *mb).collect();
        within.sort_by(f64::total_cmp);
        within[within.len() / 2]
    }
}

/// Plays for `seconds`, while `act` does one thing after the other, and ends by Ctrl-C.
fn play(seconds: f64, mut act: impl FnMut(&mut Stage<'_>)) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    project(folder.path(), seconds);
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port().to_string();
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.args([
        "watch",
        "main.ron",
        "--live",
        "--no-cache",
        "--device",
        "file:played.wav",
        "--report",
        "r.json",
    ]);
    command.args(["--osc", &port, "--meshes", "127.0.0.1:0"]).current_dir(folder.path()).env("NO_COLOR", "1");
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut reported = BufReader::new(child.stdout.take().unwrap());
    let mut first = String::new();
    reported.read_line(&mut first).unwrap();
    let meshes = first.split("meshes at ").nth(1).unwrap_or_else(|| panic!("{first}"));
    let meshes = meshes.split(';').next().unwrap().trim().to_owned();
    // Both streams are read, so that they never fill.
    std::thread::spawn(move || std::io::copy(&mut reported, &mut std::io::sink()));
    let stderr = Arc::new(Mutex::new(String::new()));
    let (mut errors, sink) = (BufReader::new(child.stderr.take().unwrap()), Arc::clone(&stderr));
    let errors = std::thread::spawn(move || {
        let mut line = String::new();
        while errors.read_line(&mut line).is_ok_and(|n| n > 0) {
            sink.lock().unwrap().push_str(&line);
            line.clear();
        }
    });
    let osc = (UdpSocket::bind("127.0.0.1:0").unwrap(), format!("127.0.0.1:{port}"));
    let lines = child.stdin.take().unwrap();
    let rng = Rng::new(25);
    let mut stage = Stage { folder: folder.path(), child, lines, osc, meshes, sender: None, time: 0.0, rng };
    let (start, mut sizes) = (Instant::now(), Vec::new());
    while start.elapsed().as_secs_f64() < seconds {
        act(&mut stage);
        assert!(stage.child.try_wait().unwrap().is_none(), "it has ended: {}", stderr.lock().unwrap());
        sizes.push((start.elapsed().as_secs_f64(), memory(&stage.child) as f64 / 1024.0));
    }
    let Stage { mut child, lines, sender, .. } = stage;
    signal(&child, "-INT");
    let asked = Instant::now();
    let status = child.wait().unwrap();
    let ending = asked.elapsed();
    drop((lines, sender));
    errors.join().unwrap();
    let stderr = stderr.lock().unwrap().clone();
    assert!(status.success(), "{status}: {stderr}");
    let report = fs::read_to_string(folder.path().join("r.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();

    let mut wav = Vec::new();
    fs::File::open(folder.path().join("played.wav")).unwrap().read_to_end(&mut wav).unwrap();
    let samples: Vec<f32> =
        hound::WavReader::new(&wav[..]).unwrap().samples::<f32>().map(Result::unwrap).collect();
    Outcome { samples, stderr, report, sizes, ending }
}

#[test]
fn collapsed_frames_and_a_sender_that_stops_silence_no_piece() {
    let mut step = 0;
    let outcome = play(4.0, |stage| {
        step += 1;
        match step {
            1 => stage.frames(30, false),
            2 => stage.frames(10, true),
            3 => stage.sender = None,
            _ => std::thread::sleep(Duration::from_millis(100)),
        }
    });
    // On a machine that is busy with something else there may be gaps, which are reported; after them it sounds.
    let long = outcome.silences();
    assert!(long.len() <= outcome.gaps_reported(), "{long:?} s of silence: {}", outcome.stderr);
    let last = &outcome.samples[outcome.samples.len().saturating_sub(8000)..];
    assert!(last.iter().any(|x| x.abs() > 0.01), "{long:?} s of silence: {}", outcome.stderr);
    assert!(outcome.report["messages"]["delivered"].as_u64().unwrap() > 30, "{}", outcome.report["messages"]);
}

#[test]
#[ignore = "takes half an hour, or FOLEY_SOAK_SECONDS"]
fn a_piece_plays_on_under_edits_floods_collapsed_frames_and_stops() {
    let seconds: f64 =
        std::env::var("FOLEY_SOAK_SECONDS").ok().and_then(|s| s.parse().ok()).unwrap_or(1800.0);
    let outcome = play(seconds, |stage| stage.act());
    let (long, recorded) = (outcome.silences(), outcome.samples.len() as f64 / 8000.0);
    let gaps = outcome.gaps_reported();
    let (early, late) = (outcome.memory(seconds, 0.2, 0.4), outcome.memory(seconds, 0.8, 1.0));
    let played = outcome.report["played_s"].as_f64().unwrap();
    println!(
        "{} acts: {played:.1} s played, {recorded:.1} s recorded; memory {early:.1} to {late:.1} MB; \
         {} silences above 0.5 s (longest {:.2} s), {gaps} reported; ended in {:.0} ms; worst callback {} us; \
         missed {}, messages {}; {} lines on standard error",
        outcome.sizes.len(),
        long.len(),
        long.iter().copied().fold(0.0, f64::max),
        outcome.ending.as_secs_f64() * 1e3,
        outcome.report["callback"]["worst_us"],
        outcome.report["missed"],
        outcome.report["messages"],
        outcome.stderr.lines().count(),
    );
    assert!((played - recorded).abs() < 1e-6, "all that was played is recorded");
    assert!(late < 1.1 * early, "memory grows from {early} to {late} MB");
    assert!(long.len() <= gaps, "{long:?} s of silence, {gaps} are reported");
    assert!(outcome.ending < Duration::from_millis(500), "{:?}", outcome.ending);
}
