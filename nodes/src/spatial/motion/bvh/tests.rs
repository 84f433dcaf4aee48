use super::*;
use std::path::Path;

const ARM: &str = "HIERARCHY
ROOT Hips
{
    OFFSET 1 2 3
    CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
    JOINT Left Arm
    {
        OFFSET 0 10 0
        CHANNELS 3 Zrotation Xrotation Yrotation
        End Site
        {
            OFFSET 5 0 0
        }
    }
}
MOTION
Frames: 2
Frame Time: 0.033333
0 0 0 0 0 0 0 0 0
10 20 30 90 0 0 90 90 0
";

fn position(bvh: &Bvh, name: &str, frame: usize, up: UpAxis) -> [f32; 3] {
    let pose = bvh.pose(bvh.joint(name).unwrap(), frame, 1.0, up).unwrap();
    pose.position.map(|x| (x * 1e4).round() / 1e4)
}

fn axes(pose: Pose) -> [[f64; 3]; 3] {
    let origin = pose.position.map(f64::from);
    let axis = |v| {
        let v = pose.to_scene(v);
        std::array::from_fn(|k| ((v[k] - origin[k]) * 1e4).round() / 1e4 + 0.0)
    };
    [axis([1.0, 0.0, 0.0]), axis([0.0, 1.0, 0.0]), axis([0.0, 0.0, 1.0])]
}

#[test]
fn offsets_add_up_without_rotation() {
    let bvh = Bvh::read(ARM.as_bytes()).unwrap();
    assert_eq!((bvh.frames(), bvh.frame_time(), bvh.rate()), (2, 0.033333, Some(Rate::hz(30))));
    assert_eq!(position(&bvh, "Hips", 0, UpAxis::Z), [1.0, 2.0, 3.0]);
    assert_eq!(position(&bvh, "Left Arm", 0, UpAxis::Z), [1.0, 12.0, 3.0]);
    assert_eq!(position(&bvh, "Left Arm/end", 0, UpAxis::Z), [6.0, 12.0, 3.0]);
    assert_eq!(
        bvh.pose(2, 0, 0.5, UpAxis::Y),
        Pose::looking([3.0, -1.5, 6.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0])
    );
    assert_eq!((bvh.pose(3, 0, 1.0, UpAxis::Y), bvh.pose(0, 2, 1.0, UpAxis::Y)), (None, None));
}

#[test]
fn rotations_apply_in_the_order_of_the_channels() {
    let bvh = Bvh::read(ARM.as_bytes()).unwrap();
    // The root turns x to y and the bone (0, 10, 0) to (-10, 0, 0). The arm turns by z, then about its new x axis: in its parent its
    // x axis is y, its y axis is z and its z axis is x; in the world they are -x, z and y.
    assert_eq!(position(&bvh, "Left Arm", 1, UpAxis::Z), [1.0, 22.0, 33.0]);
    assert_eq!(position(&bvh, "Left Arm/end", 1, UpAxis::Z), [-4.0, 22.0, 33.0]);
    let arm = bvh.joint("Left Arm").unwrap();
    let [x, y, z] = axes(bvh.pose(arm, 1, 1.0, UpAxis::Z).unwrap());
    assert_eq!((x, y, z), ([-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]));
    // In a scene with Z up, the z axis of the joint is its front: y, which becomes z; its left, -x, stays -x; its top, z, becomes -y.
    let [front, left, top] = axes(bvh.pose(arm, 1, 1.0, UpAxis::Y).unwrap());
    assert_eq!((front, left, top), ([0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]));
    assert_eq!((bvh.channel(0, 1, 1), bvh.channel(arm, 1, 1)), (Some(20.0), Some(90.0)));
    assert_eq!((bvh.channel(arm, 3, 1), bvh.channel(2, 0, 1), bvh.channel(0, 0, 2)), (None, None, None));
}

#[test]
fn another_order_of_channels_is_another_rotation() {
    let swapped = ARM.replace("3 Zrotation Xrotation", "3 Xrotation Zrotation");
    let bvh = Bvh::read(swapped.as_bytes()).unwrap();
    // The x axis becomes y by the rotation about z, and then z by the one about x; the root leaves z as it is.
    assert_eq!(position(&bvh, "Left Arm/end", 1, UpAxis::Z), [1.0, 22.0, 38.0]);
}

