use super::*;
use crate::core::item::{AnyValue, Channels};
use crate::core::params::Datum;
use crate::core::standalone::{Feed, Standalone};
use crate::core::time::Rate;
use crate::unit::{Take, build};

fn params(own: &[(&str, Datum)]) -> MfccParams {
    let get = |name: &str| own.iter().find(|(n, _)| *n == name).map(|(_, datum)| datum.clone());
    MfccParams::read(&get).unwrap()
}

fn noise(seed: u64, n: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    (0..n).map(|i| rng.between(-0.5, 0.5) as f32 * (0.1 + (i as f32 * 0.003).sin().abs())).collect()
}

fn standalone(own: &[(&str, Datum)], channels: u16, audio: Vec<f32>) -> Standalone {
    Standalone::new::<Mfcc>(params(own)).input(MfccPorts::audio, Rate::hz(48_000), Channels(channels), audio)
}

#[test]
fn a_stream_has_the_features_of_the_database() {
    let audio = noise(1, 4000);
    let run = standalone(&[], 1, audio.clone()).run().unwrap();
    let found = run.stream(MfccPorts::features);
    let c = params(&[]).convention_params(&[], false).conventions(Rate::hz(48_000), 1).unwrap();
    // Without a mean the database subtracts nothing.
    let mean = audio.iter().map(|&x| f64::from(x)).sum::<f64>() / 4000.0;
    let level: Vec<f32> = audio.iter().map(|&x| (f64::from(x) - mean) as f32).collect();
    let db = build(&[Take { channels: vec![level.clone()].into(), ..Take::default() }], &c, None).unwrap();
    let again = standalone(&[], 1, level).run().unwrap().stream(MfccPorts::features);
    assert_eq!(found.len(), 60);
    assert!(again.iter().zip(&db.unfiltered).all(|(a, b)| (a - b).abs() < 1e-3));
}

#[test]
fn a_shift_by_one_unit_shifts_the_features_by_one() {
    let own = [("high_pass", Datum::Int(0))];
    let audio = noise(2, 2000);
    let mut later = vec![0.0; 200];
    later.extend(&audio);
    let (a, b) = (standalone(&own, 1, audio).run().unwrap(), standalone(&own, 1, later).run().unwrap());
    let (a, b) = (a.stream(MfccPorts::features), b.stream(MfccPorts::features));
    assert_eq!(a[..], b[3..]);
}

#[test]
fn channels_are_independent_joint_or_of_their_mean_power() {
    let mono = noise(3, 2000);
    let stereo: Vec<f32> = mono.iter().flat_map(|&x| [x, 0.5 * x]).collect();
    let mode = |name: &str| [("channels", Datum::Name(name.into()))];
    let run = |name: &str| standalone(&mode(name), 2, stereo.clone()).run().unwrap();
    let independent_mono = standalone(&[], 1, mono).run().unwrap().stream(MfccPorts::features);
    let (independent, joint, shared) = (run("Independent"), run("Joint"), run("SharedMid"));
    assert_eq!(independent.stream(MfccPorts::features), joint.stream(MfccPorts::features));
    let left: Vec<f32> =
        independent.stream(MfccPorts::features).chunks(6).flat_map(|item| item[..3].to_vec()).collect();
    assert_eq!(left, independent_mono);
    // The mean power of x and x / 2 is 5/8 of that of x; a channel of the opposite sign has the same power.
    let of_shared = shared.stream(MfccPorts::features);
    let opposite: Vec<f32> = stereo.chunks(2).flat_map(|x| [x[0], -x[1]]).collect();
    let opposite = standalone(&mode("SharedMid"), 2, opposite).run().unwrap().stream(MfccPorts::features);
    assert_eq!(of_shared, opposite);
    assert_eq!(of_shared.len(), independent_mono.len());
    for (shared, own) in of_shared.chunks(3).zip(independent_mono.chunks(3)).skip(1).take(8) {
        let level = 3f32.sqrt() * (5.0 / 8.0f32).ln();
        assert!((shared[0] - own[0] - level).abs() < 1e-3, "{shared:?} {own:?}");
        assert!((shared[1] - own[1]).abs() < 1e-3 && (shared[2] - own[2]).abs() < 1e-3);
    }
    let shape = |name: &str| {
        standalone(&mode(name), 2, stereo.clone()).shape().unwrap().outputs[0].clone().unwrap().text
    };
    assert_eq!([shape("Independent"), shape("Joint")], ["2 channels of vectors of 3", "vectors of 6"]);
}

