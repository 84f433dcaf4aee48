//! The command as a user types it: outputs, exit codes, messages.

use super::command::foley;
use std::fs;
use std::process::{Command, Output};

const TONE: &str = "#![schema = \"foley:graph/1\"]
Graph(
    title: \"A tone\",
    params: { \"pitch\": 440.0 },
    nodes: {
        \"tone\": Tone(frequency: \"$pitch\", rate: 48000, duration: Some(0.5), level: 0.5),
        \"out\": WavOut(audio: \"tone\", path: \"tone.wav\"),
    },
)
";

fn code(output: &Output) -> i32 {
    output.status.code().unwrap_or(-1)
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn project(text: &str) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("tone.ron"), text).unwrap();
    dir
}

#[test]
fn a_run_writes_its_file_and_a_report() {
    let dir = project(TONE);
    let run = foley(dir.path(), &["run", "tone.ron", "--report", "report.json"]);
    assert_eq!(code(&run), 0, "{}", stderr(&run));
    let wav = fs::read(dir.path().join("out/tone.wav")).unwrap();
    assert_eq!(&wav[..4], b"RIFF");
    let report: serde_json::Value =
        serde_json::from_slice(&fs::read(dir.path().join("report.json")).unwrap()).unwrap();
    let output = &report["outputs"][0];
    assert_eq!(output["rate"], 48000);
    assert_eq!(output["channels"], 1);
    assert_eq!(output["seconds"], 0.5);
    let peak = output["peak"].as_f64().unwrap();
    assert!((peak - 0.5).abs() < 1e-3, "{peak}");
    let rms = output["rms"].as_f64().unwrap();
    assert!((rms - 0.5 / 2f64.sqrt()).abs() < 2e-3, "{rms}");
    assert_eq!(report["nodes"]["tone"]["kind"], "Tone");
    assert_eq!(report["nodes"]["tone"]["items"], 24000);
    assert!(report["wall_seconds"].as_f64().unwrap() > 0.0);
}

#[test]
fn threads_window_and_memory_leave_the_sound_as_it_is_and_a_seed_changes_noise() {
    let noise = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"noise\": Noise(rate: 48000, duration: Some(0.3), level: 0.1),
    \"late\": Advance(audio: \"noise\", seconds: 0.05),
    \"out\": WavOut(audio: \"late\", path: \"tone.wav\"),
})";
    let dir = project(noise);
    let sound = |args: &[&str]| {
        let run = foley(dir.path(), &[&["run", "tone.ron", "--no-cache"], args].concat());
        assert_eq!(code(&run), 0, "{args:?}: {}", stderr(&run));
        fs::read(dir.path().join("out/tone.wav")).unwrap()
    };
    let plain = sound(&[]);
    for args in [
        &["--threads", "1"][..],
        &["--threads", "3"],
        &["--window", "0.001"],
        &["--window", "10"],
        &["--memory", "1M"],
        &["--seed", "0"],
    ] {
        assert!(sound(args) == plain, "{args:?}");
    }
    assert!(sound(&["--seed", "1"]) != plain && sound(&["--seed", "1"]) == sound(&["--seed", "1"]));
    let refused = foley(dir.path(), &["run", "tone.ron", "--memory", "10K"]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("F050"), "{}", stderr(&refused));
    for (argument, value) in
        [("--window", "0"), ("--window", "soon"), ("--memory", "much"), ("--threads", "two")]
    {
        let refused = foley(dir.path(), &["run", "tone.ron", argument, value]);
        assert_eq!(code(&refused), 2, "{argument} {value}");
        assert!(stderr(&refused).contains(argument), "{}", stderr(&refused));
    }
}

#[test]
fn a_report_that_cannot_be_written_is_refused_before_the_run() {
    let dir = project(TONE);
    let run = foley(dir.path(), &["run", "tone.ron", "--report", "tone.ron/report.json"]);
    assert_ne!(code(&run), 0);
    assert!(stderr(&run).contains("tone.ron/report.json"), "{}", stderr(&run));
    assert!(!dir.path().join("out").exists(), "nothing was rendered");
}

