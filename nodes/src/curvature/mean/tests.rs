use super::*;
use crate::core::pool::with_threads;
use crate::curvature::scenes::{Scene, crumpled, grid, icosphere, moved, paraboloid};
use proptest::prelude::*;

fn curvature_of(scene: &Scene, points: &[[f64; 3]], method: Method) -> Vec<Curvature> {
    let mut out = vec![Curvature::default(); points.len()];
    let mut measure = MeanCurvature::new(&scene.topology(), method).unwrap();
    measure.measure(points, &mut out).unwrap();
    let mut divided = vec![Curvature::default(); points.len()];
    with_threads(|| measure.measure(points, &mut divided)).unwrap();
    assert_eq!(out, divided);
    out
}

fn curvature(scene: &Scene) -> Vec<Curvature> {
    curvature_of(scene, &scene.points, Method::Cotan)
}

#[test]
fn a_sphere_has_one_over_its_radius_everywhere() {
    let sphere = icosphere(4);
    for radius in [0.5, 2.0] {
        let points = sphere.map(|p| p.map(|x| x * radius));
        let worst = |method| {
            let found = curvature_of(&sphere, &points, method);
            assert!(found.iter().all(|c| c.valid));
            found.iter().map(|c| (c.h * radius - 1.0).abs()).fold(0.0, f64::max)
        };
        let (cotan, dihedral) = (worst(Method::Cotan), worst(Method::Dihedral));
        assert!(cotan < 1e-5, "{cotan}");
        assert!((6e-4..1e-3).contains(&dihedral), "{dihedral}");
    }
}

#[test]
fn a_cylinder_has_half_of_one_over_its_radius() {
    let radius = 0.3;
    let patch = grid(21, 17, false, |u, v| [radius * (2.0 * u).sin(), 0.8 * v, radius * (2.0 * u).cos()]);
    let found = curvature(&patch);
    let inner: Vec<f64> = found.iter().filter(|c| c.valid).map(|c| 2.0 * radius * c.h).collect();
    assert_eq!(inner.len(), 19 * 15);
    // The curvature of the polygon differs from that of the arc by (angle/2)/tan(angle/2) and similar terms.
    assert!(inner.iter().all(|x| (x - 1.0).abs() < 1e-9), "{inner:?}");
}

#[test]
fn a_saddle_is_flat_on_average_at_its_apex() {
    let saddle = grid(41, 41, true, |u, v| {
        let (x, y) = (u - 0.5, v - 0.5);
        [x, y, 0.7 * (x * x - y * y)]
    });
    for method in [Method::Cotan, Method::Dihedral] {
        assert!(curvature_of(&saddle, &saddle.points, method)[20 * 41 + 20].h.abs() < 1e-12);
    }
}

#[test]
fn the_apex_of_a_paraboloid_has_the_known_value() {
    let found = curvature(&paraboloid(1.3));
    assert!((found[20 * 41 + 20].h - 1.299_313_8).abs() < 5e-8, "{}", found[20 * 41 + 20].h);
    assert_eq!(found.iter().filter(|c| c.valid).count(), 1521);
}

#[test]
fn alternating_diagonals_leave_an_error_at_corners_and_a_tenth_of_that_at_the_apex() {
    let sheet = paraboloid(1.3);
    let errors: Vec<f64> = curvature(&sheet)
        .iter()
        .zip(&sheet.points)
        .filter(|(c, _)| c.valid)
        .map(|(c, p)| {
            let square = 1.69 * (p[0] * p[0] + p[1] * p[1]);
            (c.h - 0.65 * (2.0 + square) / (1.0 + square).powf(1.5)).abs()
        })
        .collect();
    let (worst, apex) = (errors.iter().copied().fold(0.0, f64::max), errors[19 * 39 + 19]);
    assert!((worst - 0.09).abs() < 0.01 && apex / 1.3 < 6e-4, "{worst} {apex}");
}

#[test]
fn flipped_winding_reverses_the_sign_to_the_last_bits() {
    // Curvature is the remainder of terms of 2 / edge that cancel, and corners are added in another order: the bound is 1e-15 of
    // a term, not of the curvature.
    let term = 2.0 * 14.0;
    for seed in 0..8 {
        let sheet = crumpled(15, seed);
        let (a, b) = (curvature(&sheet), curvature(&sheet.flipped()));
        let worst = a.iter().zip(&b).map(|(a, b)| (a.h + b.h).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-15 * term, "{worst:e}");
        assert!(a.iter().any(|c| c.h.abs() > 0.1));
    }
}

