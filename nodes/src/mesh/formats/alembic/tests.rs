//! Tests with small archives, and with a recorded one.

use std::io::Cursor;

use super::writer::{Item, Prop, archive, compound, f64s, object, property, xform};
use super::*;
use crate::mesh::UpAxis;

fn f32s(v: &[f32]) -> Vec<u8> {
    v.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn i32s(v: &[i32]) -> Vec<u8> {
    v.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// A square with the clockwise winding of Alembic.
fn square(points: Prop) -> Item {
    let faces = property(".faceIndices", 2, 6, 1, 1, (0, 0), vec![i32s(&[0, 3, 2, 1])]);
    let counts = property(".faceCounts", 2, 6, 1, 1, (0, 0), vec![i32s(&[4])]);
    object(vec![compound(".geom", vec![points, faces, counts])], vec![])
}

fn corners(z: f32) -> Vec<u8> {
    f32s(&[0.0, 0.0, z, 1.0, 0.0, z, 1.0, 1.0, z, 0.0, 1.0, z])
}

/// Six frames of a square, the samples 2 and 3 of which differ: 0 0 1 2 2 2.
fn repeating() -> Prop {
    property("P", 2, 10, 3, 6, (2, 3), vec![corners(0.0), corners(1.0), corners(2.0)])
}

/// A sheet under two transforms: a static one and an animated one.
pub(in crate::mesh) fn sheet() -> Vec<u8> {
    let mesh = object(
        vec![xform(&[0x10, 0x60, 0x00], vec![vec![1.0, 0.0, 0.0, 90.0, 2.0, 2.0, 2.0]], 1)],
        vec![("sheetShape", square(repeating()))],
    );
    let top = object(
        vec![],
        vec![(
            "scene",
            object(
                vec![xform(&[0x10], vec![vec![0.0, 0.0, 5.0], vec![0.0, 0.0, 6.0]], 1)],
                vec![("sheet", mesh)],
            ),
        )],
    );
    archive(top, &[0.5], 0.25)
}

fn reader(bytes: Vec<u8>) -> Box<dyn ReadSeek> {
    Box::new(Cursor::new(bytes))
}

fn read(bytes: Vec<u8>, path: Option<&str>) -> Result<MeshStream, MeshError> {
    open(reader(bytes), path, &ReadOptions::default())
}

fn frame(s: &mut MeshStream, k: usize) -> Vec<[f32; 3]> {
    let mut out = vec![[0.0; 3]; s.clip.vertex_count()];
    s.frames.read_frame(k, &mut out).unwrap();
    out
}

#[test]
fn repeated_samples_are_read_from_one_stored_sample() {
    let mut s = read(archive(object(vec![], vec![("m", square(repeating()))]), &[0.5], 0.25), None).unwrap();
    assert_eq!(s.clip.times(), [0.5, 0.75, 1.0, 1.25, 1.5, 1.75]);
    let heights: Vec<f32> = (0..6).map(|k| frame(&mut s, k)[0][2]).collect();
    assert_eq!(heights, [0.0, 0.0, 1.0, 2.0, 2.0, 2.0]);
    // Clockwise in the file, anticlockwise here.
    assert_eq!(s.clip.topology().triangles, [[1, 2, 3], [1, 3, 0]]);
}

#[test]
fn transforms_apply_from_the_mesh_to_the_root() {
    let mut s = read(sheet(), Some("/scene/sheet/sheetShape")).unwrap();
    // Scale 2, a quarter turn about z, 1 along x, 5 then 6 along z.
    let first = frame(&mut s, 0);
    let close = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-6);
    assert!(close(first[1], [1.0, 2.0, 5.0]) && close(first[3], [-1.0, 0.0, 5.0]), "{first:?}");
    assert_eq!(s.clip.topology().rest, first);
    assert!(close(frame(&mut s, 2)[0], [1.0, 0.0, 8.0]));
}

#[test]
fn a_transform_that_does_not_inherit_ends_the_chain() {
    let mesh = object(vec![xform(&[0x10], vec![vec![1.0, 0.0, 0.0]], 0)], vec![("m", square(repeating()))]);
    let top = object(
        vec![],
        vec![("up", object(vec![xform(&[0x10], vec![vec![0.0, 9.0, 0.0]], 1)], vec![("x", mesh)]))],
    );
    assert_eq!(frame(&mut read(archive(top, &[0.0], 1.0), None).unwrap(), 0)[0], [1.0, 0.0, 0.0]);
}

#[test]
fn an_animated_matrix_moves_a_constant_mesh_at_its_own_times() {
    let matrix = |x: f64| vec![1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0];
    let points = property(
        "P",
        2,
        11,
        3,
        1,
        (0, 0),
        vec![f64s(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0])],
    );
    let mesh = object(vec![xform(&[0x30], vec![matrix(0.0), matrix(3.0)], 1)], vec![("m", square(points))]);
    // Acyclic: a list of times.
    let bytes = archive(object(vec![], vec![("x", mesh)]), &[0.1, 0.7], f64::MAX / 32.0);
    let mut s = read(bytes, None).unwrap();
    assert_eq!(s.clip.times(), [0.1, 0.7]);
    assert_eq!(frame(&mut s, 1)[1], [4.0, 0.0, 0.0]);
}

