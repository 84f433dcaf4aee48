use super::*;
use crate::core::item::AnyValue;
use crate::core::params::{Datum, Params};
use crate::core::random::Rng;
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, ticks};
use crate::feature::mfcc::{FeatureChannels, Mfcc, MfccParams, MfccPorts};
use crate::feature::temporal_gaussian::{TemporalGaussian, TemporalGaussianParams, TemporalGaussianPorts};
use crate::feature::{FeatureConventions, FeatureFormat};
use crate::unit::selection::unit_selector::{UnitSelector, UnitSelectorParams, UnitSelectorPorts};
use crate::unit::{Pick, Take, build};

const RATE: Rate = Rate::hz(48_000);

fn noise(seed: u64, n: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    (0..n).map(|i| rng.between(-0.5, 0.5) as f32 * (0.1 + (i as f32 * 3e-4).sin().abs())).collect()
}

fn conventions() -> FeatureConventions {
    FeatureConventions { widths: vec![20.0, 50.0, 10.0], ..FeatureConventions::cloth(RATE, 200) }
}

fn read<P: Params>() -> P {
    P::read(&|_| None).unwrap()
}

/// Features of a sound through the nodes.
fn features(audio: &[f32]) -> Vec<f32> {
    let made = Standalone::new::<Mfcc>(read::<MfccParams>()).input(
        MfccPorts::audio,
        RATE,
        Channels(1),
        audio.to_vec(),
    );
    let format = FeatureFormat { vectors: 1, conventions: Arc::new(FeatureConventions::cloth(RATE, 200)) };
    let smooth = Standalone::new::<TemporalGaussian>(read::<TemporalGaussianParams>()).input(
        TemporalGaussianPorts::features,
        Rate::hz(240),
        format,
        made.run().unwrap().stream(MfccPorts::features),
    );
    smooth.run().unwrap().stream(TemporalGaussianPorts::smooth)
}

fn selection(db: &UnitDatabase, features: Vec<f32>, cool_off: usize, c: FeatureConventions) -> Standalone {
    let params = UnitSelectorParams { cool_off, ..read() };
    let format = FeatureFormat { vectors: 1, conventions: Arc::new(c) };
    Standalone::new::<UnitSelector>(params)
        .input(UnitSelectorPorts::features, Rate::hz(240), format, features)
        .value(UnitSelectorPorts::database, db.clone())
}

fn concatenation(db: &UnitDatabase, picks: Vec<Pick>, window: f64) -> Standalone {
    concatenation_with(read(), db, picks, window)
}

fn concatenation_with(
    p: UnitConcatenatorParams,
    db: &UnitDatabase,
    picks: Vec<Pick>,
    window: f64,
) -> Standalone {
    let format = PickFormat { channels: 1, conventions: Arc::new(conventions()) };
    Standalone::new::<UnitConcatenator>(p)
        .input(UnitConcatenatorPorts::picks, Rate::hz(240), format, picks)
        .value(UnitConcatenatorPorts::database, db.clone())
        .window(ticks(window))
}

#[test]
fn a_recording_put_together_from_itself_is_itself_bit_for_bit() {
    let recording = noise(1, 200 * 300);
    let take = Take { channels: vec![recording.clone()].into(), ..Take::default() };
    let db = build(&[take], &conventions(), None).unwrap();
    for cool_off in [0, 20, 1000] {
        let run = selection(&db, features(&recording), cool_off, conventions()).run().unwrap();
        let picks = run.stream(UnitSelectorPorts::picks);
        assert!(picks.iter().enumerate().all(|(i, pick)| pick.unit == i as i32 && !pick.fallback));
        for window in [0.01, 0.37] {
            let run = concatenation(&db, picks.clone(), window).run().unwrap();
            assert!(run.stream(UnitConcatenatorPorts::audio) == db.channel(0));
        }
    }
}