#[test]
fn set_changes_a_parameter_and_a_node() {
    let dir = project(TONE);
    let args =
        ["run", "tone.ron", "--set", "pitch=880", "--set", "out.path=high.wav", "--set", "tone.level=0.25"];
    let run = foley(dir.path(), &args);
    assert_eq!(code(&run), 0, "{}", stderr(&run));
    assert!(dir.path().join("out/high.wav").exists());
    assert!(!dir.path().join("out/tone.wav").exists());
}

#[test]
fn a_wrong_set_says_what_exists() {
    let dir = project(TONE);
    let run = foley(dir.path(), &["run", "tone.ron", "--set", "tone.frequncy=880"]);
    assert_eq!(code(&run), 2);
    assert!(stderr(&run).contains("did you mean `frequency`"), "{}", stderr(&run));
    let run = foley(dir.path(), &["run", "tone.ron", "--set", "pich=880"]);
    assert_eq!(code(&run), 2);
    assert!(stderr(&run).contains("did you mean `pitch`"), "{}", stderr(&run));
}

#[test]
fn errors_name_file_line_and_column() {
    let dir = project(&TONE.replace("level: 0.5", "level: loud"));
    let check = foley(dir.path(), &["check", "tone.ron", "--json"]);
    assert_eq!(code(&check), 2);
    let found: serde_json::Value = serde_json::from_slice(&check.stdout).unwrap();
    assert_eq!(found[0]["code"], "F014");
    assert_eq!(found[0]["file"], "tone.ron");
    assert_eq!(found[0]["line"], 6);
    assert_eq!(found[0]["node"], "tone");
    let text = foley(dir.path(), &["check", "tone.ron"]);
    assert!(stderr(&text).contains("tone.ron:6:"), "{}", stderr(&text));
}

#[test]
fn taps_write_audio_and_numbers() {
    let dir = project(TONE);
    let taps = ["--tap", "tone.audio=taps/a.wav", "--tap", "tone=taps/a.npy", "--tap", "tone=taps/a.csv"];
    let run = foley(dir.path(), &[&["run", "tone.ron"][..], &taps].concat());
    assert_eq!(code(&run), 0, "{}", stderr(&run));
    let csv = fs::read_to_string(dir.path().join("taps/a.csv")).unwrap();
    let npy = fs::read(dir.path().join("taps/a.npy")).unwrap();
    assert_eq!(&npy[..6], b"\x93NUMPY");
    assert_eq!(npy.len(), 128 + 4 * 24000);
    assert!(String::from_utf8_lossy(&npy[..128]).contains("'shape': (24000, 1)"));
    let wav = fs::read(dir.path().join("taps/a.wav")).unwrap();
    assert_eq!(&wav[wav.len() - 4 * 24000..], &npy[128..]);
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!((lines.len(), lines[0]), (24001, "time,0"));
    let (time, x) = lines[12001].split_once(',').unwrap();
    assert_eq!(time.parse(), Ok(0.25));
    assert_eq!(x.parse(), Ok(f32::from_le_bytes(npy[128 + 48000..][..4].try_into().unwrap())));
    let wrong = foley(dir.path(), &["run", "tone.ron", "--tap", "tone.audio=a.jsonl"]);
    assert_eq!(code(&wrong), 2);
}

#[test]
fn outputs_stay_in_their_folder() {
    let dir = project(&TONE.replace("path: \"tone.wav\"", "path: \"../tone.wav\""));
    let run = foley(dir.path(), &["run", "tone.ron", "--out", "out"]);
    assert_eq!(code(&run), 2);
    assert!(stderr(&run).contains("F082"), "{}", stderr(&run));
    assert!(!dir.path().join("tone.wav").exists());
    // The error is reported without a run.
    let check = foley(dir.path(), &["check", "tone.ron"]);
    assert_eq!(code(&check), 2);
    assert!(stderr(&check).contains("F082") && stderr(&check).contains("tone.ron:"), "{}", stderr(&check));
    // A folder is no file, whether it is there or not.
    let dir = project(&TONE.replace("path: \"tone.wav\"", "path: \"tones/\""));
    let run = foley(dir.path(), &["run", "tone.ron", "--out", "out"]);
    assert_eq!(code(&run), 2);
    assert!(stderr(&run).contains("F082") && stderr(&run).contains("tone.ron:"), "{}", stderr(&run));
}

