//! The commands around a graph: drawing it, a new project, the schema, the explanations, the book.

use super::command::foley;
use foley::diag::codes;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Output;

fn stdout(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout.clone()).unwrap()
}

#[test]
fn a_new_project_runs_and_can_be_drawn() {
    let dir = tempfile::tempdir().unwrap();
    stdout(&foley(dir.path(), &["new", "wind"]));
    let project = dir.path().join("wind");
    assert!(fs::read_to_string(project.join("README.md")).unwrap().starts_with("# wind\n"));
    stdout(&foley(&project, &["run", "wind.ron"]));
    assert!(fs::metadata(project.join("out/wind.wav")).unwrap().len() > 3 * 48_000 * 3);
    stdout(&foley(&project, &["fmt", "wind.ron", "--check"]));

    stdout(&foley(&project, &["graph", "wind.ron", "--svg", "wind.svg"]));
    let drawn = fs::read_to_string(project.join("wind.svg")).unwrap();
    for text in ["Wind", "air", "HighPass", "cutoff", "48000 Hz, mono", "closes a loop"] {
        assert_eq!(drawn.contains(text), text != "cutoff" && text != "closes a loop", "{text}");
    }
    assert_eq!(stdout(&foley(&project, &["graph", "wind.ron", "--svg", "-"])), drawn);
}

#[test]
fn a_folder_with_something_in_it_is_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("mine.txt"), "mine").unwrap();
    let made = foley(dir.path(), &["new", "."]);
    assert_eq!(made.status.code(), Some(2));
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    let made = foley(dir.path(), &["new", "mine.txt"]);
    assert_eq!(made.status.code(), Some(2));
}

#[test]
fn a_graph_without_end_is_drawn_with_its_rates() {
    let dir = tempfile::tempdir().unwrap();
    let text = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"wind\": Noise(rate: 44100, channels: 2),
    \"room\": Mix(inputs: [\"wind\", \"echo\"]),
    \"echo\": Feedback(audio: \"room\", like: \"wind\", delay: 0.1),
    \"out\": WavOut(audio: \"room\", path: \"a.wav\"),
})";
    fs::write(dir.path().join("a.ron"), text).unwrap();
    let drawn = stdout(&foley(dir.path(), &["graph", "a.ron", "--svg", "-"]));
    assert!(drawn.contains("44100 Hz, stereo") && drawn.contains("closes a loop"), "{drawn}");
    let listed = stdout(&foley(dir.path(), &["graph", "a.ron"]));
    let lines = [
        "wind  Noise       [44100 Hz, stereo]",
        "echo  Feedback  audio <- room (closes a loop); like <- wind  [44100 Hz, stereo]",
        "room  Mix       inputs <- wind, echo  [44100 Hz, stereo]",
        "out   WavOut    audio <- room",
    ];
    for line in lines {
        assert!(listed.lines().any(|l| l == line), "{line}\n{listed}");
    }
    // The plan of a graph without end is that of its first second.
    let planned = foley(dir.path(), &["plan", "a.ron"]);
    assert!(stdout(&planned).contains("latency of out"), "{planned:?}");
    assert!(String::from_utf8_lossy(&planned.stderr).contains("never ends"), "{planned:?}");
}

#[test]
fn every_code_is_explained_on_the_command_line() {
    let dir = tempfile::tempdir().unwrap();
    for code in codes::all().iter().step_by(7) {
        let text = stdout(&foley(dir.path(), &["explain", &code.code.to_lowercase()]));
        assert!(text.starts_with(&format!("{}: {}\n\n", code.code, code.title)), "{text}");
    }
    let unknown = foley(dir.path(), &["explain", "F998"]);
    assert_eq!(unknown.status.code(), Some(2));
}

#[test]
fn the_schema_is_json_and_names_every_node_type() {
    let dir = tempfile::tempdir().unwrap();
    let schema: Value = serde_json::from_str(&stdout(&foley(dir.path(), &["schema"]))).unwrap();
    let list: Value = serde_json::from_str(&stdout(&foley(dir.path(), &["nodes", "--json"]))).unwrap();
    for node in list.as_array().unwrap() {
        let name = node["name"].as_str().unwrap();
        let of = &schema["$defs"][name];
        let fields = of["properties"].as_object().unwrap();
        for spec in node["params"].as_array().unwrap().iter().chain(node["inputs"].as_array().unwrap()) {
            assert!(fields.contains_key(spec["name"].as_str().unwrap()), "{name}: {spec}");
        }
        assert_eq!(of["x-outputs"].as_array().unwrap().len(), node["outputs"].as_array().unwrap().len());
    }
}

