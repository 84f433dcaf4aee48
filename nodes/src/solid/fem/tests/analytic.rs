//! Bar, plate and sphere against the theories of beams, thin plates and elasticity.

use super::solver::{frequencies, solve};
use crate::solid::fem::eigen::Request;
use crate::solid::fem::elements::Order;
use crate::solid::mesh::formats::read_tets;
use crate::solid::mesh::shapes::{ball, block, round_ball};
use crate::solid::mesh::tet_mesh::TetMesh;
use crate::solid::model::analytic::{
    BAR, BENDING, LONGITUDINAL, PLATE, RADIUS, SPHERE, STEEL, TORSION, plate, sphere as sphere_modes,
    sphere_unit,
};

fn modes(mesh: &TetMesh, order: Order, highest: f64) -> Vec<f64> {
    frequencies(&solve(mesh, order, &STEEL, &Request { highest, ..Request::default() }).unwrap())
}

/// Relative difference.
fn off(found: f64, expected: f64) -> f64 {
    found / expected - 1.0
}

#[test]
fn a_steel_bar_has_the_modes_of_beam_theory() {
    let coarse = modes(&block(BAR, [20, 2, 2]), Order::Quadratic, 13e3);
    assert_eq!(coarse.len(), 8);
    // Each bending mode twice, then torsion between them.
    for (pair, expected) in [[0, 1], [2, 3], [5, 6]].iter().zip(BENDING) {
        pair.iter().for_each(|k| assert!((0.0..0.01).contains(&off(coarse[*k], expected)), "{coarse:?}"));
    }
    assert!((0.0..0.025).contains(&off(coarse[4], TORSION)));
    assert!(off(coarse[7], LONGITUDINAL).abs() < 5e-4);
}

#[test]
fn linear_elements_are_too_stiff_in_bending() {
    let linear = modes(&block(BAR, [40, 4, 4]), Order::Linear, 4e3);
    // CHECKED: 2717 and 2912 Hz with another arrangement of as many elements.
    assert!(linear.iter().all(|f| off(*f, BENDING[0]) > 0.05), "{linear:?}");
}

#[test]
#[ignore = "seconds"]
fn a_finer_bar_is_closer() {
    let coarse = modes(&block(BAR, [20, 2, 2]), Order::Quadratic, 13e3);
    let fine = modes(&block(BAR, [40, 4, 4]), Order::Quadratic, 13e3);
    assert!(coarse.iter().zip(&fine).all(|(a, b)| a >= b));
    for (k, expected) in [(0, BENDING[0]), (2, BENDING[1]), (5, BENDING[2]), (4, TORSION)] {
        let (before, after) = (off(coarse[k], expected).abs(), off(fine[k], expected).abs());
        assert!(after < before && after < 0.003, "{k}: {before} {after}");
    }
}

#[test]
fn a_free_square_plate_has_the_modes_of_thin_plates() {
    let modes = plate(24).unwrap();
    assert!(modes.len() == 5 && modes.iter().all(|m| m.difference().abs() < 0.01), "{modes:?}");
    // The sixth: RECALLED as 61.1.
    let [a, h] = PLATE;
    let found = self::modes(&block([a, a, h], [24, 24, 1]), Order::Quadratic, 900.0);
    assert!(found.len() >= 6);
}

/// Relative differences of the lowest and the highest mode of each group of a ball.
fn sphere(cells: usize, first: usize) -> Vec<(f64, f64)> {
    let groups = sphere_modes(cells).unwrap();
    groups[..first]
        .iter()
        .map(|m| (off(m.computed_hz[0], m.theory_hz), off(m.computed_hz[1], m.theory_hz)))
        .collect()
}

#[test]
fn a_sphere_has_modes_in_groups_of_their_multiplicity() {
    for (k, (low, high)) in sphere(6, 2).into_iter().enumerate() {
        assert!(low > 0.0 && high < 0.02, "{k}: {low} {high}");
    }
}

#[test]
fn a_ball_with_curved_edges_is_closer_to_the_sphere() {
    // 384 elements. Found: volume -7.12 and -0.06 %, T2 2.64 and 0.25 %, S2 2.77 and 0.32 %.
    const CELLS: usize = 4;
    let unit = sphere_unit();
    // Errors of the volume, and of the mean frequencies of T2 and S2.
    let errors = |mesh: &TetMesh| {
        let found = modes(mesh, Order::Quadratic, 2.9 * unit);
        assert_eq!(found.len(), 10);
        let mean = |k: usize| found[5 * k..5 * k + 5].iter().sum::<f64>() / 5.0 / unit;
        let volume = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
        [off(mesh.volume(), volume), off(mean(0), SPHERE[0].0), off(mean(1), SPHERE[1].0)]
    };
    let straight = errors(&ball(RADIUS, CELLS));
    let round = round_ball(RADIUS, CELLS);
    let round = TetMesh::with_curves(round.nodes, round.tets, round.curves).unwrap();
    let curved = errors(&round);
    for (k, (straight, curved)) in straight.iter().zip(curved).enumerate() {
        assert!(curved.abs() < [0.02, 0.15, 0.15][k] * straight.abs(), "{k}: {straight} {curved}");
    }
}

#[test]
#[ignore = "seconds"]
fn a_finer_sphere_is_closer() {
    let (coarse, fine) = (sphere(8, 5), sphere(12, 5));
    for (k, ((_, before), (low, high))) in coarse.into_iter().zip(fine).enumerate() {
        assert!(low > 0.0 && high < before && high < 0.012, "{k}: {before} {low} {high}");
    }
}

/// Frequencies of the marimba bar in steel by `tests/oracles/tet10_modes.py`: scipy.sparse.linalg.eigsh on matrices of its own.
const MARIMBA: [f64; 11] = [
    449.987177,
    1595.754445,
    1820.831189,
    1945.885340,
    3778.115703,
    4388.346847,
    5865.435626,
    6152.365193,
    6632.699870,
    8093.414779,
    8409.920283,
];

#[test]
fn a_marimba_bar_has_the_modes_of_scipy() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/assets/meshes/marimba_bar.msh");
    let mesh = read_tets(&std::fs::read(path).unwrap(), None).unwrap();
    assert!((mesh.volume() * 1e6 - 280.1).abs() < 0.05);
    let found = modes(&mesh, Order::Quadratic, 9000.0);
    assert_eq!(found.len(), 11);
    for (f, expected) in found.iter().zip(MARIMBA) {
        assert!(off(*f, expected).abs() < 1e-6, "{f} {expected}");
    }
}
