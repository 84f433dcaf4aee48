//! From correspondences to their diagnosis, and to proposals for more.

use super::*;
use crate::warp::diagnostics::correspondence_diagnostics::{
    CorrespondenceDiagnostics, CorrespondenceDiagnosticsParams, CorrespondenceDiagnosticsPorts,
};
use crate::warp::diagnostics::diagnosis::Diagnosis;
use crate::warp::suggestion::correspondence_suggester::{
    CorrespondenceSuggester, CorrespondenceSuggesterParams, CorrespondenceSuggesterPorts,
};

/// A set whose seventh correspondence is the wrong moment of the recording.
fn slipped() -> CorrespondenceSet {
    let mut set = marked();
    set.pairs[6].database = 0.1;
    set.pairs[6].label = "slip".into();
    set
}

fn diagnosed(p: CorrespondenceDiagnosticsParams, db: UnitDatabase, set: CorrespondenceSet) -> Standalone {
    let features = (0..UNITS).flat_map(target).collect();
    Standalone::new::<CorrespondenceDiagnostics>(p)
        .input(CorrespondenceDiagnosticsPorts::features, Rate::hz(240), format(1), features)
        .value(CorrespondenceDiagnosticsPorts::database, db)
        .value(CorrespondenceDiagnosticsPorts::pairs, set)
}

fn diagnostics() -> CorrespondenceDiagnosticsParams {
    let p = CorrespondenceDiagnosticsParams::read(&|_| None).unwrap();
    CorrespondenceDiagnosticsParams { lambda: Some(1.0), ..p }
}

