//! Messages of the program that no graph alone causes: one case each, with its exact text in `tests/diagnostics/cli`.
//!
//! `FOLEY_BLESS=1` writes the texts again: look at the difference before it is committed.

use std::fs;
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

const CASES: &str = "tests/diagnostics/cli";

/// A graph that plays for ever, and one that ends at once.
const TONE: &str = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"tone\": Tone(frequency: 100.0, rate: 48000),
    \"out\": WavOut(audio: \"tone\", path: \"tone.wav\"),
})
";
const SHORT: &str = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"tone\": Tone(frequency: 100.0, rate: 48000, duration: Some(0.1)),
    \"out\": WavOut(audio: \"tone\", path: \"tone.wav\"),
})
";
const LOUD: &str = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"noise\": Noise(rate: 8000, duration: Some(1.0)),
    \"measured\": Loudness(audio: \"noise\"),
    \"even\": Normalize(audio: \"noise\", level: \"measured\"),
    \"out\": WavOut(audio: \"even\", path: \"even.wav\"),
})
";

fn folder(graph: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("main.ron"), graph).unwrap();
    folder
}

fn foley(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(folder).args(arguments).arg("--quiet").stdin(Stdio::null());
    command
}

/// The report without its variable parts: the folder, messages of the operating system, and further parts of the case.
fn stable(reported: &str, folder: &Path, more: &[(&str, &str)]) -> String {
    let real = folder.canonicalize().unwrap();
    let mut text =
        reported.replace(&real.display().to_string(), "DIR").replace(&folder.display().to_string(), "DIR");
    for (from, to) in more {
        text = text.replace(from, to);
    }
    // `...: Not a directory (os error 20)`
    while let Some(at) = text.find(" (os error ") {
        let end = at + text[at..].find(')').unwrap() + 1;
        let start = text[..at].rfind(": ").unwrap() + 2;
        text.replace_range(start..end, "what the system says");
    }
    text
}

/// Compares the output of a command with the text of the case, whose name is its code.
fn case(code: &str, exit: i32, output: &Output, folder: &Path, more: &[(&str, &str)]) {
    let text = stable(&String::from_utf8_lossy(&output.stderr), folder, more);
    assert_eq!(output.status.code(), Some(exit), "{code}: {text}");
    assert!(text.contains(code), "{code} is not in {text}");
    let path = Path::new(CASES).join(code.to_lowercase()).with_extension("txt");
    if std::env::var_os("FOLEY_BLESS").is_some() {
        fs::create_dir_all(CASES).unwrap();
        fs::write(&path, text).unwrap();
    } else {
        let stored = fs::read_to_string(&path).unwrap_or_default();
        assert!(stored == text, "{code} is reported otherwise:\n{text}\nFOLEY_BLESS=1 stores the new text");
    }
}

#[test]
fn f052_nothing_to_hear() {
    let folder = folder(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: { \"tone\": Tone(frequency: 100.0, rate: 48000) })\n",
    );
    let reported =
        foley(folder.path(), &["live", "main.ron", "--device", "null", "--osc", "off"]).output().unwrap();
    case("F052", 2, &reported, folder.path(), &[]);
}

#[test]
fn f053_a_node_that_runs_offline_only() {
    let graph = "graphs/cloth/units_global.ron";
    let arguments = ["live", graph, "--device", "null", "--osc", "off", "--no-cache"];
    let reported = foley(Path::new(env!("CARGO_MANIFEST_DIR")), &arguments).output().unwrap();
    case("F053", 2, &reported, Path::new(env!("CARGO_MANIFEST_DIR")), &[]);
}

#[test]
fn f054_the_device_cannot_be_had() {
    let folder = folder(TONE);
    let arguments = ["live", "main.ron", "--device", "file:main.ron/a.wav", "--osc", "off"];
    let reported = foley(folder.path(), &arguments).output().unwrap();
    case("F054", 1, &reported, folder.path(), &[]);
}

#[test]
fn f055_no_osc_while_another_program_listens() {
    let (folder, other) = (folder(TONE), UdpSocket::bind("127.0.0.1:0").unwrap());
    let port = other.local_addr().unwrap().port().to_string();
    let arguments = ["live", "main.ron", "--device", "null", "--osc", &port, "--for", "0.1"];
    let reported = foley(folder.path(), &arguments).output().unwrap();
    case("F055", 0, &reported, folder.path(), &[(&port, "PORT")]);
}

#[test]
fn f056_a_port_that_other_machines_reach() {
    let folder = folder(TONE);
    let arguments = ["live", "main.ron", "--device", "null", "--osc", "0.0.0.0:0", "--for", "0.1"];
    let mut reported = foley(folder.path(), &arguments).output().unwrap();
    let text = String::from_utf8_lossy(&reported.stderr).into_owned();
    let port: String =
        text.split("0.0.0.0:").nth(1).unwrap_or_default().chars().take_while(char::is_ascii_digit).collect();
    reported.stderr = text.replace(&format!(":{port} "), ":PORT ").into_bytes();
    case("F056", 0, &reported, folder.path(), &[]);
}

/// A file is no folder that holds another.
#[cfg(unix)]
#[test]
fn f061_the_file_cannot_be_read() {
    let folder = folder(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
    \"in\": WavIn(path: \"main.ron/in.wav\"),
    \"out\": WavOut(audio: \"in\", path: \"out.wav\"),
})\n",
    );
    let reported = foley(folder.path(), &["run", "main.ron", "--no-cache"]).output().unwrap();
    case("F061", 2, &reported, folder.path(), &[]);
}

