mod algorithm_1;
mod effort;

use super::*;
use crate::core::random::Rng;
use crate::unit::selection::kdtree::KdTree;
use algorithm_1::algorithm_1;

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

/// Features of a random walk, sometimes on a coarse grid so that there are ties.
fn wander(rng: &mut Rng, n: usize, dims: usize, grid: bool) -> Vec<f32> {
    let mut at = vec![0.0; dims];
    let mut out = Vec::new();
    for _ in 0..n {
        for x in &mut at {
            *x = 0.9 * *x + rng.uniform() * 2.0 - 1.0;
            out.push(if grid { (*x as f32).round() } else { *x as f32 });
        }
    }
    out
}

#[test]
fn the_search_finds_the_choice_of_the_whole_table() {
    let mut rng = Rng::new(7);
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
        let units = Units { allowed, ..Units::new(&features, dims, segments) };
        let p = SelectorParams {
            look: [0, 1, 5, 100][rng.below(4)],
            d_max: [0.5, 2.0, 100.0][rng.below(3)],
            cool_off: [0, 3, 20, 200][rng.below(4)],
            loop_guard: [0, 0, 30][rng.below(3)],
            causal: rng.below(2) == 0,
            effort: None,
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
    let mut rng = Rng::new(2);
    let features = wander(&mut rng, 300, 3, false);
    let segments = vec![(0, 300)];
    let units = Units::new(&features, 3, segments);
    for (cool_off, causal) in [(0, false), (20, false), (500, false), (20, true)] {
        let p = SelectorParams { look: 5, d_max: 2.0, cool_off, loop_guard: 0, causal, effort: None };
        let picks = run(&features, &units, &p);
        assert!(
            picks
                .iter()
                .enumerate()
                .all(|(i, pick)| pick.unit as usize == i && !pick.fallback && pick.d2 == 0.0)
        );
    }
    let p = SelectorParams { look: 3, d_max: 1.5, cool_off: 20, loop_guard: 0, causal: false, effort: None };
    let other = wander(&mut rng, 400, 3, false);
    let picks = run(&other, &units, &p);
    for (i, pick) in picks.iter().enumerate() {
        assert!(pick.fallback || pick.d1 <= 1.5);
        assert!(picks[i + 1..].iter().take(20).all(|next| next.unit != pick.unit), "target {i}");
    }
    assert!(picks.iter().any(|pick| pick.fallback) && picks.iter().any(|pick| !pick.fallback));
}

/// Targets within `look` units of a join, which have no room for a window, and others that do not choose themselves.
#[track_caller]
fn itself_but_near_joins(picks: &[u32], segments: &[(usize, usize)], look: usize, cool_off: usize) -> usize {
    let mut others = 0;
    for &(from, count) in segments {
        // The target ends with the last recording: there windows shorten on both sides.
        let room = if from + count == picks.len() { 0 } else { look };
        for i in from..from + count - room {
            // Only where a unit near a join had to take this one is it at rest.
            let rests = picks[i.saturating_sub(cool_off)..i].contains(&(i as u32));
            assert!(picks[i] as usize == i || rests, "target {i} chose {}", picks[i]);
            others += usize::from(rests);
        }
    }
    others
}

#[test]
fn recordings_choose_themselves_but_for_a_window_before_each_join() {
    let mut rng = Rng::new(12);
    let features = wander(&mut rng, 240, 3, false);
    let segments = vec![(0, 90), (90, 4), (94, 80), (174, 66)];
    let units = Units::new(&features, 3, segments.clone());
    for look in [0, 5, 9] {
        for cool_off in [0, 20, 500] {
            let p = SelectorParams { look, d_max: 2.0, cool_off, loop_guard: 0, causal: false, effort: None };
            let picks: Vec<u32> = run(&features, &units, &p).iter().map(|pick| pick.unit).collect();
            let windows: Vec<_> = segments.iter().copied().filter(|(_, count)| *count > look).collect();
            let others = itself_but_near_joins(&picks, &windows, look, cool_off);
            // A unit that was taken early makes its own target take another one early.
            assert!(cool_off * look > 0 || others == 0, "{look} {cool_off}: {others}");
            // Before a join no unit has room for a window of its own.
            assert_eq!(picks[89] == 89, look == 0);
        }
    }
}

#[test]
fn families_of_like_units_are_chosen_from_as_from_the_whole_table() {
    let mut rng = Rng::new(40);
    for round in 0..60 {
        // Stretches of a few constants: whole windows are alike, in several segments, and tie at several distances.
        let level = |rng: &mut Rng| [0.0, 0.5, 1.0][rng.below(3)];
        let stretches = |rng: &mut Rng, n: usize| {
            let mut out = Vec::new();
            while out.len() < 2 * n {
                let (x, y, length) = (level(rng), level(rng), 1 + rng.below(20));
                (0..length).for_each(|_| out.extend([x, y]));
            }
            out.truncate(2 * n);
            out
        };
        let (m, n) = (60 + rng.below(60), 40);
        let (features, target) = (stretches(&mut rng, m), stretches(&mut rng, n));
        let target: Vec<f32> = target.iter().map(|x| x + 0.25).collect();
        let cut = 10 + rng.below(40);
        let allowed: Vec<bool> = (0..m).map(|_| round % 3 > 0 || rng.below(3) > 0).collect();
        let units = Units { allowed, ..Units::new(&features, 2, vec![(0, cut), (cut, m - cut)]) };
        let p = SelectorParams {
            look: [0, 2, 6][rng.below(3)],
            d_max: [0.3, 2.0][rng.below(2)],
            cool_off: [0, 3, 20][rng.below(3)],
            loop_guard: [0, 30][rng.below(2)],
            causal: rng.below(2) == 0,
            effort: None,
        };
        let (found, wanted) = (run(&target, &units, &p), algorithm_1(&target, &units, &p));
        for (i, (f, w)) in found.iter().zip(&wanted).enumerate() {
            assert_eq!(
                (f.unit, f.fallback),
                (w.unit, w.fallback),
                "round {round}, target {i}: {f:?} {w:?}; {p:?}"
            );
        }
    }
}

/// Features as units of noise have them, filtered over time with the widths of cotton: slow changes under much scatter.
fn filtered(rng: &mut Rng, n: usize, scatter: f64) -> Vec<f32> {
    let mut at = [0.0; 3];
    let mut out = Vec::with_capacity(3 * n);
    for _ in 0..n {
        for x in &mut at {
            *x = 0.995 * *x + 0.3 * rng.between(-1.0, 1.0);
            out.push((*x + scatter * rng.between(-1.0, 1.0)) as f32);
        }
    }
    crate::feature::TemporalFilter::new(&[20.0, 50.0, 10.0], false).process_segment(&out)
}

#[test]
fn comparing_the_past_keeps_runs_as_long_as_comparing_the_future() {
    // The specification found 0.53 and 0.51 of the picks to follow the one before, and 0.14 where one unit alone is compared. That depends on
    // the draw, here 0.47 to 0.65 for both alike and 0.11 to 0.17.
    let (mut ahead, mut back, mut none) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    let (seeds, n) = ([5, 6, 7, 8], 400);
    for seed in seeds {
        let mut rng = Rng::new(seed);
        let (features, target) = (filtered(&mut rng, 20_000, 3.0), filtered(&mut rng, n, 3.0));
        let units = Units::new(&features, 3, vec![(0, 20_000)]);
        for (look, causal, sum) in [(10, false, &mut ahead), (10, true, &mut back), (0, false, &mut none)] {
            let p = SelectorParams { look, d_max: 2.0, cool_off: 20, loop_guard: 0, causal, effort: None };
            let picks = run(&target, &units, &p);
            let follows = picks.windows(2).filter(|pair| pair[1].unit == pair[0].unit + 1).count();
            let found = [follows as f64 / (n - 1) as f64, picks.iter().map(|c| c.d1).sum::<f64>() / n as f64];
            println!("{seed} {look} {causal}: {found:.3?}");
            sum.iter_mut().zip(found).for_each(|(sum, x)| *sum += x / seeds.len() as f64);
        }
    }
    let all = format!("ahead {ahead:?}, back {back:?}, one unit alone {none:?}");
    println!("{all}");
    assert!((0.45..0.7).contains(&ahead[0]) && (ahead[0] - back[0]).abs() < 0.03, "{all}");
    assert!((none[0] - 0.14).abs() < 0.03 && none[0] < 0.3 * ahead[0], "{all}");
    // As near, too; and further than the nearest.
    assert!((back[1] / ahead[1] - 1.0).abs() < 0.05 && none[1] < 0.6 * ahead[1], "{all}");
}

#[test]
fn neither_threads_nor_the_order_of_the_index_change_a_choice() {
    let mut rng = Rng::new(21);
    for grid in [false, true] {
        let (features, target) = (wander(&mut rng, 300, 3, grid), wander(&mut rng, 200, 3, grid));
        let segments = vec![(0, 130), (130, 170)];
        let units = Units::new(&features, 3, segments);
        let p =
            SelectorParams { look: 4, d_max: 2.0, cool_off: 10, loop_guard: 0, causal: false, effort: None };
        let wanted = run(&target, &units, &p);
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| run(&target, &units, &p)) == wanted, "{threads} threads");
        }
        for seed in 0..8 {
            let mut other = Exact::new(&units, p.clone());
            let mut index = Index::new(&units, &p);
            let mut rng = Rng::new(seed);
            let mut mixed = |tree: &KdTree| {
                let mut points = tree.items();
                for k in (1..points.len()).rev() {
                    points.swap(k, rng.below(k + 1));
                }
                let (labels, points): (Vec<u32>, Vec<Vec<f32>>) = points.into_iter().unzip();
                KdTree::new(&labels, &points.concat(), 3)
            };
            (index.by_features, index.by_mean) = (mixed(&index.by_features), mixed(&index.by_mean));
            other.index = Arc::new(index);
            let chosen = (0..200).map(|i| other.choose(&target[3 * i..3 * (i + 5).min(200)]).unwrap());
            assert!(chosen.eq(wanted.iter().copied()), "{seed}");
        }
    }
}

