use super::*;
use crate::core::random::Rng;
use crate::unit::{SelectorParams, Units, selector};

/// Random features, of units in segments of these lengths.
fn units(rng: &mut Rng, lengths: &[usize], features: &mut Vec<f32>) -> (usize, Vec<(usize, usize)>) {
    let m: usize = lengths.iter().sum();
    *features = walk(rng, m);
    let mut start = 0;
    let segments = lengths.iter().map(|&n| {
        start += n;
        (start - n, n)
    });
    (m, segments.collect())
}

/// A random walk in three dimensions.
fn walk(rng: &mut Rng, n: usize) -> Vec<f32> {
    let mut at = [0.0; 3];
    let mut out = Vec::new();
    for _ in 0..n {
        for x in &mut at {
            *x = 0.9 * *x + rng.between(-1.0, 1.0);
            out.push(*x as f32);
        }
    }
    out
}

fn params(switch_cost: f64, cool_off: usize) -> GlobalParams {
    GlobalParams { switch_cost, cap: f64::INFINITY, cool_off, loop_guard: 0 }
}

/// The programme in O(n m²) over the whole table, in double precision.
fn full(target: &[f32], table: &Table, cost: impl Fn(usize, usize) -> f64, cap: f64) -> f64 {
    let m = table.count();
    let mut before = vec![0.0; m];
    for (i, features) in target.chunks_exact(table.dims()).enumerate() {
        let reach = |b: usize| (0..m).map(|a| before[a] + cost(a, b)).fold(f64::INFINITY, f64::min);
        let own = |j: usize| table.distance(features, j).min(cap);
        before = (0..m).map(|j| own(j) + if i == 0 { 0.0 } else { reach(j) }).collect();
    }
    before.into_iter().fold(f64::INFINITY, f64::min)
}

fn greedy(target: &[f32], set: &Units<'_>, cool_off: usize) -> Vec<u32> {
    let params = SelectorParams { look: 5, d_max: 2.0, cool_off, loop_guard: 0, causal: false, effort: None };
    let mut selector = selector(set, params).unwrap();
    let n = target.len() / 3;
    (0..n).map(|i| selector.choose(&target[3 * i..3 * (i + 6).min(n)]).unwrap().unit).collect()
}

fn columns(table: &Table, units: &[u32]) -> Vec<usize> {
    units.iter().map(|&unit| table.column(unit).unwrap()).collect()
}

#[test]
fn the_path_costs_as_much_as_that_of_the_full_programme() {
    let mut rng = Rng::new(1);
    for (case, lengths) in [vec![90], vec![1, 30, 40, 19], vec![45, 45], vec![1; 90]].into_iter().enumerate()
    {
        let mut features = Vec::new();
        let (m, segments) = units(&mut rng, &lengths, &mut features);
        let allowed = (0..m).map(|j| case != 2 || j % 13 != 5).collect();
        let set = Units { allowed, ..Units::new(&features, 3, segments) };
        let table = Table::new(&set).unwrap();
        let target = walk(&mut rng, 120);
        for (p, cap) in [(0.5, f64::INFINITY), (0.0, f64::INFINITY), (2.0, 1.5), (1000.0, f64::INFINITY)] {
            let params = GlobalParams { cap, ..params(p, 0) };
            let path = exact(&table, &target, &params, None).unwrap();
            let jump = |a: usize, b: usize| if table.follows(a, b) { 0.0 } else { p };
            let best = full(&target, &table, jump, cap);
            assert!((path.cost - best).abs() < 1e-4, "{case} {p}: {} against {best}", path.cost);
            assert_eq!(path.units.len(), 120);
            assert_eq!(path.cost, table.cost(&target, &columns(&table, &path.units), &params));
        }
    }
}

type Surcharges = std::collections::BTreeMap<usize, Vec<(usize, f32)>>;