#[test]
fn docs_are_written_and_then_up_to_date() {
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(foley(dir.path(), &["docs", "--check"]).status.code(), Some(2), "there is no book");
    let source = dir.path().join("docs/src");
    fs::create_dir_all(source.join("reference/nodes")).unwrap();
    fs::write(source.join("SUMMARY.md"), "# Summary\n").unwrap();
    fs::write(source.join("reference/nodes/gone.md"), "# gone\n").unwrap();
    assert_eq!(foley(dir.path(), &["docs", "--check"]).status.code(), Some(1));
    stdout(&foley(dir.path(), &["docs", "--write"]));
    stdout(&foley(dir.path(), &["docs", "--check"]));
    assert!(!source.join("reference/nodes/gone.md").exists());
    assert!(fs::read_to_string(source.join("reference/nodes/dsp.md")).unwrap().contains("## Gain\n"));
    // The pages of the book are in the program.
    let listed = stdout(&foley(dir.path(), &["docs"]));
    assert!(listed.contains("cloth") && listed.contains("nodes/scrape"), "{listed}");
    let page = stdout(&foley(dir.path(), &["docs", "cloth"]));
    assert_eq!(page, include_str!("../../docs/src/cloth.md"));
    assert!(stdout(&foley(dir.path(), &["docs", "nodes/scrape"])).contains("## TwoTextures"));
    let wrong = foley(dir.path(), &["docs", "clot"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("there are: cloth"), "{wrong:?}");
}

/// A reader that has seen enough, such as `head`, is no reason to panic.
#[cfg(unix)]
#[test]
fn a_closed_pipe_ends_the_command_in_silence() {
    for args in [&["nodes", "--json"][..], &["schema"], &["completions", "bash"], &["explain", "F001"]] {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_foley"))
            .args(args)
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert!(output.stderr.is_empty(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(0), "{args:?}");
    }
}

#[test]
fn limits_are_said_with_the_flag_that_raises_them() {
    let dir = tempfile::tempdir().unwrap();
    let inner = "#![schema = \"foley:graph/1\"]\nGraph(nodes: { \"tone\": Tone(frequency: 100.0, rate: 8000, duration: Some(0.1)) })";
    let middle = "#![schema = \"foley:graph/1\"]\nGraph(use: { \"in\": (path: \"inner.ron\") }, nodes: {
        \"louder\": Gain(audio: \"in.tone\", gain: 2.0),
    })";
    let outer = "#![schema = \"foley:graph/1\"]\nGraph(use: { \"mid\": (path: \"middle.ron\") }, nodes: {
        \"out\": WavOut(audio: \"mid.louder\", path: \"a.wav\"),
    })";
    for (name, text) in [("inner.ron", inner), ("middle.ron", middle), ("outer.ron", outer)] {
        fs::write(dir.path().join(name), text).unwrap();
    }
    for command in ["check", "run"] {
        for (flag, enough) in [("--max-depth", 2), ("--max-nodes", 3), ("--max-links", 2)] {
            let refused = foley(dir.path(), &[command, "outer.ron", flag, &(enough - 1).to_string()]);
            let output = String::from_utf8_lossy(&refused.stderr).into_owned();
            assert_eq!(refused.status.code(), Some(2), "{command} {flag}: {output}");
            assert!(output.contains("F009") && output.contains(flag), "{command} {flag}: {output}");
            stdout(&foley(dir.path(), &[command, "outer.ron", flag, &enough.to_string()]));
        }
    }
}

/// Writes graphs that each use the next one three times; `node` stands in each.
fn nested(dir: &Path, files: usize, node: &str) {
    for k in 0..files {
        let uses: String = (0..3).map(|n| format!("\"s{n}\": \"g{}.ron\", ", k + 1)).collect();
        let uses = if k + 1 < files { uses } else { String::new() };
        let text = format!("#![schema = \"foley:graph/1\"]\nGraph(use: {{ {uses} }}, nodes: {{ {node} }})");
        fs::write(dir.join(format!("g{k}.ron")), text).unwrap();
    }
}

