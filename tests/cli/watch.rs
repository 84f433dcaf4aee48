//! `foley watch` as a user runs it: every method by which programs save files, errors in between, and the end.

use crate::common;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Much longer than any step takes, so that a slow machine causes no failure.
const PATIENCE: Duration = Duration::from_secs(60);

fn tone(level: f64) -> String {
    format!(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: {{\n    \"tone\": Tone(frequency: 440.0, rate: 48000, \
         duration: Some(0.1), level: {level:?}),\n    \"out\": WavOut(audio: \"tone\", path: \"out.wav\"),\n}})\n"
    )
}

/// A project in a folder of its own below a temporary one, so that the whole folder can be replaced.
struct Project {
    base: tempfile::TempDir,
}

impl Project {
    fn new(files: &[(&str, &str)]) -> Self {
        let base = tempfile::tempdir().unwrap();
        let project = Self { base };
        for (name, text) in files {
            let path = project.path(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        project
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.base.path().join("project").join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
        command.args(args).current_dir(self.base.path()).env("NO_COLOR", "1");
        command
    }

    /// The output of one plain run of the graph.
    fn fresh(&self) -> Vec<u8> {
        let run = self.command(&["run", "project/main.ron", "--out", "fresh"]).output().unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        fs::read(self.base.path().join("fresh/out.wav")).unwrap()
    }

    fn output(&self) -> Vec<u8> {
        fs::read(self.base.path().join("out/out.wav")).unwrap()
    }

    fn watch(&self, more: &[&str]) -> Watched {
        let mut args = vec!["watch", "project/main.ron"];
        args.extend(more);
        let mut child = self.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (sender, lines) = channel();
        forward(child.stdout.take().unwrap(), sender.clone());
        forward(child.stderr.take().unwrap(), sender);
        Watched { child, lines, reported: String::new() }
    }
}

fn forward(from: impl Read + Send + 'static, to: Sender<String>) {
    std::thread::spawn(move || {
        for line in BufReader::new(from).lines().map_while(Result::ok) {
            let _ = to.send(line);
        }
    });
}

/// A running `foley watch`.
struct Watched {
    child: Child,
    lines: Receiver<String>,
    reported: String,
}

impl Watched {
    /// Waits for a line that contains a text; returns all lines up to it.
    fn expect(&mut self, text: &str) -> String {
        let start = Instant::now();
        let mut all = String::new();
        loop {
            let left = PATIENCE.saturating_sub(start.elapsed());
            let line = self.lines.recv_timeout(left);
            let line = line.unwrap_or_else(|e| panic!("no {text:?} ({e}) after\n{}{all}", self.reported));
            all.push_str(&line);
            all.push('\n');
            if line.contains(text) {
                self.reported.push_str(&all);
                return all;
            }
        }
    }

    /// Ends it as Ctrl-C does.
    fn end(mut self) -> (Option<i32>, String) {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
        let code = self.child.wait().unwrap().code();
        (code, self.lines.iter().map(|l| l + "\n").collect())
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The kinds of saving that the graph file goes through, each with its level.
fn save_in_every_style(more: &[&str]) {
    let project = Project::new(&[("main.ron", &tone(0.5))]);
    let mut watched = project.watch(more);
    watched.expect("watching 1 file");
    assert_eq!(project.output(), project.fresh());
    go_through_styles(&project, &mut watched, tone, |watched, style, in_time| {
        let reported = watched.expect("reran in ");
        assert!(reported.contains("1 parameter changed (tone.level)"), "{style}: {reported}");
        assert!(!in_time || !reported.contains("error"), "{style}: {reported}");
        assert_eq!(project.output(), project.fresh(), "{style}");
    });
    assert_eq!(watched.end().0, Some(0));
}

/// A tone that plays until it is stopped.
fn endless(level: f64) -> String {
    tone(level).replace("Some(0.1)", "None")
}

/// The same for a graph that plays.
fn save_in_every_style_live(more: &[&str]) {
    let project = Project::new(&[("main.ron", &endless(0.5))]);
    let mut args = vec!["--live", "--device", "null", "--osc", "off"];
    args.extend(more);
    let mut watched = project.watch(&args);
    watched.expect("watching 1 file");
    go_through_styles(&project, &mut watched, endless, |watched, style, in_time| {
        let reported = watched.expect("reloaded in ");
        assert!(reported.contains("1 retuned (tone), 1 node kept"), "{style}: {reported}");
        assert!(!in_time || !reported.contains("error"), "{style}: {reported}");
    });
    let (code, reported) = watched.end();
    assert_eq!(code, Some(0));
    assert!(reported.contains("0 window(s) missed"), "{reported}");
}

/// Saves in one style after the other; `check` learns if the pauses were short enough for an error not to be reported: on a busy machine they
/// are longer.
fn go_through_styles(
    project: &Project,
    watched: &mut Watched,
    tone: fn(f64) -> String,
    check: impl Fn(&mut Watched, &str, bool),
) {
    const PAUSE: Duration = Duration::from_millis(150);
    let main = project.path("main.ron");
    let mut check_since =
        |style: &str, start: Instant| check(watched, style, start.elapsed() < PAUSE * 5 / 2);
    let now = Instant::now;

    fs::write(&main, tone(0.1)).unwrap();
    check_since("in place", now());

    fs::write(project.path("4913"), tone(0.2)).unwrap();
    fs::rename(&main, project.path("main.ron~")).unwrap();
    fs::rename(project.path("4913"), &main).unwrap();
    fs::remove_file(project.path("main.ron~")).unwrap();
    check_since("Vim", now());

    fs::write(project.path(".main.ron.tmp"), tone(0.3)).unwrap();
    fs::rename(project.path(".main.ron.tmp"), &main).unwrap();
    check_since("temporary file and rename", now());

    let (text, start) = (tone(0.4), now());
    let mut file = File::create(&main).unwrap();
    std::thread::sleep(PAUSE);
    file.write_all(&text.as_bytes()[..60]).unwrap();
    std::thread::sleep(PAUSE);
    file.write_all(&text.as_bytes()[60..]).unwrap();
    drop(file);
    check_since("truncated, then written in pieces", start);

    let start = now();
    fs::remove_file(&main).unwrap();
    std::thread::sleep(PAUSE);
    fs::write(&main, tone(0.6)).unwrap();
    check_since("gone for a moment", start);

    let (folder, next) = (project.path(""), project.base.path().join("next"));
    for level in [0.7, 0.8] {
        fs::create_dir(&next).unwrap();
        fs::write(next.join("main.ron"), tone(level)).unwrap();
        fs::rename(&folder, project.base.path().join(format!("old-{level}"))).unwrap();
        fs::rename(&next, &folder).unwrap();
        check_since("folder replaced", now());
    }

    fs::write(&main, tone(0.9)).unwrap();
    check_since("in place, in the folder that was put there", now());
}

#[test]
fn every_style_of_saving_reruns_the_graph() {
    save_in_every_style(&[]);
}

#[test]
fn every_style_of_saving_reruns_the_graph_without_events() {
    save_in_every_style(&["--poll", "0.05"]);
}

#[test]
fn every_style_of_saving_is_heard_in_a_graph_that_plays() {
    save_in_every_style_live(&[]);
}

#[test]
fn every_style_of_saving_is_heard_without_events() {
    save_in_every_style_live(&["--poll", "0.05"]);
}

#[test]
fn a_graph_that_plays_outlives_a_broken_save() {
    let project = Project::new(&[("main.ron", &endless(0.5))]);
    let report = project.base.path().join("report.json");
    let report = report.to_str().unwrap();
    let mut watched = project.watch(&["--live", "--device", "null", "--osc", "off", "--report", report]);
    watched.expect("watching 1 file");
    fs::write(project.path("main.ron"), endless(0.25).replace("Tone(", "Tune(")).unwrap();
    let reported = watched.expect("the graph that plays is the older one");
    assert!(reported.contains("F010"), "{reported}");
    fs::write(project.path("main.ron"), endless(0.25)).unwrap();
    watched.expect("1 retuned (tone)");
    assert_eq!(watched.end().0, Some(0));
    let report: serde_json::Value = serde_json::from_str(&fs::read_to_string(report).unwrap()).unwrap();
    assert_eq!(report["missed"], 0);
    assert_eq!(report["reload_ms"].as_array().unwrap().len(), 1);
    assert!(report["nodes"].as_array().unwrap().iter().any(|n| n["id"] == "tone"));
}

#[test]
fn a_rerun_reports_what_was_kept_and_what_was_computed() {
    let graph = |peak: f64| {
        format!(
            "#![schema = \"foley:graph/1\"]\nGraph(nodes: {{
                \"noise\": Noise(colour: White, rate: 8000, duration: Some(0.3)),
                \"measured\": Loudness(audio: \"noise\"),
                \"even\": Normalize(audio: \"noise\", level: \"measured\", peak_db: {peak:?}),
                \"out\": WavOut(audio: \"even\", path: \"out.wav\"),
            }})"
        )
    };
    let project = Project::new(&[("main.ron", &graph(-6.0))]);
    let mut watched = project.watch(&[]);
    watched.expect("watching 1 file");
    fs::write(project.path("main.ron"), graph(-9.0)).unwrap();
    let reported = watched.expect("reran in ");
    assert!(
        reported.contains("1 parameter changed (even.peak_db), 1 node kept, 2 recomputed (noise, even)"),
        "{reported}"
    );
    assert_eq!(project.output(), project.fresh());
    assert_eq!(watched.end().0, Some(0));
}

#[test]
fn after_a_broken_save_the_last_good_result_stays() {
    let project = Project::new(&[("main.ron", &tone(0.5))]);
    let mut watched = project.watch(&[]);
    watched.expect("watching 1 file");
    let good = project.output();
    let broken = tone(0.25).replace("Tone(", "Tune(").replace("audio:", "audoi:");
    fs::write(project.path("main.ron"), broken).unwrap();
    let reported = watched.expect("the last good result stays; waiting for the next save");
    assert!(reported.contains("F010") && reported.contains("F011"), "{reported}");
    assert_eq!(project.output(), good);
    fs::write(project.path("main.ron"), tone(0.25)).unwrap();
    let reported = watched.expect("reran in ");
    assert!(reported.contains("1 parameter changed (tone.level)"), "{reported}");
    assert_eq!(project.output(), project.fresh());
    assert_eq!(watched.end().0, Some(0));
}

#[test]
fn a_deleted_graph_is_an_error_until_it_is_back() {
    let project = Project::new(&[("main.ron", &tone(0.5))]);
    let mut watched = project.watch(&[]);
    watched.expect("watching 1 file");
    fs::remove_file(project.path("main.ron")).unwrap();
    watched.expect("F060");
    watched.expect("the last good result stays");
    fs::write(project.path("main.ron"), tone(0.25)).unwrap();
    watched.expect("1 parameter changed (tone.level)");
    assert_eq!(project.output(), project.fresh());
}

const PARTS: &str = "#![schema = \"foley:graph/1\"]
Graph(
    use: { \"part\": \"parts/part.ron\" },
    nodes: { \"out\": WavOut(audio: \"part.sound\", path: \"out.wav\") },
)
";
const PART: &str = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"sound\": WavIn(path: \"../in.wav\"),
})
";

#[test]
fn a_changed_sub_graph_and_a_changed_input_rerun() {
    let project = Project::new(&[("main.ron", &tone(0.5))]);
    let first = project.fresh();
    fs::write(project.path("main.ron"), tone(0.25)).unwrap();
    let second = project.fresh();
    // The files that the graph names do not exist yet.
    fs::write(project.path("main.ron"), PARTS).unwrap();
    let mut watched = project.watch(&[]);
    watched.expect("there is no result yet; waiting for the next save");
    fs::create_dir(project.path("parts")).unwrap();
    fs::write(project.path("parts/part.ron"), PART).unwrap();
    watched.expect("in.wav");
    watched.expect("there is no result yet; waiting for the next save");
    fs::write(project.path("in.wav"), &first).unwrap();
    watched.expect("wrote ");
    watched.expect("times real time");
    let before = project.output();
    fs::write(project.path("in.wav"), &second).unwrap();
    let reported = watched.expect("reran in ");
    assert!(reported.contains("1 file changed (") && reported.contains("in.wav)"), "{reported}");
    assert_ne!(project.output(), before);
    assert_eq!(project.output(), project.fresh());
    let louder = PART.replace("\"sound\": WavIn", "\"wave\": WavIn");
    let louder = louder.replace("\n})", "\n    \"sound\": Gain(audio: \"wave\", gain: 0.5),\n})");
    fs::write(project.path("parts/part.ron"), louder).unwrap();
    let reported = watched.expect("reran in ");
    assert!(reported.contains("1 node added (part.wave)"), "{reported}");
    assert_eq!(project.output(), project.fresh());
    fs::write(project.path("parts/part.ron"), format!("{PART}// A comment.\n")).unwrap();
    let reported = watched.expect("reran in ");
    assert!(reported.contains("1 node removed (part.wave)"), "{reported}");
    assert_eq!(watched.end().0, Some(0));
}

#[test]
fn a_newer_save_stops_a_long_run() {
    let endless = tone(0.5).replace("Some(0.1)", "Some(80000.0)");
    let project = Project::new(&[("main.ron", &endless)]);
    let mut watched = project.watch(&[]);
    // The run has begun once its file is there under another name.
    let start = Instant::now();
    let out = project.base.path().join("out");
    while !fs::read_dir(&out).is_ok_and(|mut files| files.next().is_some()) {
        assert!(start.elapsed() < PATIENCE, "the run does not begin");
        std::thread::sleep(Duration::from_millis(5));
    }
    fs::write(project.path("main.ron"), tone(0.25)).unwrap();
    watched.expect("wrote ");
    watched.expect("watching 1 file");
    assert_eq!(project.output(), project.fresh());
    let left: Vec<_> = fs::read_dir(&out).unwrap().flatten().map(|e| e.file_name()).collect();
    assert_eq!(left, ["out.wav"]);
}

#[test]
fn the_options_of_a_run_hold_at_each_rerun() {
    let project = Project::new(&[("main.ron", &tone(0.5))]);
    let tap = project.base.path().join("tap.npy");
    let tap_arg = format!("tone={}", tap.display());
    let mut watched = project.watch(&["--set", "tone.frequency=220.0", "--out", "else", "--tap", &tap_arg]);
    watched.expect("watching 1 file");
    let first = fs::read(&tap).unwrap();
    fs::write(project.path("main.ron"), tone(0.25)).unwrap();
    watched.expect("1 parameter changed (tone.level)");
    assert_ne!(fs::read(&tap).unwrap(), first);
    assert!(Path::new(&project.base.path().join("else/out.wav")).exists());
    assert_eq!(watched.end(), (Some(0), String::new()));
}

/// Knocks on one material whose modes decay faster the higher they are; `shift` moves the frequencies.
fn write_knock(project: &Project, name: &str, shift: f64) {
    let sample = |n: i32| {
        let t = f64::from(n) / 22_050.0 - 0.05;
        let mode = |k: i32| {
            let w = std::f64::consts::TAU * (300.0 * 1.4_f64.powi(k) + shift);
            (-0.5 * (8.0 + 4e-8 * w * w) * t).exp() * (w * t).sin()
        };
        let ringing = if t < 0.0 { 0.0 } else { 0.1 * (0..8).map(mode).sum::<f64>() };
        // Noise, as each recording has some.
        (30_000.0 * (ringing + 1e-4 * (f64::from(n) * 12.9898).sin())) as i16
    };
    // Whole at once: a file that is read while it is written would be another edit.
    let whole = project.base.path().join("knock.wav");
    common::write_wav(&whole, 1, 22_050, (0..22_050).map(sample));
    fs::rename(whole, project.path(name)).unwrap();
}

/// Adds, changes and removes recordings of a folder beside one that stays; `check` waits for the result of each.
fn edit_folder(project: &Project, mut check: impl FnMut(&str)) {
    write_knock(project, "knocks/b.wav", 11.0);
    check("added");
    write_knock(project, "knocks/b.wav", 23.0);
    check("changed");
    fs::remove_file(project.path("knocks/b.wav")).unwrap();
    check("removed");
}

#[test]
fn recordings_that_are_added_to_a_folder_or_changed_or_removed_in_it_rerun_the_graph() {
    let graph = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"knocks\": ModalFeatures(folder: \"knocks\", surrogate: false, compare: false),
        \"table\": TableOut(table: \"knocks.table\", path: \"table.csv\") })";
    let project = Project::new(&[("main.ron", graph), ("knocks/notes.txt", "")]);
    write_knock(&project, "knocks/a.wav", 0.0);
    for more in [&[][..], &["--poll", "0.05"]] {
        let mut watched = project.watch(more);
        watched.expect("watching ");
        let table =
            |folder: &str| fs::read_to_string(project.base.path().join(folder).join("table.csv")).unwrap();
        let (first, mut last) = (table("out"), table("out"));
        edit_folder(&project, |edit| {
            let reported = watched.expect("reran in ");
            assert!(!reported.contains("error"), "{edit}: {reported}");
            let run = project
                .command(&["run", "project/main.ron", "--no-cache", "--out", "fresh"])
                .output()
                .unwrap();
            assert!(run.status.success(), "{edit}: {}", String::from_utf8_lossy(&run.stderr));
            let now = table("out");
            assert_eq!(now, table("fresh"), "{edit}");
            assert_ne!(now, std::mem::replace(&mut last, now.clone()), "{edit}");
        });
        assert_eq!(last, first);
        assert_eq!(watched.end().0, Some(0));
    }
}

#[test]
fn recordings_that_are_added_to_a_folder_or_changed_or_removed_in_it_change_what_plays() {
    let graph = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"knocks\": ModalFeatures(folder: \"knocks\", surrogate: false, compare: false),
        \"gate\": FeatureGate(features: [\"knocks.features\"]),
        \"fit\": DampingFit(points: \"gate\", estimator: Mixture, model: Rayleigh, draws: 0, compare: false),
        \"mesh\": TetMeshFile(path: \"bar.mesh\"),
        \"model\": ModalAnalysis(mesh: \"mesh\", young: 2e11, poisson: 0.3, density: 7800.0, highest: 4000),
        \"modes\": ModelModes(model: \"model\", material: \"fit.material\", points: [[0.0, 0.015, 0.004]]),
        \"beats\": Metronome(interval: 0.1),
        \"clicks\": Impulses(events: \"beats\", rate: 44100),
        \"bar\": ModalBank(forces: [\"clicks\"], modes: \"modes.modes\"),
        \"out\": WavOut(audio: \"bar\", path: \"out.wav\") })";
    let project = Project::new(&[("main.ron", graph), ("knocks/notes.txt", "")]);
    fs::copy(common::graphs().join("assets/meshes/bar.mesh"), project.path("bar.mesh")).unwrap();
    write_knock(&project, "knocks/a.wav", 0.0);
    let mut watched = project.watch(&["--live", "--device", "null", "--osc", "off"]);
    watched.expect("watching ");
    edit_folder(&project, |edit| {
        let reported = watched.expect("reloaded in ");
        assert!(reported.contains("bar") && !reported.contains("error"), "{edit}: {reported}");
    });
    assert_eq!(watched.end().0, Some(0));
}
