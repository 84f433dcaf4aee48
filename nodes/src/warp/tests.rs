//! Tests from files to warped features.

mod diagnostics;

use super::correspondence::correspondence_set::{Correspondences, CorrespondencesParams};
use super::fit::tps_fit::{TpsFit, TpsFitParams, TpsFitPorts};
use super::fit::tps_warp::{TpsWarp, TpsWarpParams, TpsWarpPorts};
use super::fit::warp_file::{WarpFile, WarpFileParams};
use super::{CorrespondenceSet, Location, Pairing, SourceName, Warp, read_correspondences};
use crate::core::item::AnyValue;
use crate::core::params::Params;
use crate::core::standalone::{Feed, Standalone};
use crate::core::time::{Rate, TICKS_PER_SECOND, ticks};
use crate::feature::{FeatureConventions, FeatureFormat};
use crate::unit::database::DATABASE_VERSION;
use crate::unit::{Segment, UnitDatabase, UnitSource};
use std::sync::Arc;

const UNITS: usize = 960;

fn conventions() -> FeatureConventions {
    FeatureConventions::cloth(Rate::hz(96_000), 400)
}

fn format(vectors: usize) -> FeatureFormat {
    FeatureFormat { vectors, conventions: Arc::new(conventions()) }
}

/// A gesture of features, and the same in the database with another level and colour.
fn target(unit: usize) -> [f32; 3] {
    let t = unit as f32 / 240.0;
    [10.0 * (1.3 * t).sin() - 20.0, 3.0 * (2.9 * t).cos(), 2.0 * (4.1 * t).sin()]
}

fn planted([a, b, c]: [f32; 3]) -> [f32; 3] {
    [1.2 * a + 5.0 + 0.05 * b * b, 0.8 * b - 1.0, c + 0.3 * b]
}

fn database() -> UnitDatabase {
    let features: Vec<f32> = (0..UNITS).flat_map(|unit| planted(target(unit))).collect();
    UnitDatabase {
        version: DATABASE_VERSION,
        conventions: conventions(),
        floor_energy: 1e-10,
        segments: vec![Segment { start: 0, units: UNITS as u32, source: 0, ..Segment::default() }],
        sources: vec![UnitSource { provenance: "drag.wav".into(), ..UnitSource::default() }],
        audio: vec![0.0; UNITS * 400],
        unfiltered: features.clone(),
        features,
    }
}

fn set(text: &str) -> CorrespondenceSet {
    CorrespondenceSet { file: "set.ron".into(), ..read_correspondences(text).unwrap() }
}

fn marked() -> CorrespondenceSet {
    let pairs: Vec<String> = (0..12)
        .map(|k| format!("(target: {t}, database: {t}, source: 0, duration: 0.1)", t = 0.3 * f64::from(k)))
        .collect();
    set(&format!("(pairs: [{}])", pairs.join(",")))
}

fn fit(p: TpsFitParams, set: CorrespondenceSet, vectors: usize) -> Standalone {
    let features = (0..UNITS).flat_map(|unit| vec![target(unit); vectors]).flatten().collect();
    Standalone::new::<TpsFit>(p)
        .input(TpsFitPorts::features, Rate::hz(240), format(vectors), features)
        .value(TpsFitPorts::database, database())
        .value(TpsFitPorts::pairs, set)
}

fn params() -> TpsFitParams {
    TpsFitParams::read(&|_| None).unwrap()
}

fn warp(p: TpsFitParams, vectors: usize) -> Warp {
    fit(p, marked(), vectors).run().unwrap().value(0).unwrap().get::<Warp>().unwrap().clone()
}

fn apply(warp: Warp, vectors: usize, window: i64) -> Vec<f32> {
    let features = (0..UNITS).flat_map(|unit| vec![target(unit); vectors]).flatten().collect();
    let standalone = Standalone::new::<TpsWarp>(TpsWarpParams {})
        .input(TpsWarpPorts::features, Rate::hz(240), format(vectors), features)
        .value(TpsWarpPorts::warp, warp)
        .window(window);
    standalone.run().unwrap().stream(TpsWarpPorts::warped)
}

fn error(warped: &[f32], vectors: usize) -> f64 {
    let wanted = (0..UNITS).flat_map(|unit| vec![planted(target(unit)); vectors]).flatten();
    let square: f64 = warped.iter().zip(wanted).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (square / (UNITS * vectors) as f64).sqrt()
}

