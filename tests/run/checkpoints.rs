//! A run that was interrupted resumes at its last checkpoint, with the same bits.

use crate::common;
use foley::diag::Diagnostic;
use foley::graph::{DirFiles, Limits, LoadOptions, load};
use foley::memo::{CachePolicy, Memo};
use foley::plan::{Plan, PlanOptions};
use foley::run::{DirOutputs, Job, Progress, Report, Tap, TapTarget, check_tap, run};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::time::{Duration, Instant};

/// Every phase saves checkpoints as often as the disk allows.
const OFTEN: Duration = Duration::from_millis(5);

/// One graph, run again and again into one folder over one cache.
struct Case {
    graph: PathBuf,
    taps: Vec<String>,
    options: PlanOptions,
    policy: CachePolicy,
    dir: tempfile::TempDir,
}

impl Case {
    fn of(graph: &Path) -> Self {
        let options = PlanOptions { until: common::cut(graph, 3.0), threads: 2, ..PlanOptions::default() };
        let (graph, dir) = (graph.to_owned(), tempfile::tempdir().unwrap());
        Self { graph, taps: Vec::new(), options, policy: CachePolicy::default(), dir }
    }

    /// Runs until a share of the work is done; `None` runs to the end.
    fn run(&self, out: &str, memo: bool, share: Option<f64>) -> Result<Report, Vec<Diagnostic>> {
        let loaded = load(&self.graph, &LoadOptions::default());
        let graph = loaded.graph.expect("the graph is right");
        let files = DirFiles::new(loaded.root, Limits::default());
        let out = self.dir.path().join(out);
        let taps: Vec<_> = self.taps.iter().map(|tap| check_tap(&graph, tap).unwrap()).collect();
        let taps: Vec<_> = taps
            .into_iter()
            .map(|t| Tap { target: TapTarget::File(out.join(t.path().unwrap())), ..t })
            .collect();
        let tapped = taps.iter().map(|tap| (tap.node, tap.port)).collect();
        let plan = Plan::new(&graph, &files, &PlanOptions { taps: tapped, ..self.options.clone() }).unwrap();
        let outputs = DirOutputs::new(&out);
        let memo = memo.then(|| {
            let memo = Memo::new(self.dir.path().join("cache"), 1 << 30, &self.graph);
            memo.with_policy(self.policy).with_checkpoints(&out, OFTEN)
        });
        let progress = Arc::new(Progress::default());
        let over = Arc::new(AtomicBool::new(false));
        let stopper = share.map(|share| {
            let (progress, over) = (Arc::clone(&progress), Arc::clone(&over));
            std::thread::spawn(move || {
                while !over.load(SeqCst) {
                    let (done, total) = (progress.done.load(SeqCst), progress.total.load(SeqCst));
                    if total > 0 && done as f64 >= share * total as f64 {
                        progress.stop.store(true, SeqCst);
                        return;
                    }
                    std::thread::sleep(Duration::from_micros(100));
                }
            })
        });
        let job = Job {
            graph: &graph,
            plan: &plan,
            files: &files,
            outputs: &outputs,
            taps: &taps,
            threads: self.options.threads,
            seed: graph.seed,
            memo: memo.as_ref(),
            progress,
        };
        let result = run(&job);
        over.store(true, SeqCst);
        stopper.into_iter().for_each(|thread| thread.join().unwrap());
        result
    }