/// Features with one number more, which is 0 or `weight` as a unit has the first or the second tag.
fn tagged(features: &[f32], weight: f32, second: impl Fn(usize) -> bool) -> Vec<f32> {
    let unit = |(j, f): (usize, &[f32])| [f[0], f[1], f[2], if second(j) { weight } else { 0.0 }];
    features.chunks_exact(3).enumerate().flat_map(unit).collect()
}

#[test]
fn a_heavy_tag_dimension_is_the_mask_and_a_light_one_is_a_wish() {
    let mut rng = Rng::new(31);
    for round in 0..20 {
        let grid = round % 2 == 0;
        let (features, target) = (wander(&mut rng, 360, 3, grid), wander(&mut rng, 150, 3, grid));
        let segments: Vec<_> = (0..4).map(|k| (90 * k, 90)).collect();
        let second = |j: usize| j / 90 % 2 == 1;
        let length = |f: &[f32]| f.iter().map(|x| x * x).sum::<f32>().sqrt();
        let limit = features.chunks(3).chain(target.chunks(3)).map(length).fold(0.0, f32::max);
        let p = SelectorParams {
            look: [0, 5][round % 2],
            d_max: [0.5, 2.0, 100.0][round % 3],
            cool_off: 20,
            loop_guard: [0, 30][round % 2],
            causal: round % 4 == 3,
            effort: None,
        };
        let wrong = |weight: f32, tag: bool| {
            let allowed = (0..360).map(|j| second(j) == tag).collect();
            let masked = Units { allowed, ..Units::new(&features, 3, segments.clone()) };
            let both = tagged(&features, weight, second);
            let soft = Units::new(&both, 4, segments.clone());
            let (hard, soft) = (run(&target, &masked, &p), run(&tagged(&target, weight, |_| tag), &soft, &p));
            let wrong = soft.iter().filter(|pick| second(pick.unit as usize) != tag).count();
            assert!(wrong > 0 || soft == hard, "{weight}: allowed, but not what the mask allows");
            wrong
        };
        for tag in [false, true] {
            assert_eq!(wrong(2.01 * limit, tag), 0, "round {round}");
            assert!(wrong(0.05 * limit, tag) > 0, "round {round}");
        }
    }
}

