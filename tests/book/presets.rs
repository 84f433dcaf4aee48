//! Every preset of a material plays a cloth from end to end: those of tables 1 and 3 of the paper for a first animation make a warp, those for
//! another one take it over.

use crate::common;
use crate::common::graphs;
use foley::graph::Graph;
use foley_nodes::core::params::Datum;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn presets() -> Vec<String> {
    let entries = fs::read_dir(graphs().join("lib/presets")).unwrap().map(|e| e.unwrap().path());
    let mut names: Vec<String> =
        entries.map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    names.sort();
    names
}

/// The preset whose warp another takes over: that of its material without more words.
fn first_of(name: &str) -> &str {
    name.split('_').next().unwrap_or(name)
}

/// Overrides for the sleeve, which is smaller and slower than the paper's clothes.
const OURS: &str = "\"radius\": 0.01, \"threshold\": 0.02, \"d_max\": 4.0,";

/// A graph in which a sleeve is of this material; `more` is passed to the preset.
fn graph(name: &str, more: &str) -> String {
    let graphs = graphs().display().to_string();
    format!(
        "#![schema = \"foley:graph/1\"]
Graph(seed: 3, use: {{
    \"cloth\": Sub(path: \"{graphs}/lib/presets/{name}.ron\", params: {{
        \"mesh\": \"sleeve\", \"bodies\": [\"arm\"], {more}
    }}),
}}, nodes: {{
    \"sleeve\": MeshSequence(path: \"{graphs}/assets/cloth/nylon_sleeve_elbow.pc2\", fps: 30),
    \"arm\": MeshSequence(path: \"{graphs}/assets/cloth/nylon_sleeve_elbow.body_arm.pc2\", fps: 30),
    \"head\": VertexPose(mesh: \"arm\", origin: 0, offset: [-0.2, 0.1, 0.5]),
    \"out\": WavOut(audio: \"cloth.recomposed.audio\", path: \"a.wav\"),
}})"
    )
}

/// Runs a graph, which must succeed, and returns its report on `a.wav`; writes the warp to a file if one is named.
fn run(dir: &Path, text: &str, warp: Option<&str>) -> Value {
    let [graph, read] = [dir.join("g.ron"), graphs()].map(|path| path.display().to_string());
    fs::write(&graph, text).unwrap();
    let tap = warp.map(|file| format!("cloth.recomposed.fit.warp={}", dir.join(file).display()));
    let tap: Vec<&str> = tap.iter().flat_map(|tap| ["--tap", tap]).collect();
    common::foley(dir, &[&["run", &graph, "--allow-read", &read], &tap[..]].concat())["outputs"][0].clone()
}

/// A binaural recording: clicks and noise, with another level in each ear.
fn binaural_recording(path: &Path) {
    let mut state = 1_u32;
    let samples = (0..96_000).flat_map(|n| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(state >> 16) / 32_768.0 - 1.0;
        let swell = (f64::from(n) / 24_000.0).sin().abs() + 5.0 * f64::from(u8::from(n % 4000 < 200));
        [1500.0, 900.0].map(|level| (level * swell * noise) as i16)
    });
    common::write_wav(path, 2, 48_000, samples);
}

#[test]
fn every_preset_plays_a_cloth() {
    let dir = tempfile::tempdir().unwrap();
    binaural_recording(&dir.path().join("ears.wav"));
    let marked = "\"correspondences\": \"marked.correspondences.ron\"";
    fs::write(
        dir.path().join("marked.correspondences.ron"),
        "Correspondences(pairs: [
            (target: 0.85, source: 0, database: 0.85, duration: 0.1),
            (target: 0.65, source: 0, database: 1.0, duration: 0.1),
            (target: 0.35, source: 0, database: 1.2, duration: 0.1),
        ])",
    )
    .unwrap();
    fs::write(dir.path().join("ears.correspondences.ron"), "Correspondences(pairs: [])").unwrap();
    let names = presets();
    assert!(names.len() >= 10, "{names:?}");
    let (first, later): (Vec<_>, Vec<_>) = names.iter().partition(|name| first_of(name) == *name);
    for name in first {
        let reported =
            run(dir.path(), &graph(name, &format!("{OURS} {marked}")), Some(&format!("{name}.warp.json")));
        assert!(reported["peak"].as_f64().unwrap() > 1e-3, "{name}: {reported}");
        assert_eq!(reported["channels"], 1);
    }
    for name in later {
        let text = if name.ends_with("first_person") {
            let own = "\"listener\": \"head\", \"recordings\": [\"ears.wav\"], \"correspondences\": \"ears.correspondences.ron\"";
            graph(name, &format!("{OURS} {own}"))
        } else {
            graph(name, &format!("{OURS} \"warp\": \"{}.warp.json\"", first_of(name)))
        };
        let reported = run(dir.path(), &text, None);
        assert!(reported["peak"].as_f64().unwrap() > 1e-3, "{name}: {reported}");
        assert_eq!(reported["channels"], if name.ends_with("first_person") { 2 } else { 1 }, "{name}");
    }
}

/// A row of tables 1 and 3: radius, threshold, factor and power of the speed; energies of events and of extracted samples, the latter a sum over
/// 1920 samples; length of a unit, d_max, widths, and lambda where the warp is fitted.
struct Row {
    preset: &'static str,
    contact: [f64; 2],
    map: [f64; 2],
    energies: Option<[f64; 2]>,
    unit: &'static str,
    d_max: f64,
    widths: [f64; 3],
    lambda: Option<f64>,
}

