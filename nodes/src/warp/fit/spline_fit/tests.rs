//! Known answers, limits of lambda, duplicates and flat clouds.

mod freedom;

use super::*;
use crate::warp::spline::linear::solve_dense;
use crate::warp::{WarpMap, Warper};

const FROM: [[f64; 3]; 6] =
    [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0], [1.0, 1.0, 1.0], [2.0, 2.0, 1.0]];
const TO: [[f64; 3]; 6] =
    [[0.5, 0.0, 0.0], [2.5, 0.2, 0.0], [0.0, 2.4, 0.0], [0.0, 0.1, 2.2], [1.2, 0.9, 1.3], [2.0, 2.5, 0.8]];

fn pair(from: &[f64], to: &[f64]) -> Pair {
    Pair { from: from.to_vec(), to: to.to_vec(), weight: 1.0 }
}

fn golden() -> Vec<Pair> {
    FROM.iter().zip(&TO).map(|(a, b)| pair(a, b)).collect()
}

fn at(tps: &Tps, point: &[f64]) -> Vec<f64> {
    let mut warper = Warper::new(tps);
    let moved = warper.displacement(point.iter().copied());
    point.iter().zip(moved).map(|(x, m)| x + m).collect()
}

fn near(a: &[f64], b: &[f64], tolerance: f64) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < tolerance)
}

/// Scattered numbers between -1 and 1.
fn numbers(count: usize, seed: usize) -> Vec<f64> {
    (0..count).map(|k| (((k + 31 * seed) as f64 * 12.9898).sin() * 43_758.545_3).fract()).collect()
}

fn scattered(n: usize, d: usize, seed: usize) -> Vec<Pair> {
    let (a, b) = (numbers(n * d, seed), numbers(n * d, seed + 1));
    a.chunks(d)
        .zip(b.chunks(d))
        .map(|(a, b)| pair(&a.iter().map(|x| 5.0 * x).collect::<Vec<_>>(), b))
        .collect()
}

#[test]
fn golden_vectors_are_met() {
    let rows = [
        (
            0.0,
            [0.842_722_753_6, 0.431_656_305_8, 0.689_012_751_9],
            [3.684_422_275_7, -0.713_083_546_1, -0.118_066_49],
        ),
        (
            1.0,
            [0.831_056_790_3, 0.466_242_293_1, 0.666_230_028_7],
            [3.704_373_417_7, -0.758_991_720_9, -0.096_757_874_2],
        ),
        (
            1e6,
            [0.775_000_332_5, 0.618_749_166_5, 0.575_000_446_2],
            [3.807_142_211_5, -0.969_641_659_3, -0.021_428_877_4],
        ),
    ];
    for (lambda, inside, outside) in rows {
        let (tps, _) = fit(&golden(), 3, Stiffness::Lambda(lambda)).unwrap();
        for (point, expected) in [([0.5, 0.5, 0.5], inside), ([3.0, -1.0, 0.0], outside)] {
            let found = at(&tps, &point);
            assert!(near(&found, &expected, 2e-10), "{lambda} {point:?}: {found:?} {expected:?}");
        }
    }
}

#[test]
fn lambda_0_passes_through_every_pair_and_a_large_one_is_the_affine_fit() {
    for (n, d) in [(6, 3), (40, 3), (60, 6), (5, 1)] {
        let pairs = scattered(n, d, n);
        let (tps, report) = fit(&pairs, d, Stiffness::Lambda(0.0)).unwrap();
        assert!((report.freedom - n as f64).abs() < 1e-9 && report.residual == 0.0);
        for p in &pairs {
            assert!(near(&at(&tps, &p.from), &p.to, 1e-10), "{n} {d}: {:?} {:?}", at(&tps, &p.from), p.to);
        }
        let (tps, report) = fit(&pairs, d, Stiffness::Lambda(1e12)).unwrap();
        assert!((report.freedom - (d + 1) as f64).abs() < 1e-5);
        // Normal equations of the affine fit: residuals are orthogonal to 1 and to every coordinate.
        for i in 0..d {
            let left: Vec<f64> = pairs.iter().map(|p| at(&tps, &p.from)[i] - p.to[i]).collect();
            for j in 0..=d {
                let along = |p: &Pair| j.checked_sub(1).map_or(1.0, |j| p.from[j]);
                let sum: f64 = left.iter().zip(&pairs).map(|(r, p)| r * along(p)).sum();
                assert!(sum.abs() < 1e-6, "{n} {d}: {sum}");
            }
        }
    }
}

