use super::super::dtw::distance;
use super::super::overlap::most_similar;
use super::super::pattern::Normalisation;
use super::*;
use crate::core::computation::unmonitored;
use crate::core::random::Rng;

fn curve(values: Vec<f32>, channels: usize) -> MotionCurve {
    MotionCurve { rate: 60.0, channels, values, gaps: Vec::new() }
}

fn walk(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut x = 0.0;
    (0..n)
        .map(|_| {
            x = 0.99 * x + rng.between(-1.0, 1.0);
            x as f32
        })
        .collect()
}

/// The definition, without any bound.
fn naive(curve: &MotionCurve, interval: (f64, f64), rules: QueryRules) -> Vec<MotionMatch> {
    let query = Query::new(curve, curve, interval, rules).unwrap();
    let mut found = Vec::new();
    for len in query.grids().iter().map(|grid| grid.len) {
        for start in 0..=curve.frames() - len {
            let mut window = Vec::new();
            for j in 0..query.pattern.frames {
                let at = j as f64 * (len - 1) as f64 / (query.pattern.frames - 1) as f64;
                let (k, t) = (at as usize, at - at.floor());
                for c in 0..curve.channels {
                    let x = |k: usize| curve.values[(start + k.min(len - 1)) * curve.channels + c];
                    window.push(x(k) + t as f32 * (x(k + 1) - x(k)));
                }
            }
            for c in 0..curve.channels {
                let own = |k: usize| f64::from(curve.values[k * curve.channels + c]);
                let mean = (start..start + len).map(own).sum::<f64>() / len as f64;
                let square = (start..start + len).map(|k| (own(k) - mean).powi(2)).sum::<f64>() / len as f64;
                let (mean, factor) = match rules.normalisation {
                    Normalisation::None => (0.0, 1.0),
                    Normalisation::Offset => (mean, 1.0),
                    Normalisation::ZScore => (mean, 1.0 / square.sqrt()),
                };
                let own = window.iter_mut().skip(c).step_by(curve.channels);
                own.for_each(|x| *x = ((f64::from(*x) - mean) * factor) as f32);
            }
            let d =
                distance(&query.pattern.values, &window, curve.channels, query.pattern.radius, 1e9).unwrap();
            let similarity = (-d / (query.pattern.frames as f64).sqrt() / query.pattern.deviation).exp();
            if similarity >= rules.threshold {
                let at = |k: usize| k as f64 / curve.rate;
                found.push(MotionMatch { from: at(start), to: at(start + len), similarity });
            }
        }
    }
    found
}

#[test]
fn bounds_leave_nothing_out() {
    for seed in 0..12 {
        let channels = 1 + seed as usize % 2;
        let curve = curve(walk(600 * channels, seed), channels);
        let normalisation =
            [Normalisation::Offset, Normalisation::ZScore, Normalisation::None][seed as usize % 3];
        let rules =
            QueryRules { threshold: 0.35, normalisation, exhaustive: seed % 4 == 3, ..QueryRules::default() };
        let interval = (2.0, 2.0 + 0.4 + 0.05 * seed as f64);
        let fast = find_matches(&curve, &curve, interval, rules, &unmonitored).unwrap();
        let slow = naive(&curve, interval, rules);
        assert!(slow.len() > 3, "seed {seed}: {}", slow.len());
        let best = best_matches(&curve, &curve, interval, rules, &unmonitored).unwrap();
        assert_eq!(best, most_similar(fast.clone()), "seed {seed}");
        for count in [1, 3] {
            let few = QueryRules { count: Some(count), ..rules };
            let mut expected = best.clone();
            expected.sort_by(|a, b| b.similarity.total_cmp(&a.similarity));
            expected.truncate(count);
            expected.sort_by(|a, b| a.from.total_cmp(&b.from));
            assert_eq!(
                best_matches(&curve, &curve, interval, few, &unmonitored).unwrap(),
                expected,
                "seed {seed}"
            );
        }
        // At the threshold rounding decides.
        let sure = |all: &[MotionMatch]| {
            all.iter().filter(|m| m.similarity > 0.3505).map(|m| (m.from, m.to)).collect::<Vec<_>>()
        };
        assert_eq!(sure(&fast), sure(&slow), "seed {seed}");
        for (a, b) in fast.iter().zip(&slow).take(if fast.len() == slow.len() { 9999 } else { 0 }) {
            assert!((a.similarity - b.similarity).abs() < 1e-4);
        }
    }
}