#[test]
fn a_sine_window_is_two_units_long_and_the_others_one() {
    let frame = |window: &str| {
        let p = params(&[("window", Datum::Name(window.into()))]);
        p.convention_params(&[], false).conventions(Rate::hz(48_000), 1).unwrap().frame
    };
    assert_eq!(["Sine2", "Rect", "Hann"].map(frame), [400, 200, 200]);
}

#[test]
fn with_the_floor_of_the_database_silence_has_the_features_of_its_silence() {
    // Microphone noise at about -70 dB, and a loud part.
    let floor_noise: Vec<f32> = noise(5, 48_000).iter().map(|x| 1e-3 * x).collect();
    let recording = [floor_noise.clone(), noise(6, 48_000), floor_noise].concat();
    let take = || [Take { channels: vec![recording.clone()].into(), ..Take::default() }];
    let floor = |own: &[(&str, Datum)]| {
        let p = params(own);
        let c = p.convention_params(&[], false).conventions(Rate::hz(48_000), 1).unwrap();
        let db = build(&take(), &c, None).unwrap();
        let silence = Standalone::new::<Mfcc>(p)
            .input(MfccPorts::audio, Rate::hz(48_000), Channels(1), vec![0.0; 4000])
            .feed(1, Feed::value(AnyValue::new(db.clone())));
        let silence = silence.run().unwrap().stream(MfccPorts::features)[..3].to_vec();
        // The mean over the first second, which is noise.
        let mean = |d: usize| (20..220).map(|j| db.unfiltered[3 * j + d]).sum::<f32>() / 200.0;
        let distance = (0..3).map(|d| (silence[d] - mean(d)).powi(2)).sum::<f32>().sqrt();
        (silence[0] - 3f32.sqrt() * (db.floor_energy as f32).ln(), distance)
    };
    let (off, near) = floor(&[("floor_from", Datum::Name("Database".into()))]);
    assert!(off.abs() < 1e-4 && near < 6.0, "{off} {near}");
    let (off, far) = floor(&[("floor", Datum::Int(-300))]);
    assert!(off.abs() < 1e-3 && far > 50.0, "{off} {far}");
}

#[test]
fn units_are_whole_samples_at_any_rate() {
    let length = |text: &str, rate| {
        UnitLength::read(&Datum::Text(text.into()), None).map(|u| u.samples(Rate::hz(rate)))
    };
    use crate::core::params::Param;
    use crate::feature::UnitLength;
    assert_eq!(length("1/240", 96_000), Ok(400));
    assert_eq!(length("1/240", 44_100), Ok(184));
    assert_eq!(length("1/60", 96_000), Ok(1600));
    assert_eq!(length("512 samples", 44_100), Ok(512));
    assert!(length("soon", 1).is_err() && length("1/0", 1).is_err() && length("0 samples", 1).is_err());
}

#[test]
fn parameters_that_contradict_each_other_are_refused_by_name() {
    let refused =
        |own: &[(&str, Datum)]| standalone(own, 1, vec![0.0; 10]).shape().unwrap_err().field.unwrap();
    assert_eq!(refused(&[("bands", Datum::Int(2))]), "n");
    assert_eq!(refused(&[("f_lo", Datum::Int(30_000))]), "f_hi");
    assert_eq!(refused(&[("unit", Datum::Text("1/1000000".into()))]), "unit");
    let floor = [("floor_from", Datum::Name("Database".into()))];
    assert_eq!(standalone(&floor, 1, vec![0.0; 400]).run().err().unwrap().field.as_deref(), Some("database"));
}
