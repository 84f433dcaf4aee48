//! Invariants of stiffness and mass.

use crate::core::random::Rng;
use crate::solid::fem::assembly::Discretisation;
use crate::solid::fem::block_matrix::BlockMatrix;
use crate::solid::fem::elements::Order;
use crate::solid::fem::rigid::rigid_motions;
use crate::solid::mesh::shapes::{block, round_ball};
use crate::solid::mesh::tet_mesh::TetMesh;
use faer::Mat;

pub(super) use crate::solid::model::analytic::STEEL;
const ORDERS: [Order; 2] = [Order::Linear, Order::Quadratic];

/// A block whose inner nodes are moved.
fn uneven() -> TetMesh {
    let mut mesh = block([0.1, 0.08, 0.06], [3, 3, 3]);
    let [low, high] = mesh.bounds();
    let mut rng = Rng::new(3);
    for p in &mut mesh.nodes {
        if (0..3).all(|k| p[k] > low[k] + 1e-9 && p[k] < high[k] - 1e-9) {
            p.iter_mut().for_each(|x| *x += rng.between(-4e-3, 4e-3));
        }
    }
    TetMesh::new(mesh.nodes, mesh.tets).unwrap()
}

fn assembled(order: Order) -> (TetMesh, Discretisation, BlockMatrix) {
    of_mesh(uneven(), order)
}

/// A ball with curved edges in order 2.
fn curved() -> (TetMesh, Discretisation, BlockMatrix) {
    let mesh = round_ball(0.05, 4);
    of_mesh(TetMesh::with_curves(mesh.nodes, mesh.tets, mesh.curves).unwrap(), Order::Quadratic)
}

fn of_mesh(mesh: TetMesh, order: Order) -> (TetMesh, Discretisation, BlockMatrix) {
    let space = Discretisation::new(&mesh, order);
    let matrix = space.assemble(&STEEL);
    (mesh, space, matrix)
}

#[test]
fn matrices_are_symmetric_and_the_mass_is_that_of_the_volume() {
    for (mesh, _, matrix) in ORDERS.map(assembled).into_iter().chain([curved()]) {
        let [stiffness, mass] = matrix.dense();
        assert_eq!(stiffness, stiffness.transpose().to_owned());
        assert_eq!(mass, mass.transpose().to_owned());
        let total: f64 = matrix.mass.iter().sum();
        assert!((total / (STEEL.density * mesh.volume()) - 1.0).abs() < 1e-12, "{total}");
    }
}

#[test]
fn mid_edge_nodes_are_shared() {
    let (mesh, space, _) = assembled(Order::Quadratic);
    // Euler's formula for a ball: nodes - edges + faces - elements = 1.
    let faces = (4 * mesh.tets.len() + mesh.surface().unwrap().len()) / 2;
    assert_eq!(space.middles.len(), mesh.nodes.len() + faces - mesh.tets.len() - 1);
    assert_eq!(space.nodes.len(), mesh.nodes.len() + space.middles.len());
}

#[test]
fn rigid_motions_have_no_elastic_energy() {
    for (mesh, space, matrix) in ORDERS.map(assembled).into_iter().chain([curved()]) {
        let rigid = rigid_motions(&mesh, &space, &matrix).unwrap();
        let force = matrix.stiffness_times(rigid.as_ref());
        let bound = matrix.absolute_stiffness_times(rigid.as_ref());
        let gram = rigid.transpose() * matrix.mass_times(rigid.as_ref());
        for i in 0..6 {
            assert!(force.col(i).norm_l2() < 1e-10 * bound.col(i).norm_l2());
            (0..6).for_each(|j| assert!((gram[(i, j)] - f64::from(i == j)).abs() < 1e-13));
        }
    }
}

#[test]
fn linear_displacements_pass_the_patch_test() {
    let mut rng = Rng::new(8);
    for order in ORDERS {
        let (mesh, space, matrix) = assembled(order);
        let [low, high] = mesh.bounds();
        let gradient: [[f64; 3]; 3] =
            std::array::from_fn(|_| std::array::from_fn(|_| rng.between(-1.0, 1.0)));
        let u = Mat::from_fn(3 * space.nodes.len(), 1, |i, _| {
            (0..3).map(|k| gradient[i % 3][k] * space.nodes[i / 3][k]).sum::<f64>()
        });
        let force = matrix.stiffness_times(u.as_ref());
        let largest = matrix.absolute_stiffness_times(u.as_ref()).col(0).norm_max();
        let mut inner = 0;
        for (i, p) in space.nodes.iter().enumerate() {
            if (0..3).all(|k| p[k] > low[k] + 1e-9 && p[k] < high[k] - 1e-9) {
                inner += 1;
                (0..3).for_each(|a| assert!(force[(3 * i + a, 0)].abs() < 1e-9 * largest));
            }
        }
        assert!(inner > 3);
        // The energy is that of the strain, which is constant.
        let [lambda, mu] = STEEL.lame();
        let strain = |a: usize, b: usize| 0.5 * (gradient[a][b] + gradient[b][a]);
        let trace: f64 = (0..3).map(|k| strain(k, k)).sum();
        let squares: f64 = (0..9).map(|k| strain(k / 3, k % 3).powi(2)).sum();
        let expected = mesh.volume() * (lambda * trace * trace + 2.0 * mu * squares);
        let energy = (u.transpose() * &force)[(0, 0)];
        assert!((energy / expected - 1.0).abs() < 1e-12, "{energy} {expected}");
    }
}

#[test]
fn linear_displacements_of_curved_elements_have_their_energy() {
    let (mesh, space, matrix) = curved();
    assert!(space.curved.iter().any(|c| *c) && space.curved.iter().any(|c| !c));
    // Stretched along x: (lambda + 2 mu) V, and no force inside.
    let u =
        Mat::from_fn(3 * space.nodes.len(), 1, |i, _| if i % 3 == 0 { space.nodes[i / 3][0] } else { 0.0 });
    let force = matrix.stiffness_times(u.as_ref());
    let [lambda, mu] = STEEL.lame();
    let energy = (u.transpose() * &force)[(0, 0)] / ((lambda + 2.0 * mu) * mesh.volume());
    assert!((energy - 1.0).abs() < 1e-12, "{energy}");
    let largest = matrix.absolute_stiffness_times(u.as_ref()).col(0).norm_max();
    let inner =
        (0..space.nodes.len()).filter(|i| space.nodes[*i].iter().map(|x| x * x).sum::<f64>() < 0.0015);
    let mut count = 0;
    for i in inner {
        count += 1;
        (0..3).for_each(|a| assert!(force[(3 * i + a, 0)].abs() < 1e-9 * largest));
    }
    assert!(count > 50, "{count}");
}

#[test]
fn curves_on_straight_edges_give_the_same_matrices() {
    let mut mesh = uneven();
    let (_, _, straight) = of_mesh(mesh.clone(), Order::Quadratic);
    let edges: std::collections::BTreeSet<[u32; 2]> =
        mesh.tets.iter().flat_map(crate::solid::mesh::element::edges).collect();
    mesh.curves = edges.into_iter().map(|ends| (ends, mesh.middle(ends))).collect();
    let (_, space, curved) = of_mesh(mesh, Order::Quadratic);
    assert!(space.curved.iter().all(|c| *c));
    let near = |a: &[f64], b: &[f64]| {
        let largest = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-12 * largest)
    };
    assert!(near(&straight.mass, &curved.mass));
    assert!(near(straight.stiffness.as_flattened(), curved.stiffness.as_flattened()));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| assembled(Order::Quadratic).2)
    };
    assert_eq!(with(1), with(3));
}