/// The path of the programme over all columns of every row, in its precision and with its choice among equal paths.
fn over_all_columns(target: &[f32], table: &Table, p: &GlobalParams, surcharges: &Surcharges) -> Vec<usize> {
    let (m, switch, cap) = (table.count(), p.switch_cost as f32, p.cap as f32);
    let (mut before, mut least, mut best) = (vec![0.0_f32; m], 0.0_f32, 0);
    let mut decisions: Vec<Vec<usize>> = Vec::new();
    for (i, features) in target.chunks_exact(table.dims()).enumerate() {
        let reached = |j: usize| match i {
            0 => 0.0,
            _ if j > 0 && table.follows(j - 1, j) => before[j - 1] - least,
            _ => f32::INFINITY,
        };
        let cost = |j: usize| {
            let squares = table.features(j).iter().zip(features).map(|(x, y)| (x - y) * (x - y));
            let own = squares.fold(0.0, |sum, square| sum + square).sqrt().min(cap) + reached(j).min(switch);
            let mine = surcharges.get(&i).into_iter().flatten().filter(|(column, _)| *column == j);
            mine.fold(own, |cost, (_, surcharge)| cost + surcharge)
        };
        let costs: Vec<f32> = (0..m).map(cost).collect();
        decisions.push((0..m).map(|j| if j > 0 && reached(j) <= switch { j - 1 } else { best }).collect());
        least = costs.iter().copied().fold(f32::INFINITY, f32::min);
        best = costs.iter().position(|cost| *cost == least).unwrap();
        before = costs;
    }
    let mut path = Vec::new();
    for before in decisions.iter().rev() {
        path.push(best);
        best = before[best];
    }
    path.reverse();
    path
}

#[test]
fn the_active_columns_are_all_that_the_best_path_needs() {
    let mut rng = Rng::new(14);
    for case in 0..40 {
        let mut features = Vec::new();
        let lengths: Vec<usize> = (0..1 + rng.below(9)).map(|_| 1 + rng.below(400)).collect();
        let (_, segments) = units(&mut rng, &lengths, &mut features);
        let mut target = walk(&mut rng, 80);
        if case % 4 == 0 {
            // Many paths cost the same.
            features.iter_mut().chain(&mut target).for_each(|x| *x = x.round());
        }
        let set = Units::new(&features, 3, segments);
        let table = Table::new(&set).unwrap();
        let p = GlobalParams {
            cap: [f64::INFINITY, 1.5, 0.2][rng.below(3)],
            ..params([0.0, 0.1, 0.5, 2.0, 1000.0][rng.below(5)], 0)
        };
        let mut programme = super::programme::Programme::new(&table, &target, &p, Some(1 + rng.below(30)));
        programme.solve(&vec![true; programme.blocks()]);
        assert_eq!(programme.path, over_all_columns(&target, &table, &p, &programme.surcharges), "{case}");
        for _ in 0..3 {
            let mut changed = vec![false; programme.blocks()];
            for _ in 0..rng.below(20) {
                let row = rng.below(80);
                let cell = (programme.path[row], rng.between(0.0, 1.0) as f32);
                programme.surcharges.entry(row).or_default().push(cell);
                changed[row / programme.block] = true;
            }
            programme.solve(&changed);
            let wanted = over_all_columns(&target, &table, &p, &programme.surcharges);
            assert_eq!(programme.path, wanted, "{case}, {p:?}");
        }
    }
}

