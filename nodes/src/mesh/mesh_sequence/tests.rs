//! Tests of `MeshSequence`: formats, rates, ends and errors for missing parameters.

use super::super::formats::test_files::{asset, floats, mdd, pc2};
use super::*;
use crate::core::params::Params;
use crate::core::standalone::Standalone;
use crate::core::time::{TICKS_PER_SECOND, seconds, ticks};

const TRIANGLE: &str = "o sheet\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn params(path: &str) -> MeshSequenceParams {
    let path = crate::core::params::Datum::Text(path.into());
    MeshSequenceParams::read(&|name| (name == "path").then(|| path.clone())).expect("only the path is needed")
}

fn standalone(p: MeshSequenceParams) -> Standalone {
    let mut standalone = Standalone::new::<MeshSequence>(p);
    standalone.files.insert("base.obj", TRIANGLE);
    standalone.files.insert("anim/sheet.pc2", pc2(4));
    standalone.files.insert("anim/irregular.mdd", mdd(&[0.0, 0.037, 0.1, 0.3]));
    standalone.files.insert("anim/sheet.mdd", mdd(&[0.0, 0.04, 0.08, 0.16]));
    for k in 8..12 {
        standalone
            .files
            .insert(format!("frame_{k:02}.obj"), TRIANGLE.replace("v 0 0 0", &format!("v 0 0 {k}")));
    }
    standalone
}

fn frames(standalone: &Standalone) -> Vec<[f32; 3]> {
    standalone.run().unwrap().stream(MeshSequencePorts::mesh)
}

#[test]
fn a_point_cache_is_resampled_to_the_given_rate() {
    let p = MeshSequenceParams {
        base: Some("base.obj".into()),
        fps: Some(Rate::hz(20)),
        ..params("anim/sheet.pc2")
    };
    // The file has a sample every half frame: the stored frames are at 40 Hz, and every second one is read.
    let standalone = standalone(p);
    let shape = standalone.shape().unwrap();
    assert_eq!(shape.outputs[0].as_ref().unwrap().rate, Rate::hz(20));
    assert_eq!(seconds(shape.end.unwrap()), 0.1);
    let found = frames(&standalone);
    assert_eq!(found.len(), 6);
    assert_eq!((found[1], found[4]), ([3.0, 4.0, 5.0], [21.0, 22.0, 23.0]));
}

#[test]
fn irregular_frames_are_resampled_onto_the_exact_rate() {
    let p = MeshSequenceParams {
        base: Some("base.obj".into()),
        fps: Some(Rate::hz(25)),
        ..params("anim/sheet.mdd")
    };
    let found = frames(&standalone(p));
    // Frames at 0, 0.04, 0.08 and 0.16 s; the one at 0.12 s is the mean of its neighbours.
    let x: Vec<f32> = found.chunks_exact(3).map(|f| f[0][0]).collect();
    let expected = [0.0, 9.0, 18.0, 22.5, 27.0];
    assert!(x.len() == 5 && x.iter().zip(expected).all(|(x, e)| (x - e).abs() < 1e-4), "{x:?}");
}

#[test]
fn a_single_obj_is_static_and_never_ends() {
    let standalone = standalone(params("base.obj"));
    let shape = standalone.shape().unwrap();
    assert_eq!(shape.end, None);
    let stream = shape.outputs[0].clone().unwrap();
    assert!(stream.format::<Mesh>().unwrap().is_static);
    assert_eq!(frames(&standalone).len(), 60 * 3);
}

