//! Channels of a target, and units that are skipped while it is silent.

use super::*;
use crate::core::item::Channels;
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, ticks};
use crate::feature::{FeatureConventions, FeatureFormat};
use crate::unit::{Segment, UnitSource};
use std::sync::Arc;

/// 100 units of 80 samples per second.
const RATE: Rate = Rate::hz(100);
const AUDIO: Rate = Rate::hz(8000);
const UNIT: usize = 80;

fn walk(seed: u64, count: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut at = 0.0;
    let step = |_| {
        at = 0.9 * at + rng.between(-1.0, 1.0);
        at as f32
    };
    (0..count).map(step).collect()
}

/// Recordings of 60 units in each of some channels.
fn database(channels: &[u32]) -> UnitDatabase {
    let conventions = FeatureConventions { unit: UNIT as u32, ..FeatureConventions::trial() };
    let units = 60 * channels.len();
    let features = walk(9, units * 3);
    let segment = |(k, &channel): (usize, &u32)| Segment {
        start: 60 * k as u32,
        units: 60,
        source: 0,
        channel,
        ..Segment::default()
    };
    UnitDatabase {
        version: crate::unit::database::DATABASE_VERSION,
        floor_energy: 1e-10,
        segments: channels.iter().enumerate().map(segment).collect(),
        sources: vec![UnitSource::default()],
        audio: vec![0.1; units * UNIT],
        unfiltered: features.clone(),
        features,
        conventions,
    }
}

fn selection(p: &UnitSelectorParams, db: &UnitDatabase, vectors: usize, features: &[f32]) -> Standalone {
    let format = FeatureFormat { vectors, conventions: Arc::new(db.conventions.clone()) };
    Standalone::new::<UnitSelector>(p.clone())
        .input(UnitSelectorPorts::features, RATE, format, features.to_vec())
        .value(UnitSelectorPorts::database, db.clone())
}

fn params() -> UnitSelectorParams {
    UnitSelectorParams::read(&|_| None).unwrap()
}

fn picks(standalone: &Standalone) -> (Vec<Pick>, f64) {
    let run = standalone.run().unwrap();
    let share = run.summary.iter().find(|(name, _)| *name == "asleep_share").unwrap().1.as_f64();
    (run.stream(UnitSelectorPorts::picks), share.unwrap())
}

/// A target of 600 units that sounds in the first 1.3 s and from 4 s on, in every channel that `sounds`.
fn target(sounds: &[bool]) -> Vec<f32> {
    let sample = |k: usize| if (130 * UNIT..400 * UNIT).contains(&k) { 0.5e-5 } else { 0.1 };
    (0..600 * UNIT).flat_map(|k| sounds.iter().map(move |own| if *own { 0.1 } else { sample(k) })).collect()
}

#[test]
fn while_the_target_is_silent_nothing_is_chosen_and_then_it_goes_on() {
    let (db, features) = (database(&[0]), walk(1, 600 * 3));
    for causal in [false, true] {
        let p = UnitSelectorParams { causal, ..params() };
        let with = |window| {
            selection(&p, &db, 1, &features)
                .optional(UnitSelectorPorts::target, AUDIO, Channels(1), target(&[false]))
                .window(window)
        };
        let ((all, none), (found, share)) =
            (picks(&selection(&p, &db, 1, &features)), picks(&with(ticks(1.0))));
        // Asleep from 0.55 s and two units after the last sound on.
        let asleep = 130 + 57..400;
        assert_eq!((none, share), (0.0, asleep.len() as f64 / 600.0));
        assert!(found[..187] == all[..187], "awake it chooses as ever");
        let frozen = found[187].unit;
        assert!(frozen == found[186].unit && found[asleep].iter().all(|p| p.unit == frozen && !p.fallback));
        // Awake again at the unit with the first sound, with the rests of before.
        assert!(found[400..].iter().all(|p| p.d1 > 0.0), "chosen, not frozen");
        for (k, pick) in found[400..420].iter().enumerate() {
            let rests = &found[187 - 20 + k.min(20)..187];
            assert!(rests.iter().all(|rest| rest.unit != pick.unit), "unit {}: the rest goes on", 400 + k);
        }
        for window in [RATE.span(1), ticks(0.0173), ticks(10.0)] {
            assert!(picks(&with(window)).0 == found, "{window}");
        }
    }
    let keep = UnitSelectorParams { keep_room_tone: Some(true), ..params() };
    let standalone = selection(&keep, &db, 1, &features);
    let standalone = standalone.optional(UnitSelectorPorts::target, AUDIO, Channels(1), target(&[false]));
    assert_eq!(picks(&standalone).1, 0.0);
    let standalone = selection(&params(), &db, 1, &features);
    let standalone =
        standalone.optional(UnitSelectorPorts::target, Rate::hz(44_100), Channels(1), target(&[false]));
    assert!(standalone.shape().is_err(), "a target of another rate");
}

