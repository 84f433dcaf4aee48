//! Degrees of freedom, against influences and eigenvalues.

use super::*;

#[test]
fn degrees_of_freedom_are_the_influence_of_each_pair_at_its_own_node() {
    let mut pairs = scattered(14, 3, 6);
    pairs[4].weight = 3.0;
    for lambda in [0.01, 1.0, 40.0] {
        let (_, report) = fit(&pairs, 3, Stiffness::Lambda(lambda)).unwrap();
        // Fits are linear in the moves: one that is moved alone, by one.
        let own = |k: usize| {
            let still = |p: &Pair| Pair { to: p.from.clone(), ..p.clone() };
            let mut moved: Vec<Pair> = pairs.iter().map(still).collect();
            moved[k].to[1] += 1.0;
            let (tps, _) = fit(&moved, 3, Stiffness::Lambda(lambda)).unwrap();
            at(&tps, &pairs[k].from)[1] - pairs[k].from[1]
        };
        let sum: f64 = (0..14).map(own).sum();
        assert!((report.freedom - sum).abs() < 1e-9, "{lambda}: {} {sum}", report.freedom);
    }
}

/// Nodes in `clusters` heaps as correspondences make them, at a mean distance of 12.7 from each other.
fn heaps(clusters: usize, each: usize) -> Vec<Pair> {
    let (middles, steps) = (numbers(3 * clusters, 5), numbers(3 * clusters * each, 9));
    let from: Vec<f64> =
        (0..3 * clusters * each).map(|k| middles[k / (3 * each) * 3 + k % 3] + 0.2 * steps[k]).collect();
    let points: Vec<&[f64]> = from.chunks(3).collect();
    let far = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let n = points.len() as f64;
    let mean = points.iter().flat_map(|a| points.iter().map(|b| far(a, b))).sum::<f64>() / (n * (n - 1.0));
    let scaled = |x: &&[f64]| x.iter().map(|x| 12.7 / mean * x).collect::<Vec<_>>();
    points.iter().map(scaled).map(|x| pair(&x, &x)).collect()
}

#[test]
fn the_degrees_of_freedom_measure_the_stiffness() {
    // The heaps of the table in the specification are not known; these have its number of nodes and their distance.
    let pairs = heaps(20, 21);
    let problem = crate::warp::fit::problem::Problem::new(&pairs, 3).unwrap();
    let table = [(0.0, 420.0), (1e2, 39.4), (1e3, 15.3), (1e4, 7.1), (1e5, 4.5), (1e6, 4.05)];
    let found = table.map(|(lambda, _)| problem.fit(Stiffness::Lambda(lambda)).unwrap().1.freedom);
    println!("{found:?}");
    assert!((found[0] - 420.0).abs() < 1e-6);
    for ((lambda, wanted), found) in table.into_iter().zip(found) {
        // Above those of an affine map.
        let ratio = (found - 4.0) / (wanted - 4.0);
        assert!((0.6..1.6).contains(&ratio), "{lambda}: {found}, not {wanted}");
        // By the inverse of the whole instead of its tridiagonal form.
        let other = problem.inverse(lambda).map(|(matrix, _)| problem.freedom(&matrix, lambda));
        assert!(
            lambda == 0.0 || other.is_some_and(|other| (other - found).abs() < 1e-6),
            "{lambda}: {other:?} {found}"
        );
    }
}

