//! Planted distortions are undone, and causes separate sounds that are alike.

use super::*;
use crate::warp::suggestion::normal_quantile::probit;

fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

fn normal(state: &mut u64) -> f64 {
    probit(random(state).clamp(1e-9, 1.0 - 1e-9))
}

/// Gestures: features that go smoothly from one of some states to the next, with rests.
fn gestures(units: usize, seed: u64) -> Vec<f32> {
    let mut state = seed;
    let states: Vec<[f64; 3]> =
        [[-22.0, 0.0, 0.0], [-12.0, 3.0, 1.0], [-8.0, -4.0, 0.5], [-3.0, 1.0, -2.0], [-6.0, 6.0, 2.0]]
            .to_vec();
    let (mut at, mut goal, mut left) = (states[0], states[0], 0);
    let mut out = Vec::with_capacity(3 * units);
    for _ in 0..units {
        if left == 0 {
            let near = states[(random(&mut state) * 5.0) as usize];
            goal = near.map(|x| x + 1.2 * normal(&mut state));
            left = 40 + (random(&mut state) * 120.0) as usize;
        }
        left -= 1;
        for (a, g) in at.iter_mut().zip(goal) {
            *a += 0.06 * (g - *a);
            out.push((*a + 0.15 * normal(&mut state)) as f32);
        }
    }
    out
}

