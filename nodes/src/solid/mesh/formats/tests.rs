use super::super::shapes::block;
use super::*;
use crate::core::random::Rng;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use std::fmt::Write as _;

/// Edges in the order of mid-edge nodes of Gmsh.
const GMSH_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [2, 3], [1, 3]];

fn mesh() -> TetMesh {
    block([0.1, 0.05, 0.02], [2, 1, 1])
}

/// The mesh with a node in the middle of each edge of each element, one at a time.
fn second_order(mesh: &TetMesh) -> (Vec<[f64; 3]>, Vec<Vec<u32>>) {
    let mut nodes = mesh.nodes.clone();
    let tets = mesh.tets.iter().map(|tet| {
        let mut all = tet.to_vec();
        for [a, b] in GMSH_EDGES {
            let (a, b) = (mesh.nodes[tet[a] as usize], mesh.nodes[tet[b] as usize]);
            all.push(nodes.len() as u32);
            nodes.push([0, 1, 2].map(|k| 0.5 * (a[k] + b[k])));
        }
        all
    });
    let tets = tets.collect();
    (nodes, tets)
}

fn msh2(nodes: &[[f64; 3]], tets: &[Vec<u32>]) -> String {
    let mut text = String::from(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"bar of $steel\"\n$EndPhysicalNames\n",
    );
    let _ = write!(text, "$Nodes\n{}\n", nodes.len());
    for (k, [x, y, z]) in nodes.iter().enumerate() {
        let _ = writeln!(text, "{} {x:?} {y:?} {z:?}", 10 + k);
    }
    let _ = write!(text, "$EndNodes\n$Elements\n{}\n1 15 2 0 1 10\n", tets.len() + 1);
    for (k, tet) in tets.iter().enumerate() {
        let kind = if tet.len() == 4 { 4 } else { 11 };
        let tags: Vec<String> = tet.iter().map(|c| (c + 10).to_string()).collect();
        let _ = writeln!(text, "{} {kind} 2 1 1 {}", k + 2, tags.join(" "));
    }
    text + "$EndElements\n"
}

fn msh4(mesh: &TetMesh) -> String {
    let (n, m) = (mesh.nodes.len(), mesh.tets.len());
    let mut text = format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n2 {n} 1 {n}\n2 1 1 1\n1\n");
    let [x, y, z] = mesh.nodes[0];
    let _ = writeln!(text, "{x:?} {y:?} {z:?} 0.5 0.25\n3 1 0 {}", n - 1);
    for k in 2..=n {
        let _ = writeln!(text, "{k}");
    }
    for [x, y, z] in &mesh.nodes[1..] {
        let _ = writeln!(text, "{x:?} {y:?} {z:?}");
    }
    let _ = write!(text, "$EndNodes\n$Elements\n2 {} 1 {}\n2 1 2 1\n1 1 2 3\n3 1 4 {m}\n", m + 1, m + 1);
    for (k, tet) in mesh.tets.iter().enumerate() {
        let [a, b, c, d] = tet.map(|c| c + 1);
        let _ = writeln!(text, "{} {a} {b} {c} {d}", k + 2);
    }
    text + "$EndElements\n"
}

fn msh4_binary(mesh: &TetMesh, big: bool) -> Vec<u8> {
    fn put<const N: usize>(out: &mut Vec<u8>, mut bytes: [u8; N], big: bool) {
        if big {
            bytes.reverse();
        }
        out.extend(bytes);
    }
    let (n, m) = (mesh.nodes.len() as u64, mesh.tets.len() as u64);
    let mut out = b"$MeshFormat\n4.1 1 8\n".to_vec();
    put(&mut out, 1_i32.to_le_bytes(), big);
    out.extend(b"\n$EndMeshFormat\n$Nodes\n");
    [1, n, 1, n].iter().for_each(|x: &u64| put(&mut out, x.to_le_bytes(), big));
    [3, 1, 0].iter().for_each(|x: &i32| put(&mut out, x.to_le_bytes(), big));
    put(&mut out, n.to_le_bytes(), big);
    (1..=n).for_each(|x| put(&mut out, x.to_le_bytes(), big));
    mesh.nodes.iter().flatten().for_each(|x| put(&mut out, x.to_le_bytes(), big));
    out.extend(b"\n$EndNodes\n$Elements\n");
    [1, m, 1, m].iter().for_each(|x: &u64| put(&mut out, x.to_le_bytes(), big));
    [3, 1, 4].iter().for_each(|x: &i32| put(&mut out, x.to_le_bytes(), big));
    put(&mut out, m.to_le_bytes(), big);
    for (k, tet) in mesh.tets.iter().enumerate() {
        put(&mut out, (k as u64 + 1).to_le_bytes(), big);
        tet.iter().for_each(|c| put(&mut out, (u64::from(*c) + 1).to_le_bytes(), big));
    }
    out.extend(b"\n$EndElements\n");
    out
}

