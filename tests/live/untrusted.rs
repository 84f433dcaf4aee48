//! Input of a playing graph from senders that nobody trusts: what they may name, and what they may not stop.

use foley::diag::Severity;
use foley::graph::{LoadOptions, Override, load};
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A graph that plays a recording from its own folder for ever.
const GRAPH: &str = "#![schema = \"foley:graph/1\"]
Graph(params: { \"take\": \"own.wav\", \"level\": 0.5 }, nodes: {
    \"in\": WavIn(path: \"$take\"),
    \"loud\": Gain(audio: \"in\", gain: \"$level\"),
    \"out\": WavOut(audio: \"loud\", path: \"o.wav\"),
})
";

/// `piece/main.ron` with a recording, and recordings in other folders.
fn project() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for path in ["piece/own.wav", "piece/inner/more.wav", "secret/s.wav", "assets/shared.wav", "work/w.wav"] {
        let path = folder.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        crate::common::write_wav(&path, 1, 8000, (0..80_000).map(|k| (k % 100) as i16));
    }
    fs::write(folder.path().join("piece/main.ron"), GRAPH).unwrap();
    folder
}

fn message(target: &str, value: impl Into<String>) -> Override {
    Override { target: target.into(), value: value.into() }
}

#[test]
fn a_message_names_files_below_the_folder_of_the_graph_only() {
    let folder = project();
    let graph = folder.path().join("piece/main.ron");
    let absolute = |path: &str| folder.path().join(path).display().to_string();
    let codes = |value: &str| -> Vec<&'static str> {
        ["in.path", "take"]
            .iter()
            .map(|target| {
                let loaded = load(&graph, &LoadOptions::default().messages([message(target, value)]));
                let errors = loaded.diagnostics.iter().filter(|d| d.severity == Severity::Error);
                let errors: Vec<_> = errors.map(|d| d.code).collect();
                assert!(errors.len() <= 1, "{errors:?}");
                errors.first().copied().unwrap_or("loaded")
            })
            .collect()
    };
    #[cfg(unix)]
    std::os::unix::fs::symlink(folder.path().join("secret/s.wav"), folder.path().join("piece/link.wav"))
        .unwrap();
    for right in ["own.wav", "inner/more.wav", "inner/../own.wav", "./own.wav"] {
        assert_eq!(codes(right), ["loaded"; 2], "{right}");
    }
    let wrong = [
        "../secret/s.wav".to_owned(),
        "../secret/nothing.wav".to_owned(),
        // The text of the graph may name this one.
        "../assets/shared.wav".to_owned(),
        "inner/../../secret/s.wav".to_owned(),
        absolute("secret/s.wav"),
        absolute("piece/own.wav"),
        "/etc/passwd".to_owned(),
        "\"../secret/s.wav\"".to_owned(),
        #[cfg(unix)]
        "link.wav".to_owned(),
    ];
    for wrong in wrong {
        assert_eq!(codes(&wrong), ["F062"; 2], "{wrong}");
    }
    // A person may name it, and a message wins over that only where it may.
    let named = LoadOptions::default().overrides([message("take", "own.wav")]);
    let wins = load(&graph, &named.clone().messages([message("take", "../secret/s.wav")]));
    assert!(wins.graph.is_none());
    assert!(load(&graph, &named.messages([message("take", "inner/more.wav")])).graph.is_some());
}

fn live(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.args(["live", "main.ron", "--no-cache", "--osc", "off"]).args(arguments);
    command.current_dir(folder).env("NO_COLOR", "1").stdin(Stdio::piped());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Waits until it plays.
fn playing(child: &mut Child) -> BufReader<std::process::ChildStdout> {
    let mut reported = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    while !line.starts_with("Ctrl-C") {
        line.clear();
        assert!(reported.read_line(&mut line).unwrap() > 0, "it never plays");
    }
    reported
}

#[test]
fn a_line_that_names_a_file_elsewhere_is_refused_and_nothing_of_the_file_is_shown() {
    let folder = project();
    fs::write(folder.path().join("secret/key"), "SECRETSECRETSECRET").unwrap();
    let mut child = live(&folder.path().join("piece"), &["--device", "null", "--for", "3"]).spawn().unwrap();
    let reported = playing(&mut child);
    let mut lines = child.stdin.take().unwrap();
    writeln!(lines, "{{\"set\": \"in.path\", \"value\": \"../secret/key\"}}").unwrap();
    lines.flush().unwrap();
    let run = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{text}");
    assert!(text.contains("F062") && text.contains("a message may not name"), "{text}");
    assert!(!text.contains("SECRET"), "{text}");
    drop((lines, reported));
}

/// Plays for two seconds with a reader of standard error that has gone, while wrong lines arrive; returns the sound.
#[test]
fn a_reader_of_standard_error_that_has_gone_ends_nothing() {
    let folder = project();
    let piece = folder.path().join("piece");
    let arguments = ["--device", "file:played.wav", "--report", "r.json", "--for", "2"];
    let mut child = live(&piece, &arguments).spawn().unwrap();
    let reported = playing(&mut child);
    drop(child.stderr.take());
    let mut lines = child.stdin.take().unwrap();
    for _ in 0..3 {
        writeln!(lines, "wrong\n{{\"set\": \"in.nothing\", \"value\": 1}}").unwrap();
        lines.flush().unwrap();
        std::thread::sleep(Duration::from_millis(200));
    }
    assert!(child.wait().unwrap().success());
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(piece.join("r.json")).unwrap()).unwrap();
    assert_eq!(report["messages"]["malformed"], 3, "every line is read");
    assert!(hound::WavReader::open(piece.join("played.wav")).unwrap().duration() > 8000);
    drop((lines, reported));
}

