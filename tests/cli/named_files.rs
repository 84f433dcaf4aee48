//! Files that the person at the keyboard names may lie anywhere; those that the text of a graph names may not.

use crate::common;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{fs, os};

const GRAPH: &str = r#"#![schema = "foley:graph/1"]
Graph(nodes: {
    "in": WavIn(path: "own.wav"),
    "out": WavOut(audio: "in", path: "copy.wav"),
})"#;

/// A project in `piece`, and recordings elsewhere: below the home and beside the project.
fn project() -> (tempfile::TempDir, PathBuf) {
    let base = tempfile::tempdir().unwrap();
    let path = fs::canonicalize(base.path()).unwrap();
    let noise = |k: i32| (k * 7919 % 20_001 - 10_000) as i16;
    for folder in ["piece", "home", "beside"] {
        fs::create_dir(path.join(folder)).unwrap();
    }
    for file in ["piece/own.wav", "home/a.wav", "beside/b.wav", "beside/with space.wav"] {
        common::write_wav(&path.join(file), 1, 48_000, (0..24_000).map(noise));
    }
    fs::write(path.join("piece/g.ron"), GRAPH).unwrap();
    (base, path)
}

/// Runs a graph in a folder with values from the command line; returns true if it succeeded, and its errors.
fn run(base: &Path, graph: &str, sets: &[&str]) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(base.join("piece")).env("HOME", base.join("home"));
    command.args(["run", graph, "--no-cache", "--quiet", "--out"]).arg(base.join("out"));
    sets.iter().for_each(|set| {
        command.args(["--set", set]);
    });
    let ran = command.output().unwrap();
    (ran.status.success(), String::from_utf8_lossy(&ran.stderr).into_owned())
}

#[test]
fn absolute_paths_paths_above_and_paths_in_the_home_may_be_set_and_the_graph_may_be_named_absolutely() {
    let (_base, path) = project();
    let absolute = format!("in.path={}", path.join("beside/b.wav").display());
    let spaced = format!("in.path={}", path.join("beside/with space.wav").display());
    for set in [&absolute[..], &spaced, "in.path=../beside/b.wav", "in.path=~/a.wav"] {
        let (ok, errors) = run(&path, "g.ron", &[set]);
        assert!(ok, "{set}: {errors}");
        assert!(path.join("out/copy.wav").is_file());
        fs::remove_file(path.join("out/copy.wav")).unwrap();
    }
    let graph = path.join("piece/g.ron").display().to_string();
    assert!(run(&path, &graph, &[&absolute]).0);
    let (ok, errors) = run(&path, "g.ron", &["in.path=~/missing.wav"]);
    assert!(!ok && errors.contains("F060") && errors.contains("home/missing.wav"), "{errors}");
}

#[test]
fn what_the_text_of_a_graph_names_stays_confined_and_a_link_that_leads_out_is_named() {
    let (_base, path) = project();
    let refused = |name: &str| {
        fs::write(path.join("piece/h.ron"), GRAPH.replace("own.wav", name)).unwrap();
        let (ok, errors) = run(&path, "h.ron", &[]);
        assert!(!ok && errors.contains("F062"), "{name}: {errors}");
        errors
    };
    refused("../beside/b.wav");
    refused(&path.join("beside/b.wav").display().to_string());
    os::unix::fs::symlink(path.join("beside"), path.join("piece/takes")).unwrap();
    let errors = refused("takes/b.wav");
    assert!(errors.contains("\"takes\" is a link to "), "{errors}");
    // Named on the command line, the same link may be followed.
    assert!(run(&path, "g.ron", &["in.path=takes/b.wav"]).0);
}
