//! The repaired algorithm 1, for comparison with the search.

use super::*;

/// The repaired algorithm 1, over the whole table of distances.
pub(super) fn algorithm_1(target: &[f32], units: &Units<'_>, p: &SelectorParams) -> Vec<Choice> {
    let dims = units.dims;
    let (n, m) = (target.len() / dims, units.features.len() / dims);
    let wide = |v: &[f32]| -> Vec<f64> { v.iter().map(|&x| f64::from(x)).collect() };
    let dist = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
    let t = |i: usize| wide(&target[i * dims..][..dims]);
    let u = |j: usize| wide(&units.features[j * dims..][..dims]);
    let d1 = |i: usize, j: usize| dist(&t(i), &u(j));
    let mut picks: Vec<Choice> = Vec::new();
    let segment = |j: usize| units.segments.iter().find(|(a, n)| (*a..a + n).contains(&j)).unwrap();
    for i in 0..n {
        let look = if p.causal { p.look.min(i) } else { p.look.min(n - 1 - i) };
        let history = picks.clone();
        let last =
            |k: usize| history.get(i.wrapping_sub(k)).map(|c| c.unit as usize).filter(|_| k >= 1 && k <= i);
        let cooled = |j: usize| (1..=p.cool_off).any(|k| last(k) == Some(j));
        let guarded = |j: usize| {
            (1..=p.loop_guard).any(|lag| {
                last(lag) == Some(j) && (1..=3).all(|k| last(lag + k).is_some() && last(lag + k) == last(k))
            })
        };
        let some = |f: &dyn Fn(usize) -> bool| (0..m).any(|j| units.allowed[j] && f(j));
        let age = |j: usize| (1..=i).find(|&k| last(k) == Some(j)).unwrap_or(usize::MAX);
        let oldest = (0..m).filter(|&j| units.allowed[j]).max_by_key(|&j| (age(j), std::cmp::Reverse(j)));
        let free: Box<dyn Fn(usize) -> bool + '_> = if some(&|j| !cooled(j) && !guarded(j)) {
            Box::new(|j| !cooled(j) && !guarded(j))
        } else if some(&|j| !cooled(j)) {
            Box::new(|j| !cooled(j))
        } else {
            Box::new(|j| Some(j) == oldest)
        };
        let next = last(1).map(|j| j + 1).filter(|&j| j > 0 && j < m && segment(j) == segment(j - 1));
        let offsets = |x: usize, k: usize| if p.causal { x - look + k } else { x + k };
        let mean = |f: &dyn Fn(usize) -> Vec<f64>, x: usize| -> Vec<f64> {
            let mut sum = vec![0.0; dims];
            for k in 0..=look {
                sum.iter_mut().zip(f(offsets(x, k))).for_each(|(s, v)| *s += v);
            }
            sum.iter().map(|s| s / (look + 1) as f64).collect()
        };
        let mut best: Option<((f64, bool, f64, usize), Choice)> = None;
        for j in (0..m).filter(|&j| units.allowed[j] && free(j)) {
            let (from, count) = *segment(j);
            let inside = if p.causal { j >= from + look } else { j + look < from + count };
            if !inside || d1(i, j) > p.d_max {
                continue;
            }
            let d2 = (0..=look).map(|k| d1(offsets(i, k), offsets(j, k))).sum::<f64>();
            let key = (d2, next != Some(j), dist(&mean(&t, i), &mean(&u, j)), j);
            if best.is_none_or(|(least, _)| key < least) {
                best = Some((key, Choice { unit: j as u32, d1: d1(i, j), d2, ..Choice::default() }));
            }
        }
        let chosen = best.map(|(_, choice)| choice).unwrap_or_else(|| {
            let all = (0..m).filter(|&j| units.allowed[j] && free(j));
            let key = |j: usize| (d1(i, j), next != Some(j), j);
            let j = all.min_by(|&a, &b| key(a).partial_cmp(&key(b)).unwrap()).unwrap();
            Choice { unit: j as u32, fallback: true, d1: d1(i, j), ..Choice::default() }
        });
        picks.push(chosen);
    }
    picks
}
