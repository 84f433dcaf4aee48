//! A self-organising map, and approximate matching of the strings that it makes of sequences.

use crate::core::random::Rng;

/// Width and height of the map.
const SIDE: usize = 8;
/// Passes over all frames.
const EPOCHS: usize = 20;
/// Radius of the neighbourhood in the first and in the last pass.
const RADIUS: (f64, f64) = (4.0, 0.5);
/// Cost of a symbol more, or one fewer.
const GAP: f64 = 0.5;

/// The best alignment of a query that ends at a frame.
#[derive(Clone, Copy)]
pub struct Alignment {
    /// Its cost.
    pub cost: f64,
    /// Its steps.
    pub steps: u32,
    /// The frame that it starts at.
    pub start: u32,
}

/// The nearest of the vectors.
fn nearest<const N: usize>(map: &[[f32; N]], x: &[f32; N]) -> usize {
    let distance = |w: &[f32; N]| w.iter().zip(x).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
    let mut best = (f32::INFINITY, 0);
    for (k, w) in map.iter().enumerate() {
        let d = distance(w);
        if d < best.0 {
            best = (d, k);
        }
    }
    best.1
}

fn grid_distance(a: usize, b: usize) -> f64 {
    let d = |x: usize, y: usize| x.abs_diff(y) as f64;
    d(a % SIDE, b % SIDE).hypot(d(a / SIDE, b / SIDE))
}

/// The units of a map, trained in batches on all vectors, that are nearest to each.
///
/// # Complexity
/// Vectors times 64 units times 20 passes.
///
/// # Source
/// Kohonen, "Self-Organizing Maps" (3rd ed., 2001), section 3.6: the batch map.
pub fn units<const N: usize>(all: &[[f32; N]], seed: u64) -> Vec<usize> {
    if all.is_empty() {
        return Vec::new();
    }
    let mut rng = Rng::new(seed);
    let mut map: Vec<[f32; N]> = (0..SIDE * SIDE).map(|_| all[rng.below(all.len())]).collect();
    for epoch in 0..EPOCHS {
        let t = epoch as f64 / (EPOCHS - 1) as f64;
        let radius = RADIUS.0 * (RADIUS.1 / RADIUS.0).powf(t);
        let (mut sums, mut counts) = (vec![[0.0_f64; N]; map.len()], vec![0.0_f64; map.len()]);
        for x in all {
            let k = nearest(&map, x);
            counts[k] += 1.0;
            sums[k].iter_mut().zip(x).for_each(|(sum, x)| *sum += f64::from(*x));
        }
        for (k, w) in map.iter_mut().enumerate() {
            let (mut sum, mut total) = ([0.0_f64; N], 0.0);
            for (j, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
                let h = (-0.5 * (grid_distance(k, j) / radius).powi(2)).exp();
                total += h * count;
                sum.iter_mut().zip(&sums[j]).for_each(|(sum, x)| *sum += h * x);
            }
            if total > 1e-12 {
                w.iter_mut().zip(&sum).for_each(|(w, sum)| *w = (sum / total) as f32);
            }
        }
    }
    all.iter().map(|x| nearest(&map, x)).collect()
}

/// The best match of a string that ends at each symbol of a text: a substitution costs the distance of units over the greatest, a gap one half.
///
/// # Complexity
/// Symbols of the string times those of the text.
///
/// # Source
/// Sellers, "The theory and computation of evolutionary distances: pattern recognition" (J. Algorithms 1, 1980).
pub fn string_matches(query: &[usize], text: &[usize]) -> Vec<Alignment> {
    let most = grid_distance(0, SIDE * SIDE - 1);
    let m = query.len();
    // Costs and starts of the prefixes of the query that end before this symbol.
    let mut last: Vec<(f64, u32)> = (0..=m).map(|i| (GAP * i as f64, 0)).collect();
    let mut row = last.clone();
    let mut out = Vec::with_capacity(text.len());
    for (t, symbol) in text.iter().enumerate() {
        row[0] = (0.0, t as u32 + 1);
        for (i, q) in query.iter().enumerate() {
            // An empty prefix matches from here on.
            let before = if i == 0 { (0.0, t as u32) } else { last[i] };
            let from = [
                (before.0 + grid_distance(*q, *symbol) / most, before.1),
                (last[i + 1].0 + GAP, last[i + 1].1),
                (row[i].0 + GAP, row[i].1),
            ];
            row[i + 1] = from.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or(from[0]);
        }
        let (cost, start) = row[m];
        out.push(Alignment { cost, steps: m as u32, start: start.min(t as u32) });
        std::mem::swap(&mut last, &mut row);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clusters_have_units_of_their_own() {
        let mut rng = Rng::new(3);
        let centre = [[0.0_f32, 0.0], [3.0, 0.0], [0.0, 3.0], [3.0, 3.0]];
        let all: Vec<[f32; 2]> =
            (0..400).map(|k| centre[k % 4].map(|x| x + rng.between(-0.2, 0.2) as f32)).collect();
        let found = units(&all, 1);
        for (k, unit) in found.iter().enumerate() {
            // Nothing of another cluster has this unit.
            assert!(found.iter().enumerate().all(|(j, other)| j % 4 == k % 4 || other != unit), "{k}");
        }
        assert_eq!(found, units(&all, 1));
        assert!(units::<2>(&[], 1).is_empty());
    }

    #[test]
    fn strings_are_matched_with_gaps() {
        let text = [60, 60, 1, 2, 3, 60, 60, 1, 3, 60, 9, 9];
        let found = string_matches(&[1, 2, 3], &text);
        assert_eq!((found[4].cost, found[4].start), (0.0, 2));
        // One symbol is missing.
        assert_eq!((found[8].cost, found[8].start), (GAP, 7));
        // The naive recursion over all intervals.
        let most = grid_distance(0, 63);
        let edit = |a: &[usize], b: &[usize]| {
            let mut d = vec![vec![0.0; b.len() + 1]; a.len() + 1];
            for i in 0..=a.len() {
                for j in 0..=b.len() {
                    d[i][j] = match (i, j) {
                        (0, j) => GAP * j as f64,
                        (i, 0) => GAP * i as f64,
                        (i, j) => (d[i - 1][j - 1] + grid_distance(a[i - 1], b[j - 1]) / most)
                            .min(d[i - 1][j] + GAP)
                            .min(d[i][j - 1] + GAP),
                    };
                }
            }
            d[a.len()][b.len()]
        };
        for (end, cell) in found.iter().enumerate() {
            let best =
                (0..=end + 1).map(|start| edit(&[1, 2, 3], &text[start..end + 1])).fold(f64::MAX, f64::min);
            assert!((cell.cost - best).abs() < 1e-12, "{end}: {} {best}", cell.cost);
        }
    }
}