#[test]
fn positions_of_any_joint_add_to_its_offset() {
    let moved = ARM.replace("CHANNELS 3 Z", "CHANNELS 4 Yposition Z").replace("90 90 0\n", "-4 90 90 0\n");
    let bvh = Bvh::read(moved.replace("0 0 0 0 0 0 0 0 0\n", "0 0 0 0 0 0 2 0 0 0\n").as_bytes()).unwrap();
    assert_eq!(position(&bvh, "Left Arm", 0, UpAxis::Z), [1.0, 14.0, 3.0]);
    assert_eq!(position(&bvh, "Left Arm", 1, UpAxis::Z), [5.0, 22.0, 33.0]);
}

#[test]
fn blanks_line_ends_case_and_a_byte_order_mark_do_not_matter() {
    let bvh = Bvh::read(ARM.as_bytes()).unwrap();
    let (hierarchy, motion) = ARM.split_at(ARM.find("MOTION").unwrap());
    for text in [
        ARM.replace('\n', "\r\n"),
        ARM.replace('\n', "\r"),
        ARM.replace("    ", "\t"),
        format!("\u{feff}\n\n{ARM}\n\n \u{1a}"),
        format!(
            "{}{motion}",
            hierarchy.replace("Left Arm\n    {", "Left Arm {").replace("CHANNELS", "channels\n")
        ),
        format!("{}{motion}", hierarchy.replace("rotation", "ROTATION").replace("End Site\n", "end site")),
        ARM.replace("Frames: 2", "Frames:2").replace("Frame Time: ", "frame  time :\t"),
        ARM.replace("0 0 0 0 0 0 0 0 0\n", "  0\t0 0e0 0.0 -0 +0 .0 0. 0 \n\n"),
    ] {
        assert_eq!(Bvh::read(text.as_bytes()).as_ref(), Ok(&bvh), "{text}");
    }
}

#[test]
fn joints_are_found_by_name_case_and_namespace() {
    let text = "HIERARCHY ROOT ns:Hips { OFFSET 0 0 0 CHANNELS 1 Xposition
        JOINT Hand { OFFSET 0 0 0 CHANNELS 0 End Site { OFFSET 1 0 0 } End Site { OFFSET 2 0 0 } }
        JOINT hand { OFFSET 0 0 0 CHANNELS 0 }
        JOINT a:Foot { OFFSET 0 0 0 CHANNELS 0 }
        JOINT b:Foot { OFFSET 0 0 0 CHANNELS 0 } } MOTION Frames: 1 Frame Time: 1\n0";
    let bvh = Bvh::read(text.as_bytes()).unwrap();
    for (name, index) in [
        ("ns:Hips", Some(0)),
        ("NS:hips", Some(0)),
        ("Hips", Some(0)),
        ("hips", Some(0)),
        ("hand", Some(4)),
        ("HAND", None),
        ("Hand/end", Some(2)),
        ("Hand/end2", Some(3)),
        ("a:foot", Some(5)),
        ("Foot", None),
        ("Head", None),
        ("", None),
    ] {
        assert_eq!(bvh.joint(name), index, "{name}");
    }
    let parents: Vec<Option<usize>> = bvh.joints().iter().map(|joint| joint.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(1), Some(1), Some(0), Some(0), Some(0)]);
}

#[test]
fn frame_rates_are_standard_within_their_rounding() {
    let rate = |time: &str| Bvh::read(ARM.replace("0.033333", time).as_bytes()).unwrap().rate();
    for (time, num, den) in [
        (".03333", 30, 1),
        ("0.0333667", 30_000, 1001),
        ("0.008342", 120_000, 1001),
        ("0.00833", 120, 1),
        ("0.041708", 24_000, 1001),
        ("0.01", 100, 1),
        ("0.008", 125, 1),
        ("2", 1, 2),
        ("0.0025", 400, 1),
    ] {
        assert_eq!(rate(time), Rate::new(num, den), "{time}");
    }
}