#[test]
fn a_loop_guard_ends_exact_repeats() {
    // The target stays where 25 units lie: without a guard they take turns for ever.
    let features: Vec<f32> =
        (0..200).map(|j| if j < 25 { 0.01 * j as f32 } else { 0.5 + 0.001 * j as f32 }).collect();
    let units = Units::new(&features, 1, vec![(0, 200)]);
    let repeats = |loop_guard| {
        let p = SelectorParams { look: 0, d_max: 9.0, cool_off: 20, loop_guard, causal: false, effort: None };
        let picks: Vec<u32> = run(&[0.0; 300], &units, &p).iter().map(|c| c.unit).collect();
        (120..300).filter(|&i| (1..100).any(|lag| (0..4).all(|k| picks[i - k] == picks[i - k - lag]))).count()
    };
    assert!(repeats(0) > 100, "{}", repeats(0));
    assert_eq!(repeats(100), 0);
}

#[test]
fn a_feature_that_is_not_finite_is_named_by_its_unit() {
    let features = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
    let units = Units::new(&features, 2, vec![(0, 3)]);
    let p = SelectorParams { look: 2, d_max: 1.0, cool_off: 0, loop_guard: 0, causal: false, effort: None };
    let mut selector = selector(&units, p).unwrap();
    selector.choose(&features).unwrap();
    for (at, unit) in [(0, 0), (1, 0), (4, 2), (5, 2)] {
        let mut window = features;
        window[at] = f32::NAN;
        assert_eq!(selector.choose(&window), Err(NotFinite(unit)));
        assert_eq!(NotFinite(unit).after(7), NotFinite(unit + 7));
    }
    assert_eq!(selector.choose(&[]), Err(NotFinite(0)));
}