#[test]
fn a_planted_distortion_is_undone_with_a_lambda_that_the_fit_finds() {
    let warp = warp(params(), 1);
    let report = &warp.maps[0].report;
    assert!(report.pairs == 12 * 24 && report.freedom > 4.0 && report.warnings.is_empty(), "{report:?}");
    let before: Vec<f32> = (0..UNITS).flat_map(target).collect();
    let out = apply(warp.clone(), 1, TICKS_PER_SECOND);
    assert!(error(&out, 1) < 0.04 * error(&before, 1), "{} {}", error(&out, 1), error(&before, 1));
    assert!(warp.maps[0].folds == 0.0 && warp.maps[0].outside == 0.0);
    for window in [ticks(0.0042), ticks(0.5), Rate::hz(240).span(7)] {
        assert!(apply(warp.clone(), 1, window) == out);
    }
    let stiff = self::warp(TpsFitParams { lambda: Some(1e9), ..params() }, 1);
    assert!(stiff.maps[0].report.freedom < 4.01);
    assert!(error(&apply(stiff, 1, TICKS_PER_SECOND), 1) > 2.0 * error(&out, 1));
}

#[test]
fn channels_have_maps_of_their_own_and_one_map_serves_all() {
    let own = TpsFitParams { per_channel: true, pairing: Pairing::Centroid, ..params() };
    let two = warp(TpsFitParams { lambda: Some(0.0), ..own }, 2);
    assert_eq!((two.maps.len(), two.maps[0].report.pairs), (2, 12));
    assert_eq!(two.maps[0].spline, two.maps[1].spline);
    let one = Warp { maps: two.maps[..1].to_vec(), ..two.clone() };
    let out = apply(two, 2, TICKS_PER_SECOND);
    assert!(apply(one.clone(), 2, TICKS_PER_SECOND) == out);
    assert_eq!(out[..3], apply(one, 1, TICKS_PER_SECOND)[..3]);
}

#[test]
fn channels_share_one_map_of_the_correspondences_of_both() {
    // The right channel is 4 softer, and marked at other moments than the left one.
    let quiet = |[a, b, c]: [f32; 3]| [a - 4.0, b, c];
    let features = (0..UNITS).flat_map(|unit| [target(unit), quiet(target(unit))]).flatten();
    let features: Vec<f32> = features.collect();
    let pair = |t: f64, channel: usize| {
        format!("(target: {t}, database: {t}, source: 0, duration: 0.1, channel: {channel})")
    };
    let fitted = |pairs: Vec<String>, per_channel: bool| {
        let p = TpsFitParams { lambda: Some(1.0), per_channel, ..params() };
        let standalone = Standalone::new::<TpsFit>(p)
            .input(TpsFitPorts::features, Rate::hz(240), format(2), features.clone())
            .value(TpsFitPorts::database, database())
            .value(TpsFitPorts::pairs, set(&format!("(pairs: [{}])", pairs.join(","))));
        standalone.run().unwrap().value(0).unwrap().get::<Warp>().unwrap().clone()
    };
    let left = |k: u32| pair(0.3 * f64::from(k), 0);
    let warp = fitted((0..12).map(left).collect(), false);
    assert_eq!((warp.maps.len(), warp.maps[0].report.pairs), (1, 12 * 24));
    let run = Standalone::new::<TpsWarp>(TpsWarpParams {})
        .input(TpsWarpPorts::features, Rate::hz(240), format(2), features.clone())
        .value(TpsWarpPorts::warp, warp);
    let out = run.run().unwrap().stream(TpsWarpPorts::warped);
    // The planted map stretches levels by 1.2: so is the difference of both channels.
    let difference = out.chunks_exact(6).map(|unit| f64::from(unit[0] - unit[3])).sum::<f64>() / UNITS as f64;
    assert!((difference - 4.8).abs() < 0.5, "{difference}");
    // Correspondences of both channels are in one fit.
    let either = |k: u32| pair(0.3 * f64::from(k), k as usize % 2);
    let warp = fitted((0..12).map(either).collect(), false);
    assert_eq!((warp.maps.len(), warp.maps[0].report.pairs), (1, 12 * 24));
    let own = fitted((0..12).map(either).collect(), true);
    assert_eq!(own.maps.iter().map(|map| map.report.pairs).collect::<Vec<_>>(), [6 * 24, 6 * 24]);
}

#[test]
fn without_correspondences_nothing_changes() {
    let warp =
        fit(params(), set("(pairs: [])"), 1).run().unwrap().value(0).unwrap().get::<Warp>().unwrap().clone();
    assert_eq!(warp.maps[0].report.warnings.len(), 1);
    let plain: Vec<f32> = (0..UNITS).flat_map(target).collect();
    assert!(apply(warp, 1, TICKS_PER_SECOND) == plain);
}

