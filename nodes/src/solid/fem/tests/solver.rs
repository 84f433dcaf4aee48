//! The eigenvalue solver against dense matrices, and its errors.

use super::assembly::STEEL;
use crate::solid::fem::assembly::Discretisation;
use crate::solid::fem::dense;
use crate::solid::fem::eigen::{EigenError, Eigenmodes, Request, eigenmodes};
use crate::solid::fem::elements::{Isotropic, Order};
use crate::solid::mesh::shapes::{ball, block};
use crate::solid::mesh::tet_mesh::TetMesh;
use std::f64::consts::TAU;

pub(super) fn solve(
    mesh: &TetMesh,
    order: Order,
    material: &Isotropic,
    request: &Request,
) -> Result<Eigenmodes, EigenError> {
    let space = Discretisation::new(mesh, order);
    let matrix = space.assemble(material);
    eigenmodes(mesh, &space, &matrix, request, &|_| false)
}

pub(super) fn frequencies(modes: &Eigenmodes) -> Vec<f64> {
    modes.lambda.iter().map(|x| x.sqrt() / TAU).collect()
}

fn below(highest: f64) -> Request {
    Request { highest, ..Request::default() }
}

#[test]
fn modes_are_those_of_dense_matrices() {
    // Cubes and balls have modes of equal frequency.
    for (mesh, highest) in [
        (block([0.1; 3], [3, 3, 3]), 30e3),
        (ball(0.05, 4), 45e3),
        (block([0.2, 0.03, 0.02], [6, 2, 1]), 15e3),
    ] {
        let space = Discretisation::new(&mesh, Order::Quadratic);
        let matrix = space.assemble(&STEEL);
        let (values, _) = dense::all_modes(&matrix).unwrap();
        let limit = (TAU * highest).powi(2);
        let expected: Vec<f64> = values[6..].iter().copied().filter(|x| *x < limit).collect();
        let modes = eigenmodes(&mesh, &space, &matrix, &below(highest), &|_| false).unwrap();
        assert!(modes.iterations > 0 && modes.lambda.len() > 6);
        assert_eq!((modes.lambda.len(), modes.counted), (expected.len(), expected.len()));
        for (a, b) in modes.lambda.iter().zip(&expected) {
            assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        }
        let gram = modes.shapes.transpose() * matrix.mass_times(modes.shapes.as_ref());
        for i in 0..gram.nrows() {
            (0..gram.ncols()).for_each(|j| assert!((gram[(i, j)] - f64::from(i == j)).abs() < 1e-10));
        }
        assert!(modes.residual < 1e-8, "{}", modes.residual);
    }
}

#[test]
fn a_maximum_number_returns_the_lowest_modes_up_to_a_gap() {
    let mesh = ball(0.05, 4);
    let all = solve(&mesh, Order::Quadratic, &STEEL, &below(60e3)).unwrap();
    let some = Request { max_modes: 12, ..below(60e3) };
    let some = solve(&mesh, Order::Quadratic, &STEEL, &some).unwrap();
    assert_eq!(some.counted, all.lambda.len());
    assert!((10..=12).contains(&some.lambda.len()) && all.lambda.len() > 12);
    for (a, b) in some.lambda.iter().zip(&all.lambda) {
        assert!((a / b - 1.0).abs() < 1e-9);
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            solve(&block([0.2, 0.03, 0.02], [6, 2, 1]), Order::Quadratic, &STEEL, &below(15e3)).unwrap()
        })
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn shapes_of_equal_frequencies_do_not_depend_on_the_iteration() {
    let mesh = block([0.1; 3], [3, 3, 3]);
    let first = solve(&mesh, Order::Quadratic, &STEEL, &below(30e3)).unwrap();
    let second = solve(&mesh, Order::Quadratic, &STEEL, &Request { shift: 1000.0, ..below(30e3) }).unwrap();
    let equal = first.lambda.windows(2).filter(|x| x[1] < x[0] * (1.0 + 1e-9)).count();
    assert!(equal > 3 && first.residual < 1e-8, "{equal} {}", first.residual);
    for j in 0..first.lambda.len() {
        let distance = (0..first.shapes.nrows())
            .map(|i| (second.shapes[(i, j)] - first.shapes[(i, j)]).abs())
            .fold(0.0, f64::max);
        assert!(distance < 1e-6 * first.shapes.col(j).norm_max(), "{j}: {distance:e}");
    }
}

#[test]
fn two_parts_have_twelve_rigid_motions_and_each_mode_twice() {
    let one = block([0.1, 0.02, 0.01], [4, 1, 1]);
    let mut two = one.clone();
    let count = one.nodes.len() as u32;
    two.nodes.extend(one.nodes.iter().map(|p| [p[0], p[1] + 1.0, p[2]]));
    two.tets.extend(one.tets.iter().map(|t| t.map(|c| c + count)));
    let one = solve(&one, Order::Quadratic, &STEEL, &below(20e3)).unwrap();
    let two = solve(&two, Order::Quadratic, &STEEL, &below(20e3)).unwrap();
    assert_eq!(two.lambda.len(), 2 * one.lambda.len());
    for (pair, single) in two.lambda.chunks(2).zip(&one.lambda) {
        pair.iter().for_each(|x| assert!((x / single - 1.0).abs() < 1e-8));
    }
}

#[test]
fn errors_say_what_would_be_right() {
    let mesh = block([0.2, 0.03, 0.02], [6, 2, 1]);
    let e = solve(&mesh, Order::Quadratic, &STEEL, &Request { memory: 1 << 20, ..below(15e3) }).unwrap_err();
    assert!(matches!(e, EigenError::Memory { .. }) && e.to_string().contains("raise `memory`"), "{e}");
    let e = solve(&mesh, Order::Quadratic, &STEEL, &below(100.0)).unwrap_err();
    assert_eq!(e, EigenError::None { highest: 100.0 });
    let space = Discretisation::new(&mesh, Order::Quadratic);
    let matrix = space.assemble(&STEEL);
    let e = eigenmodes(&mesh, &space, &matrix, &below(15e3), &|_| true).unwrap_err();
    assert_eq!(e, EigenError::Cancelled);
}

#[test]
fn material_and_size_scale_the_modes() {
    let mesh = block([0.1, 0.02, 0.01], [4, 1, 1]);
    let first = solve(&mesh, Order::Quadratic, &STEEL, &below(30e3)).unwrap();
    let (a, b, s) = (0.35, 0.3, 1.7);
    let other = Isotropic { young: a * STEEL.young, density: b * STEEL.density, ..STEEL };
    let factor = a / (b * s * s);
    let second = solve(&mesh.scaled(s), Order::Quadratic, &other, &below(30e3 * f64::sqrt(factor))).unwrap();
    let size = b.powf(-0.5) * f64::powf(s, -1.5);
    assert_eq!(first.lambda.len(), second.lambda.len());
    for (j, (x, y)) in first.lambda.iter().zip(&second.lambda).enumerate() {
        assert!((y / (x * factor) - 1.0).abs() < 1e-8);
        let distance = (0..first.shapes.nrows())
            .map(|i| (second.shapes[(i, j)] - size * first.shapes[(i, j)]).abs())
            .fold(0.0, f64::max);
        assert!(distance < 1e-6 * second.shapes.col(j).norm_max(), "{j}: {distance:e}");
    }
}