/// The affine map of least squares, by its normal equations, at a point.
fn least_squares(pairs: &[Pair], point: &[f64]) -> Vec<f64> {
    let (d, m) = (point.len(), point.len() + 1);
    let row = |x: &[f64]| [&[1.0], x].concat();
    let mut matrix = vec![0.0; m * m];
    let mut right = vec![vec![0.0; m]; d];
    for p in pairs {
        let x = row(&p.from);
        (0..m * m).for_each(|k| matrix[k] += x[k / m] * x[k % m]);
        right.iter_mut().zip(&p.to).for_each(|(sums, u)| (0..m).for_each(|k| sums[k] += x[k] * u));
    }
    assert!(solve_dense(&mut matrix, m, &mut right) != 0.0);
    let x = row(point);
    right.iter().map(|a| a.iter().zip(&x).map(|(a, x)| a * x).sum()).collect()
}

#[test]
fn the_largest_lambda_gives_the_affine_map_of_least_squares() {
    for (n, d) in [(6, 3), (40, 3), (60, 6), (9, 1)] {
        let pairs = scattered(n, d, n + 1);
        let (tps, _) = fit(&pairs, d, Stiffness::Lambda(1e12)).unwrap();
        for point in numbers(5 * d, 3).chunks(d).map(|x| x.iter().map(|x| 9.0 * x).collect::<Vec<_>>()) {
            let (found, wanted) = (at(&tps, &point), least_squares(&pairs, &point));
            assert!(near(&found, &wanted, 1e-6), "{n} {d}: {found:?} {wanted:?}");
        }
    }
}

#[test]
fn there_is_a_spline_in_every_dimension() {
    for d in 1..=9 {
        let pairs = scattered(4 * d + 6, d, d);
        let (tps, report) = fit(&pairs, d, Stiffness::Lambda(0.0)).unwrap();
        assert_eq!((report.nodes, report.rank), (4 * d + 6, d));
        assert!(pairs.iter().all(|p| near(&at(&tps, &p.from), &p.to, 1e-10)), "{d}");
    }
}

#[test]
fn nodes_count_as_one_within_a_billionth_of_their_spread() {
    let pairs = scattered(12, 3, 2);
    let scale = fit(&pairs, 3, Stiffness::Lambda(1.0)).unwrap().0.scale;
    for (apart, nodes) in [(0.0, 12), (0.5e-9, 12), (2e-9, 13), (1e-3, 13)] {
        let mut twin = pairs[5].clone();
        twin.from[1] += apart * scale;
        let all = [&pairs[..], &[twin]].concat();
        assert_eq!(fit(&all, 3, Stiffness::Lambda(1.0)).unwrap().1.nodes, nodes, "{apart:e}");
    }
}

#[test]
fn affine_data_are_reproduced_for_any_lambda() {
    let mut pairs = scattered(20, 3, 4);
    for p in &mut pairs {
        let [x, y, z] = [p.from[0], p.from[1], p.from[2]];
        p.to = vec![1.0 + 2.0 * x - y, 0.5 * z, x + y + z - 3.0];
    }
    for lambda in [0.0, 1e-3, 1.0, 1e5, 1e12] {
        let (tps, _) = fit(&pairs, 3, Stiffness::Lambda(lambda)).unwrap();
        let found = at(&tps, &[7.0, -8.0, 2.0]);
        assert!(near(&found, &[23.0, 1.0, -2.0], 1e-8), "{lambda}: {found:?}");
    }
}

