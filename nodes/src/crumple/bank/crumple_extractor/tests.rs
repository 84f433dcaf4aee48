use super::*;
use crate::core::params::Datum;
use crate::core::random::Random;
use crate::core::standalone::{Standalone, StandaloneRun};
use crate::crumple::bank::crumple_bank_file::{CrumpleBankFile, CrumpleBankFileParams};

/// `n` decaying bursts of noise, 0.2 s apart.
fn bursts(n: usize, level: f64, rate: u32) -> Vec<u8> {
    let random = Random::new(5, "bursts");
    let period = rate as usize / 5;
    let sample = |k: usize| {
        let t = (k % period) as f64 / f64::from(rate);
        (level * (1.0 + (k / period) as f64) * (-t / 0.01).exp() * (random.uniform(0, k as u64, 0) - 0.5))
            as f32
    };
    trial_wav(&(0..n * period).map(sample).collect::<Vec<_>>(), rate)
}

fn params(recordings: &[&str], more: &[(&str, Datum)]) -> CrumpleExtractorParams {
    let list = Datum::List(recordings.iter().map(|f| Datum::Text((*f).into())).collect());
    let given = |name: &str| match name {
        "recordings" => Some(list.clone()),
        _ => more.iter().find(|(n, _)| *n == name).map(|(_, d)| d.clone()),
    };
    CrumpleExtractorParams::read(&given).unwrap()
}

fn standalone(p: CrumpleExtractorParams) -> Standalone {
    let mut standalone = Standalone::func::<CrumpleExtractor>(p);
    standalone.files.insert("many.wav", bursts(40, 0.02, 48_000));
    standalone.files.insert("few.wav", bursts(5, 0.005, 44_100));
    let hum: Vec<f32> = (0..24_000).map(|k| 0.3 * (0.05 * k as f32).sin()).collect();
    standalone.files.insert("hum.wav", trial_wav(&hum, 48_000));
    standalone.files.insert("text.wav", "no audio");
    standalone
}

fn bank(run: &StandaloneRun) -> CrumpleBank {
    run.value(0).unwrap().get::<CrumpleBank>().unwrap().clone()
}

fn warnings(run: &StandaloneRun) -> Vec<String> {
    run.summary.iter().filter(|(k, _)| *k == "warning").map(|(_, v)| v.to_string()).collect()
}

#[test]
fn recordings_become_a_bank_that_is_read_back_from_its_file() {
    let run =
        standalone(params(&["many.wav", "few.wav"], &[("threshold", Datum::Float(1e-7))])).run().unwrap();
    let found = bank(&run);
    assert_eq!((found.len(), found.fs, found.recordings[1].fs), (45, 48_000.0, 44_100.0));
    assert!(warnings(&run).is_empty(), "{:?}", run.summary);
    assert!(crate::core::item::Data::plot(&found).unwrap().contains("45 samples"));
    let value = run.value(0).unwrap();
    let json = value.json();
    let mut file = Standalone::func::<CrumpleBankFile>(CrumpleBankFileParams { path: "b.json".into() });
    file.files.insert("b.json", json.clone());
    assert_eq!(bank(&file.run().unwrap()), found);
    for (from, to, part) in [
        ("\"version\": 1", "\"version\": 7", "`version` is 7"),
        ("\"window\": 0.02", "\"window\": 0.03", "`conventions`"),
        ("\"material\"", "\"colour\"", "unknown field"),
    ] {
        file.files.insert("b.json", json.replace(from, to));
        let reject = file.shape().unwrap_err();
        assert!(reject.code == "F106" && reject.message.contains(part), "{reject}");
    }
}

#[test]
fn a_file_with_changed_samples_is_refused() {
    let bank = crate::crumple::bank::trial_bank();
    let mut file = Standalone::func::<CrumpleBankFile>(CrumpleBankFileParams { path: "b.json".into() });
    let mut read = |bank: &CrumpleBank| {
        file.files.insert("b.json", serde_json::to_string(bank).unwrap());
        file.shape().map(|_| ()).map_err(|reject| (reject.code, reject.message))
    };
    assert_eq!(read(&bank), Ok(()));
    let mut other = bank.clone();
    other.samples[3] *= 0.5;
    let (code, message) = read(&other).unwrap_err();
    assert!(
        code == "F106" && message.contains("`content`") && message.contains("extract it again"),
        "{message}"
    );
    // Without the digest a changed bank is accepted.
    assert_eq!(read(&CrumpleBank { content: String::new(), ..other }), Ok(()));
}

#[test]
fn few_samples_and_a_low_threshold_give_warnings() {
    let run = standalone(params(&["hum.wav"], &[])).run().unwrap();
    let found = warnings(&run);
    assert!(
        found.len() == 2 && found[0].contains("with fewer than 30") && found[1].contains("too low"),
        "{found:?}"
    );
}

#[test]
fn levels_are_matched_on_request() {
    let loudest = |matched| {
        let p = params(
            &["many.wav", "few.wav"],
            &[("threshold", Datum::Float(1e-7)), ("match_levels", Datum::Bool(matched))],
        );
        let found = bank(&standalone(p).run().unwrap());
        let few = found.origins.iter().zip(&found.energies).filter(|(o, _)| o.recording == 1);
        few.map(|(_, e)| *e).fold(0.0, f64::max) / found.energies[found.len() - 1]
    };
    assert!(
        loudest(false) < 0.01 && (loudest(true) - 1.0).abs() < 0.1,
        "{} {}",
        loudest(false),
        loudest(true)
    );
}

#[test]
fn errors_name_the_recording_or_the_parameter() {
    let reject = standalone(params(&["many.wav", "text.wav"], &[])).shape().unwrap_err();
    assert!(reject.code == "F077" && reject.message.contains("text.wav"), "{reject}");
    assert_eq!(standalone(params(&[], &[])).shape().unwrap_err().code, "F077");
    assert_eq!(standalone(params(&["gone.wav"], &[])).shape().unwrap_err().code, "F060");
    assert_eq!(
        standalone(params(&["many.wav"], &[("rate", Datum::Int(10))])).shape().unwrap_err().code,
        "F106"
    );
    let fault = standalone(params(&["few.wav"], &[("threshold", Datum::Float(0.5))])).run().err().unwrap();
    assert!(fault.code == "F077" && fault.message.contains("the loudest has"), "{fault}");
}
