//! Times that a file states otherwise than `fps` or `rate` are named, by the commands that look at a graph as by those that run it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn asset(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/assets").join(file)
}

/// The notes of a command about a graph of one node, with files beside it.
fn notes(command: &str, node: &str, files: &[(&str, Vec<u8>)]) -> Vec<String> {
    let dir = tempfile::tempdir().unwrap();
    let graph = format!("#![schema = \"foley:graph/1\"]\nGraph(nodes: {{\n    \"a\": {node},\n}})\n");
    fs::write(dir.path().join("g.ron"), graph).unwrap();
    for (name, bytes) in files {
        fs::write(dir.path().join(name), bytes).unwrap();
    }
    let run = Command::new(env!("CARGO_BIN_EXE_foley"));
    let run = { run }.current_dir(dir.path()).args([command, "g.ron"]).output().unwrap();
    let all = String::from_utf8_lossy(&run.stdout).into_owned() + &String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{command} {node}: {all}");
    all.lines().filter(|line| line.contains("note") && line.contains(": ")).map(str::to_owned).collect()
}

/// Checks that `check` and `plan` note `part` for a node, and note nothing for the other one.
fn compare(differs: &str, part: &str, agrees: &str, files: &[(&str, Vec<u8>)]) {
    for command in ["check", "plan"] {
        let found = notes(command, differs, files);
        assert!(found.iter().any(|note| note.contains(part)), "{command} {differs}: {found:?}");
        let found = notes(command, agrees, files);
        assert!(!found.iter().any(|note| note.contains("second")), "{command} {agrees}: {found:?}");
    }
}

#[test]
fn a_point_cache_with_a_sample_in_two_frames_says_what_its_header_holds() {
    let name = "cloth/corduroy_trouser_legs_walk";
    let (mut cache, faces) =
        (fs::read(asset(&format!("{name}.pc2"))).unwrap(), fs::read(asset(&format!("{name}.obj"))).unwrap());
    let files = [("legs.pc2", cache.clone()), ("legs.obj", faces.clone())];
    let node = "MeshSequence(path: \"legs.pc2\", fps: 24)";
    assert_eq!(notes("check", node, &files), [""; 0]);
    cache[24..28].copy_from_slice(&2.0_f32.to_le_bytes());
    let files = [("legs.pc2", cache), ("legs.obj", faces)];
    for command in ["check", "plan"] {
        let found = notes(command, node, &files).concat();
        for part in [
            "the header of the PC2 has a sample every 2 frames: at `fps: 24` these are 12 samples a second",
            "if 24 is the rate of the samples themselves, set `fps: 48`",
        ] {
            assert!(found.contains(part), "{command}: {found}");
        }
    }
}

#[test]
fn a_file_with_times_of_its_own_says_that_fps_does_not_change_its_speed() {
    // MDD, big endian: frames, points, times, positions.
    let (frames, points) = (13_u32, 3_u32);
    let mut mdd = [frames.to_be_bytes(), points.to_be_bytes()].concat();
    (0..frames).for_each(|k| mdd.extend((k as f32 / 24.0).to_be_bytes()));
    (0..frames * points * 3).for_each(|k| mdd.extend((k as f32 * 0.001).to_be_bytes()));
    let faces = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec();
    compare(
        "MeshSequence(path: \"a.mdd\", fps: 60)",
        "the file has 24 frames a second (13 from 0 to 0.5 s) and `fps` is 60: frames between are interpolated, and the speed stays that of the file",
        "MeshSequence(path: \"a.mdd\", fps: 24)",
        &[("a.mdd", mdd), ("a.obj", faces)],
    );
}

#[test]
fn poses_of_another_rate_are_named() {
    let bvh = fs::read(asset("motion/humanoid3d_run.bvh")).unwrap();
    let text = String::from_utf8_lossy(&bvh).into_owned();
    let time: f64 = text.lines().find_map(|l| l.strip_prefix("Frame Time:")).unwrap().trim().parse().unwrap();
    let own = (1.0 / time).round();
    compare(
        "BvhPose(path: \"run.bvh\", rate: 20)",
        "and `rate` is 20: frames are left out",
        &format!("BvhPose(path: \"run.bvh\", rate: {own})"),
        &[("run.bvh", bvh)],
    );
    let gltf = fs::read(asset("motion/swing.gltf")).unwrap();
    let object = "ObjectPose(path: \"swing.gltf\", rate: 500)";
    assert!(notes("check", object, &[("swing.gltf", gltf)]).concat().contains("`rate` is 500"));
    let poses: String = (0..50).map(|k| format!("{},{k},0,0\n", f64::from(k) / 240.0)).collect();
    compare(
        "PoseFile(path: \"p.csv\")",
        "the file has 240 frames a second (50 from 0 to",
        "PoseFile(path: \"p.csv\", rate: 240)",
        &[("p.csv", format!("time_s,x,y,z\n{poses}").into_bytes())],
    );
}

#[test]
fn a_log_whose_frames_are_not_as_long_as_its_rate_says_so() {
    let log = fs::read(asset("contacts/box_slide_slope.contacts.csv")).unwrap();
    let found =
        notes("check", "ContactLog(path: \"l.csv\", rate: 240.0)", &[("l.csv", log.clone())]).concat();
    assert!(found.contains("its frames are 16.666 ms apart, 60.0 a second, and `rate` is 240"), "{found}");
    let found = notes("check", "ContactLog(path: \"l.csv\")", &[("l.csv", log)]).concat();
    assert!(!found.contains("ms apart"), "{found}");
}