fn distorted(x: &[f32], law: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<f32> {
    x.chunks_exact(3).flat_map(|x| law([x[0], x[1], x[2]].map(f64::from)).map(|y| y as f32)).collect()
}

/// Share of the distance above that of a perfect alignment which proposals take away, at the best of three stiffnesses.
fn removed(law: impl Fn([f64; 3]) -> [f64; 3]) -> f64 {
    // Two takes of the same gestures: even a perfect alignment leaves some distance.
    let (target, other) = (gestures(2000, 1), gestures(2000, 2));
    let database = distorted(&other, &law);
    let floor = sliced_wasserstein(&distorted(&target, &law), &database, 3);
    let before = sliced_wasserstein(&target, &database, 3);
    let segments = [0..1000, 1000..2000];
    let p = SuggestParams { most: 160, ..SuggestParams::default() };
    let found = suggest(&target, &database, &segments, 3, &p, &[]).unwrap();
    assert!(found.len() >= 3 && found.iter().all(|p| p.alternatives.len() == 1), "{found:?}");
    let quiet = found[0].target;
    assert!(target[3 * quiet] < -18.0, "silence is offered first");
    let left = [1e2, 1e3, 1e4].map(|lambda| {
        let some = [target.clone(), database.clone()];
        let spaces = FeatureSpaces { target: &target, database: &database, d: 3, window: 24, lambda, some };
        let with: Vec<_> = found.iter().map(|p| (p.target, p.database)).collect();
        spaces.score(&spaces.units(&with)).unwrap().0
    });
    let after = left.into_iter().fold(f64::INFINITY, f64::min);
    println!("{} proposals: {before:.2} -> {after:.2}, floor {floor:.2}", found.len());
    (before - after) / (before - floor)
}

#[test]
fn proposals_undo_most_of_a_planted_nonlinear_distortion() {
    let share = removed(|[x, y, z]| {
        [1.1 * x + 5.0 + 0.05 * y * y, 0.8 * y - 1.5 + 0.8 * (0.3 * x).sin(), z + 0.2 * y]
    });
    assert!(share >= 0.75, "{share}");
}

#[test]
fn proposals_undo_nearly_all_of_a_distortion_dimension_by_dimension() {
    let share = removed(|[x, y, z]| {
        [x + 6.0 + 2.0 * (0.2 * x).tanh(), 1.4 * y + 2.0, 0.5 * z + 0.02 * z.powi(3) - 1.0]
    });
    assert!(share >= 0.85, "{share}");
}

#[test]
fn ranks_are_what_no_monotone_distortion_changes() {
    let x = gestures(600, 4);
    let p = SuggestParams { window: 1, hop: 5, ..SuggestParams::default() };
    let of = |x: &[f32]| ranked(&windows(x, std::slice::from_ref(&(0..600)), 3, &p), 3, 0);
    assert_eq!(of(&x), of(&distorted(&x, |x| x.map(|x| 3.0 * x + 0.01 * x.powi(3)))));
    assert!(
        probit(0.5).abs() < 5e-4
            && (probit(0.975) - 1.959_964).abs() < 5e-4
            && (probit(0.001) + 3.090_232).abs() < 5e-4
    );
}

#[test]
fn the_distance_of_shifted_clouds_is_the_shift_along_the_mean_direction() {
    let x = gestures(400, 3);
    let moved = distorted(&x, |[x, y, z]| [x + 3.0, y, z]);
    assert_eq!(sliced_wasserstein(&x, &x, 3), 0.0);
    // The mean square of one coordinate of a direction is 1/3.
    assert!((sliced_wasserstein(&x, &moved, 3) / 3.0_f64.sqrt() - 1.0).abs() < 0.1);
}

#[test]
fn nothing_is_proposed_where_there_is_no_window() {
    let p = SuggestParams::default();
    assert_eq!(suggest(&[0.0; 30], &[0.0; 300], std::slice::from_ref(&(0..100)), 3, &p, &[]), Ok(vec![]));
    let found = suggest(&[0.0; 300], &[1.0; 300], std::slice::from_ref(&(0..100)), 3, &p, &[]).unwrap();
    assert!(found.len() <= 1, "all alike: {found:?}");
}

/// Distance that some proposals leave, by their means and by their units, over that without any.
fn left(target: &[f32], database: &[f32], lambda: f64, found: &[Proposal]) -> [f64; 2] {
    let some = [target.to_vec(), database.to_vec()];
    let spaces = FeatureSpaces { target, database, d: 3, window: 24, lambda, some };
    let with: Vec<_> = found.iter().map(|p| (p.target, p.database)).collect();
    let start = spaces.score(&[]).unwrap().0;
    [spaces.means(&with), spaces.units(&with)].map(|pairs| spaces.score(&pairs).unwrap().0 / start)
}

#[test]
fn a_short_take_has_no_gain_beyond_what_there_is_to_gain() {
    let mut wild = 0.0_f64;
    for seed in 1..6 {
        // A third of a second of target: some five windows, nearly on a line.
        let target = gestures(84, seed);
        let database = distorted(&gestures(600, 9), |[x, y, z]| [1.2 * x + 6.0, y, z + 1.0]);
        let p = SuggestParams { lambda: 100.0, ..SuggestParams::default() };
        let found = suggest(&target, &database, &[0..300, 300..600], 3, &p, &[]).unwrap();
        let gains: Vec<f64> = found.iter().map(|p| p.gain).collect();
        assert!(gains.iter().all(|gain| (-1.0..=1.0).contains(gain)), "{seed}: {gains:?}");
        let all = left(&target, &database, 100.0, &found);
        assert!(all[0] < 1.0, "{seed}: {all:?}");
        wild = wild.max(left(&target, &database, 100.0, &found[..1])[1]);
    }
    assert!(wild > 1.5, "slopes within the only window throw everything anywhere: {wild}");
}

/// Gestures that never rest, with digital silence after them.
fn silent_end(units: usize, silent: usize, seed: u64) -> Vec<f32> {
    let mut all = distorted(&gestures(units, seed), |[x, y, z]| [x.max(-15.0), y, z]);
    all.extend([-39.9, 0.0, 0.0].repeat(silent));
    all
}

#[test]
fn silence_goes_to_the_quietest_recording_or_is_left_out() {
    let target = silent_end(900, 300, 5);
    let loud = distorted(&gestures(600, 6), |[x, y, z]| [x.max(-15.0) + 4.0, y, z]);
    let p = SuggestParams {
        silence: Some(Silence { target: -35.0, below: 16.0, within: 2.0 }),
        ..SuggestParams::default()
    };
    let segments = [0..300, 300..600];
    let found = suggest(&target, &loud, &segments, 3, &p, &[]).unwrap();
    assert!(found.len() >= 3 && found.iter().all(|p| p.target + 24 <= 900), "{found:?}");
    assert!(leaves_out_silence(&found, &target, 3, &p));
    // A recording of the room, whose colours are those of loud moments.
    let room: Vec<f32> = (0..100).flat_map(|k| [-34.0 + 0.01 * k as f32, 3.0, 1.0]).collect();
    let database = [loud, room].concat();
    let found = suggest(&target, &database, &[0..300, 300..600, 600..700], 3, &p, &[]).unwrap();
    assert!(found[0].target >= 900 && found[0].database == 600, "{found:?}");
    assert!(found[1..].iter().all(|p| p.target + 24 <= 900 && p.database < 600), "{found:?}");
    assert!(!leaves_out_silence(&found, &target, 3, &p));
}

#[test]
fn no_gain_is_more_than_there_is_between_the_worlds() {
    let mut thrown = 0;
    for seed in 1..8 {
        // Silence alone shifts everything far away, and the next proposal brings it back.
        let target = silent_end(900, 120, seed);
        let database = distorted(&gestures(600, 9), |[x, y, z]| [x.max(-15.0) + 4.0, y, z]);
        let found =
            suggest(&target, &database, &[0..300, 300..600], 3, &SuggestParams::default(), &[]).unwrap();
        assert!(found.iter().all(|p| (-1.0..=1.0).contains(&p.gain)), "{seed}: {found:?}");
        let all = left(&target, &database, 1e3, &found)[0];
        let taken: f64 = found.iter().skip(1).map(|p| p.gain.max(0.0)).sum();
        assert!(all < 1.0 && taken <= 1.0 - all + 1e-9, "{seed}: {taken} of {}", 1.0 - all);
        thrown += u32::from(left(&target, &database, 1e3, &found[..1])[0] > 1.5);
    }
    assert!(thrown > 0, "silence alone makes it worse");
}

#[test]
fn clusters_stand_for_many_windows() {
    let law = |[x, y, z]: [f64; 3]| [x + 6.0, 1.4 * y, 0.5 * z];
    let (target, other) = (gestures(3000, 1), distorted(&gestures(3000, 2), law));
    let after = |most: usize| {
        let p = SuggestParams { most, ..SuggestParams::default() };
        let found = suggest(&target, &other, &[0..1500, 1500..3000], 3, &p, &[]).unwrap();
        left(&target, &other, 1e3, &found)[0]
    };
    let (all, few) = (after(2000), after(60));
    assert!(all < 0.4 && few < 1.25 * all, "{all} {few}");
}

#[test]
fn causes_keep_what_sounds_alike_apart() {
    // Two causes that sound the same: only their shares show which recording belongs to which.
    let target = gestures(1200, 3);
    let database = gestures(1200, 4);
    let loud = |of: bool| (0..1200).map(|k| f64::from(u8::from((k / 300 % 2 == 0) == of))).collect();
    let causes = [true, false].map(|of| Cause { power: loud(of), segments: vec![Some(of), Some(!of)] });
    let segments = [0..600, 600..1200];
    let p = SuggestParams { most: 400, ..SuggestParams::default() };
    let right = |causes: &[Cause]| {
        let (all, _) = candidates((&target, &database), &segments, 3, &p, causes);
        let whole = all.iter().filter(|p| p.target % 300 <= 276);
        let (right, count) = whole.fold((0, 0), |(right, count), p| {
            let of = p.target / 300 % 2 == 0;
            (right + usize::from((p.database < 600) == of), count + 1)
        });
        right as f64 / f64::from(count)
    };
    assert!(right(&causes) > 0.95, "{}", right(&causes));
    assert!(right(&[]) < 0.9, "{}", right(&[]));
    let unknown = causes.clone().map(|cause| Cause { segments: vec![None, None], ..cause });
    assert!(right(&unknown) < 0.9, "no recording is known to be of a cause");
}

#[test]
fn with_more_weight_on_level_what_is_as_loud_is_proposed() {
    // Colours of the recordings belong to other levels than those of the target.
    let target = gestures(2000, 1);
    let database = distorted(&gestures(2000, 2), |[x, y, z]| [x + 6.0, z, 0.5 * y]);
    let segments = [0..1000, 1000..2000];
    let of = |level: f64| {
        let p = SuggestParams { level, all: true, ..SuggestParams::default() };
        let found = suggest(&target, &database, &segments, 3, &p, &[]).unwrap();
        assert_eq!(found.len(), p.count, "all of them, whatever they gain");
        let louder = |x: &[f32], unit: usize| {
            let mean = |from: usize| (0..24).map(|k| f64::from(x[3 * (from + k)])).sum::<f64>();
            let here = mean(unit);
            (0..1976).step_by(12).filter(|from| mean(*from) > here).count() as f64 / 165.0
        };
        let off = |p: &Proposal| (louder(&target, p.target) - louder(&database, p.database)).abs();
        found.iter().map(off).sum::<f64>() / found.len() as f64
    };
    let (plain, level) = (of(1.0), of(3.0));
    println!("ranks of loudness differ by {plain:.3} on average, with the weight by {level:.3}");
    assert!(level < 0.06 && level < 0.6 * plain, "{plain} {level}");
}