#[test]
fn what_is_left_at_a_node_is_lambda_times_its_weight_over_its_share() {
    let mut pairs = scattered(25, 3, 9);
    pairs[3].weight = 4.0;
    let lambda = 0.7;
    let (tps, report) = fit(&pairs, 3, Stiffness::Lambda(lambda)).unwrap();
    let mut square = 0.0;
    for (k, p) in pairs.iter().enumerate() {
        let left: Vec<f64> = p.to.iter().zip(at(&tps, &p.from)).map(|(u, w)| u - w).collect();
        // Weights are those of scaled coordinates.
        let factor = lambda / (tps.scale * tps.scale) / p.weight;
        let expected: Vec<f64> = tps.weights[3 * k..3 * k + 3].iter().map(|w| factor * w).collect();
        assert!(near(&left, &expected, 1e-11), "{k}: {left:?} {expected:?}");
        square += p.weight * left.iter().map(|x| x * x).sum::<f64>();
    }
    let total: f64 = pairs.iter().map(|p| p.weight).sum();
    assert!((report.residual - (square / total).sqrt()).abs() < 1e-12);
    // Side conditions: weights add up to nothing, and so do their moments.
    for i in 0..3 {
        let weight = |k: usize| tps.weights[3 * k + i];
        assert!((0..25).map(weight).sum::<f64>().abs() < 1e-10);
        assert!((0..25).map(|k| weight(k) * pairs[k].from[i]).sum::<f64>().abs() < 1e-9);
    }
}

#[test]
fn pairs_from_one_place_count_as_their_mean() {
    let mut pairs = scattered(12, 3, 2);
    let twin = Pair { to: vec![0.3, 0.1, -0.9], ..pairs[5].clone() };
    pairs.push(twin.clone());
    let mean: Vec<f64> = pairs[5].to.iter().zip(&twin.to).map(|(a, b)| (a + b) / 2.0).collect();
    let mut merged = pairs[..12].to_vec();
    merged[5] = Pair { to: mean.clone(), weight: 2.0, ..merged[5].clone() };
    for lambda in [0.0, 0.5] {
        let (a, report) = fit(&pairs, 3, Stiffness::Lambda(lambda)).unwrap();
        let (b, _) = fit(&merged, 3, Stiffness::Lambda(lambda)).unwrap();
        // Not bit for bit: the mean of all nodes counts the twins twice.
        assert!(near(&at(&a, &[0.4, 1.0, -2.0]), &at(&b, &[0.4, 1.0, -2.0]), 1e-10));
        assert_eq!((report.pairs, report.nodes), (13, 12));
        assert_eq!(report.warnings.len(), usize::from(lambda == 0.0), "{:?}", report.warnings);
    }
    let (tps, report) = fit(&pairs, 3, Stiffness::Lambda(0.0)).unwrap();
    assert!(near(&at(&tps, &twin.from), &mean, 1e-10));
    let distance = twin.to.iter().zip(&mean).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    assert!((report.conflict - distance).abs() < 1e-12);
    // All in one place: a shift.
    let silence = vec![pair(&[-30.0, 0.0, 1.0], &[-20.0, 1.0, 1.0]); 23];
    let (tps, report) = fit(&silence, 3, Stiffness::Lambda(100.0)).unwrap();
    assert!(near(&at(&tps, &[4.0, 5.0, 6.0]), &[14.0, 6.0, 6.0], 1e-12));
    assert_eq!((report.nodes, report.rank), (1, 0));
}