#[test]
fn errors_name_the_line_and_what_would_be_right() {
    for (from, to, line, part) in [
        ("HIERARCHY", "RIFF", 1, "found \"RIFF\"; `HIERARCHY` is needed"),
        ("ROOT", "JOINT", 2, "`ROOT` is needed"),
        ("ROOT Hips\n", "ROOT\n", 3, "a joint without a name"),
        ("OFFSET 1 2 3", "OFFSET 1 2", 5, "z of the OFFSET of `Hips` is \"CHANNELS\""),
        (
            "OFFSET 1 2 3",
            "OFFSET 1 2 inf",
            4,
            "z of the OFFSET of `Hips` is \"inf\"; a number from -1e9 to 1e9",
        ),
        ("OFFSET 1 2 3", "", 15, "`Hips` ends without OFFSET"),
        ("OFFSET 1 2 3", "OFFSET 1 2 3 OFFSET 1 2 3", 4, "`Hips` has a second OFFSET"),
        ("OFFSET 1 2 3", "OFFSET 1 2 3 4", 4, "found \"4\" in `Hips`; OFFSET, CHANNELS, JOINT"),
        ("CHANNELS 3 Zrotation Xrotation Yrotation", "", 14, "`Left Arm` ends without CHANNELS"),
        ("CHANNELS 3 ", "CHANNELS 2 ", 9, "found \"Yrotation\""),
        ("CHANNELS 3 ", "CHANNELS 4 ", 10, "channel 4 of 4 of `Left Arm` is \"End\"; channels are Xposition"),
        ("CHANNELS 3 ", "CHANNELS 99 ", 9, "\"99\" CHANNELS; a whole number from 0 to 64"),
        ("Xrotation\n", "Xscale\n", 5, "is \"Xscale\""),
        ("OFFSET 5 0 0", "CHANNELS 1 Xposition", 12, "found \"CHANNELS\" in an End Site"),
        ("End Site", "End Point", 10, "`Site` is needed"),
        ("MOTION", "ROOT Other\n", 16, "a second ROOT"),
        ("MOTION", "", 17, "found \"Frames:\"; `MOTION` is needed"),
        ("Frames: 2", "Frames: 0", 17, "`Frames` is \"0\"; a number from 1 to 4194304"),
        ("Frames: 2", "Frames: 1.5", 17, "a whole number of frames"),
        ("Frames: 2", "Frames: 3", 20, "ends after 2 of the 3 rows"),
        ("Frames: 2", "Frames: 1", 20, "after the 1 that"),
        ("Frames: 2\n", "", 17, "found \"Frame Time\"; `Frames:` and a number"),
        ("Frame Time: 0.033333", "", 19, "`Frame Time:` and a number"),
        ("0.033333", "0", 18, "`Frame Time` is \"0\"; a number from 0.00001 to 100"),
        ("0.033333", "-1", 18, "`Frame Time` is \"-1\""),
        ("90 90 0\n", "90 90\n", 20, "8 value(s) where the joints have 9 channels"),
        ("90 90 0\n", "90 90 0 0\n", 20, "10 value(s)"),
        ("90 90 0\n", "90 nan 0\n", 20, "value 8, Xrotation of `Left Arm`, is \"nan\""),
        ("90 90 0\n", "90 0,5 0\n", 20, "is \"0,5\""),
    ] {
        let text = ARM.replacen(from, to, 1);
        assert_ne!(text, ARM, "{from}");
        let e = Bvh::read(text.as_bytes()).unwrap_err();
        assert!(e.line == line && e.message.contains(part), "{to}: {e}");
    }
    let none = "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 0 } MOTION Frames: 1 Frame Time: 1\n";
    assert!(Bvh::read(none.as_bytes()).unwrap_err().message.contains("no joint has a channel"));
    let deep = format!("HIERARCHY ROOT a {{ {}", "JOINT a {".repeat(5000));
    assert!(Bvh::read(deep.as_bytes()).unwrap_err().message.contains("more joints than 4096"));
    let promise = ARM.replace("Frames: 2", "Frames: 4194304");
    assert!(Bvh::read(promise.as_bytes()).unwrap_err().message.contains("ends after 2 of the 4194304"));
}