#[test]
fn what_is_chosen_asleep_is_never_heard() {
    use crate::unit::concatenation::unit_concatenator::{
        UnitConcatenator, UnitConcatenatorParams, UnitConcatenatorPorts,
    };
    let (mut db, features) = (database(&[0]), walk(1, 600 * 3));
    db.audio = walk(5, 60 * UNIT);
    let played = |picks: Vec<Pick>| {
        let format = PickFormat { channels: 1, conventions: Arc::new(db.conventions.clone()) };
        let standalone =
            Standalone::new::<UnitConcatenator>(UnitConcatenatorParams::read(&|_| None).unwrap())
                .input(UnitConcatenatorPorts::picks, RATE, format, picks)
                .value(UnitConcatenatorPorts::database, db.clone())
                .optional(UnitConcatenatorPorts::target, AUDIO, Channels(1), target(&[false]));
        standalone.run().unwrap().stream(UnitConcatenatorPorts::audio)
    };
    let standalone = selection(&params(), &db, 1, &features);
    let asleep = standalone.optional(UnitSelectorPorts::target, AUDIO, Channels(1), target(&[false]));
    let (all, some) = (picks(&selection(&params(), &db, 1, &features)).0, picks(&asleep).0);
    let (all, some) = (played(all), played(some));
    assert!(
        all[..395 * UNIT] == some[..395 * UNIT] && some[186 * UNIT..395 * UNIT].iter().all(|x| *x == 0.0)
    );
}

#[test]
fn channels_sleep_alone() {
    let (db, features) = (database(&[0]), walk(1, 600 * 6));
    let standalone = selection(&params(), &db, 2, &features);
    let both = standalone.optional(UnitSelectorPorts::target, AUDIO, Channels(2), target(&[true, false]));
    let (found, share) = picks(&both);
    assert!((share - 213.0 / 1200.0).abs() < 1e-12, "{share}");
    let (all, _) = picks(&selection(&params(), &db, 2, &features));
    assert!(found.iter().step_by(2).eq(all.iter().step_by(2)), "the first channel sounds on");
    // One channel of sound for both vectors sends both to sleep.
    let standalone = selection(&params(), &db, 2, &features);
    let one = standalone.optional(UnitSelectorPorts::target, AUDIO, Channels(1), target(&[false]));
    assert_eq!(picks(&one).1, 213.0 / 600.0);
}

#[test]
fn channels_choose_from_their_own_recordings_or_share_those_of_one() {
    let features = walk(3, 200 * 6);
    let stereo = database(&[0, 1, 0, 1]);
    let standalone = selection(&params(), &stereo, 2, &features);
    assert!(standalone.shape().unwrap().notes.is_empty(), "{:?}", standalone.shape().unwrap().notes);
    let (found, _) = picks(&standalone);
    for (k, pick) in found.iter().enumerate() {
        assert_eq!(pick.unit as usize / 60 % 2, k % 2, "{k}");
    }
    let shared = UnitSelectorParams { own_channels: Some(false), ..params() };
    let any = picks(&selection(&shared, &stereo, 2, &features)).0;
    assert!(any.iter().step_by(2).any(|pick| pick.unit as usize / 60 % 2 == 1));
    // One channel of recordings for both: a note states the consequence, and each chooses as if alone.
    let mono = database(&[0, 0]);
    let standalone = selection(&params(), &mono, 2, &features);
    assert!(standalone.shape().unwrap().notes[0].contains("the same units"));
    let (both, _) = picks(&standalone);
    let one: Vec<f32> = features.chunks(6).flat_map(|unit| unit[3..].to_vec()).collect();
    assert!(both.iter().skip(1).step_by(2).eq(picks(&selection(&params(), &mono, 1, &one)).0.iter()));
    let own = UnitSelectorParams { own_channels: Some(true), ..params() };
    let reject = selection(&own, &mono, 2, &features).shape().unwrap_err();
    assert!(reject.code == "F101" && reject.message.contains("channel 1"), "{reject}");
}

fn warnings(standalone: &Standalone) -> Vec<String> {
    let summary = standalone.run().unwrap().summary;
    summary.into_iter().filter(|(key, _)| *key == "warning").map(|(_, text)| text.to_string()).collect()
}

#[test]
fn many_fallbacks_and_too_few_units_are_reported_once() {
    let (db, features) = (database(&[0]), walk(1, 600 * 3));
    let near = UnitSelectorParams { d_max: 1000.0, ..params() };
    assert_eq!(warnings(&selection(&near, &db, 1, &features)), Vec::<String>::new());
    let far = UnitSelectorParams { d_max: 0.001, ..params() };
    let reported = warnings(&selection(&far, &db, 1, &features).window(ticks(0.1)));
    assert!(reported.len() == 1 && reported[0].contains("within `d_max` 0.001"), "{reported:?}");
    // Of 60 units 55 have five more after them.
    let few = |cool_off| {
        let p = UnitSelectorParams { cool_off, look: 5, ..near.clone() };
        warnings(&selection(&p, &db, 1, &features))
    };
    assert_eq!(few(54), Vec::<String>::new());
    let reported = few(55);
    assert!(
        reported.len() == 1
            && reported[0].contains("55 units can be chosen")
            && reported[0].contains("`cool_off`")
    );
}

#[test]
fn what_is_slept_through_is_marked() {
    let (db, features) = (database(&[0]), walk(1, 600 * 3));
    let standalone = selection(&params(), &db, 1, &features);
    let (found, share) =
        picks(&standalone.optional(UnitSelectorPorts::target, AUDIO, Channels(1), target(&[false])));
    let asleep = found.iter().filter(|pick| pick.asleep).count();
    assert!(asleep > 200 && (asleep as f64 / 600.0 - share).abs() < 1e-12, "{asleep} {share}");
}
