use super::*;
use crate::core::params::Datum;
use crate::core::standalone::Standalone;
use crate::unit::database::file::MARK;
use crate::unit::database::unit_database_file::{UnitDatabaseFile, UnitDatabaseFileParams};

fn standalone(files: &[&str]) -> Standalone {
    let list = Datum::List(files.iter().map(|f| Datum::Text((*f).into())).collect());
    let tags = Datum::List(vec![Datum::Text("cotton".into())]);
    let get = |name: &str| match name {
        "recordings" => Some(list.clone()),
        "tags" => Some(tags.clone()),
        "augment" => Some(Datum::Bool(false)),
        _ => None,
    };
    let mut standalone = Standalone::func::<UnitDatabaseNode>(UnitDatabaseParams::read(&get).unwrap());
    let wave = |i: usize| (0.05 * i as f32).sin() * 0.5;
    standalone.files.insert("a.wav", trial_wav(&(0..24_000).map(wave).collect::<Vec<_>>(), 48_000));
    standalone
        .files
        .insert("half.wav", trial_wav(&(0..12_000).map(|i| wave(2 * i)).collect::<Vec<_>>(), 24_000));
    standalone.files.insert("short.wav", trial_wav(&[0.1; 50], 48_000));
    standalone.files.insert("text.wav", "no audio");
    standalone
}

#[test]
fn recordings_of_any_rate_become_units_and_survive_their_file() {
    let value = standalone(&["a.wav", "half.wav"]).run().unwrap().value(0).unwrap();
    let db = value.get::<UnitDatabase>().unwrap();
    assert_eq!((db.len(), db.segments.len(), db.sources[1].tag.as_str()), (240, 2, "cotton"));
    // The same wave at either rate.
    let (a, b) = db.channel(0).split_at(24_000);
    assert!((5000..20_000).all(|i| (a[i] - b[i]).abs() < 1e-3));
    let bytes = db.to_bytes().unwrap();
    assert_eq!(&UnitDatabase::from_bytes(&bytes).unwrap(), db);
    let mut other = bytes.clone();
    other[MARK.len()] = 9;
    assert!(UnitDatabase::from_bytes(&other).unwrap_err().contains("version 9"));
    let mut other = bytes.clone();
    other[MARK.len() + 10] ^= 1;
    assert!(UnitDatabase::from_bytes(&other).unwrap_err().contains("hash"));
    // A sample that was changed by hand.
    let mut other = bytes.clone();
    let middle = other.len() / 2;
    other[middle] ^= 1;
    assert!(UnitDatabase::from_bytes(&other).unwrap_err().contains("was changed"));
    assert!(
        UnitDatabase::from_bytes(&bytes[..bytes.len() - 9]).is_err()
            && UnitDatabase::from_bytes(b"x").is_err()
    );
}

#[test]
fn recordings_are_known_by_what_they_hold_and_not_by_their_names() {
    let mut other = standalone(&["a.wav", "copy.wav", "louder.wav", "faster.wav"]);
    let wave = |gain: f32| (0..24_000).map(|i| gain * (0.05 * i as f32).sin()).collect::<Vec<_>>();
    other.files.insert("copy.wav", trial_wav(&wave(0.5), 48_000));
    other.files.insert("louder.wav", trial_wav(&wave(0.6), 48_000));
    other.files.insert("faster.wav", trial_wav(&wave(0.5), 44_100));
    let value = other.run().unwrap().value(0).unwrap();
    let of: Vec<&str> =
        value.get::<UnitDatabase>().unwrap().sources.iter().map(|s| s.content.as_str()).collect();
    assert!(of[0].len() == 16 && of[1] == of[0] && of[2] != of[0] && of[3] != of[0], "{of:?}");
}

#[test]
fn a_database_from_its_file_is_the_one_that_was_built() {
    let value = standalone(&["a.wav"]).run().unwrap().value(0).unwrap();
    let mut file = Standalone::func::<UnitDatabaseFile>(UnitDatabaseFileParams { path: "a.bin".into() });
    let bytes = (value.kind().file)(&value).unwrap();
    file.files.insert("a.bin", bytes.clone());
    let again = file.run().unwrap().value(0).unwrap();
    assert_eq!((again.hash(), again.get::<UnitDatabase>()), (value.hash(), value.get::<UnitDatabase>()));
    file.files.insert("a.bin", bytes[..bytes.len() - 100].to_vec());
    assert!(file.run().err().unwrap().message.contains("damaged"));
    file.files.insert("a.bin", "RIFF or whatever".to_owned());
    let reject = file.shape().unwrap_err();
    assert!(reject.code == "F101" && reject.message.contains("a.bin"), "{reject}");
}

#[test]
fn what_is_no_recording_or_holds_no_unit_is_named() {
    let reject = standalone(&["a.wav", "text.wav"]).shape().unwrap_err();
    assert!(reject.code == "F101" && reject.message.contains("text.wav"), "{reject}");
    assert_eq!(standalone(&[]).shape().unwrap_err().code, "F101");
    let fault = standalone(&["short.wav"]).run().err().unwrap();
    assert!(fault.code == "F101" && fault.message.contains("200 samples"), "{fault}");
}

#[test]
fn oddities_of_recordings_are_reported() {
    let mut cut = standalone(&["a.wav"]);
    let whole = trial_wav(&[0.25; 24_000], 48_000);
    cut.files.insert("a.wav", whole[..whole.len() / 2].to_vec());
    let notes = cut.shape().unwrap().notes;
    assert!(
        !notes.is_empty() && notes[0].contains("a.wav") && notes[0].contains("the header states"),
        "{notes:?}"
    );
    let warned = |standalone: &Standalone| {
        let run = standalone.run().unwrap();
        run.summary.iter().filter(|(k, _)| *k == "warning").map(|(_, v)| v.to_string()).collect::<Vec<_>>()
    };
    assert!(warned(&standalone(&["a.wav"])).is_empty());
    let mut silent = standalone(&["a.wav"]);
    silent.files.insert("a.wav", trial_wav(&[0.0; 24_000], 48_000));
    let reported = warned(&silent);
    assert!(reported.len() == 1 && reported[0].contains("silent"), "{reported:?}");
}

#[test]
fn short_recordings_have_copies_unless_they_are_not_wanted() {
    let params = |augment: Option<bool>| {
        let list = Datum::List(vec![Datum::Text("a.wav".into())]);
        let read = UnitDatabaseParams::read(&|name| (name == "recordings").then(|| list.clone())).unwrap();
        UnitDatabaseParams { augment, rate: Rate::hz(4000), ..read }
    };
    let segments = |augment, seconds: usize| {
        let mut node = Standalone::func::<UnitDatabaseNode>(params(augment));
        node.files.insert("a.wav", trial_wav(&vec![0.1; 4000 * seconds], 4000));
        let value = node.run().unwrap().value(0).unwrap();
        value.get::<UnitDatabase>().unwrap().segments.len()
    };
    assert_eq!([segments(None, 2), segments(Some(false), 2)], [9, 1]);
    assert_eq!([segments(None, 31), segments(Some(true), 31)], [1, 9]);
}
