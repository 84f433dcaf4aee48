use super::*;
use crate::core::item::Event;
use crate::core::random::Random;
use crate::core::solo::Solo;
use crate::core::time::Tick;
use crate::crumple::bank::{Cut, Origin, Recorded, trial_bank};
use crate::crumple::extract::Extraction;

fn defaults() -> CrumplePlayerParams {
    CrumplePlayerParams::read(&|_| None).unwrap()
}

/// A bank of one click of one sample, so that the output is the train of onsets itself.
fn click_bank() -> CrumpleBank {
    let cuts = vec![Cut { samples: vec![1.0], origin: Origin::default() }];
    CrumpleBank::new("", 48_000.0, cuts, vec![Recorded::default()], Extraction::default())
}

fn event(bank: &CrumpleBank, id: u32, fps: u32) -> MatchedCrumple {
    let event = MatchedCrumple::trial(&mut Draw::new(1));
    MatchedCrumple { id, sample: 0, bank: bank.id(), interval: Rate::hz(fps).tick(1), wanted: 1.0, ..event }
}

fn run(
    p: CrumplePlayerParams,
    events: &[(Tick, MatchedCrumple)],
    end: f64,
    window: f64,
    bank: &CrumpleBank,
) -> Vec<f32> {
    let solo = Solo::new::<CrumplePlayer>(p)
        .events(CrumplePlayerPorts::matched, events.to_vec(), ticks(end))
        .value(CrumplePlayerPorts::bank, bank.clone());
    solo.window(ticks(window)).run().unwrap().stream(CrumplePlayerPorts::audio)
}

#[test]
fn without_jitter_samples_begin_to_the_sample_inside_of_any_window() {
    let bank = click_bank();
    let p = CrumplePlayerParams { jitter: Jitter::Off, gain: 0.5, tail: 0.01, ..defaults() };
    let rate = Rate::hz(48_000);
    let events = [(rate.tick(1000), event(&bank, 0, 60)), (rate.tick(1000) + 1, event(&bank, 1, 60))];
    for window in [1.0, 0.003] {
        let out = run(p.clone(), &events, 0.05, window, &bank);
        let found: Vec<_> = out.iter().enumerate().filter(|(_, x)| **x != 0.0).collect();
        assert_eq!(found, [(1000, &0.5), (1001, &0.5)]);
    }
}

#[test]
fn jitter_is_whole_frames_of_the_motion() {
    let at = |fps: u32, jitter| {
        timing(&CrumplePlayerParams { jitter, ..defaults() }).spread(Rate::hz(fps).tick(1))
    };
    let third = |fps: u32, frames: i64| Rate::hz(fps).tick(1) * frames;
    for (fps, frames) in [(24, 1), (25, 1), (30, 1), (50, 2), (60, 2), (120, 4)] {
        assert_eq!(at(fps, Jitter::WholeFrames), third(fps, frames), "{fps}");
    }
    assert_eq!((at(24, Jitter::Fixed), at(24, Jitter::Off)), (ticks(0.033333333333333), 0));
}

#[test]
fn centred_jitter_begins_around_the_event_for_any_window() {
    let bank = click_bank();
    let p = CrumplePlayerParams { jitter: Jitter::Centred, tail: 0.2, ..defaults() };
    let events: Vec<_> = (0..400).map(|k| (ticks(0.5), event(&bank, k, 60))).collect();
    let whole = run(p.clone(), &events, 1.0, 3.0, &bank);
    for window in [0.0101, 0.001] {
        assert!(run(p.clone(), &events, 1.0, window, &bank) == whole);
    }
    let onsets: Vec<f64> =
        whole.iter().enumerate().filter(|(_, x)| **x != 0.0).map(|(n, _)| n as f64 / 48e3).collect();
    let (first, last) = (onsets[0], onsets[onsets.len() - 1]);
    assert!((0.4833..0.4838).contains(&first) && (0.5162..0.5167).contains(&last), "{first} {last}");
}

/// Power of a train of onsets at a frequency, per onset, as the mean over stretches of 15 s: a whole number of frames each.
fn line(onsets: &[f64], f: f64) -> f64 {
    let mut sums = [[0.0; 2]; 8];
    for t in onsets {
        let (s, c) = (std::f64::consts::TAU * f * t).sin_cos();
        let sum = &mut sums[((t / 15.0) as usize).min(7)];
        *sum = [sum[0] + c, sum[1] + s];
    }
    sums.iter().map(|[c, s]| c * c + s * s).sum::<f64>() / onsets.len() as f64
}

