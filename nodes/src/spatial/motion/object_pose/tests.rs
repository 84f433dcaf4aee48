//! Tests of `ObjectPose` with scenes that are small enough to check by hand, and against the meshes of the same scenes.

use super::*;
use crate::core::params::{Datum, Params};
use crate::core::standalone::Standalone;
use crate::core::time::{seconds, ticks};
use crate::mesh::mesh_sequence::{MeshSequence, MeshSequenceParams, MeshSequencePorts};
use crate::mesh::test_files::{asset, floats};
use writer::{archive, compound, object, property, xform};

/// A mesh without symmetry.
const CORNERS: [f32; 9] = [0.0, 0.1, 0.2, 1.0, 0.3, 0.0, -0.2, 2.0, 0.5];
/// Positions of the arm, in units of the file.
const PATH: [[f64; 3]; 4] = [[0.0, 1.0, 0.0], [0.5, 1.0, -1.0], [0.5, 2.0, -1.0], [0.5, 2.0, 3.0]];
/// Angles of the arm about its axis, in degrees.
const ANGLES: [f64; 4] = [0.0, 70.0, 150.0, 110.0];
const AXIS: [f64; 3] = [0.6, 0.0, 0.8];

fn defaults<P: Params>(path: &str) -> P {
    let path = Datum::Text(path.into());
    P::read(&|name| (name == "path").then(|| path.clone())).unwrap()
}

fn params(path: &str, object: &str) -> ObjectPoseParams {
    ObjectPoseParams { object: Some(object.into()), ..defaults(path) }
}

fn standalone(p: ObjectPoseParams, file: &[u8]) -> Standalone {
    let path = p.path.0.clone();
    let mut standalone = Standalone::new::<ObjectPose>(p);
    standalone.files.insert(path, file);
    standalone
}

fn poses(p: ObjectPoseParams, file: &[u8]) -> Vec<Pose> {
    standalone(p, file).run().unwrap().stream(ObjectPosePorts::pose)
}

fn refused(p: ObjectPoseParams, file: &[u8]) -> Reject {
    standalone(p, file).shape().unwrap_err()
}

/// A moving arm with a hand, which has a constant offset, a quarter turn about x and a mesh; 30 Hz from 0.5 s on.
fn alembic_arm() -> Vec<u8> {
    let i32s = |v: &[i32]| v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let geometry = compound(
        ".geom",
        vec![
            property("P", 2, 10, 3, 1, (0, 0), vec![floats(&CORNERS)]),
            property(".faceIndices", 2, 6, 1, 1, (0, 0), vec![i32s(&[0, 2, 1])]),
            property(".faceCounts", 2, 6, 1, 1, (0, 0), vec![i32s(&[3])]),
        ],
    );
    let hand = xform(&[0x10, 0x40], vec![vec![0.0, 0.5, 0.1, 90.0]], 1);
    let hand = object(vec![hand], vec![("handShape", object(vec![geometry], vec![]))]);
    let moving = PATH.iter().zip(ANGLES).map(|(position, angle)| [&position[..], &AXIS, &[angle]].concat());
    let arm = xform(&[0x10, 0x20], moving.collect(), 1);
    archive(object(vec![], vec![("arm", object(vec![arm], vec![("hand", hand)]))]), &[0.5], 1.0 / 30.0)
}

/// The same scene as a GLB.
fn gltf_arm() -> Vec<u8> {
    let times: Vec<f32> = (0..4u8).map(|k| 0.5 + f32::from(k) / 30.0).collect();
    let path: Vec<f32> = PATH.as_flattened().iter().map(|x| *x as f32).collect();
    let rotations = ANGLES.iter().flat_map(|angle| {
        let (sin, cos) = (angle.to_radians() / 2.0).sin_cos();
        [sin * AXIS[0], sin * AXIS[1], sin * AXIS[2], cos].map(|x| x as f32)
    });
    let rotations: Vec<f32> = rotations.collect();
    asset(
        &[
            (5126, "VEC3", 3, floats(&CORNERS)),
            (5126, "SCALAR", 4, floats(&times)),
            (5126, "VEC3", 4, floats(&path)),
            (5126, "VEC4", 4, floats(&rotations)),
        ],
        r#""meshes":[{"name":"handShape","primitives":[{"attributes":{"POSITION":0}}]}],
           "nodes":[{"name":"arm","children":[1]},
             {"name":"hand","mesh":0,"translation":[0,0.5,0.1],"rotation":[0.70710678,0,0,0.70710678]}],
           "animations":[{"name":"wave","samplers":[{"input":1,"output":2},{"input":1,"output":3}],
             "channels":[{"sampler":0,"target":{"node":0,"path":"translation"}},{"sampler":1,"target":{"node":0,"path":"rotation"}}]}]"#,
    )
}