#[test]
fn a_point_cache_of_one_frame_is_static_in_the_pose_of_its_frame() {
    for path in ["anim/one.pc2", "anim/one.mdd"] {
        let fps = path.ends_with("pc2").then_some(Rate::hz(30));
        let mut standalone =
            standalone(MeshSequenceParams { base: Some("base.obj".into()), fps, ..params(path) });
        standalone.files.insert("anim/one.pc2", pc2(1));
        standalone.files.insert("anim/one.mdd", mdd(&[0.5]));
        let shape = standalone.shape().unwrap();
        assert_eq!(shape.end, None);
        let stream = shape.outputs[0].clone().unwrap();
        let format = stream.format::<Mesh>().unwrap();
        let pose = [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]];
        assert!(format.is_static && format.topology.rest == pose, "{path}: {format:?}");
        let found = frames(&standalone);
        assert!(found.len() >= 30 * 3 && found.chunks_exact(3).all(|frame| frame == pose), "{path}");
    }
}

#[test]
fn a_numbered_sequence_is_read_in_the_order_of_its_numbers() {
    let p = MeshSequenceParams { fps: Some(Rate::hz(24)), ..params("frame_##.obj") };
    let heights: Vec<f32> = frames(&standalone(p)).chunks_exact(3).map(|f| f[0][2]).collect();
    assert_eq!(heights, [8.0, 9.0, 10.0, 11.0]);
}