#[test]
fn two_recordings_are_themselves_but_for_a_window_before_their_join() {
    let takes = [1, 2].map(|seed| Take { channels: vec![noise(seed, 200 * 150)].into(), ..Take::default() });
    let db = build(&takes, &conventions(), None).unwrap();
    let (look, join) = (read::<UnitSelectorParams>().look, 150);
    let run = selection(&db, db.features.clone(), 0, conventions()).run().unwrap();
    let picks = run.stream(UnitSelectorPorts::picks);
    for (i, pick) in picks.iter().enumerate() {
        let near = (join - look..join).contains(&i);
        assert_eq!(pick.unit == i as i32, !near, "unit {i}: {pick:?}");
    }
    // Half a unit before what differs, and half a unit after the join, the sound is the recordings again.
    let out = concatenation(&db, picks, 0.03).run().unwrap().stream(UnitConcatenatorPorts::audio);
    let (from, to) = ((join - look) * 200 - 100, join * 200 + 100);
    let x = db.channel(0);
    assert!(out[..from] == x[..from] && out[to..] == x[to..] && out[from..to] != x[from..to]);
}

/// Features of both channels of a sound joined to one vector, through the nodes.
fn joint_features(audio: &[Vec<f32>; 2]) -> (Vec<f32>, FeatureFormat) {
    let frames: Vec<f32> = audio[0].iter().zip(&audio[1]).flat_map(|(a, b)| [*a, *b]).collect();
    let params = MfccParams { channels: FeatureChannels::Joint, ..read() };
    let made = Standalone::new::<Mfcc>(params).input(MfccPorts::audio, RATE, Channels(2), frames);
    let c = FeatureConventions { joined: 2, ..FeatureConventions::cloth(RATE, 200) };
    let format = FeatureFormat { vectors: 1, conventions: Arc::new(c) };
    let smooth = Standalone::new::<TemporalGaussian>(read::<TemporalGaussianParams>()).input(
        TemporalGaussianPorts::features,
        Rate::hz(240),
        format,
        made.run().unwrap().stream(MfccPorts::features),
    );
    let c = FeatureConventions { joined: 2, ..conventions() };
    let format = FeatureFormat { vectors: 1, conventions: Arc::new(c) };
    (smooth.run().unwrap().stream(TemporalGaussianPorts::smooth), format)
}

#[test]
fn joint_channels_share_their_picks_and_cross_where_each_of_them_does() {
    let sound = [noise(1, 200 * 200), noise(2, 200 * 200)];
    let other = [noise(3, 200 * 120), noise(4, 200 * 120)];
    let (_, format) = joint_features(&sound);
    let take = Take { channels: sound.to_vec().into(), ..Take::default() };
    let db = build(&[take], &format.conventions, None).unwrap();
    let chosen = |target: &[Vec<f32>; 2]| {
        let (features, format) = joint_features(target);
        let standalone = Standalone::new::<UnitSelector>(read())
            .input(UnitSelectorPorts::features, Rate::hz(240), format, features)
            .value(UnitSelectorPorts::database, db.clone());
        standalone.run().unwrap().stream::<Picks>(UnitSelectorPorts::picks)
    };
    let heard = |picks: Vec<Pick>| {
        let format = PickFormat { channels: 1, conventions: Arc::clone(&format.conventions) };
        let standalone = Standalone::new::<UnitConcatenator>(read())
            .input(UnitConcatenatorPorts::picks, Rate::hz(240), format, picks)
            .value(UnitConcatenatorPorts::database, db.clone());
        let frames = standalone.run().unwrap().stream(UnitConcatenatorPorts::audio);
        [0, 1].map(|channel| frames.iter().skip(channel).step_by(2).copied().collect::<Vec<f32>>())
    };
    // One pick a unit; a recording chooses itself, and both its channels come back.
    let own = chosen(&sound);
    assert!(own.len() == 200 && own.iter().enumerate().all(|(i, pick)| pick.unit == i as i32));
    assert!(heard(own) == [0, 1].map(|channel| db.channel(channel).to_vec()));
    // The second channel has an influence.
    let picks = chosen(&other);
    assert!(picks.len() == 120 && picks != chosen(&[other[0].clone(), noise(5, 200 * 120)]));
    let units: Vec<u32> = picks.iter().map(|pick| pick.unit as u32).collect();
    let c = Concatenator::new(&db, Blend::EqualPower);
    assert!(heard(picks) == [0, 1].map(|channel| c.whole(channel, &units)));
    let joins: Vec<[Join; 2]> =
        units.windows(2).map(|u| [0, 1].map(|channel| c.join(channel, (Some(u[0]), Some(u[1]))))).collect();
    let cut = joins.iter().filter(|[a, b]| !a.is_empty() || !b.is_empty()).count();
    let apart = joins.iter().filter(|[a, b]| a != b).count();
    assert!(cut > 10 && 2 * apart > cut, "{apart} of {cut} joins cross at places of their own");
}