fn arms() -> [(&'static str, Vec<u8>); 2] {
    [("arm.abc", alembic_arm()), ("arm.glb", gltf_arm())]
}

/// Distance of two points.
fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    norm(std::array::from_fn(|k| a[k] - b[k]))
}

#[test]
fn a_pose_maps_the_vertices_of_a_mesh_to_those_of_a_mesh_sequence() {
    for (path, file) in arms() {
        // At 90 Hz the glTF is evaluated between its keys, with rotations along arcs.
        let rates = if path == "arm.glb" { vec![None, Some(Rate::hz(90))] } else { vec![None] };
        for rate in rates {
            for (up, metres_per_unit) in
                [(None, 1.0), (Some(UpAxis::Y), 0.01), (Some(UpAxis::Z), 1.0), (Some(UpAxis::Z), 20.0)]
            {
                let mesh = MeshSequenceParams { fps: rate, up, metres_per_unit, ..defaults(path) };
                let mut mesh = Standalone::new::<MeshSequence>(mesh);
                mesh.files.insert(path, &file[..]);
                let frames = mesh.run().unwrap().stream(MeshSequencePorts::mesh);
                let found =
                    poses(ObjectPoseParams { rate, up, metres_per_unit, ..params(path, "hand") }, &file);
                assert_eq!(frames.len(), 3 * found.len(), "{path} {rate:?} {up:?}");
                assert_eq!(found.len(), if rate.is_some() { 10 } else { 4 });
                for (k, (frame, pose)) in frames.chunks_exact(3).zip(&found).enumerate() {
                    for (vertex, corner) in frame.iter().zip(CORNERS.chunks_exact(3)) {
                        let [x, y, z] =
                            [corner[0], corner[1], corner[2]].map(|x| f64::from(x) * metres_per_unit);
                        // In local axes x is the front, y the left and z the top.
                        let local = if up == Some(UpAxis::Z) { [x, y, z] } else { [z, x, y] };
                        let error = distance(pose.to_scene(local), vertex.map(f64::from));
                        assert!(error < 1e-6 * metres_per_unit.max(1.0), "{path} {up:?}, frame {k}: {error}");
                    }
                }
            }
        }
    }
}

#[test]
fn an_object_moves_with_the_objects_above_it() {
    for (path, file) in arms() {
        let arm = poses(defaults(path), &file);
        assert_eq!(arm.len(), PATH.len());
        for (pose, [x, y, z]) in arm.iter().zip(PATH) {
            // Without a name it is the arm, the only object that is animated. Y points upward in the file, and its times are f32 in a glTF.
            assert!(distance(pose.position.map(f64::from), [x, -z, y]) < 1e-5, "{path}: {pose:?}");
        }
        let hand = poses(params(path, "hand"), &file);
        for (arm, hand) in arm.iter().zip(&hand) {
            // The offset (0, 0.5, 0.1) of the file is 0.1 m to the front and 0.5 m up.
            let offset = distance(arm.to_scene([0.1, 0.0, 0.5]), hand.position.map(f64::from));
            assert!(offset < 1e-6, "{path}: {offset}");
            // A quarter turn about x, the left side: the front of the hand is the bottom of the arm.
            let [front, bottom] = [hand.to_scene([1.0, 0.0, 0.0]), arm.to_scene([0.1, 0.0, -0.5])];
            assert!(distance(front, bottom) < 1e-6, "{path}: {front:?} {bottom:?}");
        }
        assert_eq!(poses(params(path, "handShape"), &file), hand, "{path}");
    }
    assert_eq!(
        poses(params("arm.abc", "/arm/hand"), &alembic_arm()),
        poses(params("arm.abc", "arm/hand"), &alembic_arm())
    );
}

#[test]
fn start_and_duration_select_a_part_and_poses_between_frames_are_interpolated() {
    for (path, file) in arms() {
        let p = ObjectPoseParams { rate: Some(Rate::hz(60)), ..params(path, "arm") };
        let found = poses(p.clone(), &file);
        assert_eq!(found.len(), 7, "{path}");
        assert!(distance(found[1].position.map(f64::from), [0.25, 0.5, 1.0]) < 1e-6, "{path}: {found:?}");
        // Half of the rotation from 0 to 70 degrees.
        let (a, b) = (found[1].rotation, (35_f64.to_radians() / 2.0).cos());
        let identity = poses(params(path, "arm"), &file)[0].rotation;
        let cosine: f64 = a.iter().zip(identity).map(|(x, y)| f64::from(x * y)).sum();
        assert!((cosine.abs() - b).abs() < 1e-6, "{path}: {cosine} {b}");
        let p = ObjectPoseParams { start: Some(0.45), duration: Some(0.2), ..p };
        let part = poses(p, &file);
        assert_eq!(part.len(), 12, "{path}");
        let still = (0..3).map(|k| distance(part[k].position.map(f64::from), [0.0, 0.0, 1.0]));
        assert!(still.fold(0.0, f64::max) < 1e-5, "{path}: {part:?}");
        assert!(distance(part[5].position.map(f64::from), found[2].position.map(f64::from)) < 1e-5);
        assert!(distance(part[11].position.map(f64::from), [0.5, -3.0, 2.0]) < 1e-5, "{path}: {part:?}");
    }
}

