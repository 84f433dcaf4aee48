//! The highest curve below all points: the limit of the likelihood without noise.

use super::point::Sample;
use super::scan::maximum_within;
use crate::material::damping::Family;

/// Parameters of the curve with the largest weighted sum `c(lambda_i)` under `c(lambda_i) <= y_i` and `theta >= 0`, and the mean of
/// `y - c`, in normalised units.
///
/// With two linear parameters it is the edge of the lower convex hull below the weighted mean of the frequencies, otherwise a linear
/// program. It is the limit of the maximum likelihood for `sigma` to 0, and one point too low ruins it.
///
/// # Complexity
/// O(n log n), or O(n p) for each of the pivots of the simplex method.
#[must_use]
pub fn lower_bound(sample: &Sample) -> (Vec<f64>, f64) {
    let family = sample.family;
    let theta = match family {
        Family::Rayleigh => hull_edge(&sample.x, &sample.y, &sample.weight),
        _ if family.has_exponent() => {
            let [low, high] = family.bounds()[family.linear_parameters()];
            let height = |g3: f64| program(sample, g3).1;
            let at = |k: u32| low + (high - low) * f64::from(k) / 24.0;
            let best = (0..25).max_by(|a, b| height(at(*a)).total_cmp(&height(at(*b)))).unwrap_or(0);
            let g3 = maximum_within(at(best.saturating_sub(1)), at((best + 1).min(24)), height);
            let (mut theta, _) = program(sample, g3);
            theta.push(g3);
            theta
        }
        _ => program(sample, 1.0).0,
    };
    let curve = sample.curve(&theta);
    let excess = curve.iter().zip(&sample.y).zip(&sample.weight).map(|((c, y), w)| w * (y - c)).sum::<f64>();
    (theta, excess / sample.total_weight())
}

/// The line of the lower hull over the mean abscissa, with its intercept and slope clamped to 0 or above.
fn hull_edge(x: &[f64], y: &[f64], weight: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..x.len()).filter(|i| weight[*i] > 0.0).collect();
    // Of equal abscissae the lower point counts.
    order.sort_by(|a, b| x[*a].total_cmp(&x[*b]).then(y[*a].total_cmp(&y[*b])));
    order.dedup_by(|b, a| x[*a] == x[*b]);
    let mut hull: Vec<usize> = Vec::new();
    for i in order {
        while let [.., a, b] = hull[..] {
            let turn = (x[b] - x[a]) * (y[i] - y[a]) - (y[b] - y[a]) * (x[i] - x[a]);
            if turn > 0.0 {
                break;
            }
            hull.pop();
        }
        hull.push(i);
    }
    let used = || (0..x.len()).filter(|i| weight[*i] > 0.0);
    let total: f64 = used().map(|i| weight[i]).sum();
    let mean = used().map(|i| weight[i] * x[i]).sum::<f64>() / total;
    let right = hull.iter().position(|i| x[*i] >= mean).unwrap_or(0).max(1);
    let flat = used().map(|i| y[i]).fold(f64::INFINITY, f64::min);
    let (Some(a), Some(b)) = (hull.get(right - 1), hull.get(right)) else { return vec![flat, 0.0] };
    let slope = (y[*b] - y[*a]) / (x[*b] - x[*a]);
    let intercept = y[*a] - slope * x[*a];
    if slope < 0.0 {
        vec![flat, 0.0]
    } else if intercept < 0.0 {
        vec![0.0, used().map(|i| y[i] / x[i]).fold(f64::INFINITY, f64::min)]
    } else {
        vec![intercept, slope]
    }
}

/// Linear parameters of the highest curve at an exponent, and its weighted mean height, by the simplex method.
///
/// The origin is feasible because all `y` are above 0. Bland's rule ends ties.
fn program(sample: &Sample, exponent: f64) -> (Vec<f64>, f64) {
    let (n, p) = (sample.len(), sample.family.linear_parameters());
    let basis = sample.basis_of(exponent);
    let mut scale = vec![0.0_f64; p];
    basis.chunks_exact(p).for_each(|row| row.iter().zip(&mut scale).for_each(|(b, s)| *s = s.max(b.abs())));
    scale.iter_mut().for_each(|s| *s = s.max(1e-300));
    // Rows are constraints, columns the non-basic variables, the last the right-hand sides.
    let used: Vec<usize> = (0..n).filter(|i| sample.weight[*i] > 0.0).collect();
    let mut rows: Vec<Vec<f64>> = used
        .iter()
        .map(|&i| {
            let row = (0..p).map(|j| basis[i * p + j] / scale[j]);
            row.chain([sample.y[i]]).collect()
        })
        .collect();
    let total = sample.total_weight();
    let mut top: Vec<f64> = (0..p)
        .map(|j| used.iter().map(|&i| sample.weight[i] * basis[i * p + j] / scale[j]).sum::<f64>() / total)
        .chain([0.0])
        .collect();
    let mut columns: Vec<usize> = (0..p).collect();
    let mut basic: Vec<usize> = (p..p + rows.len()).collect();
    for _ in 0..500 * p {
        let entering = (0..p).filter(|j| top[*j] > 1e-12).min_by_key(|j| columns[*j]);
        let Some(enter) = entering else { break };
        let ratio = |r: usize| rows[r][p] / rows[r][enter];
        let leaving = (0..rows.len())
            .filter(|r| rows[*r][enter] > 1e-12)
            .min_by(|a, b| ratio(*a).total_cmp(&ratio(*b)).then(basic[*a].cmp(&basic[*b])));
        let Some(leave) = leaving else { break };
        let pivot = rows[leave][enter];
        rows[leave].iter_mut().for_each(|v| *v /= pivot);
        rows[leave][enter] = 1.0 / pivot;
        let line = rows[leave].clone();
        let eliminate = |row: &mut Vec<f64>| {
            let factor = row[enter];
            if factor != 0.0 {
                row[enter] = 0.0;
                row.iter_mut().zip(&line).for_each(|(v, l)| *v -= factor * l);
            }
        };
        rows.iter_mut().enumerate().filter(|(r, _)| *r != leave).for_each(|(_, row)| eliminate(row));
        eliminate(&mut top);
        std::mem::swap(&mut columns[enter], &mut basic[leave]);
    }
    let mut theta = vec![0.0; p];
    for (variable, row) in basic.iter().zip(&rows) {
        if let Some(t) = theta.get_mut(*variable) {
            *t = row[p].max(0.0) / scale[*variable];
        }
    }
    (theta, -top[p])
}