#[test]
fn f080_the_output_folder_is_a_file() {
    let folder = folder(SHORT);
    let reported =
        foley(folder.path(), &["run", "main.ron", "--no-cache", "--out", "main.ron"]).output().unwrap();
    case("F080", 1, &reported, folder.path(), &[]);
    assert_eq!(fs::read_to_string(folder.path().join("main.ron")).unwrap(), SHORT, "nothing is touched");
}

#[test]
fn f083_a_tap_of_what_is_not_there() {
    let folder = folder(SHORT);
    let arguments = ["run", "main.ron", "--no-cache", "--tap", "ton=a.npy", "--tap", "tone=a.txt"];
    let reported = foley(folder.path(), &arguments).output().unwrap();
    case("F083", 2, &reported, folder.path(), &[]);
}

#[test]
fn f086_mistakes_in_a_test_file() {
    let folder = folder(SHORT);
    let checks = "[Peak(dB: -1.0), Silence, Events(within: 0.1)]";
    let test = format!(
        "#![schema = \"foley:test/1\"]\nTest(cases: {{ \"a\": Case(outputs: {{ \"tone\": {checks} }}) }})\n"
    );
    fs::write(folder.path().join("main.test.ron"), test).unwrap();
    let reported = foley(folder.path(), &["test", "main.ron"]).output().unwrap();
    case("F086", 2, &reported, folder.path(), &[]);
}

#[test]
fn f085_an_output_over_an_input() {
    let folder = folder(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
    \"in\": WavIn(path: \"take.wav\"),
    \"out\": WavOut(audio: \"in\", path: \"take.wav\"),
})\n",
    );
    fs::write(folder.path().join("short.ron"), SHORT.replace("tone.wav", "take.wav")).unwrap();
    assert!(foley(folder.path(), &["run", "short.ron", "--out", "."]).output().unwrap().status.success());
    let arguments = ["run", "main.ron", "--no-cache", "--out", ".", "--report", "take.wav"];
    let reported = foley(folder.path(), &arguments).output().unwrap();
    case("F085", 2, &reported, folder.path(), &[]);
}

#[test]
fn f084_a_damaged_entry_of_the_cache_is_made_anew() {
    let folder = folder(LOUD);
    let run = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
        command.current_dir(folder.path()).args(["run", "main.ron", "--cache", "cache", "--out", "."]);
        command.output().unwrap()
    };
    assert!(run().status.success());
    let sound = fs::read(folder.path().join("even.wav")).unwrap();
    let files = fs::read_dir(folder.path().join("cache")).unwrap().map(|entry| entry.unwrap().path());
    let entries: Vec<_> = files.filter(|path| path.extension().is_some_and(|e| e == "memo")).collect();
    for entry in &entries {
        let mut bytes = fs::read(entry).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        fs::write(entry, bytes).unwrap();
    }
    let mut reported = run();
    // Besides the report on the sound, which is not an error.
    let all =
        String::from_utf8_lossy(&reported.stdout).into_owned() + &String::from_utf8_lossy(&reported.stderr);
    let notes: Vec<&str> = all.lines().filter(|line| line.contains("F084")).collect();
    reported.stderr = (notes.join("\n") + "\n").into_bytes();
    let names: Vec<String> =
        entries.iter().map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect();
    let names: Vec<(&str, &str)> = names.iter().map(|name| (name.as_str(), "KEY")).collect();
    case("F084", 0, &reported, folder.path(), &names);
    assert!(fs::read(folder.path().join("even.wav")).unwrap() == sound);
}

/// Sends the signal of Ctrl-C.
#[cfg(unix)]
#[test]
fn f091_stopped_by_ctrl_c() {
    let folder = folder(TONE);
    let arguments = ["run", "main.ron", "--no-cache", "--out", ".", "--until", "80000"];
    let child = foley(folder.path(), &arguments).stderr(Stdio::piped()).spawn().unwrap();
    // Its output has begun, and so has its wait for the signal.
    let begun = || fs::read_dir(folder.path()).unwrap().count() > 1;
    for _ in 0..600 {
        if begun() {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let reported = child.wait_with_output().unwrap();
    case("F091", 75, &reported, folder.path(), &[]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left behind");
}

#[test]
fn every_case_names_a_code_that_is_in_use() {
    for entry in fs::read_dir(CASES).unwrap().map(|entry| entry.unwrap().path()) {
        let code = entry.file_stem().unwrap().to_string_lossy().to_uppercase();
        assert!(foley::diag::codes::find(&code).is_some(), "{code} is no code");
    }
}