#[test]
fn windows_of_any_length_give_the_same_poses() {
    for (path, file) in arms() {
        let p = ObjectPoseParams { rate: Some(Rate::hz(1000)), ..params(path, "hand") };
        let whole = poses(p.clone(), &file);
        assert_eq!(whole.len(), 101);
        for window in [0.001, 0.0137, 0.3] {
            let run = standalone(p.clone(), &file).window(ticks(window)).run().unwrap();
            assert_eq!(run.stream(ObjectPosePorts::pose), whole, "{path}, {window}");
        }
    }
}

#[test]
fn an_object_without_animation_has_one_pose_and_never_ends() {
    let still = object(vec![xform(&[0x10], vec![vec![1.0, 2.0, 3.0]], 1)], vec![]);
    let alembic = archive(object(vec![], vec![("still", still)]), &[0.0], 1.0);
    let gltf = asset(&[], r#""nodes":[{"name":"still","translation":[1,2,3]}]"#);
    for (path, file) in [("still.abc", alembic), ("still.glb", gltf)] {
        let shape = standalone(params(path, "still"), &file).shape().unwrap();
        assert_eq!((shape.end, shape.outputs[0].as_ref().unwrap().rate), (None, Rate::hz(60)), "{path}");
        let found = poses(params(path, "still"), &file);
        assert!(found.len() >= 60 && found.iter().all(|pose| *pose == found[0]), "{path}");
        assert_eq!(found[0].position, [1.0, -3.0, 2.0], "{path}");
        let timed = ObjectPoseParams { duration: Some(0.5), ..params(path, "still") };
        assert_eq!(standalone(timed, &file).shape().unwrap().end.map(seconds), Some(0.5), "{path}");
    }
}

/// The rotations of an object whose matrices, as rows of vectors in Alembic, are given, at 24 Hz; Z points upward.
fn rotations(linear: &[[[f64; 3]; 3]]) -> Vec<Pose> {
    let matrix = |[a, b, c]: &[[f64; 3]; 3]| {
        [a, b, c].iter().flat_map(|v| [v[0], v[1], v[2], 0.0]).chain([0.0, 0.0, 0.0, 1.0]).collect()
    };
    let moving = xform(&[0x30], linear.iter().map(matrix).collect(), 1);
    let file = archive(object(vec![], vec![("x", object(vec![moving], vec![]))]), &[0.0], 1.0 / 24.0);
    poses(ObjectPoseParams { up: Some(UpAxis::Z), ..params("x.abc", "x") }, &file)
}

#[test]
fn scale_shear_and_mirroring_have_no_effect_on_the_front() {
    // The rows are the images of x, y and z: the front, the left and the top.
    let front = [0.0, 1.0, 0.0];
    let found = rotations(&[
        [front, [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.0, 7.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.0, 3.0]],
        // Shear of the left side and of the top.
        [front, [-1.0, 0.5, 0.2], [0.0, 0.8, 1.0]],
        // Mirrored: the left side is where the right one was.
        [front, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        // The scale is 0, then the top is parallel to the front: the orientation is that of the frame before.
        [[0.0; 3]; 3],
        [front, [-1.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
    ]);
    assert_eq!(found.len(), 6);
    for (k, pose) in found.iter().enumerate() {
        assert!(distance(pose.to_scene([1.0, 0.0, 0.0]), front) < 1e-6, "{k}: {pose:?}");
        assert!(distance(pose.to_scene([0.0, 0.0, 1.0]), [0.0, 0.0, 1.0]) < 1e-6, "{k}: {pose:?}");
    }
    // Before the first orientation there is that one, and without any the axes are those of the file.
    let turned = [front, [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    assert_eq!(rotations(&[[[0.0; 3]; 3], turned])[0], found[0]);
    assert_eq!(rotations(&[[[0.0; 3]; 3], [[0.0; 3]; 3]])[1], Pose::default());
}

#[test]
fn errors_name_the_file_the_parameter_and_what_would_be_right() {
    for (path, file) in arms() {
        let e = refused(params(path, "tail"), &file);
        assert!(e.code == "F070" && e.field.as_deref() == Some("object"), "{e}");
        let listed = if path == "arm.abc" { "/arm, /arm/hand" } else { "arm, hand" };
        let message = format!("{path:?}: there is no single object `tail`; the file has: {listed}");
        assert_eq!(e.message, message);
        let e = refused(ObjectPoseParams { metres_per_unit: 1e6, ..params(path, "arm") }, &file);
        assert!(e.code == "F067" && e.field.as_deref() == Some("metres_per_unit"), "{e}");
        assert!(e.message.starts_with(&format!("{path:?}: ")) && e.message.ends_with("in frame 2"), "{e}");
        let e = refused(ObjectPoseParams { start: Some(0.7), ..params(path, "arm") }, &file);
        assert!(e.code == "F051" && e.field.as_deref() == Some("start") && e.message.contains(path), "{e}");
        let e = refused(defaults(path), b"solid");
        assert!(e.code == "F070" && e.field.as_deref() == Some("path") && e.message.contains(path), "{e}");
    }
    let e = refused(ObjectPoseParams { animation: Some("run".into()), ..defaults("arm.glb") }, &gltf_arm());
    assert!(e.field.as_deref() == Some("animation") && e.message.ends_with("the file has: wave"), "{e}");
    let e = refused(defaults("cube.obj"), b"v 0 0 0\n");
    assert!(e.code == "F070" && e.message.contains("cube.obj") && e.message.contains("no transforms"), "{e}");
}

#[test]
fn objects_that_are_not_the_only_one_must_be_named() {
    let cube = |values: Vec<Vec<f64>>, child: Vec<(&'static str, writer::Item)>| {
        object(vec![xform(&[0x10], values, 1)], child)
    };
    let (still, moving) = (vec![vec![0.0; 3]], vec![vec![0.0; 3], vec![1.0; 3]]);
    let file = |a: &[Vec<f64>], b: &[Vec<f64>]| {
        let tree = vec![
            ("a", cube(a.to_vec(), vec![("cube", cube(still.clone(), vec![]))])),
            ("b", cube(b.to_vec(), vec![("cube", cube(still.clone(), vec![]))])),
        ];
        archive(object(vec![], tree), &[0.0], 1.0 / 24.0)
    };
    let e = refused(defaults("two.abc"), &file(&moving, &moving));
    assert!(e.message.ends_with("2 objects are animated; name one object: /a, /b"), "{e}");
    assert!(e.help.unwrap().contains("`object: \"/b\"`"));
    let e = refused(defaults("two.abc"), &file(&still, &still));
    assert!(e.message.ends_with("no object is animated; name one object: /a, /a/cube, /b, /b/cube"), "{e}");
    assert_eq!(poses(defaults("two.abc"), &file(&still, &moving))[1].position, [1.0, -1.0, 1.0]);
    assert!(refused(params("two.abc", "cube"), &file(&still, &moving)).message.contains("no single object"));
    assert_eq!(poses(params("two.abc", "b/cube"), &file(&still, &moving)).len(), 2);
    // At most 40 names.
    let nodes: Vec<String> = (0..60).map(|k| format!(r#"{{"name":"joint{k}"}}"#)).collect();
    let many = asset(&[], &format!(r#""nodes":[{}]"#, nodes.join(",")));
    let e = refused(params("many.glb", "tail"), &many);
    assert!(e.message.ends_with("joint38, joint39 and 20 more"), "{e}");
}

#[test]
fn transforms_that_are_not_finite_and_times_without_a_rate_are_refused() {
    let moving = |values: [f64; 3]| {
        let values = values.map(|x| vec![x, 0.0, 0.0]).to_vec();
        object(vec![], vec![("x", object(vec![xform(&[0x10], values, 1)], vec![]))])
    };
    for bad in [f64::NAN, f64::INFINITY] {
        let e = refused(params("x.abc", "x"), &archive(moving([0.0, 1.0, bad]), &[0.0], 0.04));
        assert!(e.code == "F070" && e.message.contains("`/x` is not finite in frame 2, at 0.08 s"), "{e}");
    }
    let irregular = archive(moving([0.0, 1.0, 2.0]), &[0.0, 0.1, 0.33], f64::MAX / 32.0);
    let e = refused(params("x.abc", "x"), &irregular);
    assert!(e.code == "F071" && e.field.as_deref() == Some("rate"), "{e}");
    assert!(e.message.contains("x.abc") && e.help.unwrap().contains("`rate: 60`"));
    let found = poses(ObjectPoseParams { rate: Some(Rate::hz(100)), ..params("x.abc", "x") }, &irregular);
    assert!(found.len() == 34 && (found[33].position[0] - 2.0).abs() < 1e-6);
    let reversed = archive(moving([0.0, 1.0, 2.0]), &[0.0, 0.2, 0.1], f64::MAX / 32.0);
    assert!(refused(params("x.abc", "x"), &reversed).message.contains("frame 2 is at 0.1 s"));
}