/// Matches of the exact search that iterative deepening misses.
#[test]
fn iterative_deepening_misses_no_more_than_its_tolerance() {
    for tolerance in [0.01, 0.1, 0.5] {
        let (mut all, mut missed) = (0, 0);
        for seed in 0..12 {
            let channels = 1 + seed as usize % 2;
            let curve = curve(walk(1200 * channels, 40 + seed), channels);
            let rules = QueryRules { threshold: 0.35, ..QueryRules::default() };
            let interval = (2.0, 2.8 + 0.05 * seed as f64);
            let search = |rules| find_matches(&curve, &curve, interval, rules, &unmonitored).unwrap();
            let exact = search(rules);
            let found = search(QueryRules { tolerance: Some(tolerance), ..rules });
            assert!(found.iter().all(|m| exact.contains(m)));
            let best = best_matches(
                &curve,
                &curve,
                interval,
                QueryRules { tolerance: Some(tolerance), ..rules },
                &unmonitored,
            );
            assert_eq!(best.unwrap(), most_similar(found.clone()), "seed {seed}");
            all += exact.len();
            missed += exact.len() - found.len();
        }
        let share = missed as f64 / all as f64;
        let deviation = (tolerance * (1.0 - tolerance) / all as f64).sqrt();
        assert!(all > 1000 && share <= tolerance + 3.0 * deviation, "{tolerance}: {missed} of {all}");
        // It does leave out windows.
        assert!(tolerance < 0.5 || missed > 0, "{tolerance}: {missed} of {all}");
    }
}

#[test]
fn planted_repetitions_are_found_and_nothing_else() {
    let mut rng = Rng::new(7);
    let mut values = walk(6000, 3).into_iter().map(|x| 0.2 * x).collect::<Vec<f32>>();
    let gesture =
        |t: f64| 12.0 * ((7.0 * t).sin() * (-2.0 * t).exp() + 0.4 * (23.0 * t).sin() * t * (1.0 - t));
    let mut planted = Vec::new();
    for (k, stretch) in [1.0, 0.5, 0.7, 1.3, 2.0, 1.0].into_iter().enumerate() {
        let (start, len) = (400 + 900 * k, (60.0 * stretch) as usize);
        let offset = 20.0 * k as f64;
        for j in 0..len {
            let noise = rng.between(-0.4, 0.4);
            values[start + j] = (offset + gesture(j as f64 / (len - 1) as f64) + noise) as f32;
        }
        planted.push((start as f64 / 60.0, (start + len) as f64 / 60.0));
    }
    let curve = curve(values, 1);
    let found = find_matches(&curve, &curve, planted[0], QueryRules::default(), &unmonitored).unwrap();
    let found = most_similar(found);
    assert_eq!(found.len(), planted.len(), "{found:?}");
    for (m, (from, to)) in found.iter().zip(&planted) {
        assert!((m.from - from).abs() < 0.15 && (m.to - to).abs() < 0.15, "{m:?} {from} {to}");
    }
    assert!((found[0].similarity - 1.0).abs() < 1e-6);
}

#[test]
fn gaps_are_passed_over_and_bad_queries_are_refused() {
    let mut gapped = curve((0..600).map(|k| (0.3 * k as f32).sin()).collect(), 1);
    gapped.gaps = vec![(200, 400)];
    let found = find_matches(&gapped, &gapped, (0.5, 1.0), QueryRules::default(), &unmonitored).unwrap();
    assert!(found.iter().all(|m| m.to * 60.0 <= 200.5 || m.from * 60.0 >= 399.5) && !found.is_empty());
    let error = |c: &MotionCurve, interval| {
        find_matches(c, c, interval, QueryRules::default(), &unmonitored).unwrap_err().to_string()
    };
    assert!(error(&gapped, (9.0, 11.0)).contains("the curve ends at 10.000 s"));
    assert!(error(&gapped, (1.0, 1.02)).contains("at least 4 frames"));
    assert!(error(&curve(vec![2.0; 100], 1), (0.5, 1.0)).contains("is constant"));
    assert!(error(&curve(vec![], 1), (0.5, 1.0)).contains("no frame"));
    let stopped = find_matches(&gapped, &gapped, (0.5, 1.0), QueryRules::default(), &|_| true);
    assert_eq!(stopped, Err(QueryError::Stopped));
}