#[test]
fn damaged_files_are_errors_or_files_but_never_panics() {
    let check = |bytes: &[u8]| {
        if let Ok(bvh) = Bvh::read(bytes) {
            for joint in 0..bvh.joints().len() {
                assert!(bvh.pose(joint, bvh.frames() - 1, 1.0, UpAxis::Y).is_some());
            }
        }
    };
    for end in 0..ARM.len() {
        check(&ARM.as_bytes()[..end]);
        for byte in [0, b'\n', b' ', b'{', b'}', b':', b'9', b'e', 0xff] {
            let mut bytes = ARM.as_bytes().to_vec();
            bytes[end] = byte;
            check(&bytes);
        }
    }
    let lines: Vec<&str> = ARM.lines().collect();
    for k in 0..lines.len() {
        let without = [&lines[..k], &lines[k + 1..]].concat().join("\n");
        assert!(Bvh::read(without.as_bytes()).is_err(), "without line {}: {without}", k + 1);
        assert!(k == 0 || Bvh::read(lines[..k].join("\n").as_bytes()).is_err(), "{k}");
    }
}

type Expected = (&'static str, usize, [f64; 3], [f64; 3], [f64; 3]);

/// Joint and frame, with position and the local x and z axes by products of 4 by 4 matrices in double precision, in the coordinates of the file.
const EXPECTED: [Expected; 6] = [
    (
        "root",
        0,
        [0.0000000, 0.8475300, 0.0000000],
        [0.9951138, -0.0987350, 0.0000000],
        [-0.0027882, -0.0281017, 0.9996012],
    ),
    (
        "neck/end",
        7,
        [0.2882745, 1.5075786, 0.0053153],
        [0.9967058, -0.0633216, 0.0506756],
        [-0.0509950, -0.0034375, 0.9986930],
    ),
    (
        "right_elbow/end",
        13,
        [0.6383603, 0.9035023, 0.2990416],
        [0.6871338, 0.5208876, -0.5064812],
        [0.3363679, 0.3898261, 0.8572586],
    ),
    (
        "left_ankle/end",
        38,
        [0.9912883, 0.0090174, -0.0549148],
        [0.9486505, -0.3144348, -0.0345394],
        [0.0307486, -0.0170097, 0.9993824],
    ),
    (
        "left_ankle",
        20,
        [0.8681051, 0.0528278, -0.0381618],
        [0.9948320, 0.0909696, -0.0450971],
        [0.0356671, 0.1027470, 0.9940679],
    ),
    (
        "right_knee",
        38,
        [1.4227930, 0.4609150, 0.0977948],
        [0.9813185, 0.1896124, 0.0325738],
        [-0.0367503, 0.0185512, 0.9991523],
    ),
];

#[test]
fn recorded_motion_equals_products_of_matrices() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/mocap");
    let Ok(bytes) = std::fs::read(folder.join("humanoid3d_walk.bvh")) else {
        println!("no humanoid3d_walk.bvh in {folder:?}: skipped");
        return;
    };
    let bvh = Bvh::read(&bytes).unwrap();
    assert_eq!((bvh.frames(), bvh.joints().len(), bvh.rate()), (39, 18, Some(Rate::hz(30))));
    for (name, frame, position, x_axis, z_axis) in EXPECTED {
        let joint = bvh.joint(name).unwrap();
        let pose = bvh.pose(joint, frame, 1.0, UpAxis::Z).unwrap();
        let x = pose.to_scene([1.0, 0.0, 0.0]);
        let z = pose.to_scene([0.0, 0.0, 1.0]);
        for k in 0..3 {
            let origin = f64::from(pose.position[k]);
            for (found, want) in
                [(origin, position[k]), (x[k] - origin, x_axis[k]), (z[k] - origin, z_axis[k])]
            {
                assert!((found - want).abs() < 2e-6, "{name} {frame}: {found} {want}");
            }
        }
    }
}
