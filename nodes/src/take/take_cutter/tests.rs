use super::*;
use crate::core::params::Datum;
use crate::core::standalone::Standalone;

const RATE: u32 = 8000;

/// Noise at levels in dB for a time in seconds each.
fn noise(parts: &[(f64, f64)]) -> Vec<f32> {
    let mut rng = Rng::new(7);
    let mut out = Vec::new();
    for &(seconds, db) in parts {
        let peak = 3f64.sqrt() * 10f64.powf(db / 20.0);
        out.extend((0..(seconds * f64::from(RATE)) as usize).map(|_| rng.between(-peak, peak) as f32));
    }
    out
}

fn rustles() -> Vec<f32> {
    noise(&[
        (0.6, -70.0),
        (0.4, -30.0),
        (0.6, -70.0),
        (0.5, -20.0),
        (0.02, -70.0),
        (0.02, -30.0),
        (0.6, -70.0),
    ])
}

fn cutter(files: &[(&str, Vec<f32>)]) -> Standalone {
    let list = Datum::List(files.iter().map(|(name, _)| Datum::Text((*name).into())).collect());
    let read = |name: &str| match name {
        "recordings" => Some(list.clone()),
        _ => None,
    };
    let p = TakeCutterParams { rate: Rate::hz(RATE), ..TakeCutterParams::read(&read).unwrap() };
    standalone(p, files)
}

fn standalone(p: TakeCutterParams, files: &[(&str, Vec<f32>)]) -> Standalone {
    let mut standalone = Standalone::func::<TakeCutter>(p);
    for (name, samples) in files {
        standalone.files.insert(*name, trial_wav(samples, RATE));
    }
    standalone
}

fn warnings(summary: &Summary) -> Vec<String> {
    summary.iter().filter(|(name, _)| *name == "warning").map(|(_, text)| text.to_string()).collect()
}

#[test]
fn takes_are_cut_and_what_is_dropped_is_reported() {
    let offset: Vec<f32> = rustles().iter().map(|x| x + 0.3).collect();
    let run = cutter(&[
        ("a.wav", rustles()),
        ("dc.wav", offset),
        ("silent.wav", vec![0.0; 8000]),
        ("room.wav", noise(&[(1.0, -40.0)])),
        ("crack.wav", noise(&[(0.5, -70.0), (0.01, -20.0), (0.5, -70.0)])),
    ])
    .run()
    .unwrap();
    let value = run.value(0).unwrap();
    let takes = value.get::<Takes>().unwrap();
    let count: Vec<usize> = takes.recordings.iter().map(|r| r.takes.len()).collect();
    assert_eq!(count, [2, 2, 0, 1, 0]);
    // A constant offset changes nothing but the first samples of the filter.
    let [a, dc] = [0, 1].map(|k| takes.recordings[k].takes[1].clone());
    assert_eq!((a.start, a.end), (dc.start, dc.end));
    let texts = warnings(&run.summary);
    let about = |name: &str| texts.iter().filter(|text| text.contains(name)).cloned().collect::<Vec<_>>();
    assert!(about("silent.wav").len() == 1 && about("silent.wav")[0].contains("is dropped"), "{texts:?}");
    assert!(about("room.wav")[0].contains("steady noise"), "{texts:?}");
    assert!(about("crack.wav")[0].contains("`min_len` 0.1 s"), "{texts:?}");
    assert!(about("a.wav").is_empty(), "{texts:?}");
}

#[test]
fn recordings_of_different_gains_are_brought_to_one_level() {
    let soft: Vec<f32> = rustles().iter().map(|x| 0.05 * x).collect();
    let files = [("a.wav", rustles()), ("b.wav", soft)];
    let p = TakeCutterParams {
        recordings: vec!["a.wav".into(), "b.wav".into()],
        rate: Rate::hz(RATE),
        level: Some(-25.0),
        ..TakeCutterParams::read(&|_| None).unwrap()
    };
    let run = standalone(p, &files).run().unwrap();
    let value = run.value(0).unwrap();
    let takes = value.get::<Takes>().unwrap();
    for recording in &takes.recordings {
        let level = loudest_level(&recording.channels, &recording.takes, takes.rate.as_f64(), 0.01).unwrap();
        assert!((level + 25.0).abs() < 0.05, "{level}");
    }
    assert!((takes.recordings[1].gain / takes.recordings[0].gain - 20.0).abs() < 0.1);
}

#[test]
fn takes_at_another_rate_lie_at_the_same_times() {
    let run = cutter(&[("a.wav", rustles())]).run().unwrap();
    let value = run.value(0).unwrap();
    let takes = value.get::<Takes>().unwrap();
    let other = takes.at_rate(Rate::hz(12_000)).unwrap();
    for (a, b) in takes.recordings[0].takes.iter().zip(&other.recordings[0].takes) {
        assert!((a.start as f64 / 8000.0 - b.start as f64 / 12_000.0).abs() < 1e-4, "{a:?} {b:?}");
        assert!((a.end as f64 / 8000.0 - b.end as f64 / 12_000.0).abs() < 1e-4);
    }
    // Outside of the takes nothing is left.
    let gated = takes.recordings[0].gated_mono();
    let inside: usize = takes.recordings[0].takes.iter().map(ExactSizeIterator::len).sum();
    assert!(gated.iter().filter(|x| **x != 0.0).count() <= inside && inside > 6000, "{inside}");
}

#[test]
fn wrong_parameters_and_recordings_without_a_take_are_errors() {
    let none = standalone(TakeCutterParams::read(&|_| None).unwrap(), &[]);
    assert_eq!(none.shape().unwrap_err().code, "F101");
    let p = TakeCutterParams {
        recordings: vec!["a.wav".into()],
        open: 3.0,
        close: 5.0,
        ..TakeCutterParams::read(&|_| None).unwrap()
    };
    let reject = standalone(p, &[("a.wav", rustles())]).shape().unwrap_err();
    assert!(reject.message.contains("above `open`"), "{reject}");
    let fault = cutter(&[("a.wav", vec![0.0; 4000])]).run().err().unwrap();
    assert!(fault.to_string().contains("no recording has a take"), "{fault}");
}