/// Eigenvalues of a symmetric matrix, by Jacobi's rotations.
fn eigenvalues(mut a: Vec<f64>, n: usize) -> Vec<f64> {
    for _ in 0..12 {
        for p in 0..n {
            for q in p + 1..n {
                let off = a[p * n + q];
                if off == 0.0 {
                    continue;
                }
                let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * off);
                let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                let s = t * c;
                for k in 0..n {
                    let (x, y) = (a[k * n + p], a[k * n + q]);
                    (a[k * n + p], a[k * n + q]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..n {
                    let (x, y) = (a[p * n + k], a[q * n + k]);
                    (a[p * n + k], a[q * n + k]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    (0..n).map(|k| a[k * n + k]).collect()
}

/// Eigenvalues of the kernels between the nodes, on all that is at right angles to constants and coordinates.
fn projected(pairs: &[Pair]) -> Vec<f64> {
    let (n, d) = (pairs.len(), pairs[0].from.len());
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Gram and Schmidt, twice: the columns of P first, then whatever is left of the axes.
    let column = |j: usize| match j {
        0 => vec![1.0; n],
        j if j <= d => pairs.iter().map(|p| p.from[j - 1]).collect(),
        j => (0..n).map(|k| f64::from(u8::from(k == j - d - 1))).collect(),
    };
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for mut x in (0..=d + n).map(column) {
        let whole = dot(&x, &x);
        for _ in 0..2 {
            for b in &basis {
                let along = dot(&x, b);
                x.iter_mut().zip(b).for_each(|(x, b)| *x -= along * b);
            }
        }
        let left = dot(&x, &x);
        if left > 1e-12 * whole && basis.len() < n {
            basis.push(x.iter().map(|x| x / left.sqrt()).collect());
        }
    }
    assert_eq!(basis.len(), n);
    let free = &basis[d + 1..];
    let kernel = |a: &Pair, b: &Pair| {
        let square: f64 = a.from.iter().zip(&b.from).map(|(a, b)| (a - b).powi(2)).sum();
        if square > 0.0 { square * square.ln() } else { 0.0 }
    };
    let rows: Vec<Vec<f64>> = pairs.iter().map(|a| pairs.iter().map(|b| kernel(a, b)).collect()).collect();
    let onto = |b: &Vec<f64>| rows.iter().map(|row| dot(row, b)).collect::<Vec<f64>>();
    let bent: Vec<Vec<f64>> = free.iter().map(onto).collect();
    let matrix = free.iter().flat_map(|a| bent.iter().map(|b| dot(a, b)).collect::<Vec<_>>()).collect();
    eigenvalues(matrix, free.len())
}

#[test]
fn degrees_of_freedom_are_those_of_the_eigenvalues_of_the_projected_kernel() {
    let stiffnesses = [1e-2, 1.0, 1e2, 1e3, 1e4, 1e5, 1e6];
    for (clusters, each) in [(6, 8), (12, 5), (4, 15)] {
        let pairs = heaps(clusters, each);
        let (n, values) = (pairs.len(), projected(&pairs));
        assert!(values.len() == n - 4 && values.iter().all(|e| *e > 0.0), "{values:?}");
        let problem = crate::warp::fit::problem::Problem::new(&pairs, 3).unwrap();
        for lambda in stiffnesses {
            let wanted = 4.0 + values.iter().map(|e| e / (e + lambda)).sum::<f64>();
            let found = problem.fit(Stiffness::Lambda(lambda)).unwrap().1.freedom;
            assert!((found - wanted).abs() < 1e-8 * n as f64, "{n}, {lambda}: {found} for {wanted}");
        }
        // And of the matrix that leads from what is wanted to what is fitted, found by wanting one node at a time to move.
        let moved = |k: usize| {
            let to =
                |p: &Pair, j: usize| [p.from[0] + f64::from(u8::from(j == k)), p.from[1], p.from[2]].to_vec();
            pairs.iter().enumerate().map(|(j, p)| Pair { to: to(p, j), ..p.clone() }).collect::<Vec<_>>()
        };
        for lambda in [1.0, 1e3, 1e6] {
            let own =
                |k: usize| at(&fit(&moved(k), 3, Stiffness::Lambda(lambda)).unwrap().0, &pairs[k].from)[0];
            let trace: f64 = (0..n).map(|k| own(k) - pairs[k].from[0]).sum();
            let wanted = 4.0 + values.iter().map(|e| e / (e + lambda)).sum::<f64>();
            assert!((trace - wanted).abs() < 1e-8 * n as f64, "{n}, {lambda}: {trace} for {wanted}");
        }
    }
}