fn tetgen(mesh: &TetMesh, first: u32) -> (String, String) {
    let mut nodes = format!("# made by hand\n{} 3 1 1\n", mesh.nodes.len());
    for (k, [x, y, z]) in mesh.nodes.iter().enumerate() {
        let _ = writeln!(nodes, "{} {x:?} {y:?} {z:?} 0.5 7", k as u32 + first);
    }
    let mut elements = format!("{} 4 1\n", mesh.tets.len());
    for (k, tet) in mesh.tets.iter().enumerate() {
        let [a, b, c, d] = tet.map(|c| c + first);
        let _ = writeln!(elements, "{} {a} {b} {c} {d} 3 # region", k as u32 + first);
    }
    (elements, nodes)
}

fn vtu(mesh: &TetMesh, ascii: bool) -> String {
    let wide: Vec<u8> = mesh.nodes.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let ends: Vec<u8> = (1..=mesh.tets.len() as u32).flat_map(|k| (4 * k).to_le_bytes()).collect();
    let corners: Vec<u8> = mesh.tets.iter().flatten().flat_map(|c| i64::from(*c).to_le_bytes()).collect();
    let kinds = vec![10; mesh.tets.len()];
    let array = |kind: &str, name: &str, bytes: &[u8], text: String| {
        let (format, text) = if ascii {
            ("ascii", text)
        } else {
            let header = (bytes.len() as u64).to_le_bytes();
            ("binary", STANDARD.encode(header) + &STANDARD.encode(bytes))
        };
        format!("<DataArray type=\"{kind}\" Name='{name}' format=\"{format}\">\n{text}\n</DataArray>\n")
    };
    let join = |it: Vec<String>| it.join(" ");
    let points = array(
        "Float64",
        "Points",
        &wide,
        join(mesh.nodes.iter().flatten().map(|x| format!("{x:?}")).collect()),
    );
    let connectivity = array(
        "Int64",
        "connectivity",
        &corners,
        join(mesh.tets.iter().flatten().map(u32::to_string).collect()),
    );
    let offsets =
        array("UInt32", "offsets", &ends, join((1..=mesh.tets.len()).map(|k| (4 * k).to_string()).collect()));
    let types = array("UInt8", "types", &kinds, join(kinds.iter().map(u8::to_string).collect()));
    format!(
        "<?xml version=\"1.0\"?>\n<!-- <VTKFile> -->\n<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <UnstructuredGrid><Piece NumberOfPoints=\"1\">\n<PointData/>\n<Points>\n{points}</Points>\n<Cells>\n{connectivity}{offsets}{types}</Cells>\n\
         </Piece></UnstructuredGrid></VTKFile>\n"
    )
}

#[test]
fn all_formats_give_the_same_mesh() {
    let mesh = mesh();
    let corners: Vec<Vec<u32>> = mesh.tets.iter().map(|t| t.to_vec()).collect();
    let (nodes, tets) = second_order(&mesh);
    let files: [(&str, Vec<u8>); 10] = [
        ("medit", write_medit(&mesh).into()),
        ("medit, CRLF", write_medit(&mesh).replace('\n', "\r\n").into()),
        ("msh 2.2", msh2(&mesh.nodes, &corners).into()),
        ("msh 2.2, order 2", msh2(&nodes, &tets).into()),
        ("msh 4.1", msh4(&mesh).into()),
        ("msh 4.1, binary", msh4_binary(&mesh, false)),
        ("msh 4.1, big-endian", msh4_binary(&mesh, true)),
        ("vtu", vtu(&mesh, true).into()),
        ("vtu, base64", vtu(&mesh, false).into()),
        ("msh with a mark", ["\u{feff}", &msh4(&mesh)].concat().into()),
    ];
    for (name, bytes) in files {
        assert_eq!(read_tets(&bytes, None).as_ref(), Ok(&mesh), "{name}");
    }
    for first in [0, 1] {
        let (elements, nodes) = tetgen(&mesh, first);
        assert_eq!(read_tets(elements.as_bytes(), Some(nodes.as_bytes())).as_ref(), Ok(&mesh));
    }
}