#[test]
fn windows_do_not_change_what_the_whole_is() {
    let takes = [1, 2].map(|seed| Take { channels: vec![noise(seed, 200 * 40)].into(), ..Take::default() });
    let db = build(&takes, &conventions(), None).unwrap();
    let mut rng = Rng::new(4);
    let units: Vec<u32> = (0..100).map(|_| rng.below(80) as u32).collect();
    let picks: Vec<Pick> = units.iter().map(|&unit| Pick { unit: unit as i32, ..Pick::default() }).collect();
    let whole = Concatenator::new(&db, Blend::EqualPower).whole(0, &units);
    for window in [0.0001, 0.0037, 0.2] {
        let run = concatenation(&db, picks.clone(), window).run().unwrap();
        assert!(run.stream(UnitConcatenatorPorts::audio) == whole, "{window}");
    }
}

#[test]
fn a_silent_target_sends_it_to_sleep() {
    let db = build(
        &[Take { channels: vec![noise(1, 200 * 300)].into(), ..Take::default() }],
        &conventions(),
        None,
    )
    .unwrap();
    let picks: Vec<Pick> = (0..240).map(|unit| Pick { unit, ..Pick::default() }).collect();
    let followed = |target: Vec<f32>| {
        let standalone = concatenation(&db, picks.clone(), 0.1);
        let standalone = standalone.optional(UnitConcatenatorPorts::target, RATE, Channels(1), target);
        standalone.run().unwrap().stream(UnitConcatenatorPorts::audio)
    };
    // One click, and then nothing.
    let mut target = vec![0.0; 48_000];
    target[0] = 0.5;
    let out = followed(target);
    assert!(out[..24_000] == db.channel(0)[..24_000]);
    assert!(out[26_500..].iter().all(|x| *x == 0.0));
    // Room tone continues after a click, and where there never is a sound.
    let mut click = vec![0.0; 48_000];
    click[0] = 0.5;
    for target in [click, vec![0.0; 48_000]] {
        let params = UnitConcatenatorParams { keep_room_tone: Some(true), ..read() };
        let standalone = concatenation_with(params, &db, picks.clone(), 0.1);
        let standalone = standalone.optional(UnitConcatenatorPorts::target, RATE, Channels(1), target);
        assert!(standalone.run().unwrap().stream(UnitConcatenatorPorts::audio) == db.channel(0)[..48_000]);
    }
    // Nothing at all.
    assert!(followed(vec![0.0; 48_000]).iter().all(|x| *x == 0.0));
}