    fn files(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let entries = fs::read_dir(self.dir.path().join(out)).unwrap().map(|e| e.unwrap().path());
        entries
            .map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&p).unwrap()))
            .collect()
    }

    /// Interrupts runs at some shares of the work, runs one to its end, and compares it with one without interruption.
    /// Returns the number of runs that resumed.
    fn interrupt(&self, shares: &[f64]) -> usize {
        let name = self.graph.display();
        let wanted = self.run("whole", false, None).unwrap_or_else(|e| panic!("{name}: {e:?}"));
        let (mut resumed, mut last) = (0, false);
        for share in shares {
            let Err(e) = self.run("parts", true, Some(*share)) else {
                last = false;
                break;
            };
            assert!(e.iter().all(|e| e.code == "F091"), "{name}: {e:?}");
            // A later phase may have been stopped before its first checkpoint: then it begins again.
            last = e.iter().any(|e| e.help.as_ref().is_some_and(|help| help.contains("resumes at")));
            resumed += usize::from(last);
        }
        let report = self.run("parts", true, None).unwrap_or_else(|e| panic!("{name}: {e:?}"));
        assert!(report.resumed_at.is_some() || !last, "{name} begins again");
        assert!(
            self.files("parts") == self.files("whole"),
            "{name}: not the same bits, or not the same files"
        );
        let cache = fs::read_dir(self.dir.path().join("cache")).into_iter().flatten();
        let cache = cache.map(|e| e.unwrap().path());
        let left: Vec<_> = cache.filter(|p| p.extension().is_some_and(|e| e == "run")).collect();
        assert!(left.is_empty(), "{name} leaves {left:?}");
        let reported = |r: &Report| -> Vec<_> { r.nodes.iter().map(|n| n.summary.clone()).collect() };
        let (own, wanted) = (reported(&report), reported(&wanted));
        assert!(resumed == 0 || own == wanted, "{name}: summaries {own:#?}, expected {wanted:#?}");
        resumed
    }
}

const LOOP: &str = "#![schema = \"foley:graph/1\"]
Graph(
    nodes: {
        \"dry\": Noise(colour: White, level: 0.1, rate: 48000, duration: Some(120)),
        \"room\": Mix(inputs: [\"dry\", \"echo\"]),
        \"dull\": LowPass(audio: \"room\", cutoff: 3000.0, order: 8),
        \"echo\": Feedback(audio: \"dull\", like: \"dry\", delay: 0.11, gain: 0.6, tail: 1.4),
        \"out\": WavOut(audio: \"room\", path: \"loop.wav\"),
    },
)
";

#[test]
fn a_loop_resumes_with_the_same_bits() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("loop.ron");
    fs::write(&path, LOOP).unwrap();
    let case = Case { options: PlanOptions { threads: 2, ..PlanOptions::default() }, ..Case::of(&path) };
    assert!(case.interrupt(&[0.2, 0.5, 0.8]) > 0, "it never resumed");
}

/// Examples that together have every kind of buffer, folds of several phases, and cached streams.
#[test]
fn examples_resume_with_the_same_bits() {
    let graphs = [
        "cloth/crumple.ron",
        "cloth/couch.ron",
        "cloth/whip.ron",
        "texture/grass.ron",
        "texture/tiles_ball.ron",
    ];
    // A fast machine may have finished some of them before their first checkpoint.
    let resumed = graphs.map(|name| Case::of(&common::graphs().join(name)).interrupt(&[0.3, 0.7]));
    assert!(resumed.iter().any(|times| *times > 0), "{resumed:?}");
}

#[test]
#[ignore = "takes minutes: cargo test --test suite checkpoints -- --ignored"]
fn all_examples_resume_with_the_same_bits() {
    let mut resumed = 0;
    for path in common::all_graphs().iter().filter(|p| common::is_whole(p)) {
        for policy in [
            CachePolicy::default(),
            CachePolicy { seconds_per_byte: 1.0, min_seconds: 0.0, ..CachePolicy::default() },
        ] {
            let case = Case { policy, ..Case::of(path) };
            let count = case.interrupt(&[0.1, 0.6, 0.35, 0.9]);
            println!("{}: resumed {count} times", path.display());
            resumed += usize::from(count > 0);
        }
    }
    assert!(resumed > 20, "{resumed}");
}

#[test]
fn taps_of_every_kind_resume() {
    let taps = [
        "target.speed=speed.npy",
        "target.events=events.jsonl",
        "target.events=events.csv",
        "target.friction=friction.wav",
    ];
    let taps = taps.iter().chain(&["target.curvature=curvature.csv"]).map(|tap| (*tap).to_owned()).collect();
    let case = Case { taps, ..Case::of(&common::graphs().join("cloth/target.ron")) };
    case.interrupt(&[0.4, 0.7]);
    assert_eq!(case.files("parts").keys().filter(|name| !name.ends_with(".wav")).count(), 4);
}

const LONG: &str = "#![schema = \"foley:graph/1\"]
Graph(
    seed: 5,
    nodes: {
        \"noise\": Noise(colour: Pink, level: 0.1, rate: 96000, channels: 2, duration: Some(120)),
        \"low\": LowPass(audio: \"noise\", cutoff: 500.0, order: 10),
        \"high\": HighPass(audio: \"low\", cutoff: 100.0, order: 10),
        \"out\": WavOut(audio: \"high\", path: \"long.wav\"),
    },
)
";

