//! Tests that the command refuses to wait, to leave files behind, or to write to a terminal.

#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Runs the command, and ends it after a minute.
fn foley(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.args(arguments).current_dir(folder).env("NO_COLOR", "1").stdin(Stdio::null());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        assert!(start.elapsed() < Duration::from_secs(60) || child.kill().is_err(), "it waits for ever");
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().unwrap()
}

#[test]
fn a_device_or_a_pipe_is_no_graph_to_lay_out() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.ron");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for path in ["/dev/zero", "pipe.ron", "."] {
        let reported = foley(folder.path(), &["fmt", "--check", path]);
        let text = String::from_utf8_lossy(&reported.stderr);
        assert!(!reported.status.success() && text.contains("is not a plain file"), "{path}: {text}");
    }
}

#[test]
fn a_file_beyond_the_limit_of_the_process_is_an_error_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let graph = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"tone\": Tone(frequency: 100.0, rate: 48000, duration: Some(30.0)),
        \"out\": WavOut(audio: \"tone\", path: \"tone.wav\") })";
    fs::write(folder.path().join("main.ron"), graph).unwrap();
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -f 100; exec \"$0\" run main.ron --no-cache --out . --quiet"]);
    let reported = command.arg(env!("CARGO_BIN_EXE_foley")).current_dir(folder.path()).output().unwrap();
    let text = String::from_utf8_lossy(&reported.stderr);
    assert_eq!(reported.status.code(), Some(1), "{text}");
    assert!(text.contains("F080"), "{text}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left behind");
}

#[test]
fn names_from_a_graph_do_not_command_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let graph = "#![schema = \"foley:graph/1\"]\nGraph(title: \"\\u{1b}]0;t\\u{7}\", nodes: {
        \"tone\": Tone(frequency: 100.0, rate: 8000, duration: Some(0.1)),
        \"out\": WavOut(audio: \"tone\", path: \"\\u{1b}[2J.wav\"),
        \"\\u{9b}31m\": Tone(frequency: 100.0) })";
    fs::write(folder.path().join("wrong.ron"), graph).unwrap();
    fs::write(folder.path().join("right.ron"), graph.replace("\\u{9b}31m", "b")).unwrap();
    for arguments in
        [&["check", "wrong.ron"][..], &["run", "right.ron", "--out", "."], &["plan", "right.ron"]]
    {
        let Output { stdout, stderr, .. } = foley(folder.path(), arguments);
        let text = String::from_utf8(stdout).unwrap() + &String::from_utf8(stderr).unwrap();
        assert!(!text.contains(|c: char| c.is_control() && !"\n\t".contains(c)), "{text:?}");
        assert!(!text.is_empty());
    }
}