/// Solution of the complete system of all pairs at a point, duplicates included: `[K + lambda / weights, P; P^T, 0]` in plain coordinates.
fn unmerged(pairs: &[Pair], lambda: f64, point: &[f64]) -> Vec<f64> {
    let (n, d) = (pairs.len(), point.len());
    let m = n + d + 1;
    let kernel = |a: &[f64], b: &[f64]| {
        let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
        if square > 0.0 { square * square.ln() } else { 0.0 }
    };
    let along = |x: &[f64], j: usize| if j == 0 { 1.0 } else { x[j - 1] };
    let mut matrix = vec![0.0; m * m];
    for (k, a) in pairs.iter().enumerate() {
        for (l, b) in pairs.iter().enumerate() {
            matrix[k * m + l] = kernel(&a.from, &b.from) + if k == l { lambda / a.weight } else { 0.0 };
        }
        for j in 0..=d {
            matrix[k * m + n + j] = along(&a.from, j);
            matrix[(n + j) * m + k] = along(&a.from, j);
        }
    }
    let moved = |i: usize| pairs.iter().map(|p| p.to[i] - p.from[i]).chain(vec![0.0; d + 1]).collect();
    let mut right: Vec<Vec<f64>> = (0..d).map(moved).collect();
    assert!(solve_dense(&mut matrix, m, &mut right) != 0.0);
    let weighed: Vec<f64> =
        pairs.iter().map(|p| kernel(&p.from, point)).chain((0..=d).map(|j| along(point, j))).collect();
    let sum = |x: &Vec<f64>| x.iter().zip(&weighed).map(|(x, w)| x * w).sum::<f64>();
    right.iter().zip(point).map(|(x, f)| f + sum(x)).collect()
}

/// The greatest difference of two points.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn twins_that_count_once_with_their_weights_solve_the_system_of_all() {
    let mut worst = 0.0_f64;
    for seed in 0..6 {
        let mut pairs = scattered(14, 3, seed + 3);
        for (k, of) in [(0, 5), (1, 5), (2, 8), (3, 5)] {
            pairs.push(Pair { to: scattered(9, 3, seed + 40)[k].to.clone(), ..pairs[of].clone() });
        }
        pairs[15].weight = 2.5;
        for lambda in [2.0, 10.0, 1e3] {
            let (tps, report) = fit(&pairs, 3, Stiffness::Lambda(lambda)).unwrap();
            assert_eq!((report.pairs, report.nodes), (18, 14));
            for point in [[0.4, 1.0, -2.0], [4.0, -3.0, 0.0], [-2.0, 3.0, 1.0]] {
                worst = worst.max(apart(&at(&tps, &point), &unmerged(&pairs, lambda, &point)));
            }
        }
    }
    assert!(worst < 5e-13, "{worst:e}");
}