/// A sum whose own error hardly grows with the number of terms.
fn pairwise(terms: &[f64]) -> f64 {
    match terms {
        [] => 0.0,
        [one] => *one,
        more => {
            let (left, right) = more.split_at(more.len() / 2);
            pairwise(left) + pairwise(right)
        }
    }
}

#[test]
fn areas_add_up_to_the_mesh() {
    for (n, seed) in [(9, 0), (20, 1), (41, 2)] {
        let sheet = crumpled(n, seed);
        let corner = |t: &[u32; 3]| t.map(|v| sheet.points[v as usize]);
        let area = |[a, b, c]: [[f64; 3]; 3]| 0.5 * norm(cross(sub(b, a), sub(c, a)));
        let triangles: Vec<f64> = sheet.triangles.iter().map(|t| area(corner(t))).collect();
        let vertices: Vec<f64> = curvature(&sheet).iter().map(|c| c.area).collect();
        let (total, sum) = (pairwise(&triangles), pairwise(&vertices));
        // Four units in the last place: the two sums take eleven roundings each.
        assert!((sum / total - 1.0).abs() < 1e-15, "{sum} {total}");
    }
}

#[test]
fn a_flat_sheet_has_no_curvature_inside_and_none_defined_at_its_boundary() {
    let flat = grid(11, 11, true, |u, v| [u, v, 0.0]);
    let mut measure = MeanCurvature::new(&flat.topology(), Method::Cotan).unwrap();
    let mut found = vec![Curvature::default(); 121];
    measure.measure(&flat.points, &mut found).unwrap();
    assert!(found.iter().all(|c| c.h.abs() < 1e-12), "the boundary is invalid");
    assert_eq!(found.iter().filter(|c| c.valid).count(), 81);
    // Twice the mean curvature from the cotangents at the boundary: 20 1/m along an edge of 0.1 m, 28 at a corner.
    for (c, sums) in found.iter().zip(&measure.sums).filter(|(c, _)| !c.valid) {
        let curvature = norm(scale(sums.bend, 0.5 / sums.area));
        assert!((19.999..28.285).contains(&curvature) && sums.bend[2] == 0.0, "{curvature} {c:?}");
    }
}

/// Root mean square and largest difference of valid curvature.
fn spread(a: &[Curvature], b: &[Curvature]) -> (f64, f64) {
    let errors: Vec<f64> = a.iter().zip(b).filter(|(a, _)| a.valid).map(|(a, b)| (a.h - b.h).abs()).collect();
    (
        (errors.iter().map(|x| x * x).sum::<f64>() / errors.len() as f64).sqrt(),
        errors.iter().copied().fold(0.0, f64::max),
    )
}

#[test]
fn single_precision_100_metres_away_has_an_error_of_0_008_at_a_curvature_of_0_24() {
    // Edges of 25 mm; a quantum of 7.6 um. The five-point stencil makes sqrt(5) sigma / edge^2 of height noise sigma.
    let sheet = paraboloid(0.24);
    let far: Vec<[f32; 3]> = sheet.points.iter().map(|p| p.map(|x| (x + 100.0) as f32)).collect();
    let mut found = vec![Curvature::default(); far.len()];
    MeanCurvature::new(&sheet.topology(), Method::Cotan).unwrap().measure(&far, &mut found).unwrap();
    let (typical, worst) = spread(&curvature(&sheet), &found);
    let expected = 5.0_f64.sqrt() * 2.0_f64.powi(-17) / 12.0_f64.sqrt() / 0.025_f64.powi(2);
    assert!((typical / expected - 1.0).abs() < 0.1, "{typical} for {expected}");
    assert!((0.009..0.025).contains(&worst), "{worst}");
}

#[test]
fn a_tenth_of_a_millimetre_of_noise_on_25_mm_edges_is_0_21_of_curvature() {
    let sheet = paraboloid(0.24);
    let random = crate::core::random::Random::new(7, "noise");
    let noisy: Vec<[f64; 3]> = (0..)
        .zip(&sheet.points)
        .map(|(v, p)| [0_u32, 1, 2].map(|k| p[k as usize] + 1e-4 * (2.0 * random.uniform(0, v, k) - 1.0)))
        .collect();
    let (typical, _) = spread(&curvature(&sheet), &curvature_of(&sheet, &noisy, Method::Cotan));
    let expected = 5.0_f64.sqrt() * 1e-4 / 3.0_f64.sqrt() / 0.025_f64.powi(2);
    assert!(
        (0.2..0.22).contains(&typical) && (typical / expected - 1.0).abs() < 0.05,
        "{typical} for {expected}"
    );
}