#[test]
fn nothing_is_written_over_what_the_run_reads_or_twice() {
    let copy = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"in\": WavIn(path: \"take.wav\"),
    \"soft\": Gain(audio: \"in\", gain: 0.5),
    \"out\": WavOut(audio: \"soft\", path: \"take.wav\"),
})
";
    let dir = project(copy);
    fs::write(dir.path().join("source.ron"), TONE.replace("tone.wav", "take.wav")).unwrap();
    assert_eq!(code(&foley(dir.path(), &["run", "source.ron", "--out", "."])), 0);
    let take = fs::read(dir.path().join("take.wav")).unwrap();
    let refused = |args: &[&str], found: &str, words: &str| {
        let run = foley(dir.path(), args);
        assert_eq!(code(&run), 2, "{}", stderr(&run));
        assert!(stderr(&run).contains(found) && stderr(&run).contains(words), "{}", stderr(&run));
        assert_eq!(fs::read(dir.path().join("take.wav")).unwrap(), take, "the recording is as it was");
        assert_eq!(fs::read_to_string(dir.path().join("tone.ron")).unwrap(), copy, "the graph is as it was");
        assert!(!dir.path().join("out").exists(), "nothing is left");
    };
    refused(&["run", "tone.ron", "--out", "."], "F085", "tone.ron:5:40");
    refused(&["run", "tone.ron", "--report", "tone.ron"], "F085", "--report");
    refused(&["run", "tone.ron", "--tap", "in.audio=./take.wav"], "F085", "--tap");
    refused(&["run", "tone.ron", "--report", "out/take.wav"], "F081", "`out`");
    refused(&["run", "tone.ron", "--tap", "in.audio=out/take.wav"], "F081", "tone.ron:5:40");
    #[cfg(unix)]
    {
        // Nor by another path to the same folder.
        std::os::unix::fs::symlink(dir.path(), dir.path().join("here")).unwrap();
        refused(&["run", "tone.ron", "--out", "here"], "F085", "take.wav");
    }
    assert_eq!(code(&foley(dir.path(), &["run", "tone.ron"])), 0);
}

#[test]
fn what_plays_is_not_recorded_over_what_it_reads() {
    let dir = project(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
    \"in\": WavIn(path: \"take.wav\"),
    \"out\": WavOut(audio: \"in\", path: \"heard.wav\"),
})\n",
    );
    fs::write(dir.path().join("source.ron"), TONE.replace("tone.wav", "take.wav")).unwrap();
    assert_eq!(code(&foley(dir.path(), &["run", "source.ron", "--out", "."])), 0);
    let take = fs::read(dir.path().join("take.wav")).unwrap();
    let live = ["live", "tone.ron", "--osc", "off", "--for", "0.1", "--device", "file:./take.wav"];
    let run = foley(dir.path(), &live);
    assert_eq!(code(&run), 2, "{}", stderr(&run));
    assert!(stderr(&run).contains("F085") && stderr(&run).contains("--device"), "{}", stderr(&run));
    assert_eq!(fs::read(dir.path().join("take.wav")).unwrap(), take);
}

