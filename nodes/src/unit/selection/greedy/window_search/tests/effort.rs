//! How few units the search looks at.

use super::*;

/// Features that change as slowly as filtered ones do, in one stretch.
fn smooth(rng: &mut Rng, n: usize) -> Vec<f32> {
    let mut at = [[0.0; 3]; 3];
    let mut out = Vec::with_capacity(3 * n);
    for _ in 0..n {
        for x in &mut at {
            x[0] = 0.98 * x[0] + rng.between(-1.0, 1.0);
            x[1] += 0.2 * (x[0] - x[1]);
            x[2] += 0.2 * (x[1] - x[2]);
            out.push(x[2] as f32);
        }
    }
    out
}

/// For each target the units within `d_max`, and of those the one of the least sum over the window; exact.
fn by_ball(target: &[f32], units: &Units<'_>, p: &SelectorParams) -> Vec<(u32, bool)> {
    fn at(x: &[f32], i: usize) -> &[f32] {
        &x[3 * i..3 * i + 3]
    }
    let (n, m) = (target.len() / 3, units.features.len() / 3);
    let mut picks: Vec<(u32, bool)> = Vec::new();
    for i in 0..n {
        let look = p.look.min(n - 1 - i);
        let barred: Vec<u32> = picks.iter().rev().take(p.cool_off).map(|(unit, _)| *unit).collect();
        let (mut best, mut nearest) = ((f64::INFINITY, 0), (f64::INFINITY, 0));
        for j in (0..m as u32).filter(|j| !barred.contains(j)) {
            let d1 = squared(at(target, i), at(units.features, j as usize)).sqrt();
            nearest = if d1 < nearest.0 { (d1, j) } else { nearest };
            if d1 <= p.d_max && (j as usize) + look < m {
                let d2 = (0..=look)
                    .map(|k| squared(at(target, i + k), at(units.features, j as usize + k)).sqrt())
                    .sum::<f64>();
                best = if d2 < best.0 { (d2, j) } else { best };
            }
        }
        picks.push(if best.0 < f64::INFINITY { (best.1, false) } else { (nearest.1, true) });
    }
    picks
}

#[test]
fn among_many_units_few_are_looked_at_and_the_best_is_found() {
    let mut rng = Rng::new(31);
    let (features, target) = (smooth(&mut rng, 20_000), smooth(&mut rng, 120));
    let units = Units::new(&features, 3, vec![(0, 20_000)]);
    for d_max in [2.0, 8.0] {
        let p = SelectorParams { look: 10, d_max, cool_off: 20, loop_guard: 0, causal: false, effort: None };
        let found = run(&target, &units, &p);
        let picks: Vec<(u32, bool)> = found.iter().map(|c| (c.unit, c.fallback)).collect();
        assert_eq!(picks, by_ball(&target, &units, &p), "{d_max}");
        // But for the last targets, whose windows are shorter than those of the index, groups and units that are as many as one unit in
        // twenty are enough to show that.
        let few = run(&target, &units, &SelectorParams { effort: Some(1000), ..p });
        assert!(few[..110].iter().all(|c| !c.cut), "{}", few.iter().filter(|c| c.cut).count());
        assert_eq!(few[..110], found[..110], "{d_max}");
    }
}

#[test]
fn units_that_are_all_alike_are_not_looked_at_one_by_one() {
    // Silence in both: every unit of the first two stretches is at no distance.
    let features = [vec![0.5; 3 * 9000], vec![4.0; 3 * 1000]].concat();
    let segments = vec![(0, 4000), (4000, 5000), (9000, 1000)];
    let units = Units::new(&features, 3, segments);
    let look = 5;
    let choose = |effort, picks: &[u32]| {
        let p = SelectorParams { look, d_max: 2.0, cool_off: 20, loop_guard: 0, causal: false, effort };
        let mut selector = selector(&units, p).unwrap();
        selector.set_history(picks);
        (0..50).map(|_| selector.choose(&[0.5; 18]).unwrap()).collect::<Vec<_>>()
    };
    // From rest, in a run, and out of one that ends with its stretch.
    for (picks, first) in [(vec![], 0), (vec![700], 701), (vec![3990], 3991), (vec![8994], 0)] {
        let found = choose(Some(150), &picks);
        assert!(found.iter().all(|c| !c.cut && !c.fallback && c.d2 == 0.0), "{picks:?}");
        assert_eq!(found, choose(None, &picks));
        assert_eq!(found[0].unit, first, "{picks:?}");
    }
}

#[test]
fn units_that_are_all_as_far_are_not_looked_at_one_by_one_either() {
    // Silence of the recordings beside a target that is not quite as silent: every unit ties, at a distance that is not 0.
    let features = vec![0.5; 3 * 10_000];
    let segments = vec![(0, 4000), (4000, 6000)];
    let units = Units::new(&features, 3, segments);
    let look = 10;
    for d_max in [2.0, 0.2] {
        let choose = |effort, picks: &[u32]| {
            let p = SelectorParams { look, d_max, cool_off: 20, loop_guard: 0, causal: false, effort };
            let mut selector = selector(&units, p).unwrap();
            selector.set_history(picks);
            (0..60).map(|_| selector.choose(&[1.0; 33]).unwrap()).collect::<Vec<_>>()
        };
        for (picks, first) in
            [(vec![], 0), (vec![700], 701), (vec![3995], [3996, 0][usize::from(d_max > 1.0)])]
        {
            let found = choose(Some(150), &picks);
            assert_eq!(found[0].unit, first, "{d_max} {picks:?}");
            assert!(found.iter().all(|c| !c.cut && c.fallback == (d_max < 0.8)), "{d_max} {picks:?}");
            assert_eq!(found, choose(None, &picks));
        }
        // If nothing is near enough, the search for the nearest unit needs no limit.
        let p = SelectorParams { look, d_max, cool_off: 20, loop_guard: 0, causal: false, effort: None };
        let mut selector = Exact::new(&units, p);
        (0..60).for_each(|_| assert!(!selector.choose(&[1.0; 33]).unwrap().cut));
        selector.search.left = Some(10_000);
        selector.nearest(None).unwrap();
        let seen = 10_000 - selector.search.left.unwrap();
        println!("{seen} nodes and units for the nearest of 10000 that are alike");
        assert!(seen < 150, "{seen}");
    }
}