#[test]
fn cyclic_times_repeat_with_their_period() {
    let s = read(archive(object(vec![], vec![("m", square(repeating()))]), &[0.0, 0.1], 1.0), None).unwrap();
    assert_eq!(s.clip.times(), [0.0, 0.1, 1.0, 1.1, 2.0, 2.1]);
}

#[test]
fn changing_faces_are_rejected_with_the_frame() {
    let faces = property(
        ".faceIndices",
        2,
        6,
        1,
        6,
        (4, 5),
        vec![i32s(&[0, 3, 2, 1]), i32s(&[1, 0, 3, 2]), i32s(&[0, 1, 2, 3])],
    );
    let counts = property(".faceCounts", 2, 6, 1, 1, (0, 0), vec![i32s(&[4])]);
    let mesh = object(vec![compound(".geom", vec![repeating(), faces, counts])], vec![]);
    let error = read(archive(object(vec![], vec![("m", mesh)]), &[0.0], 1.0), None).unwrap_err();
    assert!(matches!(error, MeshError::TopologyChanged { frame: 4, .. }), "{error}");
    let mut fewer = corners(1.0);
    fewer.truncate(36);
    let points = property("P", 2, 10, 3, 3, (2, 2), vec![corners(0.0), fewer]);
    let mut s = read(archive(object(vec![], vec![("m", square(points))]), &[0.0], 1.0), None).unwrap();
    let error = s.frames.read_frame(2, &mut [[0.0; 3]; 4]).unwrap_err();
    assert!(matches!(error, MeshError::TopologyChanged { frame: 2, .. }), "{error}");
}

#[test]
fn the_error_for_a_wrong_path_lists_the_meshes() {
    let two =
        || archive(object(vec![], vec![("a", square(repeating())), ("b", square(repeating()))]), &[0.0], 1.0);
    assert!(read(two(), None).unwrap_err().to_string().contains("/a, /b"));
    assert!(read(two(), Some("/c")).unwrap_err().to_string().contains("/a, /b"));
    assert!(read(two(), Some("/b")).is_ok());
}

#[test]
fn the_end_of_a_path_names_an_object_if_it_is_the_only_one() {
    let motion = |object| object_motion(reader(sheet()), object, &MeshLimits::default()).unwrap();
    let sheet_only = motion(Some("sheet"));
    assert_eq!((sheet_only.object(), motion(None).object()), ("/scene/sheet", "/scene"));
    assert_eq!(motion(Some("scene/sheet")), sheet_only);
    assert_eq!(motion(Some("sheetShape")).position(1, [0.0; 3]), sheet_only.position(1, [0.0; 3]));
    assert!(object_motion(reader(sheet()), Some("heet"), &MeshLimits::default()).is_err());
    assert!(object_motion(reader(sheet()), Some(""), &MeshLimits::default()).is_err());
    assert_eq!(read(sheet(), Some("sheetShape")).unwrap().clip.vertex_count(), 4);
}

