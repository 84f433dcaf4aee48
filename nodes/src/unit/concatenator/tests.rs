use super::*;
use crate::core::random::Draw;
use crate::core::time::Rate;
use crate::feature::FeatureConventions;
use crate::unit::{Take, build};
use proptest::prelude::*;

fn conventions() -> FeatureConventions {
    FeatureConventions { frame: 100, ..FeatureConventions::cloth(Rate::hz(48_000), 200) }
}

/// Noise without much high treble, so that there is something to click.
fn recording(seed: u64, n: usize) -> Vec<f32> {
    let mut draw = Draw::new(seed);
    let mut y = [0.0; 2];
    (0..n)
        .map(|_| {
            y[0] += 0.1 * (draw.between(-1.0, 1.0) - y[0]);
            y[1] += 0.1 * (y[0] - y[1]);
            y[1] as f32
        })
        .collect()
}

fn database(lengths: &[usize]) -> UnitDatabase {
    let takes: Vec<Take> = lengths
        .iter()
        .enumerate()
        .map(|(k, &n)| Take { channels: vec![recording(k as u64, n * 200)], ..Take::default() })
        .collect();
    build(&takes, &conventions(), None).unwrap()
}

fn picks(seed: u64, n: usize, units: usize) -> Vec<u32> {
    let mut draw = Draw::new(seed);
    (0..n).map(|_| draw.below(units) as u32).collect()
}

#[test]
fn runs_are_the_recording_itself_bit_for_bit() {
    let db = database(&[50]);
    let all: Vec<u32> = (0..50).collect();
    for blend in [Blend::EqualPower, Blend::Linear, Blend::Add] {
        assert!(Concatenator::new(&db, blend).whole(0, &all) == db.channel(0));
    }
    // The end of one recording and the start of the next have nothing beyond them that could be mixed.
    let two = database(&[25, 25]);
    assert!(Concatenator::new(&two, Blend::EqualPower).whole(0, &all) == two.channel(0));
    // A jump within a recording is mixed, but only near the join.
    let jump: Vec<u32> = (0..10).chain(20..30).collect();
    let out = Concatenator::new(&two, Blend::EqualPower).whole(0, &jump);
    let x = two.channel(0);
    assert!(out[..1900] == x[..1900] && out[2100..3000] == x[4100..5000] && out[1900..2100] != x[1900..2100]);
}

#[test]
fn joins_reach_from_crossing_to_crossing_and_never_meet() {
    let db = database(&[40, 40]);
    let x = db.channel(0);
    for (a, b) in picks(1, 400, 80).chunks(2).map(|p| (p[0], p[1])) {
        let c = Concatenator::new(&db, Blend::EqualPower);
        let join = c.join(0, (Some(a), Some(b)));
        assert!(join.after <= 100 && join.before <= 100);
        let (end, start) = ((a as usize + 1) * 200 + join.after, b as usize * 200 - join.before);
        assert!([0, BLIND].contains(&join.after) || crosses(x, end));
        assert!([0, BLIND].contains(&join.before) || crosses(x, start));
    }
}

#[test]
fn where_nothing_crosses_zero_the_blend_is_sixteen_samples() {
    let x = vec![1.0; 2000];
    assert_eq!(join(&x, 200, 600, &(0..2000), 1000, &(0..2000)), Join { after: 16, before: 16 });
    // At the ends of segments there is nothing to go on with.
    assert_eq!(join(&x, 200, 600, &(0..600), 1000, &(1000..2000)), Join::default());
    assert_eq!(join(&x, 200, 600, &(0..605), 1000, &(990..2000)), Join { after: 5, before: 10 });
}

/// Share of joins whose largest step exceeds the 99.9th percentile of the recording's own steps.
fn clicks(db: &UnitDatabase, out: &[f32]) -> f64 {
    let mut steps: Vec<f32> = db.channel(0).windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    steps.sort_unstable_by(f32::total_cmp);
    let limit = steps[steps.len() * 999 / 1000];
    let loud = |b: usize| out[b - 101..b + 101].windows(2).any(|w| (w[1] - w[0]).abs() > limit);
    let joins = out.len() / 200 - 1;
    (1..=joins).filter(|&k| loud(k * 200)).count() as f64 / joins as f64
}

#[test]
fn joins_click_less_than_cuts() {
    let db = database(&[400]);
    let picks = picks(3, 800, 400);
    let cut: Vec<f32> =
        picks.iter().flat_map(|&p| db.channel(0)[p as usize * 200..][..200].to_vec()).collect();
    let with = |blend| clicks(&db, &Concatenator::new(&db, blend).whole(0, &picks));
    // A tenth of the windows around joins hold such a step anyway, as one in a thousand steps does.
    let (cut, add, equal) = (clicks(&db, &cut), with(Blend::Add), with(Blend::EqualPower));
    assert!(cut > 0.5 && add < cut && equal < 0.3 * cut, "{cut} {add} {equal}");
}

#[test]
fn equal_power_keeps_the_level_and_add_does_not() {
    let db = database(&[400]);
    let picks = picks(4, 800, 400);
    let rms = |x: &[f32]| (x.iter().map(|x| f64::from(x * x)).sum::<f64>() / x.len() as f64).sqrt();
    let ratio = |blend| rms(&Concatenator::new(&db, blend).whole(0, &picks)) / rms(db.channel(0));
    let (add, equal, linear) = (ratio(Blend::Add), ratio(Blend::EqualPower), ratio(Blend::Linear));
    assert!(add > equal && equal > linear && (equal - 1.0).abs() < 0.15, "{add} {equal} {linear}");
}

#[test]
fn sleep_comes_after_half_a_second_and_ends_at_once() {
    let mut sleep = Sleep::new(1000.0);
    let mut gains = |n: usize, silent| (0..n).map(|_| sleep.next(silent)).collect::<Vec<_>>();
    assert!(gains(100, false).iter().chain(&gains(500, true)).all(|&g| g == 1.0));
    let fade = gains(60, true);
    assert!(fade[0] < 1.0 && fade[25] > 0.4 && fade[48] > 0.0 && fade[52..].iter().all(|&g| g == 0.0));
    assert_eq!(gains(6, false)[4..], [1.0, 1.0]);
}

#[test]
fn nothing_is_heard_before_the_first_sound() {
    let mut sleep = Sleep::new(1000.0);
    let mut gains = |n: usize, silent| (0..n).map(|_| sleep.next(silent)).collect::<Vec<_>>();
    assert!(gains(20, true).iter().all(|&g| g == 0.0));
    let woken = gains(6, false);
    assert!(woken[0] > 0.0 && woken[0] < 1.0 && woken[5] == 1.0, "{woken:?}");
    assert!(gains(500, true).iter().all(|&g| g == 1.0));
    let mut doze = Doze::new(240.0);
    assert!(doze.next(true) && doze.next(true) && !doze.next(false) && !doze.next(true));
}

proptest! {
    #[test]
    fn output_is_linear_in_the_audio_for_the_same_crossings(seed in 0_u64..500, n in 1_usize..12) {
        let db = database(&[12, 7]);
        let mut loud = db.clone();
        // A positive factor leaves all crossings where they are.
        loud.audio.iter_mut().for_each(|x| *x *= 4.0);
        let picks = picks(seed, n, 19);
        let c = |db| Concatenator::new(db, Blend::EqualPower).whole(0, &picks);
        let (one, four) = (c(&db), c(&loud));
        prop_assert_eq!(one.len(), n * 200);
        prop_assert!(one.iter().zip(&four).all(|(a, b)| 4.0 * a == *b));
    }
}