#[test]
fn the_order_of_the_pairs_does_not_matter() {
    let mut worst = 0.0_f64;
    for (n, d, lambda) in [(30, 3, 0.0), (30, 3, 1.0), (30, 3, 1e4), (40, 6, 0.5), (5, 1, 0.1)] {
        let mut pairs = scattered(n, d, 11);
        pairs[2].weight = 3.0;
        let twin = Pair { to: pairs[1].to.clone(), ..pairs[n - 1].clone() };
        pairs.push(twin);
        let (wanted, report) = fit(&pairs, d, Stiffness::Lambda(lambda)).unwrap();
        for step in [1, 7, 11] {
            // Steps that share no factor with the number of pairs visit all of them, here backwards.
            let order = (0..=n).map(|k| (n - k) * step % (n + 1));
            let other: Vec<Pair> = order.map(|k| pairs[k].clone()).collect();
            let (found, reported) = fit(&other, d, Stiffness::Lambda(lambda)).unwrap();
            assert_eq!(
                (reported.pairs, reported.nodes, reported.rank),
                (report.pairs, report.nodes, report.rank)
            );
            for point in numbers(6 * d, 5).chunks(d).map(|x| x.iter().map(|x| 8.0 * x).collect::<Vec<_>>()) {
                worst = worst.max(apart(&at(&wanted, &point), &at(&found, &point)));
            }
        }
    }
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn clouds_that_are_flat_leave_the_other_directions_alone() {
    // A plane across the third axis, turned a little.
    let turned = |x: f64, y: f64| vec![x, y, 0.5 * x - 0.2 * y];
    let flat: Vec<Pair> = numbers(40, 6)
        .chunks(2)
        .map(|c| pair(&turned(3.0 * c[0], 3.0 * c[1]), &turned(4.0 * c[0], 3.0 * c[1] + 1.0)))
        .collect();
    for lambda in [0.0, 10.0] {
        let (tps, report) = fit(&flat, 3, Stiffness::Lambda(lambda)).unwrap();
        assert_eq!(report.rank, 2);
        assert!(report.warnings[0].contains("2 of 3"));
        assert!(at(&tps, &[0.3, 0.4, 9.0]).iter().all(|x| x.is_finite() && x.abs() < 1e3));
        if lambda == 0.0 {
            flat.iter().for_each(|p| assert!(near(&at(&tps, &p.from), &p.to, 1e-9)));
        }
    }
    let (tps, report) = fit(&flat[..2], 3, Stiffness::Lambda(5.0)).unwrap();
    assert_eq!((report.rank, report.nodes), (1, 2));
    flat[..2].iter().for_each(|p| assert!(near(&at(&tps, &p.from), &p.to, 1e-9), "a line through two"));
    let (tps, report) = fit(&[], 3, Stiffness::Auto).unwrap();
    assert_eq!((tps, report.warnings.len()), (Tps::identity(3), 1));
    let (tps, _) = fit(&flat[..1], 3, Stiffness::Auto).unwrap();
    assert!(near(&at(&tps, &flat[0].from), &flat[0].to, 1e-12));
}

#[test]
fn nodes_that_are_nearly_on_a_line_do_not_throw_what_lies_beside_it() {
    // Three moments along the loudness, apart by noise in colour, that should be a little louder.
    let nearly = |noise: f64| -> Vec<Pair> {
        [(-9.0, 0.03), (0.0, -0.04), (8.0, 0.02)]
            .map(|(x, y)| pair(&[x, noise * y, -noise * y], &[1.1 * x + 2.0, 0.3 * x.sin(), 0.4 * x.cos()]))
            .to_vec()
    };
    for lambda in [0.0, 1.0, 1e3] {
        let (tps, report) = fit(&nearly(1.0), 3, Stiffness::Lambda(lambda)).unwrap();
        assert_eq!(report.rank, 1);
        assert!(report.warnings[0].contains("on a line") && report.warnings[0].contains("of rank 1"));
        let beside = at(&tps, &[2.0, 5.0, -4.0]);
        assert!(near(&beside, &[2.0, 5.0, -4.0], 6.0), "{lambda}: {beside:?}");
        // Noise that is a hundred times less results in the same warp.
        let (less, _) = fit(&nearly(0.01), 3, Stiffness::Lambda(lambda)).unwrap();
        assert!(near(&at(&less, &[2.0, 5.0, -4.0]), &beside, 0.1), "{lambda}");
    }
    let (_, report) = fit(&nearly(100.0), 3, Stiffness::Lambda(1.0)).unwrap();
    assert!(
        report.rank == 2 && report.warnings[0].contains("on a plane"),
        "three nodes make a plane: {report:?}"
    );
}

#[test]
fn scaling_everything_scales_lambda_with_the_square() {
    let pairs = scattered(15, 3, 3);
    let scaled: Vec<Pair> = pairs
        .iter()
        .map(|p| Pair {
            from: p.from.iter().map(|x| 10.0 * x).collect(),
            to: p.to.iter().map(|x| 10.0 * x).collect(),
            weight: 1.0,
        })
        .collect();
    let (a, _) = fit(&pairs, 3, Stiffness::Lambda(2.0)).unwrap();
    let (b, _) = fit(&scaled, 3, Stiffness::Lambda(200.0)).unwrap();
    let tenth: Vec<f64> = at(&b, &[10.0, 20.0, -5.0]).iter().map(|x| x / 10.0).collect();
    assert!(near(&at(&a, &[1.0, 2.0, -0.5]), &tenth, 1e-10));
    let free = |p: &[Pair]| fit(p, 3, Stiffness::ScaleFree(0.1)).unwrap().1;
    assert!((free(&scaled).lambda / free(&pairs).lambda - 100.0).abs() < 1e-9);
    // A tenth of the square of the mean distance of two nodes.
    let distance =
        |a: &Pair, b: &Pair| a.from.iter().zip(&b.from).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let distances =
        || (0..15).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| distance(&pairs[i], &pairs[j]));
    let mean = distances().sum::<f64>() / distances().count() as f64;
    assert!((free(&pairs).lambda / (0.1 * mean * mean) - 1.0).abs() < 1e-12);
    assert!((free(&scaled).freedom - free(&pairs).freedom).abs() < 1e-9);
}