#[test]
fn degenerate_triangles_and_collapsed_vertices_stay_finite() {
    let mut sheet = grid(6, 6, true, |u, v| [u, v, 0.1 * u * v]);
    sheet.points[8] = sheet.points[7];
    sheet.points[20] = sheet.points[14].map(|x| x + 1e-13);
    for method in [Method::Cotan, Method::Dihedral] {
        assert!(
            curvature_of(&sheet, &sheet.points, method).iter().all(|c| c.h.is_finite() && c.area.is_finite())
        );
        let heap = vec![[1.0; 3]; 36];
        assert!(curvature_of(&sheet, &heap, method).iter().all(|c| !c.valid && c.h == 0.0));
    }
}

#[test]
fn a_needle_has_the_cotangent_of_one_degree() {
    // The term of the side opposite to an angle: the cotangent times that side.
    let cotangent_term = |degrees: f64| {
        let (s, c) = degrees.to_radians().sin_cos();
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [c, s, 0.0]];
        let triangle =
            Topology { rest: points.map(|p| p.map(|x| x as f32)).to_vec(), triangles: vec![[0, 1, 2]] };
        let mut measure = MeanCurvature::new(&triangle, Method::Cotan).unwrap();
        measure.measure(&points, &mut [Curvature::default(); 3]).unwrap();
        // The angle of the corner at (c, s) is half the rest of 180 degrees.
        let other = (0.5 * (180.0 - degrees)).to_radians().tan().recip().min(MAX_COT);
        let own = sub(measure.sums[1].bend, scale(sub(points[1], points[0]), other));
        let side = sub(points[1], points[2]);
        (dot(own, side) / dot(side, side), norm(cross(own, side)))
    };
    let cot = |degrees: f64| degrees.to_radians().tan().recip();
    for (degrees, expected) in [
        (0.1, cot(1.0)),
        (0.999, cot(1.0)),
        (1.5, cot(1.5)),
        (60.0, cot(60.0)),
        (178.5, cot(178.5)),
        (179.9, -cot(1.0)),
    ] {
        let (found, aside) = cotangent_term(degrees);
        assert!(
            (found / expected - 1.0).abs() < 1e-9 && aside < 1e-9,
            "{degrees}: {found} for {expected}, {aside}"
        );
    }
    // In a sheet, a vertex nearly on the line between two others has two corners of less than a degree around it.
    let mut sheet = crumpled(7, 3);
    for k in 0..3 {
        sheet.points[24][k] = 0.5 * (sheet.points[18][k] + sheet.points[25][k]) - [4e-5, 0.0, 0.0][k];
    }
    let found = curvature(&sheet);
    let max_error = |max_cot: f64| {
        let valid = found.iter().enumerate().filter(|(_, c)| c.valid);
        valid.map(|(v, c)| (c.h - by_definition(&sheet, v, max_cot)).abs()).fold(0.0, f64::max)
    };
    let [clamped, free] = [MAX_COT, f64::INFINITY].map(max_error);
    assert!(clamped < 1e-6 && free > 0.1, "{clamped:e} {free}");
}

#[test]
fn a_position_that_is_not_finite_is_reported() {
    let mut sheet = grid(4, 4, true, |u, v| [u, v, 0.0]);
    let mut measure = MeanCurvature::new(&sheet.topology(), Method::Cotan).unwrap();
    sheet.points[9][1] = f64::NAN;
    assert_eq!(measure.measure(&sheet.points, &mut [Curvature::default(); 16]), Err(9));
    assert_eq!(measure.measure(&sheet.points[..5], &mut [Curvature::default(); 16]), Err(5));
}