#[test]
fn what_is_recalled_is_all_that_is_known() {
    let mut rng = Rng::new(11);
    let (features, target) = (wander(&mut rng, 80, 2, false), wander(&mut rng, 60, 2, false));
    let units = Units::new(&features, 2, vec![(0, 80)]);
    let p = SelectorParams { look: 3, d_max: 2.0, cool_off: 12, loop_guard: 0, causal: false, effort: None };
    let picks = run(&target, &units, &p);
    let mut again = selector(&units, p).unwrap();
    let window = |i: usize| &target[2 * i..2 * (i + 4).min(60)];
    let mut differs = 0;
    // In any order: each choice follows from the picks of its rest alone.
    for i in (0..60_usize).rev() {
        let history: Vec<u32> = picks[i.saturating_sub(12)..i].iter().map(|c| c.unit).collect();
        again.set_history(&history);
        assert_eq!(again.boxed_clone().choose(window(i)), Ok(picks[i]), "{i}");
        again.set_history(&[]);
        differs += usize::from(again.choose(window(i)).unwrap().unit != picks[i].unit);
    }
    assert!(differs > 0, "the rest of units matters here");
}

/// Noise in `segments` stretches of 500 units.
fn noise(segments: usize, rng: &mut Rng) -> Vec<f32> {
    (0..segments * 500 * 3).map(|_| rng.between(-3.0, 3.0) as f32).collect()
}

#[test]
fn a_search_that_takes_too_much_goes_on_with_the_run_and_a_short_one_is_left_alone() {
    let mut rng = Rng::new(11);
    let features = noise(4, &mut rng);
    let segments: Vec<_> = (0..4).map(|k| (500 * k, 500)).collect();
    let units = Units::new(&features, 3, segments);
    let target = noise(1, &mut rng);
    let look = 3;
    let choose = |effort| {
        let p = SelectorParams { look, d_max: 9.0, cool_off: 20, loop_guard: 0, causal: false, effort };
        let mut selector = selector(&units, p).unwrap();
        let windows = (0..500 - look).map(|i| &target[3 * i..][..3 * (look + 1)]);
        windows.map(|window| selector.choose(window).unwrap()).collect::<Vec<Choice>>()
    };
    let all = choose(None);
    assert!(all.iter().all(|c| !c.cut));
    assert_eq!(choose(Some(1_000_000)), all);
    // Windows of noise have no near mean: most searches look at most of the units.
    let some = choose(Some(600));
    let cut = some.iter().filter(|c| c.cut).count();
    assert!((100..490).contains(&cut), "{cut} of {} searches were cut", some.len());
    let few = choose(Some(10));
    assert!(few.iter().all(|c| c.cut));
    for pair in few.windows(2).chain(some.windows(2)) {
        let [before, after] = [pair[0].unit, pair[1].unit];
        let may_go_on = (before + 1) % 500 != 0;
        assert!(!pair[1].cut || !may_go_on || after == before + 1, "{pair:?}");
    }
    // The end of a stretch is no end of the search for a unit: the nearest is taken.
    assert!(few.windows(2).any(|pair| pair[1].unit != pair[0].unit + 1 && pair[1].unit < 2000));
}
