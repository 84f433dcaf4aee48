use super::*;
use crate::core::random::Draw;

/// Algorithm 1 as repaired, over the whole table of distances.
fn algorithm_1(target: &[f32], units: &Units<'_>, p: &SelectorParams) -> Vec<Choice> {
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
        let past = picks.clone();
        let last =
            |k: usize| past.get(i.wrapping_sub(k)).map(|c| c.unit as usize).filter(|_| k >= 1 && k <= i);
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
                best = Some((key, Choice { unit: j as u32, fallback: false, d1: d1(i, j), d2 }));
            }
        }
        let chosen = best.map(|(_, choice)| choice).unwrap_or_else(|| {
            let all = (0..m).filter(|&j| units.allowed[j] && free(j));
            let key = |j: usize| (d1(i, j), next != Some(j), j);
            let j = all.min_by(|&a, &b| key(a).partial_cmp(&key(b)).unwrap()).unwrap();
            Choice { unit: j as u32, fallback: true, d1: d1(i, j), d2: 0.0 }
        });
        picks.push(chosen);
    }
    picks
}

fn run(target: &[f32], units: &Units<'_>, p: &SelectorParams) -> Vec<Choice> {
    let mut selector = selector(units, p.clone()).unwrap();
    let n = target.len() / units.dims;
    (0..n)
        .map(|i| {
            let (from, to) = if p.causal { (i - p.look.min(i), i) } else { (i, (i + p.look).min(n - 1)) };
            selector.choose(&target[from * units.dims..(to + 1) * units.dims]).unwrap()
        })
        .collect()
}

/// Features that wander, on a coarse grid now and then so that there are ties.
fn wander(rng: &mut Draw, n: usize, dims: usize, grid: bool) -> Vec<f32> {
    let mut at = vec![0.0; dims];
    let mut out = Vec::new();
    for _ in 0..n {
        for x in &mut at {
            *x = 0.9 * *x + rng.unit() * 2.0 - 1.0;
            out.push(if grid { (*x as f32).round() } else { *x as f32 });
        }
    }
    out
}

#[test]
fn the_search_finds_what_the_whole_table_says() {
    let mut rng = Draw::new(7);
    for round in 0..200 {
        let dims = 1 + rng.below(6);
        let mut segments = Vec::new();
        let mut m = 0;
        for _ in 0..1 + rng.below(4) {
            let count = 1 + rng.below(40);
            segments.push((m, count));
            m += count;
        }
        let grid = rng.below(2) == 0;
        let features = wander(&mut rng, m, dims, grid);
        let n = 1 + rng.below(60);
        let target = wander(&mut rng, n, dims, grid);
        let mut allowed: Vec<bool> = (0..m).map(|_| rng.below(4) > 0).collect();
        if round % 3 > 0 || !allowed.contains(&true) {
            allowed = vec![true; m];
        }
        let units = Units { features: &features, dims, segments, allowed };
        let p = SelectorParams {
            look: [0, 1, 5, 100][rng.below(4)],
            d_max: [0.5, 2.0, 100.0][rng.below(3)],
            cool_off: [0, 3, 20, 200][rng.below(4)],
            loop_guard: [0, 0, 30][rng.below(3)],
            causal: rng.below(2) == 0,
        };
        let (found, wanted) = (run(&target, &units, &p), algorithm_1(&target, &units, &p));
        for (i, (f, w)) in found.iter().zip(&wanted).enumerate() {
            assert!(
                f.unit == w.unit
                    && f.fallback == w.fallback
                    && (f.d1 - w.d1).abs() < 1e-9
                    && (f.d2 - w.d2).abs() < 1e-9,
                "round {round}, target {i}: {f:?}, not {w:?}; {p:?}"
            );
        }
    }
}

