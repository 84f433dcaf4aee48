use super::*;
use crate::core::random::Rng;
use crate::core::time::Rate;

fn cloth() -> FeatureConventions {
    FeatureConventions { widths: vec![4.0], ..FeatureConventions::cloth(Rate::hz(8000), 100) }
}

fn noise(seed: u64, n: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    (0..n).map(|_| rng.between(-0.5, 0.5) as f32).collect()
}

fn take(channels: Vec<Vec<f32>>) -> Take<'static> {
    Take {
        channels: channels.into(),
        spans: None,
        source: UnitSource { provenance: "a.wav".into(), ..UnitSource::default() },
    }
}

#[test]
fn channels_are_segments_and_their_tails_are_dropped() {
    let takes =
        [take(vec![noise(1, 1250), noise(2, 1250)]), take(vec![noise(3, 399)]), take(vec![noise(4, 99)])];
    let db = build(&takes, &cloth(), None).unwrap();
    let table: Vec<_> = db.segments.iter().map(|s| (s.start, s.units, s.source, s.channel)).collect();
    assert_eq!(table, [(0, 12, 0, 0), (12, 12, 0, 1), (24, 3, 1, 0)]);
    assert_eq!((db.len(), db.audio.len(), db.features.len()), (27, 2700, 81));
}

#[test]
fn nothing_leaves_its_segment() {
    let (a, b) = (noise(1, 1000), noise(2, 1000));
    let both = build(&[take(vec![a.clone()]), take(vec![b.clone()])], &cloth(), None).unwrap();
    let alone = build(&[take(vec![b])], &cloth(), None).unwrap();
    assert_eq!(both.features[30..], alone.features);
    assert_eq!(both.channel(0)[1000..], alone.audio);
    assert_ne!(both.features[..30], alone.features);
    assert!(both.features != both.unfiltered);
}

#[test]
fn audio_loses_its_mean_and_what_is_below_the_high_pass() {
    let tone: Vec<f32> = (0..8000).map(|i| 0.3 + (0.01 * i as f32).sin()).collect();
    let db = build(&[take(vec![tone.clone()])], &cloth(), None).unwrap();
    // 12.7 Hz is far below 100 Hz.
    assert!(db.audio[4000..].iter().all(|x| x.abs() < 1e-3));
    let open = FeatureConventions { high_pass: 0.0, ..cloth() };
    let db = build(&[take(vec![tone])], &open, None).unwrap();
    assert!(db.audio.iter().sum::<f32>().abs() / 8000.0 < 1e-6 && db.audio[157] > 0.5);
}

#[test]
fn silence_cuts_segments_and_joint_channels_stay_together() {
    let mut x = noise(5, 1000);
    x.extend([0.0; 500]);
    x.extend(noise(6, 700));
    let gap = Gap { samples: 400, level: 1e-4 };
    let db = build(&[take(vec![x.clone()])], &cloth(), Some(gap)).unwrap();
    let table: Vec<_> = db.segments.iter().map(|s| (s.units, s.offset)).collect();
    assert_eq!(table, [(10, 0), (7, 1500)]);
    let joint = FeatureConventions { joined: 2, ..cloth() };
    let db = build(&[take(vec![x.clone(), x.clone()])], &joint, None).unwrap();
    assert_eq!((db.dims(), db.channels(), db.len(), db.audio.len()), (6, 2, 22, 4400));
    assert_eq!(db.feature(7)[..3], db.feature(7)[3..]);
    assert_eq!(db.channel(0), db.channel(1));
    let found = build(&[take(vec![x])], &joint, None).unwrap_err();
    assert_eq!(found.to_string(), "\"a.wav\" has 1 channels; the database joins 2");
}

#[test]
fn the_floor_can_come_from_the_recordings() {
    let quiet: Vec<f32> = noise(7, 8000).iter().map(|x| 1e-3 * x).collect();
    let c = FeatureConventions { floor: FloorRule::Database, ..cloth() };
    let db = build(&[take(vec![quiet])], &c, None).unwrap();
    let db_level = 10.0 * db.floor_energy.log10();
    // Uniform noise of -70.8 dB in all, less in each band.
    assert!((-95.0..-70.0).contains(&db_level), "{db_level}");
    // Of 200 band energies ten are lower. Digital silence, and bands above half the rate, are none.
    let numbers: Vec<f32> = (0..=200).map(|k| ((k * 77) % 201) as f32 * 1e-9).collect();
    assert!((percentile(&numbers, 0.05) - 11e-9).abs() < 1e-15, "{}", percentile(&numbers, 0.05));
    assert_eq!(percentile(&[0.0; 7], 0.05), 1e-10);
    // The high-pass rings on in a pause, ever less.
    let sound = noise(7, 40_000);
    let mut with_pause = sound.clone();
    with_pause[10_000..18_000].fill(0.0);
    let level = |x: Vec<f32>| build(&[take(vec![x])], &c, None).unwrap().floor_energy;
    assert!((level(with_pause) / level(sound)).log10().abs() < 0.3);
}

