use super::*;
use crate::core::item::Data;
use crate::core::params::Datum;
use crate::core::standalone::{Standalone, StandaloneRun};
use crate::io::trial_wav;

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
    assert_eq!(bell.phase_drifts.len(), bell.features.len());
    assert!(bell.phase_drifts.iter().all(|d| d.is_some_and(|d| d < 0.02)), "{:?}", bell.phase_drifts);
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

/// A run with files by name and parameters.
fn run_files(
    files: &[(&str, Vec<u8>)],
    given: &[(&'static str, Datum)],
) -> Result<(FeatureSets, ExtractionReport, String), Fault> {
    let find = |name: &str| given.iter().find(|(n, _)| *n == name).map(|(_, d)| d.clone());
    let mut standalone = Standalone::func::<ModalFeatures>(ModalFeaturesParams::read(&find).unwrap());
    for (name, bytes) in files {
        standalone.files.insert(*name, bytes.clone());
    }
    let run = standalone.run()?;
    let sets = run.value(0).unwrap().get::<FeatureSets>().unwrap().clone();
    let report = run.value(1).unwrap().get::<ExtractionReport>().unwrap().clone();
    let texts = run.summary.iter().filter(|(k, _)| *k == "warning").map(|(_, t)| t.to_string());
    Ok((sets, report, texts.collect::<Vec<_>>().join("\n")))
}

fn text(text: &str) -> Datum {
    Datum::Text(text.into())
}

fn wav(sound: &[f32]) -> Vec<u8> {
    trial_wav(sound, 44_100)
}

const QUICK: [(&str, Datum); 2] = [("surrogate", Datum::Bool(false)), ("count", Datum::Int(12))];

#[test]
fn a_manifest_names_object_and_support_and_a_folder_is_read_in_order() {
    let list = b"file,object,material,support\n../b.wav,plate,steel,fingers\na.wav,cup,clay,foam\n".to_vec();
    let knock = wav(&ring(&[2000])[..30_000]);
    let files =
        [("in/takes.csv", list), ("in/a.wav", knock.clone()), ("b.wav", knock), ("in/notes.txt", vec![1])];
    let mut given = QUICK.to_vec();
    given.push(("manifest", text("in/takes.csv")));
    let (sets, report, _) = run_files(&files, &given).unwrap();
    let named: Vec<[&str; 3]> =
        sets.sets.iter().map(|s| [s.recording.as_str(), &s.object, &s.support]).collect();
    assert_eq!(named, [["b.wav", "plate", "fingers"], ["in/a.wav", "cup", "foam"]]);
    assert!(report.pairs.is_empty() && report.recordings[1].take.material == "clay");
    let points = crate::material::Gate::default().points(&sets.sets);
    assert_eq!(points.supports[1].as_deref(), Some("cup: foam"));

    // One material of the manifest, and the folder; one object, so that the takes are compared.
    given.extend([("material", text("steel")), ("folder", text("in")), ("object", text("plate"))]);
    let (sets, report, warnings) = run_files(&files, &given).unwrap();
    let names: Vec<&str> = sets.sets.iter().map(|s| s.recording.as_str()).collect();
    assert_eq!((names, report.pairs.len()), (vec!["in/a.wav", "b.wav"], 1));
    assert!(report.recordings[0].by_other_takes_db.unwrap() < -30.0, "{warnings}");
    given[3].1 = text("oak");
    let fault = run_files(&files, &given).err().unwrap();
    assert!(fault.message.contains("no take of the material \"oak\""), "{fault:?}");
    assert!(fault.help.unwrap().contains("\"clay\", \"steel\""));
}

#[test]
fn wrong_lists_and_folders_are_named() {
    let wrong = |files: &[(&str, Vec<u8>)], field: &'static str, path: &str| {
        let fault = run_files(files, &[(field, text(path))]).err().unwrap();
        (fault.code, fault.field.unwrap_or_default(), fault.message)
    };
    let (code, field, message) = wrong(&[("t.csv", b"file,object\n,plate\n".to_vec())], "manifest", "t.csv");
    assert_eq!((code, field.as_str()), ("F077", "manifest"));
    assert!(message.starts_with("\"t.csv\": line 2, column `file`: \"\""), "{message}");
    let (code, field, message) = wrong(&[("t.csv", b"file\nnone.wav\n".to_vec())], "manifest", "t.csv");
    assert!((code, field.as_str()) == ("F060", "manifest") && message.contains("none.wav"), "{message}");
    let (code, _, message) = wrong(&[("in/notes.txt", vec![1])], "folder", "in");
    assert!(code == "F077" && message.contains("1 files, none of which is a recording"), "{message}");
    assert_eq!(wrong(&[], "folder", "in").0, "F060");
    let fault = run_files(&[], &[]).err().unwrap();
    assert!(fault.message == "there is no recording" && fault.help.unwrap().contains("manifest"));
}

#[test]
fn unusable_recordings_are_an_error_that_names_all_or_are_left_out() {
    let files = [
        ("in/a.wav", wav(&vec![0.0; 20_000])),
        ("in/b.wav", wav(&ring(&[2000])[..30_000])),
        ("in/c.wav", wav(&ring(&[0])[..500])),
        ("in/d.wav", wav(&ring(&[2000, 30_000]))),
    ];
    let mut given = QUICK.to_vec();
    given.push(("folder", text("in")));
    let fault = run_files(&files, &given).err().unwrap();
    for part in
        ["\"in/a.wav\": the recording is silent; ", "in/c.wav", "at least 1024", "\"in/d.wav\": 2 impacts"]
    {
        assert!(fault.message.contains(part), "{part}: {fault:?}");
    }
    assert!(fault.help.unwrap().contains("microphone"));
    given.push(("unusable", Datum::Name("Skip".into())));
    let (sets, report, warnings) = run_files(&files, &given).unwrap();
    assert_eq!((sets.sets.len(), report.unusable.len()), (1, 3));
    assert!(warnings.contains("in/a.wav") && warnings.contains("left out"), "{warnings}");
    // None is left.
    let fault = run_files(&files[..1], &given).err().unwrap();
    assert!(fault.message.contains("silent"), "{fault:?}");
}

#[test]
fn both_extractors_measure_a_bell_and_a_room_is_taken_out() {
    let knock = [("a.wav", wav(&ring(&[2000])))];
    for extractor in ["Subband", "Greedy"] {
        let mut given = QUICK.to_vec();
        let list = Datum::List(vec![text("a.wav")]);
        given.extend([("extractor", Datum::Name(extractor.into())), ("recordings", list)]);
        let (sets, ..) = run_files(&knock, &given).unwrap();
        for (f, d) in MODES {
            let near = sets.sets[0].features.iter().find(|q| (q.freq_hz - f).abs() < 0.5).unwrap();
            assert!((near.decay / d - 1.0).abs() < 0.01, "{extractor}: {near:?}");
        }
        // A room of 0.2 s hides what decays at 0.6 of 34.5 1/s or faster.
        let band = Datum::List(vec![Datum::List(vec![Datum::Float(1000.0), Datum::Float(0.2)])]);
        given.push(("room", band));
        let (sets, _, warnings) = run_files(&knock, &given).unwrap();
        assert!(sets.sets[0].features.iter().all(|f| f.decay < 20.8), "{:?}", sets.sets);
        assert!(sets.sets[0].features.len() >= 3 && warnings.contains("decay like the room"), "{warnings}");
    }
}