#[test]
fn small_files_that_stand_for_millions_of_nodes_are_refused_once() {
    let dir = tempfile::tempdir().unwrap();
    for node in ["", "\"t\": Tone(frequency: 100.0, rate: 8000, duration: Some(0.1))"] {
        nested(dir.path(), 14, node);
        let refused = foley(dir.path(), &["check", "g0.ron"]);
        let output = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{output}");
        assert_eq!(output.matches("F009").count(), 1, "{output}");
    }
    nested(dir.path(), 4, "\"t\": Tone(frequency: 100.0, rate: 8000, duration: Some(0.1))");
    stdout(&foley(dir.path(), &["check", "g0.ron"]));
}

#[test]
fn likeness_finds_what_a_sound_repeats() {
    let dir = tempfile::tempdir().unwrap();
    let noise = |seed: u64, samples: usize| -> Vec<i16> {
        let mut x = seed;
        let mut next = || {
            x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (x >> 50) as i16 - 8192
        };
        (0..samples).map(|_| next()).collect()
    };
    let rate = 16_000;
    let (take, own) = (noise(1, 3 * rate), noise(2, rate));
    crate::common::write_wav(&dir.path().join("take.wav"), 1, rate as u32, take);
    // 1 s, and the same again.
    let twice: Vec<i16> = own.iter().chain(&own).copied().collect();
    crate::common::write_wav(&dir.path().join("twice.wav"), 1, rate as u32, twice);
    let run = |arguments: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_foley"))
            .arg("likeness")
            .args(arguments)
            .current_dir(dir.path())
            .output()
            .unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.success(), text(&output.stdout), text(&output.stderr))
    };
    let (is_done, json, _) = run(&["twice.wav", "take.wav", "--json", "--svg", "twice.svg"]);
    assert!(is_done);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let share = json["repeats"]["share"].as_f64().unwrap();
    assert!((share - 0.5).abs() < 0.03, "{share}");
    let lag = json["repeats"]["longest"][0]["lag"].as_f64().unwrap();
    assert!((lag - 1.0).abs() < 1e-3, "{lag}");
    assert!(std::fs::read_to_string(dir.path().join("twice.svg")).unwrap().starts_with("<svg"));
    let (is_done, text, _) = run(&["take.wav", "take.wav"]);
    assert!(is_done && text.contains("repeats"), "{text}");
    let (is_done, _, message) = run(&["twice.wav", "none.wav"]);
    assert!(!is_done && message.contains("none.wav"), "{message}");
}

#[test]
fn an_older_graph_is_upgraded_in_place_and_its_comments_stay() {
    let dir = tempfile::tempdir().unwrap();
    let old = "// Old.\nGraph(nodes: {\n    \"take\": WavIn(path: \"a.wav\"),\n    \"mfcc\": Mfcc(audio: \"take\", balance: \"take\"), // features\n})\n";
    fs::write(dir.path().join("a.ron"), old).unwrap();
    let found = foley(dir.path(), &["check", "a.ron"]);
    let text = String::from_utf8_lossy(&found.stderr).into_owned();
    assert!(text.contains("it is gone: put InterauralCues") && text.contains("`foley upgrade`"), "{text}");
    let checked = foley(dir.path(), &["upgrade", "--check", "a.ron"]);
    assert_eq!(checked.status.code(), Some(1));
    assert_eq!(fs::read_to_string(dir.path().join("a.ron")).unwrap(), old);
    let shown = stdout(&foley(dir.path(), &["upgrade", "a.ron"]));
    assert!(shown.contains("a.ron:4: `mfcc`: `balance` is removed: put InterauralCues"), "{shown}");
    let new = fs::read_to_string(dir.path().join("a.ron")).unwrap();
    assert_eq!(new, format!("#![schema = \"foley:graph/1\"]\n{}", old.replace(", balance: \"take\"", "")));
    assert_eq!(stdout(&foley(dir.path(), &["upgrade", "--check", "a.ron"])), "");
    fs::write(dir.path().join("b.ron"), "Graph(nodes: {").unwrap();
    let wrong = foley(dir.path(), &["upgrade", "b.ron"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("F001"));
}