struct Shell(tempfile::TempDir);

impl Shell {
    fn new() -> Self {
        let shell = Self(tempfile::tempdir().unwrap());
        shell.edit(LONG);
        shell
    }

    fn edit(&self, text: &str) {
        fs::write(self.0.path().join("graph.ron"), text).unwrap();
    }

    fn command(&self, more: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
        let pause: &[&str] = if more.contains(&"--checkpoint") { &[] } else { &["--checkpoint", "0.05"] };
        command.current_dir(&self.0).args(["run", "graph.ron"]).args(pause).args(more);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Starts a run and waits for its first checkpoint.
    fn started(&self) -> Child {
        let child = self.command(&[]).spawn().unwrap();
        let start = Instant::now();
        while self.named(".foley/cache", ".run").is_empty() {
            assert!(start.elapsed() < Duration::from_secs(60), "it never saves a checkpoint");
            std::thread::sleep(Duration::from_millis(2));
        }
        child
    }

    fn named(&self, folder: &str, ending: &str) -> Vec<String> {
        let entries = fs::read_dir(self.0.path().join(folder)).into_iter().flatten();
        let names = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
        names.filter(|name| name.ends_with(ending)).collect()
    }

    /// Runs to the end; returns the text of its output.
    fn finish(&self, more: &[&str]) -> String {
        let output = self.command(more).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    fn sound(&self, folder: &str) -> blake3::Hash {
        blake3::hash(&fs::read(self.0.path().join(folder).join("long.wav")).unwrap())
    }
}

#[test]
fn a_run_that_was_killed_resumes_and_one_of_another_graph_does_not() {
    let shell = Shell::new();
    shell.finish(&["--no-cache", "--out", "whole"]);
    let mut child = shell.started();
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(shell.named("out", ".part").len(), 1);
    let output_text = shell.finish(&[]);
    assert!(output_text.contains("resumed at "), "{output_text}");
    assert!(shell.sound("out") == shell.sound("whole"), "not the same bits");
    assert_eq!(shell.named("out", "").len(), 1, "nothing else is left");
    assert!(shell.named(".foley/cache", ".run").is_empty());

    let mut child = shell.started();
    child.kill().unwrap();
    child.wait().unwrap();
    shell.edit(&LONG.replace("500.0", "600.0"));
    let output_text = shell.finish(&[]);
    assert!(!output_text.contains("resumed at"), "{output_text}");
    assert!(shell.sound("out") != shell.sound("whole"));
    assert_eq!(shell.named("out", "").len(), 1, "the partial files of the earlier graph are removed");

    // Nodes of the same names with other inputs.
    shell.edit(LONG);
    let mut child = shell.started();
    child.kill().unwrap();
    child.wait().unwrap();
    let soft = "\"soft\": Gain(audio: \"low\", gain: 0.5), \"high\": HighPass(audio: \"soft\",";
    shell.edit(&LONG.replace("\"high\": HighPass(audio: \"low\",", soft));
    let output_text = shell.finish(&[]);
    assert!(!output_text.contains("resumed at"), "{output_text}");
    shell.finish(&["--no-cache", "--out", "soft"]);
    assert!(shell.sound("out") == shell.sound("soft"), "not the same bits");
}

#[test]
fn a_stopped_run_reports_where_it_resumes() {
    let shell = Shell::new();
    let child = shell.started();
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let output_text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(75), "{output_text}");
    assert!(output_text.contains("F091") && output_text.contains("resumes at "), "{output_text}");
    let output_text = shell.finish(&["--report", "report.json"]);
    assert!(output_text.contains("resumed at "), "{output_text}");
    let report = fs::read_to_string(shell.0.path().join("report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!(report["went_on_at"].as_f64().unwrap() > 0.0);
    assert_eq!(report["outputs"][0]["frames"], 120 * 96_000);
    // Without a checkpoint it cannot resume, and nothing is left behind.
    let mut child = shell.command(&["--checkpoint", "0"]).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    child.wait().unwrap();
    assert!(shell.named("out", ".part").is_empty());
}

#[test]
fn a_wrong_pause_is_refused() {
    let output = Shell::new().command(&["--checkpoint", "-1"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("0, or from 0.001"));
}
