//! Limited-memory quasi-Newton ascent within bounds.

use super::newton::{Ascent, blocked, projected_norm};

/// Number of steps that the approximation of the Hessian remembers.
const HISTORY: usize = 10;

/// Maximises a function from `z` on, in place, with gradients alone.
///
/// Variables at a bound that the gradient presses against are fixed for the step; the quasi-Newton direction in the others is followed
/// along its projection, with backtracking. Ends when the projected gradient is below `tolerance`, or after `max_steps`.
///
/// # Source
/// Liu and Nocedal, "On the limited memory BFGS method for large scale optimization" (Math. Program. 45, 1989); Byrd, Lu, Nocedal and
/// Zhu, "A limited memory algorithm for bound constrained optimization" (SIAM J. Sci. Comput. 16(5), 1995).
pub(crate) fn lbfgs(
    mut f: impl FnMut(&[f64], &mut [f64]) -> f64,
    bounds: &[[f64; 2]],
    z: &mut [f64],
    tolerance: f64,
    max_steps: usize,
) -> Ascent {
    let n = z.len();
    let (mut g, mut next_g, mut trial) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut pairs: Vec<(Vec<f64>, Vec<f64>)> = Vec::with_capacity(HISTORY + 1);
    z.iter_mut().zip(bounds).for_each(|(z, [low, high])| *z = z.clamp(*low, *high));
    let mut out = Ascent { value: f(z, &mut g), evaluations: 1, ..Ascent::default() };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    while out.value.is_finite() && out.steps < max_steps {
        out.gradient = projected_norm(z, &g, bounds);
        if out.gradient <= tolerance {
            break;
        }
        let free: Vec<bool> = (0..n).map(|i| !blocked(z[i], g[i], bounds[i])).collect();
        let mask = |x: &mut [f64]| x.iter_mut().zip(&free).for_each(|(x, f)| *x *= f64::from(u8::from(*f)));
        // Two-loop recursion over the free variables.
        let mut direction = g.clone();
        mask(&mut direction);
        let mut factors = Vec::with_capacity(pairs.len());
        let reduced: Vec<(Vec<f64>, Vec<f64>)> = pairs
            .iter()
            .map(|(s, y)| {
                let (mut s, mut y) = (s.clone(), y.clone());
                mask(&mut s);
                mask(&mut y);
                (s, y)
            })
            .filter(|(s, y)| dot(s, y) > 1e-14 * dot(y, y))
            .collect();
        for (s, y) in reduced.iter().rev() {
            let factor = dot(s, &direction) / dot(s, y);
            direction.iter_mut().zip(y).for_each(|(d, y)| *d -= factor * y);
            factors.push(factor);
        }
        let scale = reduced.last().map_or(1.0 / out.gradient.max(1.0), |(s, y)| dot(s, y) / dot(y, y));
        direction.iter_mut().for_each(|d| *d *= scale);
        for ((s, y), factor) in reduced.iter().zip(factors.iter().rev()) {
            let back = dot(y, &direction) / dot(s, y);
            direction.iter_mut().zip(s).for_each(|(d, s)| *d += s * (factor - back));
        }
        mask(&mut direction);
        if dot(&direction, &g) <= 0.0 {
            pairs.clear();
            direction.copy_from_slice(&g);
            mask(&mut direction);
        }
        let (mut length, mut accepted) = (1.0, false);
        for _ in 0..50 {
            for i in 0..n {
                trial[i] = (z[i] + length * direction[i]).clamp(bounds[i][0], bounds[i][1]);
            }
            let next = f(&trial, &mut next_g);
            out.evaluations += 1;
            let gain: f64 = (0..n).map(|i| g[i] * (trial[i] - z[i])).sum();
            if next.is_finite() && next >= out.value + 1e-4 * gain && next > out.value {
                out.value = next;
                accepted = true;
                break;
            }
            length *= 0.4;
        }
        if !accepted {
            if pairs.is_empty() {
                break;
            }
            pairs.clear();
            continue;
        }
        out.steps += 1;
        let s: Vec<f64> = trial.iter().zip(z.iter()).map(|(a, b)| a - b).collect();
        // Of minus the function, whose curvature is positive near a maximum.
        let y: Vec<f64> = g.iter().zip(&next_g).map(|(a, b)| a - b).collect();
        if dot(&s, &y) > 1e-12 * dot(&s, &s).sqrt() * dot(&y, &y).sqrt() {
            pairs.push((s, y));
            if pairs.len() > HISTORY {
                pairs.remove(0);
            }
        }
        z.copy_from_slice(&trial);
        std::mem::swap(&mut g, &mut next_g);
    }
    out.gradient = projected_norm(z, &g, bounds);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_valley_of_rosenbrock_is_followed_to_its_end_or_to_a_bound() {
        let f = |z: &[f64], g: &mut [f64]| {
            let r = z[1] - z[0] * z[0];
            g.copy_from_slice(&[-2.0 * (z[0] - 1.0) + 400.0 * r * z[0], -200.0 * r]);
            -(z[0] - 1.0).powi(2) - 100.0 * r * r
        };
        let mut z = [-1.2, 1.0];
        let out = lbfgs(f, &[[-5.0, 5.0]; 2], &mut z, 1e-10, 500);
        assert!((z[0] - 1.0).abs() < 1e-8 && out.steps < 100, "{z:?} {out:?}");
        let mut z = [-1.2, 1.0];
        lbfgs(f, &[[-5.0, 0.5], [-5.0, 5.0]], &mut z, 1e-10, 500);
        assert!(z[0] == 0.5 && (z[1] - 0.25).abs() < 1e-8, "{z:?}");
    }
}
