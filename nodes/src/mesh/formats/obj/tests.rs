//! Tests of the OBJ parser.

use super::*;

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn parse(text: &str, name: Option<&str>) -> Result<ObjMesh, MeshError> {
    ObjMesh::parse(text.as_bytes(), name, &MeshLimits::default())
}

#[test]
fn all_forms_of_a_corner_name_the_same_vertex() {
    for face in [
        "1 2 3 4",
        "1/1 2/2 3/3 4/4",
        "1//9 2//9 3//9 4//9",
        "1/1/1 2/2/2 3/3/3 4/4/4",
        "-4 -3 -2 -1",
        "1/ 2/ 3/ 4/",
    ] {
        let mesh = parse(&format!("# a square\r\n{SQUARE}f {face} # end\r\n"), None).unwrap();
        assert_eq!(mesh.face(0), [0, 1, 2, 3], "{face}");
    }
}

#[test]
fn a_line_continues_after_a_backslash() {
    let mesh = parse(&format!("{SQUARE}f 1 2 \\\n3 \\\r\n4"), None).unwrap();
    assert_eq!(mesh.face(0), [0, 1, 2, 3]);
}

#[test]
fn a_selected_object_or_group_has_only_its_own_vertices() {
    let text = format!(
        "o left\n{SQUARE}f 1 2 3\no right side\nv 2 0 0\nv 3 0 0\nv 3 1 0\ng a b\nf 5 6 7\ng c\nf 1 6 7\n"
    );
    let right = parse(&text, Some("right side")).unwrap();
    assert_eq!((right.positions.len(), right.face_count()), (4, 2));
    assert_eq!((right.face(0), right.face(1)), (&[1, 2, 3][..], &[0, 2, 3][..]));
    assert_eq!(
        parse(&text, Some("b")).unwrap().positions,
        [[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1.0, 0.0]]
    );
    let error = parse(&text, Some("middle")).unwrap_err().to_string();
    assert!(error.contains("left, right side, a b, c"), "{error}");
}

#[test]
fn triangles_have_the_material_of_their_face() {
    let text =
        format!("{SQUARE}f 1 2 3 4\nusemtl silk\nf 1 1 2\nf 1 2 3\nusemtl wool cloth # thick\nf 2 3 4\n");
    let clip = parse(&text, None).unwrap().clip(vec![0.0], &ReadOptions::default()).unwrap();
    let materials = clip.materials();
    let names: Vec<_> = (0..4).map(|t| materials.name(materials.of_triangle(t))).collect();
    assert_eq!(names, ["", "", "silk", "wool cloth"]);
    let plain = parse(&format!("{SQUARE}f 1 2 3 4\n"), None).unwrap();
    assert_eq!(plain.clip(vec![0.0], &ReadOptions::default()).unwrap().materials(), &Materials::default());
}

#[test]
fn errors_name_the_line_and_the_correct_form() {
    for (text, line, part) in [
        ("v 1 2\n", 1, "at least 3"),
        ("\n\nv 1 2 x\n", 3, "`x` is not a number"),
        ("v 0 0 0\nf 1 2\n", 2, "2 corners"),
        ("v 0 0 0\nf 0 1 1\n", 2, "vertex 0"),
        ("v 0 0 0\nf -2 1 1\n", 2, "vertex -2"),
        ("f 1/1/1/1 2 3\n", 1, "not a corner"),
        ("cstype bspline\n", 1, "free-form"),
    ] {
        match parse(text, None).unwrap_err() {
            MeshError::Line { line: found, what } => {
                assert_eq!(found, line, "{text}");
                assert!(what.contains(part), "{what}");
            }
            other => panic!("{other}"),
        }
    }
    assert!(matches!(
        parse("v 0 0 0\nf 1 2 3\n", None),
        Err(MeshError::FaceIndex { face: 0, vertex: 1, .. })
    ));
}

#[test]
fn a_rest_pose_is_scaled_to_metres_and_must_be_finite() {
    let options = ReadOptions { metres_per_unit: 0.01, ..ReadOptions::default() };
    let (t, dropped) =
        parse(&format!("{SQUARE}f 1 2 3 4\nf 1 1 2\n"), None).unwrap().topology(&options).unwrap();
    assert_eq!((t.rest[2], dropped), ([0.01, 0.01, 0.0], 1));
    let nan = parse("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", None).unwrap().topology(&options);
    assert!(matches!(nan, Err(MeshError::NotFinite { vertex: 1, .. })));
    let empty = parse("v 0 0 0\n", None).unwrap().topology(&options);
    assert!(matches!(empty, Err(MeshError::Empty { vertices: 1, faces: 0, .. })));
}

#[test]
fn limits_are_enforced() {
    let limits = MeshLimits { max_vertices: 3, ..MeshLimits::default() };
    let error = ObjMesh::parse(SQUARE.as_bytes(), None, &limits).unwrap_err();
    assert!(matches!(error, MeshError::Limit { field: "max_vertices", .. }));
}
