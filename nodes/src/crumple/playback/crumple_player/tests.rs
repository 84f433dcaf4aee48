use super::super::onset_timing::Jitter;
use super::*;
use crate::core::item::Event;
use crate::core::random::Random;
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, Tick};
use crate::crumple::bank::{Cut, Extraction, Origin, Recorded, trial_bank};

fn defaults() -> CrumplePlayerParams {
    CrumplePlayerParams::read(&|_| None).unwrap()
}

fn params(jitter: Jitter, playback: PlaybackParams) -> CrumplePlayerParams {
    let onset = JitterParams { jitter, ..defaults().onset };
    CrumplePlayerParams { onset, playback }
}

/// A bank of one click of one sample, so that the output is the train of onsets itself.
fn click_bank() -> CrumpleBank {
    let cuts = vec![Cut { samples: vec![1.0], origin: Origin::default() }];
    CrumpleBank::new("", 48_000.0, cuts, vec![Recorded::default()], Extraction::default())
}

fn event(bank: &CrumpleBank, id: u32, fps: u32) -> MatchedCrumple {
    let event = MatchedCrumple::trial(&mut Rng::new(1));
    MatchedCrumple { id, sample: 0, bank: bank.id(), interval: Rate::hz(fps).tick(1), wanted: 1.0, ..event }
}

fn run(
    p: CrumplePlayerParams,
    events: &[(Tick, MatchedCrumple)],
    end: f64,
    window: f64,
    bank: &CrumpleBank,
) -> Vec<f32> {
    let standalone = Standalone::new::<CrumplePlayer>(p)
        .events(CrumplePlayerPorts::matched, events.to_vec(), ticks(end))
        .value(CrumplePlayerPorts::bank, bank.clone());
    standalone.window(ticks(window)).run().unwrap().stream(CrumplePlayerPorts::audio)
}

#[test]
fn without_jitter_samples_begin_at_the_exact_frame_in_any_window() {
    let bank = click_bank();
    let p = params(Jitter::Off, PlaybackParams { gain: 0.5, tail: 0.01, ..defaults().playback });
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
    let at = |fps: u32, jitter| params(jitter, defaults().playback).onset.spread(Rate::hz(fps).tick(1));
    let spread = |fps: u32, frames: i64| Rate::hz(fps).tick(1) * frames;
    for (fps, frames) in [(24, 1), (25, 1), (30, 1), (50, 2), (60, 2), (120, 4)] {
        assert_eq!(at(fps, Jitter::WholeFrames), spread(fps, frames), "{fps}");
    }
    assert_eq!((at(24, Jitter::Fixed), at(24, Jitter::Off)), (ticks(0.033333333333333), 0));
}