#[test]
fn joint_recordings_keep_their_room_tone_where_nothing_else_is_said() {
    let c = FeatureConventions { joined: 2, ..conventions() };
    let take = Take { channels: vec![noise(1, 200 * 300), noise(2, 200 * 300)].into(), ..Take::default() };
    let db = build(&[take], &c, None).unwrap();
    let format = PickFormat { channels: 1, conventions: Arc::new(c) };
    let picks: Vec<Pick> = (0..240).map(|unit| Pick { unit, ..Pick::default() }).collect();
    for (keep_room_tone, heard) in [(None, true), (Some(true), true), (Some(false), false)] {
        let standalone =
            Standalone::new::<UnitConcatenator>(UnitConcatenatorParams { keep_room_tone, ..read() })
                .input(UnitConcatenatorPorts::picks, Rate::hz(240), format.clone(), picks.clone())
                .value(UnitConcatenatorPorts::database, db.clone())
                .optional(UnitConcatenatorPorts::target, RATE, Channels(1), vec![0.0; 48_000]);
        let out = standalone.run().unwrap().stream(UnitConcatenatorPorts::audio);
        let own = db.channel(0).iter().zip(db.channel(1)).flat_map(|(a, b)| [*a, *b]).take(96_000);
        let wanted: Vec<f32> = if heard { own.collect() } else { vec![0.0; 96_000] };
        assert!(out == wanted, "{keep_room_tone:?}");
    }
}

#[test]
fn features_of_other_conventions_are_refused_by_the_field() {
    let db =
        build(&[Take { channels: vec![noise(1, 8000)].into(), ..Take::default() }], &conventions(), None)
            .unwrap();
    let refused = |c| selection(&db, vec![0.0; 30], 20, c).shape().unwrap_err();
    let reject = refused(FeatureConventions { f_hi: 24_000.0, ..conventions() });
    assert!(reject.code == "F100" && reject.message.contains("`f_hi`"), "{reject}");
    let reject = refused(FeatureConventions { widths: vec![20.0], ..conventions() });
    assert!(
        reject.message.contains("`widths`") && reject.to_string().contains("TemporalGaussian"),
        "{reject}"
    );
}

#[test]
fn a_feature_that_is_no_number_is_named_by_its_unit() {
    let db =
        build(&[Take { channels: vec![noise(1, 8000)].into(), ..Take::default() }], &conventions(), None)
            .unwrap();
    let format = FeatureFormat { vectors: 1, conventions: Arc::new(conventions()) };
    // With look-ahead the bad unit is first seen five units ahead; with look-behind, afterwards.
    for causal in [false, true] {
        let mut features = vec![0.0; 60];
        features[33] = f32::NAN;
        let fault = Standalone::new::<UnitSelector>(UnitSelectorParams { causal, ..read() })
            .input(UnitSelectorPorts::features, Rate::hz(240), format.clone(), features)
            .value(UnitSelectorPorts::database, db.clone())
            .run()
            .err()
            .unwrap();
        assert!(fault.code == "F102" && fault.message.contains("unit 11 of"), "{fault}");
        assert_eq!(fault.time, Some(Rate::hz(240).tick(11)));
    }
}

#[test]
fn tags_leave_only_their_recordings_to_choose_from() {
    let tagged = |seed, tag: &str| Take {
        spans: None,
        channels: vec![noise(seed, 8000)].into(),
        source: crate::unit::UnitSource { tag: tag.into(), ..Default::default() },
    };
    let db = build(&[tagged(1, "friction"), tagged(2, "crumple")], &conventions(), None).unwrap();
    let run = |tag: &str| {
        let params = UnitSelectorParams { tags: vec![tag.into()], ..read() };
        let format = FeatureFormat { vectors: 1, conventions: Arc::new(conventions()) };
        Standalone::new::<UnitSelector>(params)
            .input(UnitSelectorPorts::features, Rate::hz(240), format, features(&noise(1, 8000)))
            .value(UnitSelectorPorts::database, db.clone())
            .run()
            .map(|run| run.stream(UnitSelectorPorts::picks))
    };
    assert!(run("crumple").unwrap().iter().all(|pick| pick.unit >= 40));
    assert!(run("friction").unwrap().iter().all(|pick| pick.unit < 40));
    let fault = run("silk").unwrap_err();
    assert!(fault.code == "F101" && fault.to_string().contains("crumple"), "{fault}");
    let _ = (AnyValue::new(db), Datum::Unit);
}