/// One element with the edges of Gmsh, with the node of the edge between the corners 1 and 3 moved by some distance along x.
fn one_curved(off: f64) -> (Vec<[f64; 3]>, Vec<Vec<u32>>) {
    let nodes = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let (mut nodes, tets) = second_order(&TetMesh::new(nodes, vec![[0, 1, 2, 3]]).unwrap());
    nodes[9][0] += off;
    (nodes, tets)
}

#[test]
fn curved_elements_have_the_volume_within_the_curves() {
    // x = L1 + 4 s L1 L3 has the Jacobian 1 + 4 s L3, with the mean 1 + s.
    let (nodes, tets) = one_curved(0.1);
    let mesh = read_tets(msh2(&nodes, &tets).as_bytes(), None).unwrap();
    assert_eq!((mesh.nodes.len(), &mesh.curves), (4, &vec![([1, 3], [0.6, 0.0, 0.5])]));
    assert!((mesh.volume() - 1.1 / 6.0).abs() < 1e-15);
    assert_eq!(read_tets(write_medit(&mesh).as_bytes(), None), Ok(mesh.clone()));
    // The order of VTK.
    let ids: Vec<String> = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8].map(|k| tets[0][k].to_string()).into();
    let text = vtu(&TetMesh { nodes, tets: vec![[0; 4]], curves: Vec::new() }, true)
        .replace("0 0 0 0\n</", &format!("{}\n</", ids.join(" ")))
        .replace("4\n</", "10\n</")
        .replace("10\n</DataArray>\n</Cells>", "24\n</DataArray>\n</Cells>");
    assert_eq!(read_tets(text.as_bytes(), None), Ok(mesh));
}

#[test]
fn folded_elements_and_curves_of_an_unknown_order_are_errors() {
    let (nodes, tets) = one_curved(-0.6);
    let e = read_tets(msh2(&nodes, &tets).as_bytes(), None).unwrap_err();
    assert!(matches!(e, TetMeshError::Folded { tet: 0, .. }), "{e}");
    let (nodes, tets) = one_curved(0.1);
    let line = |k: usize, [x, y, z]: &[f64; 3]| format!("{k} {x:?} {y:?} {z:?}\n");
    let lines: String = nodes.iter().enumerate().map(|(k, p)| line(k, p)).collect();
    let ids: Vec<String> = tets[0].iter().map(u32::to_string).collect();
    let elements = format!("1 10 0\n0 {}\n", ids.join(" "));
    let e = read_tets(elements.as_bytes(), Some(format!("10 3 0 0\n{lines}").as_bytes())).unwrap_err();
    assert!(e.to_string().contains("curved elements of this format are not read"), "{e}");
}

#[test]
fn two_curves_of_one_edge_are_an_error() {
    let (mut nodes, tets) = second_order(&mesh());
    // The first edge of the last element belongs to another element too.
    let last = nodes.len() - 6;
    nodes[last][0] += 1e-4;
    let e = read_tets(msh2(&nodes, &tets).as_bytes(), None).unwrap_err().to_string();
    assert!(e.contains("different nodes in the middle of one edge") && e.starts_with("line "), "{e}");
}

#[test]
fn a_round_ball_passes_through_a_file() {
    let ball = crate::solid::mesh::shapes::round_ball(0.05, 4);
    let ball = TetMesh::with_curves(ball.nodes, ball.tets, ball.curves).unwrap();
    assert!(ball.curves.len() > 100);
    assert_eq!(read_tets(write_medit(&ball).as_bytes(), None), Ok(ball));
}