fn tables_1_and_3() -> Vec<Row> {
    let row = |preset, contact, map, energies, unit, d_max, widths, lambda| Row {
        preset,
        contact,
        map,
        energies,
        unit,
        d_max,
        widths,
        lambda,
    };
    let (plain, slow) = ([1.0, 1.0], [0.25, 1.5]);
    let (short, long) = ("1/240", "1/60");
    let near = 2.0;
    let [simulated, boxing, jogging] = [98_902.0, 172_875.0, 906_402.0].map(|energy| Some([energy, 0.025]));
    let (cotton, polyester, others) = ([20.0, 50.0, 10.0], [10.0, 50.0, 20.0], [20.0, 30.0, 10.0]);
    vec![
        row("cotton", [0.05, 0.02], plain, Some([4878.0, 0.5]), short, near, cotton, Some(1e2)),
        row("cotton_known", [0.2, 0.02], plain, Some([4878.0, 0.5]), short, near, cotton, None),
        row("polyester", [0.05, 0.02], plain, Some([528.0, 0.25]), short, near, polyester, Some(1e5)),
        row("polyester_known", [0.2, 0.02], plain, Some([528.0, 0.25]), short, near, polyester, None),
        row("windbreaker", [0.05, 0.0], slow, simulated, short, near, others, Some(1e5)),
        row("windbreaker_boxing", [0.05, 1.0], slow, boxing, short, near, others, None),
        row("windbreaker_jogging", [0.05, 0.0], slow, jogging, short, near, others, None),
        row("windbreaker_first_person", [0.05, 1.0], slow, boxing, short, near, others, Some(1e5)),
        row("corduroy", [0.05, 2.0], plain, None, long, 3.0, others, Some(0.0)),
        row("corduroy_known", [0.05, 1.0], plain, None, long, 3.0, others, None),
    ]
}

/// A parameter of all nodes of a type, which agree.
fn parameter(graph: &Graph, ty: &str, name: &str) -> Option<Datum> {
    let own = graph.nodes.iter().filter(|node| node.ty.name == ty);
    let mut found = own.map(|node| {
        let all = node.params.write();
        all.into_iter().find(|(param, _)| *param == name).unwrap_or_else(|| panic!("{ty}.{name}")).1
    });
    let first = found.next()?;
    assert!(found.all(|other| other == first), "{ty}.{name}");
    Some(first)
}

fn numbers(datum: &Datum) -> Vec<f64> {
    match datum {
        Datum::Int(x) => vec![*x as f64],
        Datum::Float(x) => vec![*x],
        Datum::List(all) => all.iter().flat_map(numbers).collect(),
        other => panic!("{other:?} is no number"),
    }
}

#[test]
fn presets_hold_the_values_of_tables_1_and_3_where_their_nodes_read_them() {
    let table = tables_1_and_3();
    let rows: Vec<&str> = table.iter().map(|row| row.preset).collect();
    assert!(presets().iter().all(|name| rows.contains(&name.as_str())), "a preset without a row");
    let assets = graphs().join("assets/cloth").display().to_string();
    for row in table {
        let name = row.preset;
        let more = format!(
            "\"listener\": \"head\", \"correspondences\": \"{assets}/none.correspondences.ron\", \"warp\": \"{assets}/cotton.warp.json\", \"loop_guard\": 0.5"
        );
        let own = fs::read_to_string(graphs().join(format!("lib/presets/{name}.ron"))).unwrap();
        let taken =
            more.split(", ").filter(|param| own.contains(&format!("{}:", param.split(':').next().unwrap())));
        let graph = common::graph(&graph(name, &taken.collect::<Vec<_>>().join(", "))).unwrap();
        let number = |ty: &str, name: &str| parameter(&graph, ty, name).map(|datum| numbers(&datum));
        let is = |ty: &str, param: &str, wanted: &[f64]| {
            let found = number(ty, param).unwrap_or_else(|| panic!("{name} has no {ty}"));
            let near = found.iter().zip(wanted).all(|(a, b)| (a - b).abs() <= 0.005 * b.abs());
            assert!(
                near && found.len() == wanted.len(),
                "{name}: {ty}.{param} is {found:?}, the table has {wanted:?}"
            );
        };
        is("ContactDetector", "radius", &row.contact[..1]);
        is("SlidingSpeed", "threshold", &row.contact[1..]);
        is("SlidingSpeed", "factor", &row.map[..1]);
        is("SlidingSpeed", "power", &row.map[1..]);
        match row.energies {
            Some([event, sample]) => {
                is("EnergyCalibration", "e_min", &[event]);
                is("CrumpleExtractor", "threshold", &[sample / 1920.0]);
                is("CrumpleExtractor", "window", &[0.02]);
                let ears = parameter(&graph, "BinauralCrumplePlayer", "jitter_time").is_some();
                is(
                    if ears { "BinauralCrumplePlayer" } else { "CrumplePlayer" },
                    "jitter_time",
                    &[1.0 / 30.0],
                );
            }
            None => assert!(number("CrumpleExtractor", "threshold").is_none(), "{name} does not crumple"),
        }
        for ty in ["Mfcc", "UnitDatabase"] {
            assert_eq!(parameter(&graph, ty, "unit"), Some(Datum::Text(row.unit.into())), "{name}: {ty}");
            is(ty, "n", &[3.0]);
            is(ty, "high_pass", &[100.0]);
        }
        for ty in ["TemporalGaussian", "UnitDatabase"] {
            is(ty, "widths", &row.widths);
        }
        is("GlobalUnitSelector", "d_max", &[row.d_max]);
        // Not in the tables.
        is("GlobalUnitSelector", "loop_guard", &[0.5]);
        match row.lambda {
            Some(lambda) => is("TpsFit", "lambda", &[lambda]),
            None => assert!(number("TpsFit", "lambda").is_none(), "{name} takes over a warp"),
        }
    }
}