#[test]
fn a_set_that_was_marked_elsewhere_is_reported_and_used() {
    let reported = |head: &str| {
        let set = set(&format!("({head}pairs: [(target: 0, database: 0, source: 0, duration: 0.1)])"));
        let run = fit(params(), set, 1).run().unwrap();
        let texts = run.summary.iter().filter(|(k, _)| *k == "warning");
        texts.map(|(_, text)| text.as_str().unwrap_or_default().to_owned()).collect::<Vec<_>>()
    };
    for own in ["", "length: 4.0, database: \"drag.wav\", ", "length: 4.005, "] {
        assert_eq!(reported(own), Vec::<String>::new(), "{own}");
    }
    let found = reported("target: \"take 7\", length: 7.6, database: \"drag.wav, fold.wav\", ");
    assert_eq!(found.len(), 2);
    assert!(
        found[0]
            .starts_with("set.ron was marked in \"take 7\", which lasts 7.600 s; this target lasts 4.000 s"),
        "{found:?}"
    );
    assert!(found[1].contains("\"drag.wav, fold.wav\"; the database has \"drag.wav\""), "{found:?}");
}

#[test]
fn a_warp_that_was_fitted_in_other_recordings_is_reported_and_used() {
    let warp = warp(TpsFitParams { lambda: Some(1.0), pairing: Pairing::Centroid, ..params() }, 1);
    let known = |provenance: &str, content: &str, warp: &Warp| {
        let (provenance, content) = (provenance.into(), content.into());
        let sources = vec![UnitSource { provenance, content, ..UnitSource::default() }];
        let standalone = Standalone::new::<TpsWarp>(TpsWarpParams {})
            .input(TpsWarpPorts::features, Rate::hz(240), format(1), vec![0.0; 3])
            .value(TpsWarpPorts::warp, warp.clone())
            .feed(2, Feed::value(AnyValue::new(UnitDatabase { sources, ..database() })));
        let summary = standalone.run().unwrap().summary;
        summary.iter().map(|(key, text)| format!("{key}: {text}")).collect::<Vec<_>>()
    };
    let reported = |provenance: &str, warp: &Warp| known(provenance, "", warp);
    assert_eq!(
        reported("elsewhere/drag.wav", &warp),
        Vec::<String>::new(),
        "the same file in another folder"
    );
    let found = reported("fold.wav", &warp);
    assert!(found.len() == 1 && found[0].starts_with("warning: \"`recordings` of the warp are"), "{found:?}");
    assert!(found[0].contains("drag.wav") && found[0].contains("fold.wav"), "{found:?}");
    assert_eq!(
        reported("fold.wav", &Warp { recordings: vec![], ..warp.clone() }),
        Vec::<String>::new(),
        "it names none"
    );
    // If both store the contents of the recordings, names do not matter.
    let two = |contents: [&str; 1]| Warp { contents: contents.map(String::from).into(), ..warp.clone() };
    assert_eq!(known("renamed.wav", "a1", &two(["a1"])), Vec::<String>::new());
    let found = known("drag.wav", "b2", &two(["a1"]));
    assert!(found.len() == 1 && found[0].contains("some with other contents than at the fit"), "{found:?}");
    assert_eq!(known("fold.wav", "b2", &two(["a1"])).len(), 1);
    // If one of them does not, names decide.
    for (content, warp) in [("a1", warp.clone()), ("a1", two([""])), ("", two(["a1"]))] {
        assert_eq!(known("drag.wav", content, &warp), Vec::<String>::new());
        assert_eq!(known("renamed.wav", content, &warp).len(), 1);
    }
}

#[test]
fn a_warp_stores_the_correspondences_that_it_was_fitted_to() {
    let of = |set: CorrespondenceSet| {
        let p = TpsFitParams { lambda: Some(1.0), pairing: Pairing::Centroid, ..params() };
        fit(p, set, 1).run().unwrap().value(0).unwrap().get::<Warp>().unwrap().clone()
    };
    let (set, mut other) = (marked(), marked());
    let warp = of(set.clone());
    assert_eq!(warp.correspondences_content, set.content());
    assert_eq!(
        of(CorrespondenceSet { file: "renamed.ron".into(), ..set }).correspondences_content,
        warp.correspondences_content
    );
    other.pairs[3].enabled = false;
    assert_ne!(of(other).correspondences_content, warp.correspondences_content);
    // It is part of what the warp's own digest covers.
    let bent = Warp { correspondences_content: "0123456789abcdef".into(), ..warp };
    assert!(bent.altered().is_some());
}