#[test]
fn a_correspondence_that_leads_astray_is_named_first_with_its_place_and_times() {
    let run = diagnosed(diagnostics(), database(), slipped()).run().unwrap();
    let found = run.value(0).unwrap().get::<Diagnosis>().unwrap().clone();
    let channel = &found.channels[0];
    let suspect = &channel.verdicts[0];
    assert_eq!((suspect.label.as_str(), suspect.rank, suspect.correspondence), ("slip", 1, 6), "{found:?}");
    assert!(suspect.ranges.iter().any(|[from, to]| *from <= 1.82 && *to >= 1.88), "{:?}", suspect.ranges);
    assert!(suspect.delta_fallback < 0.0 || suspect.delta_folds < 0.0, "{suspect:?}");
    assert!(channel.verdicts.len() == 12 && channel.degrees_of_freedom > 4.0);
    let text = &found.text()[0];
    assert!(text.contains("\"slip\" at set.ron:1:") && text.contains("move it"), "{text}");
    // One flat record of each, as programs read it.
    let json = serde_json::to_value(suspect).unwrap();
    for field in ["label", "score", "rank", "conflicts", "ranges", "delta_fallback", "delta_folds"] {
        assert!(json.get(field).is_some(), "{field}");
    }
    // The note of the run names it too, and there is none where nothing can hurt.
    let noted = |set| {
        let run = diagnosed(diagnostics(), database(), set).run().unwrap();
        let notes = run.summary.into_iter().filter(|(key, _)| *key == "warning");
        notes.map(|(_, text)| text.as_str().unwrap_or_default().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(noted(slipped()), std::slice::from_ref(text));
    assert_eq!(noted(set("(pairs: [])")), Vec::<String>::new());
    let good = diagnosed(diagnostics(), database(), marked()).run().unwrap();
    let good = good.value(0).unwrap().get::<Diagnosis>().unwrap().clone();
    assert!(good.channels[0].verdicts[0].score < 0.1 * suspect.score, "{good:?}");
}

#[test]
fn the_worst_range_is_written_with_and_without_the_suspect() {
    let mut db = database();
    db.audio = (0..UNITS * 400).map(|k| (k / 400) as f32 / UNITS as f32).collect();
    let paths = |p| CorrespondenceDiagnosticsParams {
        with: Some("with.wav".into()),
        without: Some("without.wav".into()),
        ..p
    };
    let standalone = diagnosed(paths(diagnostics()), db.clone(), slipped());
    let run = standalone.run().unwrap();
    let found = run.value(0).unwrap().get::<Diagnosis>().unwrap().clone();
    let length = |[from, to]: &[f64; 2]| to - from;
    let longest = found.channels[0].verdicts[0].ranges.iter().map(length).fold(0.0, f64::max);
    let clip = |standalone: &Standalone, path: &str| -> Vec<f32> {
        let bytes = standalone.outputs.get(path).unwrap();
        let mut reader = hound::WavReader::new(std::io::Cursor::new(bytes)).unwrap();
        reader.samples::<f32>().map(Result::unwrap).collect()
    };
    let (with, without) = (clip(&standalone, "with.wav"), clip(&standalone, "without.wav"));
    assert!(with.len() == without.len() && with.len() as f64 >= longest * 96_000.0, "{longest}");
    let differs = with.iter().zip(&without).filter(|(a, b)| a != b).count();
    assert!(differs * 3 > with.len(), "{differs} of {}", with.len());
    // Without a suspect there is no sound.
    let standalone = diagnosed(paths(diagnostics()), db, set("(pairs: [])"));
    standalone.run().unwrap();
    assert_eq!(clip(&standalone, "with.wav").len(), 0);
}

#[test]
fn proposals_are_written_so_that_they_can_be_read_and_fitted() {
    let p = CorrespondenceSuggesterParams { count: 5, lambda: 100.0, ..suggester() };
    let features = (0..UNITS).flat_map(target).collect();
    let standalone = Standalone::new::<CorrespondenceSuggester>(p)
        .input(CorrespondenceSuggesterPorts::features, Rate::hz(240), format(1), features)
        .value(CorrespondenceSuggesterPorts::database, database());
    standalone.run().unwrap();
    let text = String::from_utf8(standalone.outputs.get("new.ron").unwrap()).unwrap();
    let set = set(&text);
    assert_eq!((set.length, set.database.as_str()), (Some(4.0), "drag.wav"), "what it was made of");
    assert!((2..=5).contains(&set.pairs.len()) && set.pairs[0].label.starts_with("gain"), "{text}");
    let warp = fit(TpsFitParams { lambda: Some(100.0), ..params() }, set, 1).run().unwrap().value(0).unwrap();
    let before: Vec<f32> = (0..UNITS).flat_map(target).collect();
    let after = apply(warp.get::<Warp>().unwrap().clone(), 1, TICKS_PER_SECOND);
    assert!(error(&after, 1) < 0.5 * error(&before, 1), "{} {text}", error(&after, 1));
}

#[test]
fn only_recordings_of_the_tags_are_proposed() {
    let mut db = database();
    let half = UNITS as u32 / 2;
    db.sources =
        ["cotton", "nylon"].map(|tag| UnitSource { tag: tag.into(), ..UnitSource::default() }).into();
    db.segments =
        [0, 1].map(|k| Segment { start: k * half, units: half, source: k, ..Segment::default() }).into();
    let standalone = |tag: &str| {
        let p = CorrespondenceSuggesterParams { count: 4, all: true, tags: vec![tag.into()], ..suggester() };
        Standalone::new::<CorrespondenceSuggester>(p)
            .input(
                CorrespondenceSuggesterPorts::features,
                Rate::hz(240),
                format(1),
                (0..UNITS).flat_map(target).collect(),
            )
            .value(CorrespondenceSuggesterPorts::database, db.clone())
    };
    for (k, tag) in (0..).zip(["cotton", "nylon"]) {
        let standalone = standalone(tag);
        standalone.run().unwrap();
        let set = set(&String::from_utf8(standalone.outputs.get("new.ron").unwrap()).unwrap());
        assert_eq!(set.pairs.len(), 4);
        assert!(set.pairs.iter().all(|c| c.source == Some(SourceName::Index(k))), "{tag}: {set:?}");
    }
    let reject = standalone("linen").shape().unwrap_err();
    assert!(reject.field.as_deref() == Some("tags") && reject.to_string().contains("linen"), "{reject}");
}

#[test]
fn causes_of_a_target_are_heard_at_the_rate_of_its_units_alone() {
    use crate::core::item::Channels;
    // The first half of the target is friction, the second crumpling; so are two recordings.
    let mut db = database();
    db.sources =
        ["friction", "crumple"].map(|tag| UnitSource { tag: tag.into(), ..UnitSource::default() }).into();
    let half = UNITS as u32 / 2;
    db.segments =
        [0, 1].map(|k| Segment { start: k * half, units: half, source: k, ..Segment::default() }).into();
    let suggested = |rate: u32, window: i64| {
        let p = CorrespondenceSuggesterParams { count: 8, lambda: 100.0, ..suggester() };
        let features = (0..UNITS).flat_map(|unit| target(unit % (UNITS / 2))).collect();
        let part = |first: bool| {
            (0..UNITS * 400).map(|k| f32::from(u8::from((k < UNITS * 200) == first))).collect::<Vec<_>>()
        };
        Standalone::new::<CorrespondenceSuggester>(p)
            .input(CorrespondenceSuggesterPorts::features, Rate::hz(240), format(1), features)
            .value(CorrespondenceSuggesterPorts::database, db.clone())
            .optional(CorrespondenceSuggesterPorts::friction, Rate::hz(rate), Channels(1), part(true))
            .optional(CorrespondenceSuggesterPorts::crumple, Rate::hz(rate), Channels(1), part(false))
            .window(window)
    };
    let of = |window: i64| {
        let standalone = suggested(96_000, window);
        standalone.run().unwrap();
        String::from_utf8(standalone.outputs.get("new.ron").unwrap()).unwrap()
    };
    let text = of(TICKS_PER_SECOND);
    let set = set(&text);
    assert!(set.pairs.len() >= 2);
    for pair in &set.pairs {
        // Units that are half of each may be either.
        let mixed = (pair.target - 2.0).abs() < 0.11;
        let source = SourceName::Index(u32::from(pair.target >= 2.0));
        assert!(mixed || pair.source == Some(source), "{text}");
    }
    assert_eq!(of(ticks(0.0137)), text, "windows change nothing");
    let reject = suggested(48_000, TICKS_PER_SECOND).shape().unwrap_err();
    assert!(reject.field.as_deref() == Some("friction") || reject.message.contains("friction"), "{reject}");
}

fn suggester() -> CorrespondenceSuggesterParams {
    let read = CorrespondenceSuggesterParams::read(&|name| {
        (name == "path").then(|| crate::core::params::Datum::Text("new.ron".into()))
    });
    read.unwrap()
}