#[test]
fn no_choice_unit_by_unit_is_cheaper() {
    let mut rng = Rng::new(2);
    for case in 0..40 {
        let mut features = Vec::new();
        let lengths: Vec<usize> = (0..1 + rng.below(4)).map(|_| 1 + rng.below(60)).collect();
        let (m, segments) = units(&mut rng, &lengths, &mut features);
        let set = Units::new(&features, 3, segments);
        let table = Table::new(&set).unwrap();
        let target = walk(&mut rng, 1 + case * 7);
        let p = params(rng.between(0.0, 3.0), 0);
        let one_by_one = greedy(&target, &set, 0);
        let global = exact(&table, &target, &p, None).unwrap();
        let cost = table.cost(&target, &columns(&table, &one_by_one), &p);
        assert!(global.cost <= cost + 1e-4, "{case}: {} against {cost}", global.cost);
        let beam_params = BeamParams { path: p, candidates: 4, feature: 0.3, level: 0.2, crossing: 0.1 };
        let joins = joins(&mut rng, m);
        let found = beam(&table, &joins, &target, &one_by_one, &beam_params).unwrap();
        let cost = joins.path_cost(&table, &target, &one_by_one, &beam_params);
        assert!(found.cost <= cost + 1e-9, "{case}: beam {} against {cost}", found.cost);
    }
}

fn joins(rng: &mut Rng, m: usize) -> Joins {
    Joins {
        levels: (0..m).map(|_| rng.between(-6.0, 0.0) as f32).collect(),
        leaves: (0..m).map(|_| rng.below(9) > 0).collect(),
        enters: (0..m).map(|_| rng.below(9) > 0).collect(),
    }
}

#[test]
fn a_beam_as_wide_as_the_database_finds_the_best_path() {
    let mut rng = Rng::new(3);
    let mut features = Vec::new();
    let (m, segments) = units(&mut rng, &[20, 30], &mut features);
    let set = Units::new(&features, 3, segments);
    let table = Table::new(&set).unwrap();
    let target = walk(&mut rng, 60);
    let p = BeamParams { path: params(0.4, 0), candidates: m, feature: 0.3, level: 0.2, crossing: 0.5 };
    let joins = joins(&mut rng, m);
    let found = beam(&table, &joins, &target, &[], &p).unwrap();
    let best = full(&target, &table, |a, b| joins.cost(&table, a, b, &p), f64::INFINITY);
    assert!((found.cost - best).abs() < 1e-9, "{} against {best}", found.cost);
    let plain = BeamParams { feature: 0.0, level: 0.0, crossing: 0.0, ..p };
    let found = beam(&table, &joins, &target, &[], &plain).unwrap();
    let best = exact(&table, &target, &plain.path, None).unwrap();
    assert!((found.cost - best.cost).abs() < 1e-4);
}

#[test]
fn free_jumps_give_the_nearest_units_and_expensive_ones_an_unbroken_run() {
    let mut rng = Rng::new(4);
    let mut features = Vec::new();
    let (m, segments) = units(&mut rng, &[50, 150], &mut features);
    let set = Units::new(&features, 3, segments);
    let table = Table::new(&set).unwrap();
    let target = walk(&mut rng, 100);
    let near = exact(&table, &target, &params(0.0, 0), None).unwrap();
    for (features, &unit) in target.chunks_exact(3).zip(&near.units) {
        let least = (0..m).map(|j| table.distance(features, j)).fold(f64::INFINITY, f64::min);
        assert!(table.distance(features, unit as usize) <= least + 1e-6);
    }
    let run = exact(&table, &target, &params(1000.0, 0), None).unwrap();
    assert!(run.units.windows(2).all(|w| w[1] == w[0] + 1), "{:?}", run.units);
    // The only recording that is long enough.
    assert!(run.units[0] >= 50);
    let best = (50..=100)
        .map(|from| (0..100).map(|i| table.distance(&target[3 * i..3 * i + 3], from + i)).sum::<f64>())
        .fold(f64::INFINITY, f64::min);
    assert!((run.cost - best).abs() < 1e-3);
}