/// The definition with angles and with cotangents up to a limit, vertex by vertex.
fn by_definition(scene: &Scene, v: usize, max_cot: f64) -> f64 {
    let p = |k: u32| scene.points[k as usize];
    let (mut k, mut n, mut area) = ([0.0; 3], [0.0; 3], 0.0);
    for t in &scene.triangles {
        let Some(at) = t.iter().position(|c| *c as usize == v) else { continue };
        let [a, b, c] = [p(t[at]), p(t[(at + 1) % 3]), p(t[(at + 2) % 3])];
        let corner = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| {
            let (u, w) = (sub(b, a), sub(c, a));
            (dot(u, w) / norm(u) / norm(w)).acos()
        };
        let (at_a, at_b, at_c) = (corner(a, b, c), corner(b, c, a), corner(c, a, b));
        k = add(k, scale(sub(a, b), (1.0 / at_c.tan()).clamp(-max_cot, max_cot)));
        k = add(k, scale(sub(a, c), (1.0 / at_b.tan()).clamp(-max_cot, max_cot)));
        let face = cross(sub(b, a), sub(c, a));
        n = add(n, scale(face, at_a / norm(face)));
        let right = std::f64::consts::FRAC_PI_2;
        let square = |x: [f64; 3]| dot(x, x);
        area += if at_a > right {
            0.25 * norm(face)
        } else if at_b > right || at_c > right {
            0.125 * norm(face)
        } else {
            (square(sub(a, c)) / at_b.tan() + square(sub(a, b)) / at_c.tan()) / 8.0
        };
    }
    0.5 * dot(scale(k, 1.0 / (2.0 * area)), scale(n, 1.0 / norm(n)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_result_equals_the_definition(seed in 0_u64..1000) {
        let sheet = crumpled(9, seed);
        let found = curvature(&sheet);
        for (v, c) in found.iter().enumerate().filter(|(_, c)| c.valid) {
            let slow = by_definition(&sheet, v, MAX_COT);
            prop_assert!((c.h - slow).abs() < 1e-9 * (1.0 + slow.abs()), "{} {}", c.h, slow);
        }
    }

    #[test]
    fn both_methods_agree_on_smooth_sheets_in_the_integral(seed in 0_u64..1000) {
        let sheet = crumpled(41, seed);
        let total = |method| -> f64 {
            let found = curvature_of(&sheet, &sheet.points, method);
            found.iter().filter(|c| c.valid).map(|c| c.h * c.area).sum()
        };
        let (cotan, dihedral) = (total(Method::Cotan), total(Method::Dihedral));
        prop_assert!((cotan - dihedral).abs() < 0.01 * (0.5 + cotan.abs()), "{} {}", cotan, dihedral);
    }

    #[test]
    fn motion_leaves_it_and_scale_divides_it(
        seed in 0_u64..1000, turn in -3.0..3.0, shift in prop::array::uniform3(-2.0..2.0), k in 0.1..20.0_f64,
    ) {
        let sheet = crumpled(12, seed);
        for method in [Method::Cotan, Method::Dihedral] {
            let base = curvature_of(&sheet, &sheet.points, method);
            let rigid = curvature_of(&sheet, &sheet.map(|p| moved(p, turn, shift)), method);
            let large = curvature_of(&sheet, &sheet.map(|p| p.map(|x| k * x)), method);
            for ((a, b), c) in base.iter().zip(&rigid).zip(&large) {
                prop_assert!((a.h - b.h).abs() < 1e-9 * (1.0 + a.h.abs()), "{} {}", a.h, b.h);
                prop_assert!((a.h - k * c.h).abs() < 1e-9 * (1.0 + a.h.abs()), "{} {}", a.h, c.h);
            }
        }
    }

    #[test]
    fn other_numbers_of_vertices_permute_it(seed in 0_u64..1000, step in 1_usize..80) {
        let sheet = crumpled(9, seed);
        // A permutation by multiplication modulo 83, without the numbers beyond the last.
        let order: Vec<usize> = (1..83).map(|k| k * step % 83).filter(|k| *k <= 81).map(|k| k - 1).collect();
        let mut index = vec![0_u32; 81];
        order.iter().enumerate().for_each(|(new, &old)| index[old] = new as u32);
        let points = order.iter().map(|&old| sheet.points[old]).collect();
        let triangles = sheet.triangles.iter().rev().map(|t| [t[1], t[2], t[0]].map(|v| index[v as usize])).collect();
        let (a, b) = (curvature(&sheet), curvature(&Scene { points, triangles }));
        for (v, a) in a.iter().enumerate() {
            let b = b[index[v] as usize];
            prop_assert_eq!(a.valid, b.valid);
            prop_assert!((a.h - b.h).abs() < 1e-10 * (1.0 + a.h.abs()));
        }
    }
}
