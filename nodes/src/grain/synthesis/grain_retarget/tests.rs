use super::*;
use crate::core::computation::NotStored;
use crate::core::feed::Feed;
use crate::core::item::{AnyValue, Event};
use crate::core::standalone::{Standalone, StandaloneRun};
use crate::grain::correlation::{CorrelateRules, correlate};
use crate::grain::dictionary::{ExtractRules, extract};
use crate::grain::recording::{Component, GrainRecording, GrainRecordings, Part};
use crate::modal::Body;
use crate::rigid::State;
use std::f64::consts::TAU;

const RATE: f64 = 16_000.0;

/// Three knocks, lower and higher ones, and a rub with a steady tone of 800 Hz and a noise.
fn recordings() -> GrainRecordings {
    let mut rng = Rng::new(1);
    let mut knock = |k: usize| {
        let sample = |i: usize| {
            let t = i as f64 / RATE;
            let ring = (TAU * (700.0 + 90.0 * k as f64) * t).sin() + rng.between(-0.6, 0.6);
            (0.4 * (-t * (30.0 + 3.0 * k as f64)).exp() * ring) as f32
        };
        GrainRecording {
            name: format!("knock_{k}.wav"),
            tags: vec!["knock".into(), ["low", "middle", "high"][k].into()],
            parts: vec![Part {
                component: Component::Whole,
                channels: vec![(0..6000).map(sample).collect()],
            }],
            ..GrainRecording::default()
        }
    };
    let mut all: Vec<GrainRecording> = (0..3).map(&mut knock).collect();
    let steady = (0..24_000).map(|i| (0.2 * (TAU * 800.0 * f64::from(i) / RATE).sin()) as f32).collect();
    let noise = (0..24_000).map(|_| rng.between(-0.1, 0.1) as f32).collect();
    all.push(GrainRecording {
        name: "rub.wav".into(),
        tags: vec!["rub".into()],
        kind: SourceKind::Continuous,
        speed: Some(0.5),
        parts: vec![
            Part { component: Component::Steady, channels: vec![steady] },
            Part { component: Component::Transient, channels: vec![noise] },
        ],
        ..GrainRecording::default()
    });
    GrainRecordings { rate: RATE, recordings: all }
}

fn dictionary() -> GrainDictionary {
    extract(&recordings(), &ExtractRules::at_rate(RATE)).0
}

fn params() -> GrainRetargetParams {
    GrainRetargetParams {
        impact: "knock".into(),
        sliding: "rub".into(),
        rolling: "rub".into(),
        rate: Rate::hz(16_000),
        tail: 0.5,
        ..GrainRetargetParams::read(&|_| None).unwrap()
    }
}

fn state(kind: State, gain: f32, speed: f32, hz: f64) -> ContactState {
    let mut state = ContactState::trial(&mut Rng::new(2));
    (state.state, state.gain, state.slip, state.sliding, state.rolling) = (kind, gain, 1.0, speed, speed);
    (state.frame.bodies, state.frame.begins, state.frame.ends) = ([0, 1], false, false);
    state.frame.interval = ticks(1.0 / hz);
    state
}

/// A contact that lasts for `seconds`, logged at a rate.
fn contact(kind: State, hz: f64, seconds: f64, of: impl Fn(f64) -> (f32, f32)) -> Vec<(Tick, ContactState)> {
    (0..(hz * seconds) as usize)
        .map(|k| {
            let t = k as f64 / hz;
            let (gain, speed) = of(t);
            (ticks(t), state(kind, gain, speed, hz))
        })
        .collect()
}

/// The dictionary with the sinusoids of the rub.
fn dictionary_with_tracks() -> GrainDictionary {
    extract(&recordings(), &ExtractRules { tracks: true, ..ExtractRules::at_rate(RATE) }).0
}

fn standalone(p: GrainRetargetParams) -> Standalone {
    standalone_of(dictionary(), p)
}