/// Buffers are most of the memory of a run with a long look-ahead: the process is compared with the plan.
#[test]
fn a_process_takes_the_memory_that_was_planned() {
    let dir = project("");
    let measured = |name: &str, seconds: f64| {
        let graph = format!(
            "#![schema = \"foley:graph/1\"]\nGraph(nodes: {{
    \"in\": Noise(rate: 96000, channels: 2, duration: Some(70.0)),
    \"early\": Advance(audio: \"in\", seconds: {seconds:?}),
    \"out\": WavOut(audio: \"early\", path: \"out.wav\"),
}})\n"
        );
        fs::write(dir.path().join(name), graph).unwrap();
        let run = foley(dir.path(), &["run", name, "--no-cache", "--threads", "1", "--report", "r.json"]);
        assert_eq!(code(&run), 0, "{}", stderr(&run));
        let report = fs::read(dir.path().join("r.json")).unwrap();
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
        let bytes = |key: &str| report[key].as_f64();
        Some((bytes("planned_bytes").unwrap(), bytes("peak_process_bytes")?))
    };
    let Some((little, base)) = measured("short.ron", 0.01) else {
        return eprintln!("skipped: this system does not report the memory of a process");
    };
    let (planned, process) = measured("long.ron", 60.0).unwrap();
    assert!(planned - little > 50e6, "{planned} bytes are planned");
    let ratio = (process - base) / (planned - little);
    assert!((0.9..1.1).contains(&ratio), "{} bytes of {planned} planned", process - base);
}

#[test]
fn an_endless_graph_needs_an_end() {
    let dir = project(&TONE.replace("duration: Some(0.5), ", ""));
    let run = foley(dir.path(), &["run", "tone.ron"]);
    assert_eq!(code(&run), 2);
    assert!(stderr(&run).contains("F048"), "{}", stderr(&run));
    let run = foley(dir.path(), &["run", "tone.ron", "--until", "0.25"]);
    assert_eq!(code(&run), 0, "{}", stderr(&run));
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_no_half_file() {
    let dir = project(&TONE.replace("Some(0.5)", "Some(36000.0)"));
    let mut child = Command::new(env!("CARGO_BIN_EXE_foley"))
        .args(["run", "tone.ron", "--quiet"])
        .current_dir(dir.path())
        .spawn()
        .unwrap();
    let out = dir.path().join("out");
    while !out.exists() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(75));
    assert_eq!(fs::read_dir(out).unwrap().count(), 0);
}

#[test]
fn fmt_keeps_comments_and_says_what_it_would_change() {
    let dir = project(&TONE.replace("    title", "  // What it is.\n  title"));
    assert_eq!(code(&foley(dir.path(), &["fmt", "tone.ron", "--check"])), 1);
    assert_eq!(code(&foley(dir.path(), &["fmt", "tone.ron"])), 0);
    let text = fs::read_to_string(dir.path().join("tone.ron")).unwrap();
    assert!(text.contains("    // What it is.\n    title"), "{text}");
    assert_eq!(code(&foley(dir.path(), &["fmt", "tone.ron", "--check"])), 0);
}

#[test]
fn nodes_and_codes_explain_themselves() {
    let dir = tempfile::tempdir().unwrap();
    let list = foley(dir.path(), &["nodes"]);
    assert!(String::from_utf8_lossy(&list.stdout).contains("WavOut"));
    let one = foley(dir.path(), &["nodes", "Gain", "--json"]);
    let gain: serde_json::Value = serde_json::from_slice(&one.stdout).unwrap();
    assert_eq!(gain["inputs"][0]["name"], "audio");
    let modal = foley(dir.path(), &["nodes", "Modal"]);
    let modal = String::from_utf8_lossy(&modal.stdout).into_owned();
    assert!(
        modal.contains("ModalBank") && modal.contains("ModesFile") && !modal.contains("WavOut"),
        "{modal}"
    );
    let none = foley(dir.path(), &["nodes", "HihgPass"]);
    assert_eq!(code(&none), 2);
    assert!(String::from_utf8_lossy(&none.stderr).contains("did you mean HighPass?"));
    assert_eq!(code(&foley(dir.path(), &["explain", "f025"])), 0);
    assert_eq!(code(&foley(dir.path(), &["explain", "F999"])), 2);
}