#[test]
fn cross_validation_finds_the_noise() {
    let smooth = |x: &[f64]| vec![x[0] + (x[1]).sin(), x[1] - 0.3 * x[0], x[2] + 0.05 * x[0] * x[0]];
    let noise = numbers(120 * 3, 77);
    let with = |level: f64| -> Vec<Pair> {
        let from = numbers(120 * 3, 5);
        from.chunks(3)
            .zip(noise.chunks(3))
            .map(|(x, e)| {
                let x: Vec<f64> = x.iter().map(|x| 4.0 * x).collect();
                let to: Vec<f64> = smooth(&x).iter().zip(e).map(|(y, e)| y + level * e).collect();
                pair(&x, &to)
            })
            .collect()
    };
    let (quiet, loud) =
        (fit(&with(0.0), 3, Stiffness::Auto).unwrap(), fit(&with(1.0), 3, Stiffness::Auto).unwrap());
    assert!(quiet.1.lambda < loud.1.lambda && loud.1.freedom < 60.0, "{:?} {:?}", quiet.1, loud.1);
    let error = |tps: &Tps| {
        numbers(300, 8)
            .chunks(3)
            .map(|x| x.iter().map(|x| 3.0 * x).collect::<Vec<_>>())
            .map(|x| at(tps, &x).iter().zip(smooth(&x)).map(|(a, b)| (a - b).powi(2)).sum::<f64>())
            .sum::<f64>()
    };
    let through = fit(&with(1.0), 3, Stiffness::Lambda(0.0)).unwrap().0;
    assert!(error(&loud.0) < 0.5 * error(&through));
}

#[test]
fn cross_validation_takes_the_least_of_all_stiffnesses() {
    for (seed, noise) in [(3, 0.0), (4, 0.3), (5, 3.0)] {
        let mut pairs = scattered(30, 3, seed);
        let errors = numbers(90, seed + 60);
        for (p, e) in pairs.iter_mut().zip(errors.chunks(3)) {
            p.to = vec![p.from[0] + p.from[1].sin(), p.from[1], 0.9 * p.from[2]];
            p.to.iter_mut().zip(e).for_each(|(u, e)| *u += noise * e);
        }
        pairs[7].weight = 2.0;
        let grid = (0..=36).map(|k| 10_f64.powf(-2.0 + f64::from(k) / 4.0));
        let score = |lambda: f64| {
            let (tps, report) = fit(&pairs, 3, Stiffness::Lambda(lambda)).unwrap();
            let left = |p: &Pair| {
                p.weight * at(&tps, &p.from).iter().zip(&p.to).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
            };
            let rss: f64 = pairs.iter().map(left).sum();
            (report.freedom < 27.0).then(|| (30.0 * rss / (30.0 - report.freedom).powi(2), lambda))
        };
        let best = grid.filter_map(score).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        let found = fit(&pairs, 3, Stiffness::Auto).unwrap().1.lambda;
        assert!((found / best.1 - 1.0).abs() < 1e-12, "noise {noise}: {found}, not {best:?}");
    }
}

