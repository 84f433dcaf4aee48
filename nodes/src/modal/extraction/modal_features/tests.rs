use super::*;
use crate::core::item::Data;
use crate::core::params::Datum;
use crate::core::standalone::{Standalone, StandaloneRun};

fn run(sounds: &[Vec<f32>], split: &'static str) -> Result<StandaloneRun, Fault> {
    let names: Vec<String> = (0..sounds.len()).map(|k| format!("{k}.wav")).collect();
    let list = Datum::List(names.iter().map(|n| Datum::Text(n.clone())).collect());
    let p = ModalFeaturesParams::read(&|name| match name {
        "recordings" => Some(list.clone()),
        "split" => Some(Datum::Name(split.into())),
        _ => None,
    })
    .unwrap();
    let mut standalone = Standalone::func::<ModalFeatures>(p);
    for (name, sound) in names.iter().zip(sounds) {
        standalone.files.insert(name, trial_wav(sound, 44_100));
    }
    standalone.run()
}

const MODES: [(f64, f64); 5] =
    [(440.0, 6.0), (1100.0, 9.0), (2500.0, 20.0), (6000.0, 50.0), (11_000.0, 90.0)];

fn ring(onsets: &[usize]) -> Vec<f32> {
    let mode = |t: f64| {
        MODES.iter().map(|(f, d)| (-d * t).exp() * (std::f64::consts::TAU * f * t).cos()).sum::<f64>()
    };
    let sample = |n: usize| {
        let impact = |at: &usize| n.checked_sub(*at).map_or(0.0, |n| 0.1 * mode(n as f64 / 44_100.0));
        onsets.iter().map(impact).sum::<f64>() as f32
    };
    (0..66_150).map(sample).collect()
}

#[test]
fn a_bell_rings_and_noise_does_not() {
    let mut rng = Rng::new(8);
    let thud: Vec<f32> =
        (0..44_100).map(|n| (0.5 * (-f64::from(n) / 900.0).exp() * rng.between(-1.0, 1.0)) as f32).collect();
    let run = run(&[ring(&[2000]), thud], "None").unwrap();
    let report = run.value(1).unwrap().get::<ExtractionReport>().unwrap().clone();
    let [bell, thud] = [&report.recordings[0], &report.recordings[1]];
    assert_eq!((bell.ringing, thud.ringing), (Some(true), Some(false)), "{:?}", thud.surrogate_db);
    let sets = run.value(0).unwrap().get::<FeatureSets>().unwrap().clone();
    for (f, d) in MODES {
        let near = sets.sets[0].features.iter().find(|q| (q.freq_hz - f).abs() < 0.5).unwrap();
        assert!((near.decay / d - 1.0).abs() < 0.01, "{near:?}");
    }
    assert!(report.plot().unwrap().contains("surrogate"));
}

#[test]
fn several_impacts_are_an_error_unless_they_are_split() {
    let sound = ring(&[2000, 30_000]);
    let fault = run(std::slice::from_ref(&sound), "None").err().unwrap();
    assert!(fault.code == "F077" && fault.message.contains("2 impacts, at 0.045 s, 0.680 s"), "{fault:?}");
    let count = |split| {
        let run = run(std::slice::from_ref(&sound), split).unwrap();
        run.value(0).unwrap().get::<FeatureSets>().unwrap().sets.len()
    };
    assert_eq!((count("First"), count("All")), (1, 2));
}

#[test]
fn clipped_and_silent_recordings_are_named() {
    let clipped: Vec<f32> = ring(&[2000]).iter().map(|x| (4.0 * x).clamp(-0.5, 0.5)).collect();
    let run_clipped = run(&[clipped], "None").unwrap();
    assert!(run_clipped.summary.iter().any(|(k, t)| *k == "warning" && t.to_string().contains("clipped")));
    let fault = run(&[vec![0.0; 20_000]], "None").err().unwrap();
    assert!(fault.message.contains("silent"), "{fault:?}");
}
