use super::*;
use crate::core::feed::Feed;
use crate::core::item::{AnyValue, Channels, Data};
use crate::core::standalone::Standalone;
use crate::core::time::ticks;
use crate::feature::FeatureConventions;
use crate::likeness::statistics::testing::gaussian;
use crate::unit::{Pick, Segment, UnitSource};
use std::sync::Arc;

const UNIT: usize = 200;

/// A database of units of 200 samples of noise at 48 kHz, of two recordings.
fn database() -> UnitDatabase {
    let conventions =
        FeatureConventions { rate: Rate::hz(48_000), unit: UNIT as u32, ..FeatureConventions::trial() };
    let units = 480;
    let features = vec![0.0; units * conventions.dims()];
    let source = |name: &str| UnitSource { provenance: name.into(), ..UnitSource::default() };
    let segment = |start, source| Segment { start, units: 240, source, ..Segment::default() };
    UnitDatabase {
        segments: vec![segment(0, 0), segment(240, 1)],
        sources: vec![source("folder/a.wav"), source("folder/b.wav")],
        audio: gaussian(units * UNIT, 1),
        unfiltered: features.clone(),
        features,
        conventions,
        ..UnitDatabase::trial(&mut Rng::new(1))
    }
}

fn pick(unit: usize) -> Pick {
    Pick { unit: unit as i32, fallback: false, asleep: false, d1: 0.0, d2: 0.0 }
}

fn report(db: &UnitDatabase, units: &[usize], window: f64) -> (Likeness, ResultTable, Summary) {
    let sound: Vec<f32> = units.iter().flat_map(|k| &db.audio[k * UNIT..(k + 1) * UNIT]).copied().collect();
    let format = PickFormat { channels: 1, conventions: Arc::new(db.conventions.clone()) };
    let picks: Vec<Pick> = units.iter().map(|k| pick(*k)).collect();
    let params = LikenessReportParams { recordings: Vec::new(), unit: None, window: 2.0, threshold: 0.9 };
    let run = Standalone::new::<LikenessReport>(params)
        .input(LikenessReportPorts::audio, Rate::hz(48_000), Channels(1), sound)
        .feed(LikenessReportPorts::picks.index(), Feed::stream::<Picks>(Rate::hz(240), format, picks))
        .feed(LikenessReportPorts::database.index(), Feed::value(AnyValue::new(db.clone())))
        .window(ticks(window))
        .run()
        .unwrap();
    let [likeness, table] = [0, 1].map(|k| run.value(k).unwrap());
    (likeness.get::<Likeness>().unwrap().clone(), table.get::<ResultTable>().unwrap().clone(), run.summary)
}

#[test]
fn joins_and_repeats_of_a_selection_are_found() {
    let db = database();
    // The recordings as they are: joined where the second begins.
    let all: Vec<usize> = (0..480).collect();
    let (found, table, _) = report(&db, &all, 0.1);
    assert_eq!(found.repeats.share, Some(0.0));
    assert_eq!(found.joins.as_ref().unwrap().count, 1);
    assert!((found.lines.as_ref().unwrap().unit_s - 1.0 / 240.0).abs() < 1e-12);
    assert_eq!(found.recordings.iter().map(|t| t.name.as_str()).collect::<Vec<_>>(), ["a.wav", "b.wav"]);
    assert!(found.within_share.unwrap() > 0.9, "{}", found.text());
    assert!(table.csv().contains("third octave,1000,"), "{}", table.csv());
    // A run of 24 units again and again.
    let loops: Vec<usize> = (0..480).map(|k| 100 + k % 24).collect();
    let (found, _, summary) = report(&db, &loops, 0.013);
    assert!(found.repeats.share.unwrap() > 0.9, "{}", found.text());
    assert!((found.repeats.longest[0].lag - 0.1).abs() < 1e-9);
    assert_eq!(found.joins.as_ref().unwrap().count, 19);
    let share = &summary.iter().find(|(name, _)| *name == "repeated_share").unwrap().1;
    assert_eq!(share.as_f64(), found.repeats.share);
    // The report does not depend on the windows.
    assert_eq!(report(&db, &loops, 1.0).0, found);
}

#[test]
fn a_stereo_sound_is_compared_with_files_of_other_rates() {
    let mut files = MemoryFiles::default();
    files.insert("a.wav", trial_wav(&gaussian(22_050, 1), 22_050));
    files.insert("b.wav", trial_wav(&gaussian(22_050, 2), 22_050));
    let stereo = gaussian(48_000, 3).iter().flat_map(|x| [*x, *x]).collect();
    let params = LikenessReportParams {
        recordings: vec!["a.wav".into(), "b.wav".into()],
        unit: Some(UnitLength::Seconds(1, 240)),
        window: 2.0,
        threshold: 0.9,
    };
    let mut standalone = Standalone::new::<LikenessReport>(params);
    standalone.files = files;
    let standalone = standalone.input(LikenessReportPorts::audio, Rate::hz(48_000), Channels(2), stereo);
    let run = standalone.run().unwrap();
    let value = run.value(0).unwrap();
    let found: &Likeness = value.get().unwrap();
    assert_eq!((found.highest_hz, found.sound.seconds, found.recordings.len()), (11_025.0, 1.0, 2));
    assert!(found.lines.is_some() && found.joins.is_none(), "{}", found.text());
    assert!(found.repeats.share == Some(0.0) && found.within_share.is_some());
}

#[test]
fn what_is_missing_is_named() {
    let params = || LikenessReportParams { recordings: Vec::new(), unit: None, window: 2.0, threshold: 0.9 };
    let standalone = || {
        let audio = vec![0.0; 100];
        Standalone::new::<LikenessReport>(params()).input(
            LikenessReportPorts::audio,
            Rate::hz(48_000),
            Channels(1),
            audio,
        )
    };
    let reject = standalone().shape().unwrap_err();
    assert!(reject.code == "F101" && reject.message.contains("no recording"), "{reject}");
}