#[test]
fn one_list_of_events_sounds_without_its_frame_rate_whatever_that_is() {
    let bank = click_bank();
    // One take of 120 s, which every frame rate sees at the end of the frame in which something happens.
    let random = Random::new(9, "frames");
    let times: Vec<f64> = (0..7200).map(|k| 119.9 * random.uniform(1, k, 0)).collect();
    // Spectral line at the frame rate over its neighbourhood, dB.
    let level = |jitter, fps: u32| {
        let frame = |t: &f64| (t * f64::from(fps)).ceil() as i64;
        let mut seen: Vec<(i64, u32)> = times.iter().map(frame).zip(0..).collect();
        seen.sort_unstable();
        let events: Vec<_> =
            seen.into_iter().map(|(k, id)| (Rate::hz(fps).tick(k), event(&bank, id, fps))).collect();
        let p = CrumplePlayerParams { jitter, tail: 0.1, ..defaults() };
        let out = run(p, &events, 120.0, 1.0, &bank);
        let onsets: Vec<f64> = out
            .iter()
            .enumerate()
            .flat_map(|(n, x)| std::iter::repeat_n(n as f64 / 48e3, *x as usize))
            .collect();
        assert_eq!(onsets.len(), 7200, "every event is heard once");
        let f = f64::from(fps);
        let around: Vec<f64> =
            (1..=20).flat_map(|k| [f - 0.2 * f64::from(k), f + 0.2 * f64::from(k)]).collect();
        let beside = around.iter().map(|f| line(&onsets, *f)).sum::<f64>() / around.len() as f64;
        10.0 * (line(&onsets, f) / beside).log10()
    };
    for fps in [24, 25, 30, 50, 60, 120] {
        let found = level(Jitter::WholeFrames, fps);
        assert!(found.abs() < 6.0, "{fps} fps: {found} dB");
    }
    // The test can fail: without jitter, and with a jitter that is no whole number of frames.
    assert!(level(Jitter::Off, 30) > 20.0);
    assert!(level(Jitter::Fixed, 24) > 10.0, "{}", level(Jitter::Fixed, 24));
}

#[test]
fn gains_are_matched_within_six_decibels() {
    let bank = click_bank();
    let of = |wanted| {
        let p = CrumplePlayerParams { jitter: Jitter::Off, match_gain: true, tail: 0.01, ..defaults() };
        run(p, &[(0, MatchedCrumple { wanted, ..event(&bank, 0, 60) })], 0.01, 1.0, &bank)[0]
    };
    assert!(
        (of(2.25) - 1.5).abs() < 1e-6 && (of(100.0) - 1.9953).abs() < 1e-4 && (of(0.0) - 0.5012).abs() < 1e-4
    );
}

#[test]
fn another_bank_than_the_matched_one_is_refused_and_another_rate_is_not() {
    let bank = trial_bank();
    let solo = |event| {
        Solo::new::<CrumplePlayer>(CrumplePlayerParams { jitter: Jitter::Off, tail: 0.05, ..defaults() })
            .events(CrumplePlayerPorts::matched, vec![(0, event)], ticks(0.1))
            .value(CrumplePlayerPorts::bank, bank.clone())
    };
    let fault = solo(event(&click_bank(), 0, 60)).run().err().unwrap();
    assert!(fault.code == "F106" && fault.message.contains("another bank"), "{fault}");
    let out = solo(MatchedCrumple { sample: 2, ..event(&bank, 0, 60) })
        .run()
        .unwrap()
        .stream(CrumplePlayerPorts::audio);
    // Samples at 8 kHz, played at 48 kHz: six times as many.
    let last = out.iter().rposition(|x| x.abs() > 1e-4).unwrap();
    assert!((500..680).contains(&last), "{last}");
}

#[test]
fn no_event_is_silence_of_the_right_length() {
    let out = run(CrumplePlayerParams { tail: 0.25, ..defaults() }, &[], 0.5, 0.1, &click_bank());
    assert!(out.len() == 36_000 && out.iter().all(|x| *x == 0.0));
}