#[test]
fn a_reader_of_standard_output_that_has_gone_ends_the_piece_with_a_whole_recording() {
    let folder = project();
    let piece = folder.path().join("piece");
    let arguments = ["--device", "file:played.wav", "--report", "r.json", "--for", "20", "--json"];
    let mut child = live(&piece, &arguments).spawn().unwrap();
    let mut reported = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    reported.read_line(&mut line).unwrap();
    drop(reported);
    assert!(child.wait_with_output().unwrap().status.success());
    assert!(piece.join("r.json").exists());
    assert!(hound::WavReader::open(piece.join("played.wav")).unwrap().duration() > 800);
}

/// Messages and report of a graph that plays for `seconds` while `send` writes lines.
fn play(folder: &Path, seconds: &str, send: impl FnOnce(&mut dyn Write)) -> (String, serde_json::Value) {
    let arguments = ["--device", "file:played.wav", "--report", "r.json", "--for", seconds];
    let mut child = live(folder, &arguments).spawn().unwrap();
    let reported = playing(&mut child);
    let mut lines = child.stdin.take().unwrap();
    send(&mut lines);
    let run = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success(), "{text}");
    drop((lines, reported));
    (text, serde_json::from_str(&fs::read_to_string(folder.join("r.json")).unwrap()).unwrap())
}

/// The greatest magnitude in the last quarter of a second of the recording.
fn last_peak(folder: &Path) -> f32 {
    let mut reader = hound::WavReader::open(folder.join("played.wav")).unwrap();
    let samples: Vec<f32> = reader.samples::<f32>().map(Result::unwrap).collect();
    samples[samples.len() - 2000..].iter().fold(0.0, |peak, x| peak.max(x.abs()))
}

/// The recording has a peak of 99 of 32768.
const PEAK: f32 = 99.0 / 32768.0;

#[test]
fn wrong_sets_take_no_right_one_with_them() {
    let folder = project();
    let piece = folder.path().join("piece");
    let (text, _) = play(&piece, "3", |lines| {
        // All in one load: two that no graph can have, one that only planning refuses, and one that is right.
        let sets = [("nothing", "1"), ("in.path", "\"inner\""), ("level", "0.25"), ("loud.gain", "\"loud\"")];
        for (target, value) in sets {
            writeln!(lines, "{{\"set\": \"{target}\", \"value\": {value}}}").unwrap();
        }
        lines.flush().unwrap();
    });
    assert!(text.contains("nothing") && text.contains("F064") && text.contains("loud"), "{text}");
    assert!((last_peak(&piece) / PEAK - 0.25).abs() < 0.01, "{}", last_peak(&piece) / PEAK);
}

#[test]
fn a_flood_of_wrong_sets_delays_no_right_one_and_is_reported_by_tens() {
    let folder = project();
    let piece = folder.path().join("piece");
    let (text, report) = play(&piece, "4", |lines| {
        for k in 0..30_000 {
            writeln!(lines, "{{\"set\": \"nothing{}\", \"value\": {k}}}\nwrong", k % 200).unwrap();
        }
        writeln!(lines, "{{\"set\": \"level\", \"value\": 0.25}}").unwrap();
        lines.flush().unwrap();
    });
    let errors =
        text.lines().filter(|line| line.starts_with("error") || line.contains("standard input")).count();
    assert!(errors <= 60, "{errors}");
    assert!(text.contains(" more"), "{text}");
    assert_eq!(report["messages"]["malformed"], 30_000);
    assert!((last_peak(&piece) / PEAK - 0.25).abs() < 0.01, "{}", last_peak(&piece) / PEAK);
}