#[test]
fn empty_short_and_broken_recordings_are_named() {
    assert!(build(&[], &cloth(), None).unwrap_err().to_string().contains("no unit"));
    assert!(
        build(&[take(vec![noise(1, 99)])], &cloth(), None).unwrap_err().to_string().contains("100 samples")
    );
    let mut x = noise(1, 500);
    x[321] = f32::NAN;
    let found = build(&[take(vec![x])], &cloth(), None).unwrap_err();
    assert!(matches!(found, BuildError::NotFinite { sample: 321, .. }), "{found}");
}

fn power(x: &[f32]) -> f64 {
    x.iter().map(|x| f64::from(x * x)).sum::<f64>() / x.len() as f64
}

#[test]
fn copies_have_other_speeds_and_levels_and_stand_after_the_recordings() {
    let c = FeatureConventions { floor: FloorRule::Database, ..cloth() };
    let takes = [take(vec![noise(8, 2000)]), take(vec![noise(9, 1000)])];
    let more = Augmentation { speeds: vec![0.8], gains: vec![-6.0] };
    let (plain, db) = (build(&takes, &c, None).unwrap(), build_augmented(&takes, &c, None, &more).unwrap());
    let table: Vec<_> =
        db.segments.iter().map(|s| (s.source, s.units, s.variant.speed, s.variant.gain)).collect();
    let copies = |speed, gain, [a, b]: [u32; 2]| [(0, a, speed, gain), (1, b, speed, gain)];
    let expected = [
        copies(1.0, 0.0, [20, 10]),
        copies(1.0, -6.0, [20, 10]),
        copies(0.8, 0.0, [25, 12]),
        copies(0.8, -6.0, [25, 12]),
    ];
    assert_eq!(table, expected.concat());
    // The recordings are as without copies, whose levels do not move the floor.
    assert_eq!(db.floor_energy, plain.floor_energy);
    assert_eq!((&db.features[..90], &db.audio[..3000]), (&plain.features[..], &plain.audio[..]));
    let of = |segment: usize| &db.channel(0)[db.segments[segment].range().start * 100..][..1000];
    assert!((10.0 * (power(of(2)) / power(of(0))).log10() + 6.0).abs() < 1e-3);
    // Units that differ in level only are one sound.
    let same = db.same_sounds();
    assert_eq!((same.len(), same[30], same[59], same[60], same[97]), (134, 0, 29, 60, 60));
    assert!(plain.same_sounds().is_empty());
    // The speed and the level of the recordings themselves add nothing.
    let own = Augmentation { speeds: vec![1.0, 0.8, 1.0004], gains: vec![0.0, -6.0] };
    assert_eq!(build_augmented(&takes, &c, None, &own).unwrap(), db);
}

#[test]
fn a_copy_at_another_speed_has_its_pitch() {
    let tone: Vec<f32> = (0..8000).map(|i| (std::f32::consts::TAU * i as f32 / 16.0).sin()).collect();
    let spans = [1000..3000, 5000..8000];
    let takes = [Take { spans: Some(spans.to_vec()), ..take(vec![tone]) }];
    let more = Augmentation { speeds: vec![1.25], gains: Vec::new() };
    let db = build_augmented(&takes, &cloth(), None, &more).unwrap();
    let table: Vec<_> = db.segments.iter().map(|s| (s.units, s.offset)).collect();
    assert_eq!(table, [(20, 1000), (30, 5000), (16, 1000), (24, 5000)]);
    let crossings = |x: &[f32]| x.windows(2).filter(|w| w[0] < 0.0 && w[1] >= 0.0).count();
    let of = |segment: usize| &db.channel(0)[db.segments[segment].range().start * 100..][..1600];
    assert_eq!((crossings(of(0)), crossings(of(2))), (100, 125));
}