#[test]
fn a_warp_from_before_recordings_had_digests_is_read_and_keeps_its_own() {
    let warp = warp(TpsFitParams { lambda: Some(1.0), pairing: Pairing::Centroid, ..params() }, 1);
    let old = Warp { contents: Vec::new(), correspondences_content: String::new(), ..warp.clone() }.sealed();
    let text = serde_json::to_string(&old).unwrap();
    let later = ["\"contents\":[],", "\"correspondences_content\":\"\","];
    assert!(later.iter().all(|field| text.contains(field)));
    let before = later.iter().fold(text, |text, field| text.replacen(field, "", 1));
    assert_eq!(serde_json::from_str::<Warp>(&before).unwrap(), old);
    // The digest is the one of a file without the fields.
    let plain = before.replace(&old.content, "");
    assert_eq!(old.content, blake3::hash(plain.as_bytes()).to_hex()[..16]);
    assert!(old.altered().is_none() && old.content != warp.content);
}

#[test]
fn what_does_not_fit_is_named_before_the_run() {
    let late = set("(pairs: [\n  (target: 0, database: 99, duration: 0.1),\n])");
    let reject = fit(params(), late, 1).shape().unwrap_err();
    assert_eq!((reject.code, reject.field.as_deref()), ("F110", Some("pairs")));
    assert!(reject.message.starts_with("set.ron:2:3: correspondence 0: 99.000 to"), "{reject}");
    let mut other = warp(TpsFitParams { lambda: Some(1.0), pairing: Pairing::Centroid, ..params() }, 1);
    other.conventions.f_hi = 8000.0;
    let standalone = Standalone::new::<TpsWarp>(TpsWarpParams {})
        .input(TpsWarpPorts::features, Rate::hz(240), format(1), vec![0.0; 3])
        .value(TpsWarpPorts::warp, other.clone());
    assert!(standalone.shape().unwrap_err().message.contains("`f_hi`"));
    let maps = Warp { maps: vec![other.maps[0].clone(); 3], conventions: conventions(), ..other };
    let standalone = Standalone::new::<TpsWarp>(TpsWarpParams {})
        .input(TpsWarpPorts::features, Rate::hz(240), format(2), vec![0.0; 6])
        .value(TpsWarpPorts::warp, maps);
    assert!(standalone.shape().unwrap_err().message.contains("3 channels"));
}

#[test]
fn files_are_read_and_what_is_wrong_in_them_is_named() {
    let correspondences = |text: &str| {
        let mut standalone =
            Standalone::func::<Correspondences>(CorrespondencesParams { path: "set.ron".into() });
        standalone.files.insert("set.ron", text);
        standalone
    };
    let set = correspondences("(pairs: [(target: 0, database: 1, duration: 0.1)])").run().unwrap();
    let set = set.value(0).unwrap().get::<CorrespondenceSet>().unwrap().clone();
    assert_eq!((set.file.as_str(), set.pairs[0].location), ("set.ron", Location { line: 1, column: 10 }));
    let reject = correspondences("(pairs: [\n(target: 0)])").shape().unwrap_err();
    assert!(
        reject.code == "F110" && reject.message.starts_with("set.ron:2:1: `database` is missing"),
        "{reject}"
    );

    let warp = warp(TpsFitParams { lambda: Some(1.0), pairing: Pairing::Centroid, ..params() }, 1);
    let file = |bytes: Vec<u8>| {
        let mut standalone = Standalone::func::<WarpFile>(WarpFileParams { path: "cotton.warp".into() });
        standalone.files.insert("cotton.warp", bytes);
        standalone
    };
    let read = file(serde_json::to_vec(&warp).unwrap()).run().unwrap().value(0).unwrap();
    assert!(read.get::<Warp>() == Some(&warp));
    // One without a digest is taken as it is; what was changed under one is reported.
    let open = Warp { content: String::new(), ..warp.clone() };
    assert!(!warp.content.is_empty());
    let read = file(serde_json::to_vec(&open).unwrap()).run().unwrap().value(0).unwrap();
    assert!(read.get::<Warp>() == Some(&open));
    let mut bent = warp.clone();
    bent.maps[0].spline.affine[2] += 1e-9;
    for changed in [bent, Warp { recordings: vec!["other.wav".into()], ..warp.clone() }] {
        let reject = file(serde_json::to_vec(&changed).unwrap()).shape().unwrap_err();
        let named = format!("`content` is {:?}", warp.content);
        assert!(reject.code == "F111" && reject.message.contains(&named), "{reject}");
        assert!(file(serde_json::to_vec(&changed.sealed()).unwrap()).shape().is_ok());
    }
    let old = Warp { version: 9, ..warp };
    let reject = file(serde_json::to_vec(&old).unwrap()).shape().unwrap_err();
    assert!(reject.code == "F111" && reject.message.contains("version 9"), "{reject}");
}
