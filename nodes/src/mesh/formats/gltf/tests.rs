//! Tests with assets that are small enough to check by hand.

use super::*;
use crate::mesh::UpAxis;

/// An asset of one buffer: each accessor is (component type, type, count, bytes).
pub(crate) fn asset(accessors: &[(u32, &str, usize, Vec<u8>)], rest: &str) -> Vec<u8> {
    let (mut bin, mut views, mut list) = (Vec::new(), Vec::new(), Vec::new());
    for (k, (component, kind, count, bytes)) in accessors.iter().enumerate() {
        views.push(format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#, bin.len(), bytes.len()));
        let bounds = if *kind == "VEC3" { r#","min":[-9,-9,-9],"max":[9,9,9]"# } else { "" };
        list.push(format!(
            r#"{{"bufferView":{k},"componentType":{component},"type":"{kind}","count":{count}{bounds}}}"#
        ));
        bin.extend(bytes);
        bin.resize(bin.len().next_multiple_of(4), 0);
    }
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
        bin.len(),
        views.join(","),
        list.join(",")
    );
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    let mut out = b"glTF".to_vec();
    out.extend(2u32.to_le_bytes());
    out.extend(((12 + 8 + json.len() + 8 + bin.len()) as u32).to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(json.as_bytes());
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

fn read(bytes: &[u8], selection: &GltfSelection) -> Result<MeshStream, MeshError> {
    open(bytes, selection, &mut |_| Err(std::io::ErrorKind::NotFound.into()), &ReadOptions::default())
}

/// A triangle with a morph target, under a node that rotates by 90 degrees about z in 1 s.
pub(in crate::mesh) fn moving() -> Vec<u8> {
    let h = std::f32::consts::FRAC_1_SQRT_2;
    asset(
        &[
            (5126, "VEC3", 3, floats(&TRIANGLE)),
            (5126, "VEC3", 3, floats(&[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
            (5126, "SCALAR", 2, floats(&[0.0, 1.0])),
            (5126, "SCALAR", 2, floats(&[0.0, 1.0])),
            (5126, "VEC4", 2, floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, h, h])),
        ],
        r#""meshes":[{"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":1}]}]}],
           "nodes":[{"name":"arm","children":[1],"translation":[1,0,0]},{"name":"cloth","mesh":0,"scale":[2,2,2]}],
           "animations":[{"samplers":[{"input":2,"output":3},{"input":2,"output":4}],
             "channels":[{"sampler":0,"target":{"node":1,"path":"weights"}},{"sampler":1,"target":{"node":0,"path":"rotation"}}]}]"#,
    )
}

/// A triangle whose third vertex has half of its weight on a joint that moves along y.
pub(in crate::mesh) fn skinned() -> Vec<u8> {
    let mut identity = [0.0f32; 32];
    (0..8).for_each(|k| identity[16 * (k / 4) + 5 * (k % 4)] = 1.0);
    identity[16 + 12] = -1.0;
    asset(
        &[
            (5126, "VEC3", 3, floats(&TRIANGLE)),
            (5121, "VEC4", 3, [0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0].to_vec()),
            (5126, "VEC4", 3, floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0])),
            (5126, "MAT4", 2, floats(&identity)),
            (5126, "SCALAR", 2, floats(&[0.0, 0.5])),
            (5126, "VEC3", 2, floats(&[1.0, 0.0, 0.0, 1.0, 4.0, 0.0])),
        ],
        r#""meshes":[{"name":"skin mesh","primitives":[{"attributes":{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2}}]}],
           "skins":[{"joints":[1,2],"inverseBindMatrices":3}],
           "nodes":[{"mesh":0,"skin":0,"translation":[50,0,0]},{"name":"a"},{"name":"b","translation":[1,0,0]}],
           "animations":[{"samplers":[{"input":4,"output":5}],"channels":[{"sampler":0,"target":{"node":2,"path":"translation"}}]}]"#,
    )
}

fn close(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-5)
}

#[test]
fn morph_weights_and_nodes_move_together() {
    let mut s = read(&moving(), &GltfSelection { fps: Some(2.0), ..GltfSelection::default() }).unwrap();
    assert_eq!(s.clip.times(), [0.0, 0.5, 1.0]);
    assert_eq!(s.clip.topology().rest, [[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [1.0, 2.0, 0.0]]);
    let mut out = [[0.0; 3]; 3];
    s.frames.read_frame(2, &mut out).unwrap();
    assert!(close(out[0], [1.0, 0.0, 4.0]) && close(out[1], [1.0, 2.0, 0.0]), "{out:?}");
    s.frames.read_frame(1, &mut out).unwrap();
    let d = 2.0 * std::f32::consts::FRAC_1_SQRT_2;
    assert!(close(out[0], [1.0, 0.0, 2.0]) && close(out[1], [1.0 + d, d, 0.0]), "{out:?}");
}

#[test]
fn a_skin_blends_its_joints_and_ignores_its_own_node() {
    let selection = GltfSelection { object: Some("skin mesh".into()), ..GltfSelection::default() };
    let mut s = read(&skinned(), &selection).unwrap();
    assert_eq!(s.clip.times(), [0.0, 0.5]);
    assert!(s.clip.topology().rest.iter().zip(TRIANGLE.chunks(3)).all(|(r, p)| r == p));
    let mut out = [[0.0; 3]; 3];
    s.frames.read_frame(1, &mut out).unwrap();
    assert_eq!(out, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 3.0, 0.0]]);
}