#[test]
fn a_database_chooses_itself_and_never_repeats_within_the_cool_off() {
    let mut rng = Draw::new(2);
    let features = wander(&mut rng, 300, 3, false);
    let segments = vec![(0, 300)];
    let units = Units { features: &features, dims: 3, segments, allowed: vec![true; 300] };
    for (cool_off, causal) in [(0, false), (20, false), (500, false), (20, true)] {
        let p = SelectorParams { look: 5, d_max: 2.0, cool_off, loop_guard: 0, causal };
        let picks = run(&features, &units, &p);
        assert!(
            picks
                .iter()
                .enumerate()
                .all(|(i, pick)| pick.unit as usize == i && !pick.fallback && pick.d2 == 0.0)
        );
    }
    let p = SelectorParams { look: 3, d_max: 1.5, cool_off: 20, loop_guard: 0, causal: false };
    let other = wander(&mut rng, 400, 3, false);
    let picks = run(&other, &units, &p);
    for (i, pick) in picks.iter().enumerate() {
        assert!(pick.fallback || pick.d1 <= 1.5);
        assert!(picks[i + 1..].iter().take(20).all(|next| next.unit != pick.unit), "target {i}");
    }
    assert!(picks.iter().any(|pick| pick.fallback) && picks.iter().any(|pick| !pick.fallback));
}

#[test]
fn a_loop_guard_ends_exact_repeats() {
    // The target stays where 25 units lie: without a guard they take turns for ever.
    let features: Vec<f32> =
        (0..200).map(|j| if j < 25 { 0.01 * j as f32 } else { 0.5 + 0.001 * j as f32 }).collect();
    let units = Units { features: &features, dims: 1, segments: vec![(0, 200)], allowed: vec![true; 200] };
    let repeats = |loop_guard| {
        let p = SelectorParams { look: 0, d_max: 9.0, cool_off: 20, loop_guard, causal: false };
        let picks: Vec<u32> = run(&[0.0; 300], &units, &p).iter().map(|c| c.unit).collect();
        (120..300).filter(|&i| (1..100).any(|lag| (0..4).all(|k| picks[i - k] == picks[i - k - lag]))).count()
    };
    assert!(repeats(0) > 100, "{}", repeats(0));
    assert_eq!(repeats(100), 0);
}

#[test]
fn a_feature_that_is_not_finite_is_named_by_its_unit() {
    let units = Units { features: &[0.0, 1.0], dims: 1, segments: vec![(0, 2)], allowed: vec![true; 2] };
    let p = SelectorParams { look: 0, d_max: 1.0, cool_off: 0, loop_guard: 0, causal: false };
    let mut selector = selector(&units, p).unwrap();
    selector.choose(&[0.5]).unwrap();
    assert_eq!(selector.choose(&[f32::NAN]), Err(NotFinite(1)));
}

#[test]
fn what_is_recalled_is_all_that_is_known() {
    let mut rng = Draw::new(11);
    let (features, target) = (wander(&mut rng, 80, 2, false), wander(&mut rng, 60, 2, false));
    let units = Units { features: &features, dims: 2, segments: vec![(0, 80)], allowed: vec![true; 80] };
    let p = SelectorParams { look: 3, d_max: 2.0, cool_off: 12, loop_guard: 0, causal: false };
    let picks = run(&target, &units, &p);
    let mut again = selector(&units, p).unwrap();
    let window = |i: usize| &target[2 * i..2 * (i + 4).min(60)];
    let mut differs = 0;
    // In any order: each choice follows from the picks of its rest alone.
    for i in (0..60_usize).rev() {
        let past: Vec<u32> = picks[i.saturating_sub(12)..i].iter().map(|c| c.unit).collect();
        again.recall(&past);
        assert_eq!(again.another().choose(window(i)), Ok(picks[i]), "{i}");
        again.recall(&[]);
        differs += usize::from(again.choose(window(i)).unwrap().unit != picks[i].unit);
    }
    assert!(differs > 0, "the rest of units matters here");
}
