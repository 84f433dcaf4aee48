//! The cloth graphs of the book's examples on every animation and every recording of cloth in the data beside the repository.
//!
//! Files that are missing are skipped. Tests that take longer than half a minute run on demand:
//! `cargo test --release --test suite cloth::data -- --include-ignored --nocapture`

use crate::common::{foley, graphs, shared, wav};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Files of a folder of the data with one of some endings, by name.
fn files(folder: &str, endings: &[&str]) -> Vec<PathBuf> {
    let Some(folder) = shared(folder) else { return Vec::new() };
    let ends = |p: &PathBuf| p.extension().and_then(|e| e.to_str()).is_some_and(|e| endings.contains(&e));
    let mut all: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).filter(ends).collect();
    all.sort();
    all
}

fn name(path: &Path) -> String {
    path.file_name().unwrap().to_string_lossy().into_owned()
}

/// The animations of cloth, each with the bodies that belong to it: those that move as their own animations.
fn animations() -> Vec<(PathBuf, Vec<PathBuf>)> {
    let all = files("cloth", &["pc2", "mdd", "abc", "glb", "obj"]);
    let is_body = |p: &&PathBuf| name(p).contains(".body_");
    let moves = |p: &&PathBuf| p.extension().is_some_and(|e| e != "obj");
    let stem = |p: &Path| name(p).split('.').next().unwrap_or_default().to_owned();
    let bodies = |cloth: &Path| -> Vec<PathBuf> {
        let own = all.iter().filter(is_body).filter(|p| stem(p) == stem(cloth));
        // A body that moves has an OBJ of its faces beside its animation.
        own.filter(|p| moves(p) || !p.with_extension("pc2").exists()).cloned().collect()
    };
    let cloths = all.iter().filter(moves).filter(|p| !is_body(p));
    cloths.map(|cloth| (cloth.clone(), bodies(cloth))).collect()
}

/// An example graph whose cloth, bodies and correspondences can be replaced.
#[derive(Clone, Copy)]
struct Example {
    graph: &'static str,
    wav: &'static str,
    mesh: &'static str,
    /// Nodes of bodies that other bodies can replace, and the field that lists them.
    bodies: &'static [&'static str],
    others: &'static str,
    /// Frames per second of point caches, which do not store them.
    fps: u32,
    /// Fields that name correspondences, which belong to the graph's own animation.
    marked: &'static [&'static str],
}

const FRICTION: Example = Example {
    graph: "friction.ron",
    wav: "friction.wav",
    mesh: "sheet",
    bodies: &["floor", "cylinder", "wall1", "wall2"],
    others: "contacts.others",
    fps: 60,
    marked: &[],
};
const SHEET: Example = Example {
    graph: "sheet.ron",
    wav: "sheet.wav",
    others: "cotton.bodies",
    marked: &["cotton.correspondences"],
    ..FRICTION
};

/// The graphs that are run on every animation, `friction.ron` and `sheet.ron` among them.
const EXAMPLES: [Example; 10] = [
    FRICTION,
    Example { graph: "crumple.ron", wav: "crumple.wav", bodies: &[], ..FRICTION },
    Example { graph: "target.ron", wav: "target.wav", others: "target.bodies", ..FRICTION },
    SHEET,
    Example {
        graph: "couch.ron",
        wav: "couch.wav",
        bodies: &["floor", "seat", "back", "left", "right"],
        fps: 30,
        marked: &[],
        ..SHEET
    },
    Example {
        graph: "windbreaker.ron",
        wav: "windbreaker.wav",
        mesh: "sleeve",
        bodies: &["arm"],
        others: "windbreaker.bodies",
        fps: 30,
        marked: &["windbreaker.correspondences"],
    },
    Example {
        graph: "corduroy.ron",
        wav: "corduroy.wav",
        mesh: "trousers",
        bodies: &["left", "right"],
        others: "corduroy.bodies",
        fps: 30,
        marked: &["corduroy.correspondences"],
    },
    Example {
        graph: "first_person.ron",
        wav: "first_person.wav",
        others: "ears.bodies",
        marked: &["recomposed.correspondences"],
        ..FRICTION
    },
    Example {
        graph: "two_materials.ron",
        wav: "two_materials.wav",
        bodies: &["floor", "cylinder"],
        marked: &[
            "itself_units.correspondences",
            "cover_units.correspondences",
            "crumple_units.correspondences",
        ],
        ..FRICTION
    },
    Example { graph: "live.ron", wav: "live.wav", bodies: &["floor", "wall1", "wall2"], ..FRICTION },
];