#[test]
fn errors_name_the_line_and_what_would_be_right() {
    let (elements, nodes) = tetgen(&mesh(), 1);
    let medit = write_medit(&mesh());
    let gmsh = msh4(&mesh());
    let cases: Vec<(String, Option<&str>, &str)> = vec![
        (String::new(), None, "an empty file"),
        ("solid bar\n".into(), None, "the formats are Gmsh"),
        ("# vtk DataFile Version 3.0\n".into(), None, "save it as .vtu"),
        (elements.clone(), None, "set `nodes`"),
        (nodes.clone(), None, "a TetGen .node file"),
        (elements.replace("12 4 1", "13 4 1"), Some(&nodes), "the file ends where"),
        (elements.replace("12 4 1", "11 4 1"), Some(&nodes), "line 13: found \"12\" after the 11 elements"),
        (elements.replace("12 4 1", "12 8 1"), Some(&nodes), "elements have 8 nodes; 4 or 10"),
        (elements, Some("4 2 0 0\n"), "line 1 of the .node file: the dimension is 2"),
        (medit.replace("\n1 ", "\n99 "), None, "names node 99, which is none of the 12 nodes"),
        (medit.replace("0.1 0.0 0.0", "0.1 x 0.0"), None, "line 7: found \"x\" where y, a number, is needed"),
        (medit.replace("Dimension 3", "Dimension 2"), None, "line 2: the dimension is 2; 3 is needed"),
        (medit.replace("Tetrahedra", "Hexahedra"), None, "there are 12 Hexahedra; tetrahedra are needed"),
        (medit.replace("Vertices\n12", "Vertices\n99999999999999999"), None, "found \"Tetrahedra\" where x"),
        (medit.replace("0.1 0.05 0.02", "nan 0.05 0.02"), None, "not finite"),
        (gmsh.replace("4.1 0", "4.0 0"), None, "line 2: the version of the format is \"4.0\"; 2.2 or 4.1"),
        (gmsh.replace("3 1 4 12", "3 1 5 12"), None, "there are hexahedra; tetrahedra"),
        (gmsh.replace("$EndElements", ""), None, "\"$EndElements\" is needed"),
        (gmsh.replace("$Nodes", "$Noddes"), None, "\"$EndNoddes\" is missing"),
        (vtu(&mesh(), true).replace(">\n10 10", ">\n12 10"), None, "cell 0 has type 12"),
        (vtu(&mesh(), true).replace("ascii", "appended"), None, "ascii or binary is needed"),
        (vtu(&mesh(), false).replace("UInt64", "UInt32"), None, "its header states"),
        (
            vtu(&mesh(), true).replace("UnstructuredGrid\" b", "PolyData\" b"),
            None,
            "UnstructuredGrid is needed",
        ),
    ];
    for (text, nodes, part) in cases {
        let e = read_tets(text.as_bytes(), nodes.map(str::as_bytes)).unwrap_err().to_string();
        assert!(e.contains(part), "{part}: {e}");
    }
}

#[test]
fn damaged_files_give_a_mesh_or_an_error() {
    let mesh = mesh();
    let corners: Vec<Vec<u32>> = mesh.tets.iter().map(|t| t.to_vec()).collect();
    let (elements, nodes) = tetgen(&mesh, 1);
    let files: [Vec<u8>; 7] = [
        write_medit(&mesh).into(),
        msh2(&mesh.nodes, &corners).into(),
        msh4(&mesh).into(),
        msh4_binary(&mesh, false),
        vtu(&mesh, true).into(),
        vtu(&mesh, false).into(),
        elements.into(),
    ];
    let mut rng = Rng::new(26);
    let mut read = [0; 7];
    for k in 0..7 * 600 {
        let mut bytes = files[k % 7].clone();
        for _ in 0..=rng.below(3) {
            let at = rng.below(bytes.len());
            match rng.below(5) {
                0 => bytes[at] = b"$<>\n\"-9e= 0\xff\x00"[rng.below(13)],
                1 => drop(bytes.remove(at)),
                2 => bytes.insert(at, b"0123456789.-\n "[rng.below(14)]),
                3 => bytes.truncate(at.max(1)),
                _ => bytes[at] ^= 1 << rng.below(8),
            }
        }
        if let Ok(mesh) = read_tets(&bytes, Some(nodes.as_bytes())) {
            read[k % 7] += 1;
            assert!(mesh.volume() > 0.0);
        }
    }
    assert!(read.iter().all(|n| *n > 20), "{read:?}");
}

#[test]
fn meshes_of_a_mesher_have_their_volumes() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/meshes");
    for (name, cubic_centimetres) in [
        ("bar_steel.msh", 72.0),
        ("bowl.msh", 139.5),
        ("plate.msh", 245.7),
        ("vase.msh", 355.7),
        ("vase.mesh", 355.7),
    ] {
        let Ok(bytes) = std::fs::read(folder.join(name)) else {
            eprintln!("skipped: {name} is not beside the repository");
            continue;
        };
        let mesh = read_tets(&bytes, None).unwrap();
        let volume = mesh.volume() * 1e6;
        assert!((volume - cubic_centimetres).abs() < 0.06, "{name}: {volume}");
        assert_eq!(mesh.quality().components, 1);
    }
}