fn standalone_of(dictionary: GrainDictionary, p: GrainRetargetParams) -> Standalone {
    Standalone::new::<GrainRetarget>(p).value(GrainRetargetPorts::dictionary, dictionary)
}

/// Sound of contacts for two seconds.
fn sliding(p: GrainRetargetParams, states: Vec<(Tick, ContactState)>) -> Vec<f32> {
    sliding_of(dictionary(), p, states)
}

fn sliding_of(
    dictionary: GrainDictionary,
    p: GrainRetargetParams,
    states: Vec<(Tick, ContactState)>,
) -> Vec<f32> {
    let feed = Feed::events(states, ticks(2.0));
    let port = GrainRetargetPorts::states.index();
    standalone_of(dictionary, p).feed(port, feed).run().unwrap().stream(GrainRetargetPorts::audio)
}

fn struck(p: GrainRetargetParams, energies: &[(f64, f64)], patterns: bool) -> Vec<f32> {
    let hit = |(t, energy): &(f64, f64)| {
        (ticks(*t), Impact::from_energy(*energy, Body { mass: 0.1, restitution: 0.5 }))
    };
    let end = energies.last().map_or(0.0, |e| e.0) + 0.1;
    let feed = Feed::events(energies.iter().map(hit).collect(), ticks(end));
    let mut run = standalone(p).feed(GrainRetargetPorts::impacts.index(), feed);
    if patterns {
        let found =
            correlate(&recordings(), &dictionary(), &CorrelateRules::default(), &|_| false, &NotStored)
                .unwrap();
        run = run.feed(GrainRetargetPorts::patterns.index(), Feed::value(AnyValue::new(found)));
    }
    run.run().unwrap().stream(GrainRetargetPorts::audio)
}