#[test]
fn joints_and_nodes_of_skins_are_objects() {
    let motion = |object: Option<&str>, fps| {
        let selection = GltfSelection { object: object.map(str::to_owned), fps, ..GltfSelection::default() };
        let mut none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        object_motion(&skinned(), &selection, &mut none, &MeshLimits::default())
    };
    let joint = motion(None, None).unwrap();
    assert_eq!((joint.object(), joint.times()), ("b", &[0.0, 0.5][..]));
    assert_eq!(joint.position(1, [0.0; 3]), Some([1.0, 4.0, 0.0]));
    let fine = motion(Some("b"), Some(4.0)).unwrap();
    assert_eq!(fine.times(), [0.0, 0.25, 0.5]);
    assert_eq!(fine.position(1, [0.0; 3]), Some([1.0, 2.0, 0.0]));
    // The skin moves the vertices of a mesh and not its node.
    for name in ["skin mesh", "node 0"] {
        let node = motion(Some(name), None).unwrap();
        assert_eq!((node.times().len(), node.position(0, [0.0; 3])), (1, Some([50.0, 0.0, 0.0])), "{name}");
    }
    assert_eq!(motion(Some("node 2"), None).unwrap().object(), "b");
    let error = motion(Some("c"), None).unwrap_err().to_string();
    assert!(error.ends_with("the file has: skin mesh, a, b"), "{error}");
}

#[test]
fn strips_and_fans_become_triangles_and_points_are_rejected() {
    let square = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];
    let of_mode = |mode: u32, order: [u8; 4]| {
        let rest = format!(
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":{mode}}}]}}],"nodes":[{{"mesh":0}}]"#
        );
        read(
            &asset(&[(5126, "VEC3", 4, floats(&square)), (5121, "SCALAR", 4, order.to_vec())], &rest),
            &GltfSelection::default(),
        )
    };
    assert_eq!(of_mode(5, [0, 1, 3, 2]).unwrap().clip.topology().triangles, [[0, 1, 3], [3, 1, 2]]);
    assert_eq!(of_mode(6, [0, 1, 2, 3]).unwrap().clip.topology().triangles, [[1, 2, 0], [2, 3, 0]]);
    assert!(of_mode(0, [0, 1, 2, 3]).unwrap_err().to_string().contains("Points"));
    assert!(matches!(of_mode(4, [0, 1, 2, 3]), Err(MeshError::Malformed { .. })));
    assert!(matches!(of_mode(5, [0, 1, 9, 2]), Err(MeshError::FaceIndex { vertex: 9, vertices: 4, .. })));
}

#[test]
fn a_sparse_accessor_replaces_some_positions() {
    let json = r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"cloth.bin","byteLength":52}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":1},{"buffer":0,"byteOffset":40,"byteLength":12}],
        "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,"min":[0,0,0],"max":[9,9,9],
          "sparse":{"count":1,"indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":2}}}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}]}"#;
    let mut bin = floats(&TRIANGLE);
    bin.extend([2, 0, 0, 0]);
    bin.extend(floats(&[7.0, 8.0, 9.0]));
    let mut requested = Vec::new();
    let mut resolve = |uri: &str| {
        requested.push(uri.to_owned());
        Ok(bin.clone())
    };
    let s = open(json.as_bytes(), &GltfSelection::default(), &mut resolve, &ReadOptions::default()).unwrap();
    assert_eq!(s.clip.topology().rest, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [7.0, 8.0, 9.0]]);
    assert_eq!(requested, ["cloth.bin"]);
}

#[test]
fn a_wrong_length_in_the_header_does_not_panic() {
    let mut bytes = moving();
    bytes[8..12].copy_from_slice(&3u32.to_le_bytes());
    assert!(read(&bytes, &GltfSelection::default()).is_ok());
    bytes.truncate(40);
    assert!(matches!(read(&bytes, &GltfSelection::default()), Err(MeshError::Truncated { .. })));
    assert!(matches!(read(b"solid", &GltfSelection::default()), Err(MeshError::Format { .. })));
    let wrong = GltfSelection { object: Some("sleeve".into()), ..GltfSelection::default() };
    assert!(read(&moving(), &wrong).unwrap_err().to_string().contains("cloth"));
}

#[test]
fn the_recorded_sheet_has_nine_hundred_vertices_at_30_fps() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/cloth/small_sheet_drag_30fps.glb");
    let Ok(bytes) = std::fs::read(path) else {
        eprintln!("skipped: the recorded sheet is not here");
        return;
    };
    let mut s = read(&bytes, &GltfSelection::default()).unwrap().with_up_axis(UpAxis::Y, UpAxis::Z);
    assert_eq!((s.clip.vertex_count(), s.clip.topology().triangles.len()), (900, 1682));
    assert_eq!(crate::mesh::nominal_rate(s.clip.times()), Some((30, 1)));
    let mut out = vec![[0.0; 3]; 900];
    for k in 0..s.clip.frame_count() {
        s.frames.read_frame(k, &mut out).unwrap();
        assert!(out.iter().all(|p| p[2] > -0.05 && p.iter().all(|x| x.abs() < 5.0)), "frame {k}");
        if k == 100 {
            // Vertex 457, decoded from the file with Python's struct module; Y is up in the file.
            assert!(close(out[457], [3.454_091_9, -0.213_309_4, 0.209_302_75]), "{:?}", out[457]);
        }
    }
}