/// Units on a grid, so that the gap between any two is known, and a target that plays stretches of them with noise.
fn planted(rng: &mut Rng, noise: f64) -> (Vec<f32>, Vec<(usize, usize)>, Vec<u32>, Vec<f32>) {
    let first_position = |j: usize| [(j % 9) as f64, (j / 9 % 9) as f64, (j / 81) as f64];
    let m = 243;
    let mut order: Vec<usize> = (0..m).collect();
    for k in (1..m).rev() {
        order.swap(k, rng.below(k + 1));
    }
    let features: Vec<f32> = order.iter().flat_map(|&j| first_position(j)).map(|x| x as f32).collect();
    let mut path: Vec<u32> = Vec::new();
    while path.len() < 400 {
        // Stretches end before their recording does.
        let (from, to) = [(0, 100), (100, m)][rng.below(2)];
        let length = 12 + rng.below(20);
        let start = from + rng.below(to - from - length);
        if path.last() != Some(&(start as u32).wrapping_sub(1)) {
            path.extend((start..start + length).map(|j| j as u32));
        }
    }
    let target = path.iter().flat_map(|&j| features[3 * j as usize..][..3].to_vec());
    let most = noise / 3.0f64.sqrt();
    let target = target.map(|x| (f64::from(x) + rng.between(-most, most)) as f32).collect();
    (features, vec![(0, 100), (100, 143)], path, target)
}

#[test]
fn a_planted_path_is_recovered_when_noise_is_below_half_the_gap() {
    let mut rng = Rng::new(5);
    for noise in [0.0, 0.49] {
        let (features, segments, path, target) = planted(&mut rng, noise);
        let set = Units::new(&features, 3, segments);
        let table = Table::new(&set).unwrap();
        assert_eq!(exact(&table, &target, &params(0.02, 0), None).unwrap().units, path);
    }
}

#[test]
fn blocks_of_any_size_give_the_same_path() {
    let mut rng = Rng::new(6);
    let mut features = Vec::new();
    let (_, segments) = units(&mut rng, &[9000, 8500], &mut features);
    let set = Units::new(&features, 3, segments);
    let table = Table::new(&set).unwrap();
    let target = walk(&mut rng, 50);
    let p = params(0.5, 3);
    let first = exact(&table, &target, &p, None).unwrap();
    for block in [1, 2, 7, 49, 50, 1000] {
        assert_eq!(exact(&table, &target, &p, Some(block)).unwrap(), first, "{block}");
    }
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| exact(&table, &target, &p, None).unwrap()), first, "{threads} threads");
    }
}

fn repeated(path: &[u32], cool_off: usize) -> usize {
    (0..path.len()).filter(|&i| path[i.saturating_sub(cool_off)..i].contains(&path[i])).count()
}

/// Cost of a path with a cool-off of 10 units, and of one that only replaces units that recur too early.
fn repaired(seed: u64, lengths: &[usize], rows: usize) -> (f64, f64) {
    let mut rng = Rng::new(seed);
    let mut features = Vec::new();
    let (m, segments) = units(&mut rng, lengths, &mut features);
    let set = Units::new(&features, 3, segments);
    let table = Table::new(&set).unwrap();
    let target = walk(&mut rng, rows);
    let free = exact(&table, &target, &params(0.2, 0), None).unwrap();
    let p = params(0.2, 10);
    let rested = exact(&table, &target, &p, None).unwrap();
    assert!(rested.repeats > 0 && rested.repeats == repeated(&free.units, 10));
    assert_eq!(repeated(&rested.units, 10), 0);
    assert!(rested.rounds > 0 && rested.rounds <= 20);
    assert!((rested.free_cost - free.cost).abs() < 1e-12 && rested.cost >= free.cost);
    let mut history = crate::unit::selection::history::History::new(m, &[], 10, 0);
    let mut replaced = columns(&table, &free.units);
    for i in 0..replaced.len() {
        replaced[i] = super::repair::substitute(&history, &table, &target[3 * i..3 * i + 3], replaced[i], &p);
        history.record(replaced[i] as u32);
    }
    let beam_params = BeamParams { path: p, candidates: 40, feature: 0.0, level: 0.0, crossing: 0.0 };
    let found = beam(&table, &Joins::default(), &target, &[], &beam_params).unwrap();
    assert_eq!((repeated(&found.units, 10), found.repeats), (0, 0));
    (rested.cost, table.cost(&target, &replaced, &p))
}