#[test]
fn the_frames_of_an_object_are_the_samples_of_all_transforms_above_it() {
    // The scene moves at 0.5 and 0.75 s: scale 2 and a quarter turn about z of the sheet, then 5 and 6 along z.
    let motion = object_motion(reader(sheet()), Some("sheet"), &MeshLimits::default()).unwrap();
    assert_eq!(motion.times(), [0.5, 0.75]);
    let close =
        |a: Option<[f64; 3]>, b: [f64; 3]| a.unwrap().iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-12);
    assert!(close(motion.position(1, [0.0; 3]), [1.0, 0.0, 6.0]));
    assert!(close(motion.position(0, [1.0, 0.0, 0.0]), [1.0, 2.0, 5.0]));
    assert!(close(motion.direction(0, [1.0, 0.0, 0.0]), [0.0, 2.0, 0.0]));
    assert_eq!(motion.position(2, [0.0; 3]), None);
    let few = MeshLimits { max_frames: 1, ..MeshLimits::default() };
    assert!(matches!(object_motion(reader(sheet()), None, &few), Err(MeshError::Limit { .. })));
}

#[test]
fn other_containers_are_rejected_by_name() {
    let hdf = read(b"\x89HDF\r\n\x1a\n--------".to_vec(), None).unwrap_err().to_string();
    assert!(hdf.contains("HDF5") && hdf.contains("Ogawa"), "{hdf}");
    let mut open = sheet();
    open[5] = 0;
    assert!(read(open, None).unwrap_err().to_string().contains("not closed"));
    assert!(matches!(read(b"solid".to_vec(), None), Err(MeshError::Format { .. })));
    let mut cut = sheet();
    cut.truncate(cut.len() - 9);
    assert!(matches!(read(cut, None), Err(MeshError::Truncated { .. })));
}

#[test]
fn the_recorded_sheet_starts_as_its_rest_pose() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/cloth/");
    let (Ok(abc), Ok(obj)) = (
        std::fs::File::open(format!("{folder}sheet_on_couch_pulled_off.abc")),
        std::fs::read(format!("{folder}sheet_on_couch_pulled_off.obj")),
    ) else {
        eprintln!("skipped: the recorded sheet is not here");
        return;
    };
    let base = crate::mesh::ObjMesh::parse(&obj, None, &MeshLimits::default()).unwrap();
    let (rest, _) = base.topology(&ReadOptions::default()).unwrap();
    let meshes = list(Box::new(abc.try_clone().unwrap()), &MeshLimits::default()).unwrap();
    assert_eq!(
        meshes.iter().filter(|m| m.vertices == 2668 && m.faces == 2565 && m.samples == 330).count(),
        1
    );
    let sheet = meshes.iter().find(|m| m.vertices == 2668).unwrap();
    let s = open(Box::new(abc), Some(&sheet.path), &ReadOptions::default()).unwrap();
    let mut s = s.with_up_axis(UpAxis::Y, UpAxis::Z);
    assert_eq!(crate::mesh::nominal_rate(s.clip.times()), Some((60, 1)));
    let distance =
        |a: &[f32; 3], b: &[f32; 3]| a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
    let max_distance =
        rest.rest.iter().zip(&s.clip.topology().rest).map(|(a, b)| distance(a, b)).fold(0.0, f32::max);
    assert!(max_distance < 1e-6, "{max_distance}");
    // The same winding: corresponding triangles have the same orientation.
    let orientation = |t: [u32; 3], p: &[[f32; 3]]| {
        let [a, b, c] = t.map(|v| p[v as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let same = rest.triangles.iter().zip(&s.clip.topology().triangles);
    assert!(
        same.clone().count() == 5130
            && same.clone().all(|(a, b)| orientation(*a, &rest.rest) * orientation(*b, &rest.rest) > 0.0)
    );
    let last = frame(&mut s, 329);
    assert!(last.iter().flatten().all(|x| x.abs() < 5.0));
    assert_ne!(last, s.clip.topology().rest);
}