/// Arguments that put another cloth into a graph, and its bodies where the graph has nodes for them.
fn replaced(cloth: &Path, bodies: &[PathBuf], example: &Example) -> Vec<String> {
    let Example { mesh, fps, others, .. } = example;
    let mut sets = vec![format!("{mesh}.path={}", cloth.display())];
    let none = "graphs/assets/cloth/none.correspondences.ron";
    sets.extend(example.marked.iter().map(|field| format!("{field}={none}")));
    if example.bodies.is_empty() {
        return sets;
    }
    let used: Vec<_> = example.bodies.iter().zip(bodies).collect();
    for (node, body) in &used {
        sets.push(format!("{node}.path={}", body.display()));
        if body.extension().is_some_and(|e| e == "pc2") {
            sets.push(format!("{node}.fps={fps}"));
        }
    }
    let list: Vec<String> = used.iter().map(|(node, _)| format!("\"{node}\"")).collect();
    sets.push(format!("{others}=[{}]", list.join(", ")));
    sets
}

/// Runs a graph with its parts replaced, checks its outputs, none of which may clip, and reports the time.
fn sounds(graph: &str, sets: &[String], wanted: &str, reported: &str) -> f64 {
    let (folder, path) = (tempfile::tempdir().unwrap(), graphs().join("cloth").join(graph));
    let path = path.display().to_string();
    let data = shared("").unwrap().display().to_string();
    let mut arguments = vec!["run", &path, "--allow-read", &data];
    sets.iter().for_each(|set| arguments.extend(["--set", set]));
    let start = Instant::now();
    let report = foley(folder.path(), &arguments);
    for output in report["outputs"].as_array().unwrap() {
        assert!(
            output["clipped"].as_u64().is_none_or(|clipped| clipped == 0),
            "{graph} {reported}: {output}"
        );
    }
    let audio = wav(&folder.path().join(wanted));
    assert!(audio.iter().all(|x| x.is_finite()), "{reported}");
    let peak = audio.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
    let seconds = audio.len() as f64 / 48_000.0;
    println!(
        "{graph:16} {reported:44} {seconds:5.2} s of sound, peak {peak:.4}, in {:.1} s",
        start.elapsed().as_secs_f64()
    );
    assert!(seconds > 0.5, "{reported}: {seconds} s");
    f64::from(peak)
}

#[test]
fn friction_sounds_of_every_animation() {
    for (cloth, bodies) in animations() {
        let mut sets = replaced(&cloth, &bodies, &FRICTION);
        sets.push("levels=0".into());
        let peak = sounds("friction.ron", &sets, "friction.wav", &name(&cloth));
        assert!(peak > 0.0, "{}", cloth.display());
    }
}

#[test]
#[ignore = "minutes: cargo test --release --test suite cloth::data -- --include-ignored"]
fn every_example_sounds_of_every_animation() {
    let all = animations();
    for example in &EXAMPLES {
        let mut silent = Vec::new();
        // Two materials need a body that is of the other one.
        let alone = example.graph == "two_materials.ron";
        for (cloth, bodies) in all.iter().filter(|(_, bodies)| !(alone && bodies.is_empty())) {
            let reported = name(cloth);
            if sounds(example.graph, &replaced(cloth, bodies, example), example.wav, &reported) == 0.0 {
                silent.push(reported);
            }
        }
        // Values for another cloth, such as its radius, may be too small for some.
        assert!(4 * silent.len() <= all.len(), "{}: silent for {silent:?}", example.graph);
    }
}

#[test]
#[ignore = "a minute: cargo test --release --test suite cloth::data -- --include-ignored"]
fn the_chain_sounds_of_every_recording() {
    let all = files("recordings/cloth", &["flac", "wav"]);
    let none = "cotton.correspondences=graphs/assets/cloth/none.correspondences.ron";
    let list = |some: &[PathBuf]| {
        let quoted: Vec<String> = some.iter().map(|p| format!("{:?}", p.display().to_string())).collect();
        format!("[{}]", quoted.join(", "))
    };
    // Some are so soft that nothing of them is above the threshold of the examples.
    let soft = "bank.threshold=0.00003";
    for one in &all {
        let recordings = list(std::slice::from_ref(one));
        let sets = [format!("bank.recordings={recordings}"), soft.to_owned()];
        let peak = sounds("crumple.ron", &sets, "crumple.wav", &name(one));
        let sets = [format!("cotton.recordings={recordings}"), format!("cotton.{soft}"), none.to_owned()];
        assert!(peak.min(sounds("sheet.ron", &sets, "sheet.wav", &name(one))) > 0.0, "{}", name(one));
    }
    if !all.is_empty() {
        let sets = [format!("cotton.recordings={}", list(&all)), none.to_owned()];
        assert!(sounds("sheet.ron", &sets, "sheet.wav", "all of them") > 0.0);
    }
}
