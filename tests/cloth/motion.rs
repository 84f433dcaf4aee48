//! Animations without a sound, through the program: messages state what was found and what is needed, and silence is as
//! long as the motion.

use crate::common;
use crate::common::graphs;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// A flat sheet of 5 x 5 vertices high above the floor of the examples, as an OBJ, and
/// `lift` m above it as a point cache of some frames.
fn sheet(folder: &Path, frames: usize, lift: f32) {
    let vertices: Vec<[f32; 3]> =
        (0..25).map(|k| [0.1 * (k % 5) as f32, 0.1 * (k / 5) as f32, 5.0]).collect();
    let mut obj = String::new();
    for [x, y, z] in &vertices {
        writeln!(obj, "v {x} {y} {z}").unwrap();
    }
    for k in (0..19).filter(|k| k % 5 != 4) {
        writeln!(obj, "f {} {} {} {}", k + 1, k + 2, k + 7, k + 6).unwrap();
    }
    fs::write(folder.join("sheet.obj"), obj).unwrap();
    let mut cache = b"POINTCACHE2\0".to_vec();
    cache.extend(1_i32.to_le_bytes());
    cache.extend(25_i32.to_le_bytes());
    cache.extend(0_f32.to_le_bytes());
    cache.extend(1_f32.to_le_bytes());
    cache.extend((frames as i32).to_le_bytes());
    for _ in 0..frames {
        vertices.iter().flat_map(|[x, y, z]| [*x, *y, z + lift]).for_each(|x| cache.extend(x.to_le_bytes()));
    }
    fs::write(folder.join("sheet.pc2"), cache).unwrap();
}

fn run(graph: &str, folder: &Path, sets: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(["run", "--no-cache", "--allow-read"]).arg(folder);
    command.arg("--out").arg(folder).arg(graphs().join("cloth").join(graph));
    command.arg("--set").arg(format!("sheet.path={}", folder.join("sheet.pc2").display()));
    sets.iter().for_each(|set| {
        command.args(["--set", set]);
    });
    command.output().unwrap()
}

const UNMARKED: &str = "cotton.correspondences=graphs/assets/cloth/none.correspondences.ron";

#[test]
fn an_animation_of_one_frame_is_reported_with_what_is_needed() {
    let folder = tempfile::tempdir().unwrap();
    for (graph, sets, lift) in [
        ("friction.ron", &[][..], 0.0),
        ("crumple.ron", &[], 0.0),
        ("target.ron", &[], 0.0),
        ("sheet.ron", &[UNMARKED], 0.0),
        // Whatever the pose of its base.
        ("friction.ron", &[], 0.5),
        ("crumple.ron", &[], 0.5),
    ] {
        sheet(folder.path(), 1, lift);
        let ran = run(graph, folder.path(), sets);
        let reported = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert!(!ran.status.success(), "{graph}");
        assert!(
            reported.contains("one frame") && reported.contains("at least two frames is needed"),
            "{graph}: {reported}"
        );
        assert!(reported.contains("export the motion of the cloth"), "{graph}: {reported}");
    }
}

#[test]
fn an_animation_without_contact_or_snap_is_silence_of_its_length_with_a_note_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    sheet(folder.path(), 30, 0.0);
    for (graph, file, seconds, part) in [
        ("friction.ron", "friction.wav", 0.5, "nothing slides, so the sound of these speeds is silent"),
        ("crumple.ron", "crumple.wav", 1.1, "the cloth never snaps"),
    ] {
        let ran = run(graph, folder.path(), &[]);
        let reported =
            [ran.stdout, ran.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
        assert!(ran.status.success(), "{graph}: {reported}");
        let notes: Vec<_> = reported.lines().filter(|line| line.starts_with("note:")).collect();
        assert!(notes.iter().filter(|note| note.contains(part)).count() == 1, "{graph}: {reported}");
        assert!(notes.iter().any(|note| note.contains("metres_per_unit")), "{graph}: {reported}");
        let sound = common::wav(&folder.path().join(file));
        assert_eq!(sound.len(), (seconds * 48_000.0) as usize, "{graph}");
        // The file is dithered.
        let peak = sound.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
        assert!(peak < 1e-4, "{graph}: {peak}");
    }
}