#[test]
fn centred_jitter_begins_around_the_event_for_any_window() {
    let bank = click_bank();
    let p = params(Jitter::Centred, PlaybackParams { tail: 0.2, ..defaults().playback });
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

/// Mean power per onset of a train of onsets at a frequency, over intervals of 15 s, which are whole numbers of frames.
fn spectral_power(onsets: &[f64], f: f64) -> f64 {
    let mut sums = [[0.0; 2]; 8];
    for t in onsets {
        let (s, c) = (std::f64::consts::TAU * f * t).sin_cos();
        let sum = &mut sums[((t / 15.0) as usize).min(7)];
        *sum = [sum[0] + c, sum[1] + s];
    }
    sums.iter().map(|[c, s]| c * c + s * s).sum::<f64>() / onsets.len() as f64
}

#[test]
fn jitter_of_whole_frames_hides_every_frame_rate() {
    let bank = click_bank();
    // One take of 120 s. At each frame rate, events occur at the end of their frame.
    let random = Random::new(9, "frames");
    let times: Vec<f64> = (0..7200).map(|k| 119.9 * random.uniform(1, k, 0)).collect();
    // Spectral line at the frame rate over its neighbourhood, dB.
    let level = |jitter, fps: u32| {
        let frame = |t: &f64| (t * f64::from(fps)).ceil() as i64;
        let mut quantised: Vec<(i64, u32)> = times.iter().map(frame).zip(0..).collect();
        quantised.sort_unstable();
        let events: Vec<_> =
            quantised.into_iter().map(|(k, id)| (Rate::hz(fps).tick(k), event(&bank, id, fps))).collect();
        let p = params(jitter, PlaybackParams { tail: 0.1, ..defaults().playback });
        let out = run(p, &events, 120.0, 1.0, &bank);
        let onsets: Vec<f64> = out
            .iter()
            .enumerate()
            .flat_map(|(n, x)| std::iter::repeat_n(n as f64 / 48e3, *x as usize))
            .collect();
        assert_eq!(onsets.len(), 7200, "every event plays once");
        let f = f64::from(fps);
        let around: Vec<f64> =
            (1..=20).flat_map(|k| [f - 0.2 * f64::from(k), f + 0.2 * f64::from(k)]).collect();
        let mean = around.iter().map(|f| spectral_power(&onsets, *f)).sum::<f64>() / around.len() as f64;
        10.0 * (spectral_power(&onsets, f) / mean).log10()
    };
    for fps in [24, 25, 30, 50, 60, 120] {
        let found = level(Jitter::WholeFrames, fps);
        assert!(found.abs() < 6.0, "{fps} fps: {found} dB");
    }
    // The frame rate is audible without jitter, and with jitter of a fractional number of frames.
    assert!(level(Jitter::Off, 30) > 20.0);
    assert!(level(Jitter::Fixed, 24) > 10.0, "{}", level(Jitter::Fixed, 24));
}

#[test]
fn with_64_voices_the_quietest_are_stolen_and_by_default_none() {
    // Samples of constant levels, 0.01 to 0.80.
    let cut = |k: usize| Cut { samples: vec![0.01 * (k + 1) as f32; 9600], origin: Origin::default() };
    let bank = CrumpleBank::new(
        "",
        48e3,
        (0..80).map(cut).collect(),
        vec![Recorded::default()],
        Extraction::default(),
    );
    // All but the strongest sixteen in mixed order, then those 0.1 s later.
    let early = (0..64_u32).map(|k| (0, k * 37 % 64));
    let late = (64..80_u32).map(|k| (ticks(0.1), k));
    let events: Vec<_> = early
        .chain(late)
        .map(|(tick, k)| (tick, MatchedCrumple { sample: k, ..event(&bank, k, 60) }))
        .collect();
    let play = |max_voices| {
        let p = params(Jitter::Off, PlaybackParams { tail: 0.1, max_voices, ..defaults().playback });
        let standalone = Standalone::new::<CrumplePlayer>(p)
            .events(CrumplePlayerPorts::matched, events.clone(), ticks(0.3))
            .value(CrumplePlayerPorts::bank, bank.clone());
        let run = standalone.run().unwrap();
        let figure = |key| run.summary.iter().find(|(k, _)| *k == key).and_then(|(_, v)| v.as_u64());
        (run.stream(CrumplePlayerPorts::audio), figure("at_once_at_most"), figure("stolen"))
    };
    let sum = |voices: std::ops::Range<usize>| voices.map(|k| 0.01 * (k + 1) as f32).sum::<f32>();
    let (out, at_once, stolen) = play(defaults().playback.max_voices);
    assert!((out[4000] - sum(0..64)).abs() < 1e-4 && (out[6000] - sum(0..80)).abs() < 1e-4);
    assert_eq!((at_once, stolen), (Some(80), None));
    let (out, at_once, stolen) = play(64);
    assert_eq!((at_once, stolen), (Some(64), Some(16)));
    assert!((out[4000] - sum(0..64)).abs() < 1e-4);
    // The sixteen quietest have faded out after 64 samples.
    assert!((out[6000] - sum(16..80)).abs() < 1e-4, "{} for {}", out[6000], sum(16..80));
}

#[test]
fn no_sample_begins_before_its_event_unless_jitter_is_centred() {
    let bank = click_bank();
    let events: Vec<_> =
        (0..2000).map(|k| (Rate::hz(60).tick(i64::from(k) / 2), event(&bank, k, 60))).collect();
    for jitter in [Jitter::WholeFrames, Jitter::Fixed, Jitter::Off] {
        let p = params(jitter, PlaybackParams { tail: 0.1, ..defaults().playback });
        // Without look-ahead no sample can begin before its event.
        assert_eq!(p.onset.ahead(0, p.playback.rate), 0);
        let spread = p.onset.spread(Rate::hz(60).tick(1));
        assert!(spread <= Rate::hz(60).tick(2));
        for k in (0..events.len()).step_by(97) {
            let out = run(p.clone(), &events[k..=k], 17.0, 17.0, &bank);
            let at = out.iter().position(|x| *x != 0.0).unwrap() as i64;
            let first = Rate::hz(48_000).first_at(events[k].0);
            let last = Rate::hz(48_000).first_at(events[k].0 + spread);
            assert!((first..=last).contains(&at), "{first} {at} {last}");
        }
    }
    // Samples that begin before their event need look-ahead.
    let p = params(Jitter::Centred, defaults().playback);
    assert!(p.onset.ahead(0, p.playback.rate) >= p.onset.spread(Rate::hz(60).tick(1)) / 2);
}

#[test]
fn gains_are_matched_within_six_decibels() {
    let bank = click_bank();
    let of = |wanted| {
        let p = params(Jitter::Off, PlaybackParams { match_gain: true, tail: 0.01, ..defaults().playback });
        run(p, &[(0, MatchedCrumple { wanted, ..event(&bank, 0, 60) })], 0.01, 1.0, &bank)[0]
    };
    assert!(
        (of(2.25) - 1.5).abs() < 1e-6 && (of(100.0) - 1.9953).abs() < 1e-4 && (of(0.0) - 0.5012).abs() < 1e-4
    );
}

#[test]
fn another_bank_than_the_matched_one_is_refused_and_another_rate_is_not() {
    let bank = trial_bank();
    let standalone = |event| {
        Standalone::new::<CrumplePlayer>(params(
            Jitter::Off,
            PlaybackParams { tail: 0.05, ..defaults().playback },
        ))
        .events(CrumplePlayerPorts::matched, vec![(0, event)], ticks(0.1))
        .value(CrumplePlayerPorts::bank, bank.clone())
    };
    let fault = standalone(event(&click_bank(), 0, 60)).run().err().unwrap();
    assert!(fault.code == "F106" && fault.message.contains("another bank"), "{fault}");
    let out = standalone(MatchedCrumple { sample: 2, ..event(&bank, 0, 60) })
        .run()
        .unwrap()
        .stream(CrumplePlayerPorts::audio);
    // Samples at 8 kHz, played at 48 kHz: six times as many.
    let last = out.iter().rposition(|x| x.abs() > 1e-4).unwrap();
    assert!((500..680).contains(&last), "{last}");
}

#[test]
fn without_events_the_output_is_silence_of_the_right_length() {
    let p = params(Jitter::WholeFrames, PlaybackParams { tail: 0.25, ..defaults().playback });
    let out = run(p, &[], 0.5, 0.1, &click_bank());
    assert!(out.len() == 36_000 && out.iter().all(|x| *x == 0.0));
}