fn rms(x: &[f32]) -> f64 {
    (x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

fn db(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

#[test]
fn windows_of_any_length_give_the_same_samples() {
    let states = contact(State::Sliding, 60.0, 1.2, |t| {
        if (0.5..0.7).contains(&t) { (0.0, 0.0) } else { (0.5, 0.3 + t as f32) }
    });
    let hits: Vec<(Tick, Impact)> = (0..9)
        .map(|k| {
            (ticks(0.137 * f64::from(k)), Impact::from_energy(0.05, Body { mass: 0.1, restitution: 0.5 }))
        })
        .collect();
    let of = |dictionary: GrainDictionary, window: f64| {
        let feed = Feed::events(states.clone(), ticks(1.3));
        let hits = Feed::events(hits.clone(), ticks(1.3));
        let run = standalone_of(dictionary, GrainRetargetParams { voices: 2, ..params() })
            .feed(GrainRetargetPorts::states.index(), feed)
            .feed(GrainRetargetPorts::impacts.index(), hits);
        run.window(ticks(window)).run().unwrap().stream(GrainRetargetPorts::audio)
    };
    for dictionary in [dictionary(), dictionary_with_tracks()] {
        let whole = of(dictionary.clone(), 0.25);
        assert!(rms(&whole) > 0.01);
        for window in [0.002, 0.0131, 0.1] {
            assert_eq!(of(dictionary.clone(), window), whole, "{window}");
        }
    }
}

#[test]
fn an_impact_sounds_at_its_time_with_the_root_of_its_energy() {
    let one = GrainRetargetParams { variations: 1, energy_ref: 1.0, spread: 0.0, ..params() };
    let times = [(0.1, 0.01), (0.6, 0.04), (1.1, 0.16), (1.6, 0.64)];
    let audio = struck(one, &times, false);
    let at = |t: f64| (t * RATE) as usize;
    let levels: Vec<f64> = times.iter().map(|(t, _)| rms(&audio[at(*t)..at(*t + 0.4)])).collect();
    for (k, pair) in levels.windows(2).enumerate() {
        assert!((db(pair[1] / pair[0]) - 6.02).abs() < 1.0, "{k}: {levels:?}");
    }
    for (t, _) in times {
        let before = &audio[at(t) - 40..at(t)];
        let after = &audio[at(t)..at(t) + 40];
        assert!(rms(after) > 30.0 * rms(before), "{t}");
    }
    assert!(audio[..at(0.1)].iter().all(|x| *x == 0.0));
}

#[test]
fn a_hundred_impacts_differ_in_shape_and_not_in_loudness() {
    let energies: Vec<(f64, f64)> = (0..100).map(|k| (0.4 * f64::from(k), 0.1)).collect();
    let audio = struck(GrainRetargetParams { spread: 0.0, ..params() }, &energies, true);
    let n = (0.39 * RATE) as usize;
    let sounds: Vec<&[f32]> =
        energies.iter().map(|(t, _)| &audio[(t * RATE).round() as usize..][..n]).collect();
    let norm = |x: &[f32]| rms(x) * (x.len() as f64).sqrt();
    let norms: Vec<f64> = sounds.iter().map(|x| norm(x)).collect();
    let [low, high] =
        [norms.iter().copied().fold(f64::MAX, f64::min), norms.iter().copied().fold(0.0, f64::max)];
    assert!(db(high / low) < 1.5, "{}", db(high / low));
    let mut alike = 0;
    for j in 0..100 {
        for k in j + 1..100 {
            let dot: f64 = sounds[j].iter().zip(sounds[k]).map(|(a, b)| f64::from(a * b)).sum();
            alike += usize::from(dot / (norms[j] * norms[k]) > 0.98);
        }
    }
    assert_eq!(alike, 0);
}

#[test]
fn resting_bodies_are_silent_and_the_end_of_a_contact_fades_out() {
    assert!(sliding(params(), contact(State::Static, 60.0, 1.5, |_| (0.0, 0.0))).iter().all(|x| *x == 0.0));
    let audio = sliding(params(), contact(State::Sliding, 60.0, 1.0, |_| (0.5, 0.5)));
    let at = |t: f64| (t * RATE) as usize;
    assert!(rms(&audio[at(0.5)..at(0.9)]) > 0.01);
    assert!(audio[at(1.4)..].iter().all(|x| *x == 0.0));
    let step = audio.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(step < 0.3, "{step}");
}

#[test]
fn the_rate_of_the_physics_is_not_heard() {
    let noise_only = GrainRetargetParams { steady: -200.0, ..params() };
    let of = |hz: f64| sliding(noise_only.clone(), contact(State::Sliding, hz, 1.9, |_| (1.0, 0.5)));
    let at = |t: f64| (t * RATE) as usize;
    let reference = rms(&of(240.0)[at(0.3)..at(1.8)]);
    for hz in [30.0, 60.0, 240.0, 1200.0] {
        let audio = of(hz);
        let inner = &audio[at(0.3)..at(1.8)];
        assert!(db(rms(inner) / reference).abs() < 0.5, "{hz}");
        // No hole longer than a taper.
        let quietest = inner.chunks(80).map(rms).fold(f64::MAX, f64::min);
        assert!(db(quietest / reference) > -6.0, "{hz}: {quietest} {reference}");
    }
    // A level that rises is the same at all rates.
    let rising = |hz: f64| {
        sliding(noise_only.clone(), contact(State::Sliding, hz, 1.9, |t| (0.2 + 0.5 * t as f32, 0.5)))
    };
    let (a, b) = (rising(60.0), rising(240.0));
    for t in [0.5, 1.0, 1.5] {
        let level = |x: &[f32]| rms(&x[at(t)..at(t + 0.2)]);
        assert!(db(level(&a) / level(&b)).abs() < 1.0, "{t}");
    }
}

#[test]
fn four_times_the_power_is_twice_the_amplitude() {
    let of = |gain: f32| sliding(params(), contact(State::Sliding, 60.0, 1.9, |_| (gain, 0.5)));
    let at = |t: f64| (t * RATE) as usize;
    let level = |x: &[f32]| rms(&x[at(0.3)..at(1.8)]);
    assert!((db(level(&of(1.0)) / level(&of(0.5))) - 6.02).abs() < 0.01);
}

#[test]
fn the_steady_part_follows_the_speed_and_the_transient_part_does_not() {
    let crossings = |x: &[f32]| x.windows(2).filter(|w| w[0] <= 0.0 && w[1] > 0.0).count() as f64;
    let at = |t: f64| (t * RATE) as usize;
    let steady = GrainRetargetParams { transient: -200.0, ..params() };
    let frequency = |speed: f32, gamma: f64| {
        let p = GrainRetargetParams { gamma, ..steady.clone() };
        let audio = sliding(p, contact(State::Sliding, 60.0, 1.9, |_| (1.0, speed)));
        crossings(&audio[at(0.4)..at(1.8)]) / 1.4
    };
    for (speed, gamma, want) in
        [(0.5, 0.5, 800.0), (1.0, 0.5, 1131.4), (1.0, 1.0, 1600.0), (0.125, 0.5, 400.0)]
    {
        let found = frequency(speed, gamma);
        assert!((found / want - 1.0).abs() < 0.02, "{speed} {gamma}: {found} {want}");
    }
    let transient = GrainRetargetParams { steady: -200.0, ..params() };
    let of = |speed: f32| sliding(transient.clone(), contact(State::Sliding, 60.0, 1.9, |_| (1.0, speed)));
    assert!(of(0.5).iter().zip(of(2.0)).all(|(a, b)| (a - b).abs() < 1e-6));
}

/// Share of the power of a sound that is not in one sinusoid.
fn impurity(x: &[f32], frequency: f64) -> f64 {
    let (n, mut sums) = (x.len() as f64, [0.0; 2]);
    for (i, x) in x.iter().enumerate() {
        let (sin, cos) = (TAU * frequency * i as f64 / RATE).sin_cos();
        sums = [sums[0] + f64::from(*x) * cos, sums[1] + f64::from(*x) * sin];
    }
    let of_tone = 2.0 * (sums[0].powi(2) + sums[1].powi(2)) / (n * n);
    1.0 - of_tone / rms(x).powi(2)
}

#[test]
fn by_tracks_a_shifted_tone_is_as_loud_and_as_pure_as_the_recorded_one() {
    let p = GrainRetargetParams { transient: -200.0, gamma: 1.0, jump: 0.0, ..params() };
    let of = |speed: f32| {
        let states = contact(State::Sliding, 60.0, 1.9, |_| (1.0, speed));
        let audio = sliding_of(dictionary_with_tracks(), p.clone(), states);
        audio[(0.1 * RATE) as usize..(0.4 * RATE) as usize].to_vec()
    };
    let recorded = of(0.5);
    for (speed, frequency) in [(0.25, 400.0), (0.4, 640.0), (0.75, 1200.0), (1.0, 1600.0)] {
        let x = of(speed);
        assert!(db(rms(&x) / rms(&recorded)).abs() < 0.2, "{speed}: {}", db(rms(&x) / rms(&recorded)));
        assert!(impurity(&x, frequency) < 1e-3, "{speed}: {}", impurity(&x, frequency));
    }
    assert!(impurity(&recorded, 800.0) < 1e-3);
    // The speed rises within the contact: phases go on in grains, and grains fade into each other.
    let states = contact(State::Sliding, 60.0, 1.9, |t| (1.0, 0.5 + 0.3 * t as f32));
    let x = sliding_of(dictionary_with_tracks(), p, states);
    let middle = &x[(0.2 * RATE) as usize..(1.7 * RATE) as usize];
    assert!(db(rms(middle) / rms(&recorded)).abs() < 1.0, "{}", db(rms(middle) / rms(&recorded)));
}

#[test]
fn bad_events_are_counted_and_many_contacts_are_bounded() {
    let mut states = contact(State::Sliding, 60.0, 0.5, |_| (0.5, 0.5));
    states[3].1.gain = f32::NAN;
    for k in 0..2000 {
        let mut other = state(State::Sliding, 0.1, 0.5, 60.0);
        other.frame.bodies = [k, k + 1];
        states.push((ticks(0.6), other));
    }
    let feed = Feed::events(states, ticks(0.8));
    let run = standalone(params()).feed(GrainRetargetPorts::states.index(), feed).run().unwrap();
    assert!(run.stream(GrainRetargetPorts::audio).iter().all(|x| x.is_finite()));
    let count = |name: &str| run.summary.iter().find(|(n, _)| *n == name).map(|(_, v)| v.as_u64().unwrap());
    assert_eq!((count("not_finite"), count("dropped")), (Some(1), Some(2000 - 64)));
}

#[test]
fn tags_without_recordings_are_replaced_with_a_warning_and_events_are_needed() {
    let p = GrainRetargetParams { impact: "knock stone".into(), ..params() };
    let feed = Feed::events(vec![(0, Trigger::of(1.0))], ticks(0.5));
    let run = standalone(p.clone()).feed(GrainRetargetPorts::triggers.index(), feed).run().unwrap();
    assert!(rms(&run.stream(GrainRetargetPorts::audio)) > 0.001);
    assert!(run.summary.iter().any(|(n, text)| *n == "warning" && text.to_string().contains("knock stone")));
    assert!(standalone(p).shape().unwrap_err().message.contains("nothing plays"));
}

/// A run with triggers at times in s.
fn triggered(p: GrainRetargetParams, triggers: &[(f64, Trigger)], window: f64) -> StandaloneRun {
    let end = triggers.last().map_or(0.0, |t| t.0) + 0.1;
    let events = triggers.iter().map(|(t, trigger)| (ticks(*t), *trigger)).collect();
    let port = GrainRetargetPorts::triggers.index();
    standalone(p).feed(port, Feed::events(events, ticks(end))).window(ticks(window)).run().unwrap()
}

/// The sound of one trigger.
fn one_trigger(p: &GrainRetargetParams, trigger: Trigger) -> Vec<f32> {
    triggered(p.clone(), &[(0.0, trigger)], 0.05).stream(GrainRetargetPorts::audio)
}

#[test]
fn the_index_of_a_trigger_selects_the_tags() {
    let tags = |tags: &str| GrainRetargetParams { impact: tags.into(), variations: 1, ..params() };
    let p = GrainRetargetParams { triggered: vec!["low".into(), "high".into()], ..tags("knock middle") };
    let of = |index: u32| one_trigger(&p, Trigger { index, ..Trigger::of(1.0) });
    let [low, middle, high] =
        ["knock low", "knock middle", "knock high"].map(|t| one_trigger(&tags(t), Trigger::of(1.0)));
    assert!(low != middle && middle != high && rms(&low) > 0.001);
    assert!(of(0) == low && of(1) == high);
    // An impact is played by an index beyond the list, and without a list.
    assert!(of(2) == middle && of(u32::MAX) == middle);
    let other = Trigger { index: 1, ..Trigger::of(1.0) };
    assert!(one_trigger(&tags("knock middle"), other) == middle);
}

#[test]
fn a_trigger_without_index_and_ratio_is_the_impact_of_its_amplitude() {
    let p = GrainRetargetParams { energy_ref: 0.5, ..params() };
    let hits = [(0.0, 0.5), (0.3, 0.5), (0.35, 0.5), (0.9, 0.5)];
    let taps = hits.map(|(t, _)| (t, Trigger::of(1.0)));
    let audio = triggered(p.clone(), &taps, 0.05).stream(GrainRetargetPorts::audio);
    assert!(rms(&audio) > 0.01 && audio == struck(p, &hits, false));
}

#[test]
fn a_ratio_of_two_halves_the_duration_and_raises_an_octave() {
    let p = GrainRetargetParams { impact: "knock low".into(), variations: 1, ..params() };
    let [slow, plain, fast] =
        [0.5, 1.0, 2.0].map(|ratio| one_trigger(&p, Trigger { ratio, ..Trigger::of(1.0) }));
    let frames = |x: &[f32]| x.iter().rposition(|x| *x != 0.0).map_or(0, |k| k + 1);
    assert!(frames(&plain).abs_diff(2 * frames(&fast)) <= 4, "{} {}", frames(&plain), frames(&fast));
    assert!(frames(&slow).abs_diff(2 * frames(&plain)) <= 4, "{} {}", frames(&slow), frames(&plain));
    let difference = |a: &[f32], b: &[f32]| {
        let apart: Vec<f32> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        rms(&apart) / rms(a)
    };
    let every_second = |x: &[f32]| x.iter().copied().step_by(2).collect::<Vec<f32>>();
    let n = frames(&fast) - 40;
    let fast_error = difference(&fast[40..n], &every_second(&plain)[40..n]);
    let slow_error = difference(&plain[40..n], &every_second(&slow)[40..n]);
    assert!(fast_error < 0.02 && slow_error < 0.02, "{fast_error} {slow_error}");
}

#[test]
fn triggers_of_any_ratio_have_the_same_samples_in_windows_of_any_length() {
    let p = GrainRetargetParams {
        voices: 2,
        break_energy: Some(0.1),
        breaking: "middle".into(),
        triggered: vec!["low".into(), "high".into()],
        ..params()
    };
    let taps: Vec<(f64, Trigger)> = (0..12)
        .map(|k| {
            let ratio = [1.0, 0.7, 2.0, 0.0625, 3.1][k as usize % 5];
            (0.083 * f64::from(k), Trigger { gain: 0.5, index: k % 3, ratio })
        })
        .collect();
    let whole = triggered(p.clone(), &taps, 0.25);
    assert!(rms(&whole.stream(GrainRetargetPorts::audio)) > 0.01);
    assert!(whole.summary.iter().any(|(name, _)| *name == "stolen"));
    for window in [0.002, 0.0131, 0.1] {
        let other = triggered(p.clone(), &taps, window);
        assert!(
            other.stream(GrainRetargetPorts::audio) == whole.stream(GrainRetargetPorts::audio),
            "{window}"
        );
    }
}

#[test]
fn invalid_triggers_are_counted_and_silent() {
    let one = Trigger::of(1.0);
    let wrong = [0.0, -1.0, 17.0, f32::NAN, f32::INFINITY].map(|ratio| Trigger { ratio, ..one });
    let gain = Trigger { gain: f32::NAN, ..one };
    let taps: Vec<(f64, Trigger)> = wrong.into_iter().chain([gain]).map(|trigger| (0.1, trigger)).collect();
    let run = triggered(params(), &taps, 0.05);
    assert!(run.stream(GrainRetargetPorts::audio).iter().all(|x| *x == 0.0));
    let count = |name: &str| run.summary.iter().find(|(n, _)| *n == name).and_then(|(_, v)| v.as_u64());
    assert_eq!((count("not_finite"), count("impacts")), (Some(6), Some(0)));
}

#[test]
fn tags_of_triggers_without_recordings_are_replaced_with_a_warning() {
    let p = GrainRetargetParams { triggered: vec!["low".into(), "low gong".into()], ..params() };
    let run = triggered(p, &[(0.0, Trigger { index: 1, ..Trigger::of(1.0) })], 0.05);
    assert!(rms(&run.stream(GrainRetargetPorts::audio)) > 0.001);
    let warnings =
        run.summary.iter().filter(|(name, text)| *name == "warning" && text.to_string().contains("low gong"));
    assert_eq!(warnings.count(), 1);
}