#[test]
fn units_rest_after_a_repair_that_costs_no_more_than_replacing() {
    let mut sum = (0.0, 0.0);
    for seed in 0..12 {
        let lengths = if seed % 2 == 0 { [120, 80] } else { [1500, 1500] };
        let (rested, replaced) = repaired(7 + seed, &lengths, 400);
        assert!(rested <= replaced, "{rested} against {replaced}");
        sum = (sum.0 + rested, sum.1 + replaced);
    }
    assert!(sum.0 < sum.1, "{sum:?}");
}

#[test]
fn every_search_takes_copies_at_another_level_for_the_same_unit() {
    let mut rng = Rng::new(31);
    let (mut features, lengths) = (Vec::new(), [70, 50]);
    let (m, segments) = units(&mut rng, &lengths, &mut features);
    // The copies lie so near that they would take turns with the units themselves.
    let copies: Vec<f32> = features.iter().map(|x| x + 1e-3).collect();
    let twice: Vec<f32> = [&features[..], &copies].concat();
    let all: Vec<_> =
        segments.iter().copied().chain(segments.iter().map(|(from, n)| (from + m, *n))).collect();
    let same: Vec<u32> = (0..2 * m).map(|j| (j % m) as u32).collect();
    let sounds = |picks: &[u32]| picks.iter().map(|unit| unit % m as u32).collect::<Vec<_>>();
    // A target that hardly moves selects the same units again and again.
    let target: Vec<f32> = walk(&mut rng, 150).iter().map(|x| 0.05 * x).collect();
    for are_known in [false, true] {
        let same = if are_known { same.clone() } else { Vec::new() };
        let set = Units { same, ..Units::new(&twice, 3, all.clone()) };
        let table = Table::new(&set).unwrap();
        let p = params(0.0, 10);
        let exact = exact(&table, &target, &p, None).unwrap().units;
        let beam_params = BeamParams { path: p, candidates: 60, feature: 0.0, level: 0.0, crossing: 0.0 };
        let beam = beam(&table, &Joins::default(), &target, &[], &beam_params).unwrap().units;
        let mut lagged = FixedLag::new(Table::new(&set).unwrap(), p, 5);
        let window = |i: usize| &target[3 * i..(3 * (i + 6)).min(target.len())];
        let lagged: Vec<u32> = (0..150).map(|i| lagged.choose(window(i)).unwrap().unit).collect();
        for (name, picks) in
            [("exact", exact), ("beam", beam), ("lagged", lagged), ("greedy", greedy(&target, &set, 10))]
        {
            assert_eq!(repeated(&picks, 10), 0, "{name}");
            assert_eq!(repeated(&sounds(&picks), 10) == 0, are_known, "{name}, known: {are_known}");
        }
    }
}

/// Number of picks that complete a repeat of four picks within `guard` targets.
fn loops(path: &[u32], guard: usize) -> usize {
    let same = |i: usize, lag: usize| i >= lag + 3 && path[i - 3..=i] == path[i - lag - 3..=i - lag];
    (0..path.len()).filter(|&i| (1..=guard).any(|lag| same(i, lag))).count()
}

