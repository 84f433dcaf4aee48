use super::super::quality::{components, shape};
use super::super::shapes::{ball, block};
use super::*;
use crate::contact::vector::{cross, dot};

fn unit() -> Vec<[f64; 3]> {
    vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
}

#[test]
fn a_regular_tetrahedron_has_a_ratio_of_one_and_its_angle() {
    let p = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let (angle, ratio) = shape(&if signed_volume(&p) > 0.0 { p } else { [p[0], p[1], p[3], p[2]] });
    assert!((angle - (1.0_f64 / 3.0).acos().to_degrees()).abs() < 1e-9, "{angle}");
    assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
}

#[test]
fn elements_are_oriented_and_unused_nodes_dropped() {
    let mut nodes = unit();
    nodes.insert(1, [9.0; 3]);
    let mesh = TetMesh::new(nodes, vec![[0, 3, 2, 4]]).unwrap();
    assert_eq!(mesh.nodes, unit());
    assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-15);
}

#[test]
fn errors_name_the_element() {
    let new = |tets: Vec<[u32; 4]>| TetMesh::new(unit(), tets).unwrap_err();
    assert_eq!(new(vec![]), TetMeshError::Count { found: 0 });
    assert_eq!(new(vec![[0, 1, 2, 3], [1, 3, 0, 2]]), TetMeshError::Duplicate { first: 0, second: 1 });
    assert_eq!(new(vec![[0, 1, 2, 4]]), TetMeshError::Node { tet: 0, node: 4, nodes: 4 });
    assert!(matches!(new(vec![[0, 1, 2, 3], [0, 1, 2, 2]]), TetMeshError::Degenerate { tet: 1, .. }));
    let flat = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, 0.3, 1e-3]];
    assert!(matches!(TetMesh::new(flat, vec![[0, 1, 2, 3]]), Err(TetMeshError::Sliver { tet: 0, .. })));
    let far = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, f64::NAN, 0.0], [0.0, 0.0, 1.0]];
    assert_eq!(TetMesh::new(far, vec![[0, 1, 2, 3]]), Err(TetMeshError::NotFinite { node: 2 }));
}

#[test]
fn parts_that_touch_at_an_edge_are_a_hinge() {
    let mut nodes = unit();
    nodes.extend([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
    let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [0, 4, 5, 3]]).unwrap();
    assert_eq!(components(mesh.nodes.len(), &mesh.tets).unwrap_err(), TetMeshError::Hinge { parts: 2 });
    let mut nodes = unit();
    nodes.extend(unit().iter().map(|p| p.map(|x| x + 5.0)));
    let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [4, 5, 6, 7]]).unwrap();
    assert_eq!(components(mesh.nodes.len(), &mesh.tets).unwrap(), (vec![0, 0, 0, 0, 1, 1, 1, 1], 2));
}

#[test]
fn surfaces_are_closed_and_look_outwards() {
    for mesh in [block([1.0, 2.0, 0.5], [2, 3, 1]), ball(1.0, 6)] {
        let checked = TetMesh::new(mesh.nodes.clone(), mesh.tets.clone()).unwrap();
        assert_eq!(checked, mesh);
        let surface = mesh.surface().unwrap();
        // By Gauss' theorem the surface encloses the volume of the elements.
        let enclosed: f64 = surface
            .iter()
            .map(|f| {
                let [a, b, c] = f.map(|i| mesh.nodes[i as usize]);
                dot(a, cross(b, c)) / 6.0
            })
            .sum();
        assert!((enclosed / mesh.volume() - 1.0).abs() < 1e-12);
        assert_eq!(mesh.quality().components, 1);
    }
    let volume = ball(1.0, 12).volume();
    assert!((volume / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.03, "{volume}");
}