#[test]
fn the_buffer_of_a_gltf_is_read_from_the_same_folder() {
    let mut standalone = standalone(MeshSequenceParams { up: Some(UpAxis::Y), ..params("scene/a.gltf") });
    let positions: Vec<u8> =
        [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    standalone.files.insert("scene/a.bin", positions);
    standalone.files.insert(
        "scene/a.gltf",
        r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin", "byteLength": 36}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                           "min": [0, 0, 0], "max": [1, 1, 0]}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}],
            "scenes": [{"nodes": [0]}], "scene": 0}"#,
    );
    assert_eq!(standalone.shape().unwrap().end, None);
    assert_eq!(frames(&standalone)[..3], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
}

#[test]
fn start_duration_units_and_up_axis_have_effect() {
    let p = MeshSequenceParams {
        fps: Some(Rate::hz(10)),
        start: Some(0.1),
        duration: Some(0.5),
        metres_per_unit: 0.5,
        up: Some(UpAxis::Y),
        ..params("frame_##.obj")
    };
    let found = frames(&standalone(p));
    let first: Vec<f32> = found.chunks_exact(3).map(|f| f[0][1]).collect();
    assert_eq!(first, [-4.5, -5.0, -5.5, -5.5, -5.5]);
    assert_eq!(found[2], [0.0, 0.0, 0.5]);
}

#[test]
fn errors_for_missing_parameters_name_the_field_and_a_value() {
    let reject = |p| standalone(p).shape().unwrap_err();
    let e = reject(MeshSequenceParams { fps: Some(Rate::hz(60)), ..params("anim/sheet.pc2") });
    assert_eq!((e.code, e.field.as_deref()), ("F070", Some("base")));
    assert!(e.message.contains("anim/sheet.obj"), "{e}");
    let e = reject(MeshSequenceParams { base: Some("base.obj".into()), ..params("anim/sheet.pc2") });
    assert_eq!((e.code, e.field.as_deref()), ("F071", Some("fps")));
    let e = reject(MeshSequenceParams { base: Some("base.obj".into()), ..params("anim/irregular.mdd") });
    assert!(e.code == "F071" && e.message.contains("4 frames"), "{e}");
    let e = reject(MeshSequenceParams { object: Some("skirt".into()), ..params("base.obj") });
    assert!(e.field.as_deref() == Some("object") && e.to_string().contains("`object: \"sheet\"`"), "{e}");
    assert_eq!(reject(params("frame_##.obj")).code, "F071");
    assert_eq!(reject(params("none_##.obj")).code, "F060");
    let late = MeshSequenceParams { fps: Some(Rate::hz(10)), start: Some(0.31), ..params("frame_##.obj") };
    let e = reject(late.clone());
    assert!(e.code == "F051" && e.field.as_deref() == Some("start") && e.message.contains("0.3 s"), "{e}");
    let held = standalone(MeshSequenceParams { duration: Some(0.2), ..late }).shape().unwrap();
    assert_eq!(held.end.map(seconds), Some(0.2));
    let mut gap = standalone(MeshSequenceParams { fps: Some(Rate::hz(10)), ..params("frame_##.obj") });
    gap.files.insert("frame_13.obj", TRIANGLE);
    let e = gap.shape().unwrap_err();
    assert!(e.code == "F060" && e.message.contains("number 12"), "{e}");
}

#[test]
fn an_invalid_frame_is_a_fault_with_its_time() {
    let mut standalone = standalone(MeshSequenceParams { fps: Some(Rate::hz(10)), ..params("frame_##.obj") });
    standalone.files.insert("frame_10.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 3 2\n");
    let fault = standalone.run().err().unwrap();
    assert_eq!((fault.code, fault.time), ("F070", Some(ticks(0.2))));
}

#[test]
fn windows_of_any_length_return_the_same_frames() {
    let p = MeshSequenceParams {
        base: Some("base.obj".into()),
        fps: Some(Rate::new(24_000, 1001).unwrap()),
        duration: Some(0.5),
        ..params("anim/sheet.mdd")
    };
    let expected = frames(&standalone(p.clone()).window(TICKS_PER_SECOND));
    for window in [0.001, 0.0177, 0.1] {
        assert_eq!(frames(&standalone(p.clone()).window(ticks(window))), expected);
    }
}

#[test]
fn the_base_of_a_point_cache_is_the_obj_of_the_same_name() {
    let p = MeshSequenceParams { fps: Some(Rate::hz(20)), ..params("anim/sheet.pc2") };
    let explicit = MeshSequenceParams { base: Some("base.obj".into()), ..p.clone() };
    let mut implicit = standalone(p);
    implicit.files.insert("anim/sheet.obj", TRIANGLE);
    assert_eq!(frames(&implicit), frames(&standalone(explicit)));
}

#[test]
fn a_base_that_is_not_needed_is_ignored_with_a_note() {
    let p = MeshSequenceParams { base: Some("no such file".into()), ..params("base.obj") };
    let shape = standalone(p).shape().unwrap();
    assert!(shape.notes.iter().any(|note| note.contains("`base`")), "{:?}", shape.notes);
}

/// A static triangle and a quad of two triangles, in the plane z = 0 of the file.
fn scene(second: usize) -> Vec<u8> {
    let corners = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 1.0, 2.0, 0.0];
    asset(
        &[
            (5126, "VEC3", 3, floats(&corners[..9])),
            (5126, "VEC3", second, floats(&corners[..3 * second])),
            (5123, "SCALAR", 3, [0, 0, 1, 0, 2, 0].to_vec()),
        ],
        r#""meshes":[{"primitives":[{"attributes":{"POSITION":0}}]},
            {"primitives":[{"attributes":{"POSITION":1},"indices":2}]}],
            "nodes":[{"name":"button","mesh":0},{"name":"sheet","mesh":1}],"scenes":[{"nodes":[0,1]}],"scene":0"#,
    )
}

#[test]
fn of_several_meshes_the_largest_is_read_and_the_others_are_named() {
    let with = |object: Option<&str>, second| {
        let mut standalone =
            standalone(MeshSequenceParams { object: object.map(Text::from), ..params("two.glb") });
        standalone.files.insert("two.glb", scene(second));
        standalone
    };
    let largest = with(None, 4);
    // Y points upward in the glTF and becomes Z.
    assert_eq!(frames(&largest)[..4], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [1.0, 0.0, 2.0]]);
    let notes = largest.shape().unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("Others: button")), "{notes:?}");
    assert!(with(Some("button"), 4).shape().unwrap().notes.is_empty());
    let e = with(None, 3).shape().unwrap_err();
    assert_eq!((e.code, e.field.as_deref()), ("F070", Some("object")));
}
