use super::*;
use crate::scrape::testing::piece;

fn rules(budget: Option<f64>) -> LodRules {
    let distances = [5.0, 15.0, 40.0, 100.0];
    LodRules { distances, hysteresis: 0.1, costs: [25.0, 20.0, 10.0, 8.0], budget }
}

type Parts = [Vec<(Tick, PathPiece)>; LEVELS];

/// Pieces on each level, for pieces at distances.
fn parts(rules: LodRules, pieces: &[(Tick, PathPiece, f64)]) -> (Parts, LodSelector) {
    let mut selector = LodSelector::new(rules, 64);
    let mut queues = [(); LEVELS].map(|()| Queue::new(2000));
    let mut all: Parts = Default::default();
    for (tick, piece, distance) in pieces {
        selector.take(*tick, piece, *distance, &mut queues);
        for (all, queue) in all.iter_mut().zip(&mut queues) {
            queue.give(tick + 1, |tick, piece| all.push((tick, piece)));
        }
    }
    for (all, queue) in all.iter_mut().zip(&mut queues) {
        queue.give(Tick::MAX, |tick, piece| all.push((tick, piece)));
    }
    (all, selector)
}

fn gain(parts: &[(Tick, PathPiece)], tick: Tick) -> f64 {
    let now = parts.iter().filter(|(from, p)| (*from..from + p.duration).contains(&tick));
    now.map(|(from, p)| p.gain_at((tick - from) as f64 / p.duration as f64)).sum()
}

#[test]
fn a_level_changes_only_where_a_distance_is_well_passed() {
    let rules = rules(None);
    let mut level = None;
    let mut walk = |distance: f64| {
        level = Some(rules.level(distance, level));
        level.unwrap()
    };
    assert_eq!([4.0, 5.4, 5.6, 4.6, 4.4].map(&mut walk), [0, 0, 1, 1, 0]);
    assert_eq!([200.0, 95.0, 89.0, 3.0].map(&mut walk), [4, 4, 3, 0]);
}

#[test]
fn who_walks_away_hears_no_step_and_costs_less_and_less() {
    // From 2 m to 150 m at 50 m/s, in frames of 1/60 s.
    let frame = 1.0 / 60.0;
    let path: Vec<_> = (0..180)
        .map(|k| {
            let t = f64::from(k) * frame;
            (ticks(t), piece([t, 0.0], [1.0, 0.0], frame), 2.0 + 50.0 * t)
        })
        .collect();
    let (parts, selector) = parts(rules(None), &path);
    assert_eq!(selector.changes, 4);
    let mut before: Option<[f64; LEVELS]> = None;
    let (mut cost, mut fading) = (f64::INFINITY, false);
    for k in 0..2_900 {
        let tick = ticks(f64::from(k) * 0.001);
        let now: [f64; LEVELS] = std::array::from_fn(|level| gain(&parts[level], tick));
        let power: f64 = now.iter().map(|g| g * g).sum();
        if k < 2000 {
            assert!((power - 1.0).abs() < 0.02, "{k} ms: {power}");
        }
        // Levels that sound have a cost; in a cross-fade both levels do, for 50 ms.
        let paid = (0..LEVELS).filter(|level| now[*level] > 0.0);
        let both = paid.clone().count() > 1;
        let paid: f64 = paid.map(|level| selector.rules.costs[level]).sum();
        if !both {
            assert!(paid <= cost, "{k} ms: {paid} after {cost}");
            cost = paid;
        }
        fading |= both;
        if let Some(before) = before {
            let step = now.iter().zip(before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(step < 0.05, "{k} ms: {step}");
        }
        before = Some(now);
    }
    assert!(parts.iter().all(|p| !p.is_empty()) && before == Some([0.0; LEVELS]));
    assert!(fading && cost == 0.0);
}

#[test]
fn a_budget_takes_from_the_farthest_first_and_each_rests_for_half_a_second() {
    let (frame, count) = (1.0 / 60.0, 8_u64);
    // Contact k is 1 + k / 2 m away and ends after 4 + k / 10 s, but for the last; all are near enough for the finest level.
    let distance = |k: u64| 1.0 + 0.5 * k as f64;
    let mut selector = LodSelector::new(rules(Some(130.0)), 64);
    let mut queues = [(); LEVELS].map(|()| Queue::new(2000));
    let mut steps = vec![(Tick::MIN / 2, 0); count as usize];
    let (mut most, mut fell, mut rose) = (0.0_f64, 0, 0);
    for n in 0..420 {
        let t = f64::from(n) * frame;
        // A smaller budget for a while.
        let budget = if (1.5..2.8).contains(&t) { 90.0 } else { 130.0 };
        selector.set_rules(rules(Some(budget)));
        for k in (0..count).filter(|k| t < 4.0 + 0.1 * *k as f64 || *k == count - 1) {
            let piece = PathPiece { contact: k, ..piece([t, 0.0], [1.0, 0.0], frame) };
            selector.take(ticks(t), &piece, distance(k), &mut queues);
            let live: Vec<ContactLevel> =
                selector.chosen.iter().filter(|c| c.until > ticks(t)).copied().collect();
            let total: f64 = live.iter().map(|c| selector.rules.cost(c.level())).sum();
            let rested = |c: &&ContactLevel| ticks(t) - c.since >= ticks(STABLE) && c.level() < LEVELS;
            assert!(total <= budget || live.iter().filter(rested).count() == 0, "{t}: {total}");
            // After three rests at most it fits, however much has to go.
            let settled = (1.2..1.5).contains(&t) || (2.6..2.8).contains(&t) || t > 3.8;
            assert!(!settled || total <= budget, "{t}: {total} of {budget}");
            for c in &live {
                let (since, down) = &mut steps[c.contact as usize];
                if *down != c.down {
                    let rest = seconds_of(ticks(t) - *since);
                    assert!(c.down.abs_diff(*down) == 1, "{t}: one step at a time");
                    assert!(rest >= STABLE - 1e-9, "{t}: contact {} after {rest} s", c.contact);
                    (fell, rose) = (fell + usize::from(c.down > *down), rose + usize::from(c.down < *down));
                    (*since, *down) = (ticks(t), c.down);
                }
                // Whoever is nearer is no coarser for longer than it takes both to rest.
                for far in live.iter().filter(|far| far.distance > c.distance) {
                    let rests = |c: &ContactLevel| ticks(t) - c.since < ticks(STABLE + 0.1);
                    let order = far.level() >= c.level() || rests(c) || rests(far);
                    assert!(order, "{t}: {c:?} {far:?}");
                }
            }
            most = most.max(total);
        }
    }
    assert!(fell >= 4 && rose >= 2 && most > 130.0, "{fell} down, {rose} up, {most}");
    let last = selector.chosen.iter().find(|c| c.contact == count - 1).map(ContactLevel::level);
    assert_eq!(last, Some(0), "what is left can be paid in full");
}

fn seconds_of(time: Tick) -> f64 {
    crate::core::time::seconds(time)
}