#[test]
fn no_four_picks_are_repeated_within_the_loop_guard() {
    let mut rng = Rng::new(21);
    for lengths in [&[60, 40][..], &[400, 300]] {
        let mut features = Vec::new();
        let (_, segments) = units(&mut rng, lengths, &mut features);
        let set = Units::new(&features, 3, segments);
        let table = Table::new(&set).unwrap();
        // A target that repeats itself.
        let target = walk(&mut rng, 60).repeat(5);
        let guarded = GlobalParams { loop_guard: 70, ..params(0.5, 5) };
        let free = exact(&table, &target, &params(0.5, 5), None).unwrap();
        assert!(loops(&free.units, 70) > 100, "{}", loops(&free.units, 70));
        let found = exact(&table, &target, &guarded, None).unwrap();
        assert_eq!((loops(&found.units, 70), repeated(&found.units, 5)), (0, 0));
        assert!(found.cost < 1.5 * free.cost, "{} for {}", found.cost, free.cost);
        let beam_params =
            BeamParams { path: guarded, candidates: 40, feature: 0.0, level: 0.0, crossing: 0.0 };
        let found = beam(&table, &Joins::default(), &target, &[], &beam_params).unwrap();
        assert_eq!((loops(&found.units, 70), found.repeats), (0, 0));
        let mut online = FixedLag::new(table.clone(), guarded, 12);
        let windows = (0..300).map(|i| &target[3 * i..3 * (i + 13).min(300)]);
        let online: Vec<u32> = windows.map(|window| online.choose(window).unwrap().unit).collect();
        assert_eq!((loops(&online, 70), repeated(&online, 5)), (0, 0));
    }
}

#[test]
fn fewer_units_than_have_to_rest_are_chosen_all_the_same() {
    let features = [0.0, 1.0, 2.0];
    let set = Units::new(&features, 1, vec![(0, 3)]);
    let table = Table::new(&set).unwrap();
    let target = [0.0, 0.0, 0.0, 0.0, 2.0];
    let path = exact(&table, &target, &params(0.5, 20), None).unwrap();
    assert_eq!(path.units.len(), 5);
    // The one that has rested longest comes first again.
    assert_eq!(path.units[..4], [0, 1, 2, 0]);
    let p = BeamParams { path: params(0.5, 20), candidates: 3, feature: 0.0, level: 0.0, crossing: 0.0 };
    let found = beam(&table, &Joins::default(), &target, &[], &p).unwrap();
    assert_eq!((found.units.len(), found.repeats), (5, 2));
}

#[test]
fn a_lag_as_long_as_the_target_loses_nothing_and_a_short_one_little() {
    let mut rng = Rng::new(8);
    let mut features = Vec::new();
    let (_, segments) = units(&mut rng, &[300, 200], &mut features);
    let set = Units::new(&features, 3, segments);
    let table = Table::new(&set).unwrap();
    let n = 300;
    let target = walk(&mut rng, n);
    let p = params(0.5, 0);
    let best = exact(&table, &target, &p, None).unwrap();
    let mut costs = Vec::new();
    for lag in [0, 12, n] {
        let mut online = FixedLag::new(table.clone(), p, lag);
        let windows = (0..n).map(|i| &target[3 * i..3 * (i + 1 + lag).min(n)]);
        let units: Vec<u32> = windows.map(|window| online.choose(window).unwrap().unit).collect();
        let cost = table.cost(&target, &columns(&table, &units), &p);
        costs.push((difference(&units, &best.units), cost));
    }
    assert!(costs[2].0 == 0.0, "{costs:?}");
    assert!(costs[1].0 < 0.3 && costs[0].0 > costs[1].0, "{costs:?}");
    assert!(costs[1].1 < 1.05 * best.cost && costs[0].1 > costs[1].1, "{costs:?} {}", best.cost);
}

#[test]
fn targets_that_are_not_finite_are_named_and_empty_ones_are_empty() {
    let features = [0.0, 1.0];
    let set = Units::new(&features, 1, vec![(0, 2)]);
    let table = Table::new(&set).unwrap();
    let p = params(0.5, 0);
    assert_eq!(exact(&table, &[0.0, f32::NAN], &p, None), Err(crate::unit::NotFinite(1)));
    assert!(exact(&table, &[], &p, None).unwrap().units.is_empty());
    let none = Units { allowed: vec![false; 2], ..set };
    assert!(Table::new(&none).is_none());
}