#[test]
fn the_jacobian_is_that_of_differences_and_detects_folds() {
    let (tps, _) = fit(&golden(), 3, Stiffness::Lambda(0.1)).unwrap();
    let point = [0.3_f32, 0.7, 0.2];
    let found = Warper::new(&tps).jacobian(&point);
    for column in 0..3 {
        let moved = |h: f64| {
            let mut p = point.map(f64::from);
            p[column] += h;
            at(&tps, &p)
        };
        let (a, b) = (moved(1e-5), moved(-1e-5));
        for row in 0..3 {
            let slope = (a[row] - b[row]) / 2e-5;
            assert!((slope - found[row * 3 + column]).abs() < 6e-10, "{row} {column}: {slope}");
        }
    }
    let mirror: Vec<Pair> =
        scattered(10, 2, 1).iter().map(|p| pair(&p.from, &[-p.from[0], p.from[1]])).collect();
    let (tps, _) = fit(&mirror, 2, Stiffness::Lambda(0.0)).unwrap();
    assert!((Warper::new(&tps).determinant(&[1.0, 2.0]) + 1.0).abs() < 1e-6);
}

#[test]
fn a_mirror_is_distinguished_from_a_fold() {
    let square: Vec<[f64; 2]> = (0..81).map(|k| [f64::from(k % 9) - 4.0, f64::from(k / 9) - 4.0]).collect();
    let target: Vec<f32> = square.iter().flatten().map(|x| 0.9 * *x as f32 + 0.05).collect();
    let of = |law: &dyn Fn(f64) -> f64| {
        let pairs: Vec<Pair> = square.iter().map(|[x, y]| pair(&[*x, *y], &[law(*x), *y])).collect();
        let map = WarpMap::fit(&pairs, 2, Stiffness::Lambda(0.0), &target, &target).unwrap();
        (map.folds, map.mirrored)
    };
    assert_eq!(of(&|x| x + 1.0), (0.0, false));
    assert_eq!(of(&|x| -x), (0.0, true));
    // Folded along a line with a third of the target beyond it, and with two thirds.
    let (folds, mirrored) = of(&|x| (x - 1.5).abs());
    assert!((0.3..0.4).contains(&folds) && mirrored, "{folds}");
    let (folds, mirrored) = of(&|x| (x + 1.5).abs());
    assert!((0.3..0.4).contains(&folds) && !mirrored, "{folds}");
}

#[test]
fn units_beyond_twice_the_radius_of_the_nodes_are_extrapolated() {
    let pairs = golden();
    let (tps, _) = fit(&pairs, 3, Stiffness::Lambda(1.0)).unwrap();
    let distance = |x: &[f64]| x.iter().zip(&tps.centre).map(|(x, c)| (x - c).powi(2)).sum::<f64>().sqrt();
    let radius = FROM.iter().map(|x| distance(x)).fold(0.0, f64::max);
    // Along the first axis from the middle of the nodes, every twentieth of four radii: half of them are too far.
    let along = |k: i32| [tps.centre[0] + (f64::from(k) + 0.5) / 5.0 * radius, tps.centre[1], tps.centre[2]];
    let target: Vec<f32> = (0..20).flat_map(along).map(|x| x as f32).collect();
    let map = WarpMap::fit(&pairs, 3, Stiffness::Lambda(1.0), &target, &target).unwrap();
    assert!((map.radius - radius).abs() < 1e-12 && map.outside == 0.5, "{} {}", map.radius, map.outside);
    // Who changes nothing extrapolates nothing.
    assert_eq!(WarpMap::fit(&[], 3, Stiffness::Auto, &target, &target).unwrap().outside, 0.0);
}

#[test]
fn what_cannot_be_fitted_is_named() {
    let wrong = |p: Pair, part: &str| {
        let e = fit(&[golden().remove(0), p], 3, Stiffness::Auto).unwrap_err().to_string();
        assert!(e.contains("pair 1") && e.contains(part), "{e}");
    };
    wrong(pair(&[f64::NAN, 0.0, 0.0], &[0.0; 3]), "NaN");
    wrong(pair(&[0.0; 2], &[0.0; 3]), "3 are needed");
    wrong(Pair { weight: 0.0, ..golden()[1].clone() }, "weight is 0");
    assert!(matches!(fit(&golden(), 3, Stiffness::Lambda(-1.0)), Err(FitError::Lambda { .. })));
}
