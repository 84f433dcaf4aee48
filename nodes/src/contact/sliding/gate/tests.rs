use super::*;
use proptest::prelude::*;

/// The rule of [`IntervalGate`] applied to a complete series.
fn interval_of_series(series: &[Option<f32>], threshold: f32, look_ahead: usize) -> Vec<f32> {
    let passes = |i: usize| {
        let start = (0..i).rev().find(|&j| series[j].is_none()).map_or(0, |j| j + 1);
        let last = (i + look_ahead).min(series.len() - 1);
        series[start..=last].iter().enumerate().take_while(|(k, s)| start + k <= i || s.is_some()).any(
            |(k, s)| {
                let unbroken = series[i..=(start + k).max(i)].iter().all(Option::is_some);
                unbroken && s.is_some_and(|s| s > threshold)
            },
        )
    };
    (0..series.len()).map(|i| series[i].filter(|_| passes(i)).unwrap_or(0.0)).collect()
}

fn run_interval(series_list: &[Vec<Option<f32>>], threshold: f32, look_ahead: usize) -> Vec<Vec<f32>> {
    let mut gate = IntervalGate::new(series_list.len(), threshold, look_ahead);
    let (mut out, mut gated) = (vec![9.0; series_list.len()], vec![Vec::new(); series_list.len()]);
    let mut store = |out: &[f32]| gated.iter_mut().zip(out).for_each(|(g, &s)| g.push(s));
    for frame in 0..series_list[0].len() {
        let speeds: Vec<f32> = series_list.iter().map(|t| t[frame].unwrap_or(0.0)).collect();
        let touching: Vec<bool> = series_list.iter().map(|t| t[frame].is_some()).collect();
        if gate.push(&speeds, &touching, &mut out) {
            store(&out);
        }
    }
    while gate.finish(&mut out) {
        store(&out);
    }
    gated
}

#[test]
fn a_short_run_passes_completely_if_it_exceeds_the_threshold_once() {
    let series: Vec<_> =
        [0.1, 0.1, 0.5, 0.1].map(Some).into_iter().chain([None]).chain([Some(0.1); 3]).collect();
    assert_eq!(run_interval(&[series], 0.2, 4), [[0.1, 0.1, 0.5, 0.1, 0.0, 0.0, 0.0, 0.0]]);
}

#[test]
fn a_run_longer_than_the_look_ahead_opens_that_long_before_its_first_fast_frame() {
    let mut series = vec![Some(0.1); 10];
    series[7] = Some(1.0);
    let gated = run_interval(&[series], 0.2, 3).remove(0);
    assert_eq!(gated, [0.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1, 1.0, 0.1, 0.1]);
}

#[test]
fn a_fast_run_does_not_open_a_slow_run_just_before_it() {
    let series = vec![Some(0.1), Some(0.1), None, Some(1.0)];
    assert_eq!(run_interval(&[series], 0.2, 8), [[0.0, 0.0, 0.0, 1.0]]);
}

#[test]
fn a_zero_threshold_silences_only_vertices_that_never_move() {
    let mut ever = EverGate::new(2, 0.0);
    for frame in [[0.0, 0.0], [0.0, 0.3], [0.0, 0.1]] {
        ever.observe(&frame);
    }
    let mut out = [9.0; 2];
    ever.apply(&[0.0, 0.1], &mut out);
    assert_eq!(out, [0.0, 0.1]);
    assert_eq!(ever.maxima(), [0.0, 0.3]);
}

#[test]
fn a_speed_equal_to_the_threshold_opens_no_gate() {
    let mut ever = EverGate::new(1, 0.5);
    ever.observe(&[0.5]);
    let mut out = [9.0];
    ever.apply(&[0.5], &mut out);
    assert_eq!(out, [0.0]);
    CausalGate::new(1, 0.5, 0.25).push(0.0, &[0.5], &[true], &mut out);
    assert_eq!(out, [0.0]);
    assert_eq!(run_interval(&[vec![Some(0.5); 3]], 0.5, 1), [[0.0; 3]]);
}

#[test]
fn the_causal_gate_stays_open_for_the_hold_time_and_closes_after_it() {
    let mut gate = CausalGate::new(1, 0.2, 0.25);
    let mut out = [0.0];
    let mut at = |time: f64, speed: f32, touches: bool| {
        gate.push(time, &[speed], &[touches], &mut out);
        out[0]
    };
    assert_eq!(at(0.0, 0.15, true), 0.0);
    assert_eq!(at(0.1, 0.3, true), 0.3);
    assert_eq!(at(0.2, 0.0, false), 0.0);
    assert_eq!(at(0.3, 0.05, true), 0.05);
    assert_eq!(at(0.35, 0.05, true), 0.0);
    assert_eq!(at(0.4, 0.15, true), 0.0);
    assert_eq!(at(0.5, 0.25, true), 0.25);
    assert_eq!(at(0.7, 0.1, true), 0.1);
    assert_eq!(at(0.9, 0.1, true), 0.1);
}

#[test]
fn look_ahead_rounds_up_to_whole_frames() {
    assert_eq!(GateMode::default().look_ahead(60.0), Some(30));
    assert_eq!(GateMode::Interval { max_hold: 0.5 }.look_ahead(25.0), Some(13));
    assert_eq!(GateMode::Interval { max_hold: 0.1 }.look_ahead(30.0), Some(3));
    assert_eq!(
        (GateMode::Ever.look_ahead(60.0), GateMode::Causal { hold: 0.25 }.look_ahead(60.0)),
        (None, Some(0))
    );
}

fn series() -> impl Strategy<Value = Vec<Option<f32>>> {
    prop::collection::vec(prop::option::weighted(0.8, prop::sample::select(vec![0.0f32, 0.1, 0.2, 0.3])), 40)
}

proptest! {
    #[test]
    fn streaming_equals_the_rule_for_the_complete_series(
        series_list in prop::collection::vec(series(), 3), look_ahead in 0usize..50,
    ) {
        let expected: Vec<_> = series_list.iter().map(|t| interval_of_series(t, 0.2, look_ahead)).collect();
        prop_assert_eq!(run_interval(&series_list, 0.2, look_ahead), expected);
    }

    #[test]
    fn a_frame_does_not_depend_on_frames_beyond_the_look_ahead(one in series(), other in series(), cut in 10usize..30) {
        let mut changed = one.clone();
        changed[cut..].copy_from_slice(&other[cut..]);
        let (a, b) = (run_interval(&[one], 0.2, 6).remove(0), run_interval(&[changed], 0.2, 6).remove(0));
        prop_assert_eq!(&a[..cut - 6], &b[..cut - 6]);
    }
}