#[test]
fn a_set_applies_to_the_graph_that_plays_and_not_to_a_half_done_edit_on_the_disk() {
    let folder = project();
    let piece = folder.path().join("piece");
    let (text, _) = play(&piece, "2", |lines| {
        fs::write(piece.join("main.ron"), GRAPH.replace("Gain(audio", "Gain(audio: \"half done")).unwrap();
        writeln!(lines, "{{\"set\": \"level\", \"value\": 0.25}}").unwrap();
        lines.flush().unwrap();
    });
    assert!(text.is_empty(), "{text}");
    assert!((last_peak(&piece) / PEAK - 0.25).abs() < 0.01, "{}", last_peak(&piece) / PEAK);
}

#[cfg(unix)]
fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
    assert!(status.success());
}

#[cfg(unix)]
#[test]
fn a_process_that_is_stopped_for_a_while_records_all_that_it_plays() {
    let folder = project();
    let piece = folder.path().join("piece");
    let arguments = ["--device", "file:played.wav", "--report", "r.json", "--for", "4"];
    let mut child = live(&piece, &arguments).spawn().unwrap();
    let reported = playing(&mut child);
    std::thread::sleep(Duration::from_millis(500));
    signal(&child, "-STOP");
    std::thread::sleep(Duration::from_millis(2500));
    signal(&child, "-CONT");
    let run = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success() && text.contains("the clock stood still for 2."), "{text}");
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(piece.join("r.json")).unwrap()).unwrap();
    let recorded = f64::from(hound::WavReader::open(piece.join("played.wav")).unwrap().duration()) / 8000.0;
    assert_eq!((report["played_s"].as_f64().unwrap(), &report["lost_windows"]), (recorded, &0.into()));
    drop(reported);
}

/// A limit of the size of files simulates a full disk.
#[cfg(unix)]
#[test]
fn a_recording_that_the_disk_refuses_is_reported_at_once_and_kept_as_far_as_it_came() {
    let folder = project();
    let piece = folder.path().join("piece");
    let mut command = Command::new("sh");
    // 100 blocks of 512 bytes are 1.6 s.
    command.args([
        "-c",
        "ulimit -f 100; exec \"$0\" live main.ron --no-cache --osc off --device file:played.wav --for 5",
    ]);
    command.arg(env!("CARGO_BIN_EXE_foley")).current_dir(&piece).env("NO_COLOR", "1").stdin(Stdio::piped());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let reported = playing(&mut child);
    let mut errors = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    errors.read_line(&mut line).unwrap();
    assert!(line.contains("F080") && line.contains("played.wav"), "{line}");
    assert!(child.try_wait().unwrap().is_none(), "it plays on");
    assert_eq!(child.wait().unwrap().code(), Some(1));
    let mut reader = hound::WavReader::open(piece.join("played.wav")).unwrap();
    assert!((11_000..=12_800).contains(&reader.duration()), "{}", reader.duration());
    assert!(reader.samples::<f32>().all(|x| x.is_ok()));
    let names = fs::read_dir(&piece).unwrap().map(|entry| entry.unwrap().file_name());
    assert!(names.into_iter().all(|name| !name.to_string_lossy().ends_with(".part")));
    drop((reported, errors));
}

#[test]
fn a_recording_that_ends_early_and_a_sound_that_is_too_loud_are_reported_while_it_plays() {
    let folder = project();
    let piece = folder.path().join("piece");
    let whole = fs::read(piece.join("own.wav")).unwrap();
    fs::write(piece.join("own.wav"), &whole[..whole.len() / 2]).unwrap();
    let text = GRAPH.replace("audio: \"loud\", path", "audio: \"both\", path").replace(
        "\"out\":",
        "\"x\": LiveControl(channel: \"x\", rate: 8000), \"both\": Mix(inputs: [\"loud\", \"x\"]), \"out\":",
    );
    fs::write(piece.join("main.ron"), text).unwrap();
    let (text, report) = play(&piece, "2", |lines| {
        writeln!(lines, "{{\"control\": \"x\", \"values\": [1e39]}}").unwrap();
        lines.flush().unwrap();
    });
    let early = text.lines().find(|line| line.contains("note: in:")).unwrap_or_else(|| panic!("{text}"));
    assert!(early.contains("own.wav"), "{early}");
    assert_eq!(text.matches("exceeds 120 dB").count(), 1, "{text}");
    assert!(report["cut"].as_u64().unwrap() > 0);
    assert_eq!(last_peak(&piece), 1e6);
}
