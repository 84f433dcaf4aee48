//! Tests with archives of a small Ogawa writer, and with a recorded one.

use std::io::Cursor;

use super::*;
use crate::mesh::UpAxis;

/// A tree to write.
pub(in crate::mesh) enum Item {
    Data(Vec<u8>),
    Group(Vec<Item>),
}

/// Writes an item after its children and returns its position; the top bit is set for data.
fn write(item: &Item, out: &mut Vec<u8>) -> u64 {
    match item {
        Item::Data(bytes) if bytes.is_empty() => 1 << 63,
        Item::Data(bytes) => {
            let at = out.len() as u64;
            out.extend((bytes.len() as u64).to_le_bytes());
            out.extend(bytes);
            at | 1 << 63
        }
        Item::Group(items) if items.is_empty() => 0,
        Item::Group(items) => {
            let children: Vec<u64> = items.iter().map(|i| write(i, out)).collect();
            let at = out.len() as u64;
            out.extend((children.len() as u64).to_le_bytes());
            children.iter().for_each(|c| out.extend(c.to_le_bytes()));
            at
        }
    }
}

/// A property: its header and its group.
struct Prop(Vec<u8>, Item);

fn sample(bytes: Vec<u8>) -> Item {
    let mut keyed = vec![7; 16];
    keyed.extend(bytes);
    Item::Data(keyed)
}

/// `changed` is first and last changed sample; the stored samples are those between, and sample 0.
fn property(
    name: &str,
    kind: u32,
    pod: u32,
    extent: u32,
    count: u8,
    changed: (u8, u8),
    stored: Vec<Vec<u8>>,
) -> Prop {
    let mut header = (kind | pod << 4 | 0x100 | 0x200 | extent << 12).to_le_bytes().to_vec();
    header.extend([count, changed.0, changed.1, 1, name.len() as u8]);
    header.extend(name.as_bytes());
    let mut items = Vec::new();
    for bytes in stored {
        items.push(sample(bytes));
        if kind == 2 {
            items.push(Item::Data(Vec::new()));
        }
    }
    Prop(header, Item::Group(items))
}

fn compound(name: &str, sub_properties: Vec<Prop>) -> Prop {
    let mut header = 0u32.to_le_bytes().to_vec();
    header.push(name.len() as u8);
    header.extend(name.as_bytes());
    Prop(header, properties(sub_properties))
}

fn properties(list: Vec<Prop>) -> Item {
    let (mut headers, mut items) = (Vec::new(), Vec::new());
    for Prop(header, item) in list {
        headers.extend(header);
        items.push(item);
    }
    items.push(Item::Data(headers));
    Item::Group(items)
}

fn object(props: Vec<Prop>, children: Vec<(&str, Item)>) -> Item {
    let (mut headers, mut items) = (Vec::new(), vec![properties(props)]);
    for (name, item) in children {
        headers.extend((name.len() as u32).to_le_bytes());
        headers.extend(name.as_bytes());
        headers.push(0);
        items.push(item);
    }
    headers.extend([0; 32]);
    items.push(Item::Data(headers));
    Item::Group(items)
}

fn archive(top: Item, sampling: &[f64], period: f64) -> Vec<u8> {
    let mut times = Vec::new();
    for (period, list) in [(1.0, &[0.0][..]), (period, sampling)] {
        times.extend(1u32.to_le_bytes());
        times.extend(f64::to_le_bytes(period));
        times.extend((list.len() as u32).to_le_bytes());
        list.iter().for_each(|t| times.extend(t.to_le_bytes()));
    }
    let root = Item::Group(vec![
        Item::Data(vec![0; 4]),
        Item::Data(10803u32.to_le_bytes().to_vec()),
        top,
        Item::Data(Vec::new()),
        Item::Data(times),
        Item::Data(Vec::new()),
    ]);
    let mut out = b"Ogawa\xff\0\x01\0\0\0\0\0\0\0\0".to_vec();
    let at = write(&root, &mut out);
    out[8..16].copy_from_slice(&at.to_le_bytes());
    out
}

fn f32s(v: &[f32]) -> Vec<u8> {
    v.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn f64s(v: &[f64]) -> Vec<u8> {
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

/// Six frames of a square of which samples 2 and 3 differ: 0 0 1 2 2 2.
fn repeating() -> Prop {
    property("P", 2, 10, 3, 6, (2, 3), vec![corners(0.0), corners(1.0), corners(2.0)])
}

fn xform(ops: &[u8], values: Vec<Vec<f64>>, inherits: u8) -> Prop {
    let last = values.len() as u8 - 1;
    let n = values[0].len() as u32;
    let stored: Vec<Vec<u8>> = values.iter().map(|v| f64s(v)).collect();
    compound(
        ".xform",
        vec![
            property(".inherits", 1, 0, 1, 1, (0, 0), vec![vec![inherits]]),
            property(".ops", 1, 1, ops.len() as u32, 1, (0, 0), vec![ops.to_vec()]),
            property(".vals", 1, 11, n, last + 1, (u8::from(last > 0), last), stored),
        ],
    )
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
