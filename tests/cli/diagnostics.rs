//! Diagnostics of wrong graphs: every case in `tests/diagnostics` with its text, byte for byte.
//!
//! A case is a graph; its first lines may hold arguments, such as `// --set wind.level=3`. `FOLEY_BLESS=1` writes the
//! texts again: look at the difference before it is committed.

use foley::diag::{Diagnostic, Severity, Sources, any_error, codes, json, render, sort};
use foley::graph::{DirFiles, Limits, LoadOptions, Override, load, load_text};
use foley::lang::edit::apply;
use foley::lang::parse;
use foley::plan::{Plan, PlanOptions, sound_shapes};
use foley::run::{DirOutputs, Job, Progress, run};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const CASES: &str = "tests/diagnostics";

/// Codes without a case, and the reason.
const WITHOUT_A_CASE: [(&str, &str); 3] = [
    ("F090", "the system has to refuse a thread"),
    ("F092", "the file system has to lack events; `watch` looks once a second then, which its own tests do"),
    ("F099", "a defect in foley"),
];

fn cases() -> Vec<PathBuf> {
    let entries = fs::read_dir(CASES).unwrap().map(|e| e.unwrap().path());
    let mut all: Vec<_> = entries.filter(|p| p.extension().is_some_and(|e| e == "ron")).collect();
    all.sort();
    all
}

/// All diagnostics of a graph, from its text to its files.
fn findings(path: &Path) -> (Vec<Diagnostic>, Sources) {
    let text = fs::read_to_string(path).unwrap();
    let (mut limits, mut options, mut sets) = (Limits::default(), PlanOptions::default(), Vec::new());
    for line in text.lines().map_while(|l| l.strip_prefix("// --")) {
        let (name, value) = line.split_once(' ').unwrap();
        match name {
            "set" => {
                let (target, value) = value.split_once('=').unwrap();
                sets.push(Override { target: target.into(), value: value.into() });
            }
            "max-nodes" => limits.nodes = value.parse().unwrap(),
            "max-file" => limits.file_bytes = value.parse().unwrap(),
            "memory" => options.memory = value.parse().unwrap(),
            other => panic!("{}: no argument --{other}", path.display()),
        }
    }
    let loaded = load(path, &LoadOptions::default().overrides(sets).limits(limits));
    let mut found = loaded.diagnostics;
    let files = DirFiles::new(loaded.root, limits);
    let Some(graph) = loaded.graph else {
        found.extend(sound_shapes(&loaded.sound.unwrap(), &files, &options).1);
        sort(&mut found, &loaded.sources);
        return (found, loaded.sources);
    };
    match Plan::new(&graph, &files, &options) {
        Err(errors) => {
            found.extend(errors);
            sort(&mut found, &loaded.sources);
        }
        Ok(plan) => {
            let out = tempfile::tempdir().unwrap();
            let outputs = DirOutputs::new(out.path());
            let job = Job {
                graph: &graph,
                plan: &plan,
                files: &files,
                outputs: &outputs,
                taps: &[],
                threads: 1,
                seed: graph.seed,
                memo: None,
                progress: Arc::new(Progress::default()),
            };
            let mut errors = run(&job).err().unwrap_or_default();
            // The folder is another one in each run.
            let folder = out.path().display().to_string();
            errors.iter_mut().for_each(|e| e.message = e.message.replace(&folder, "out"));
            found.extend(errors);
        }
    }
    (found, loaded.sources)
}

#[test]
fn every_case_is_reported_as_its_text_states() {
    let bless = std::env::var_os("FOLEY_BLESS").is_some();
    let mut wrong = Vec::new();
    for path in cases() {
        let (found, sources) = findings(&path);
        // Backslashes of another system are no difference.
        let text = render(&found, &sources, false).replace('\\', "/");
        let stored = path.with_extension("txt");
        if bless {
            fs::write(&stored, text).unwrap();
        } else if fs::read_to_string(&stored).unwrap_or_default() != text {
            wrong.push(format!("{} is reported otherwise:\n{text}", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}\nFOLEY_BLESS=1 stores the new texts", wrong.join("\n"));
}

#[test]
fn every_case_provokes_the_code_in_its_name() {
    for path in cases() {
        let name = path.file_stem().unwrap().to_str().unwrap();
        let code = name.split('_').next().unwrap().to_uppercase();
        let (found, _) = findings(&path);
        assert!(!found.is_empty(), "{name} is reported nothing");
        if codes::find(&code).is_some() {
            assert!(found.iter().any(|d| d.code == code), "{name}: {found:#?}");
        }
    }
}

#[test]
fn every_code_has_a_case() {
    // Those that need more than a graph are cases of the program, in a folder of their own.
    let of_the_program = fs::read_dir(Path::new(CASES).join("cli")).unwrap().map(|e| e.unwrap().path());
    let names: Vec<String> = cases()
        .into_iter()
        .chain(of_the_program)
        .map(|p| p.file_stem().unwrap().to_string_lossy().to_uppercase())
        .collect();
    for code in codes::all() {
        let has = names.iter().any(|n| n.split('_').next() == Some(code.code));
        let excused = WITHOUT_A_CASE.iter().any(|(without, _)| *without == code.code);
        assert!(has != excused, "{} has {}a case", code.code, if has { "" } else { "not " });
    }
}

#[test]
fn no_finding_repeats_another_or_lacks_its_place() {
    for path in cases() {
        let (found, sources) = findings(&path);
        for (k, one) in found.iter().enumerate() {
            let same = |other: &Diagnostic| {
                (other.code, &other.message, &other.location) == (one.code, &one.message, &one.location)
            };
            assert!(!found[..k].iter().any(same), "{}: twice {one:?}", path.display());
            assert!(codes::find(one.code).is_some(), "{} has no entry", one.code);
            let Some(location) = &one.location else { continue };
            let source = sources.get(location.file).unwrap_or_else(|| panic!("{one:?}"));
            assert!(source.text.get(location.span.clone()).is_some(), "{one:?}");
        }
    }
}

#[test]
fn all_errors_of_a_file_come_in_one_pass() {
    let (found, _) = findings(&Path::new(CASES).join("many_at_once.ron"));
    let codes: Vec<&str> = found.iter().map(|d| d.code).collect();
    for code in ["F001", "F004", "F007", "F010", "F011", "F013", "F014", "F015", "F017", "F020", "F023"] {
        assert!(codes.contains(&code), "{code} is not in {codes:?}");
    }
}

#[test]
fn errors_of_the_text_and_of_the_plan_come_in_one_pass_without_those_that_follow_from_them() {
    let (found, _) = findings(&Path::new(CASES).join("text_and_plan_at_once.ron"));
    let reported: Vec<_> = found.iter().map(|d| (d.code, d.node.as_deref().unwrap_or_default())).collect();
    let wanted = [
        ("F060", "gone"),
        ("F011", "typo"),
        ("F025", "x"),
        ("F045", "rates"),
        ("F046", "beside_gone"),
        ("F046", "beside_typo"),
        ("F049", "back"),
        ("F082", "o2"),
        ("F081", "o3"),
    ];
    assert_eq!(reported, wanted);
}

#[test]
fn loops_that_share_a_node_are_each_reported() {
    let (found, _) = findings(&Path::new(CASES).join("f025_knot.ron"));
    let mut reported: Vec<&str> = found.iter().filter_map(|d| d.message.rsplit(": ").next()).collect();
    reported.sort();
    assert_eq!(reported, ["sum -> left -> sum", "sum -> right -> sum", "sum -> sum"]);
    assert!(found.iter().all(|d| d.code == "F025"));
}

#[test]
fn a_bare_word_on_the_command_line_is_text_where_a_path_or_a_text_is_taken() {
    let text = "#![schema = \"foley:graph/1\"]
Graph(params: {\"name\": \"a.wav\"}, nodes: {
    \"in\": Noise(duration: Some(1.0)),
    \"out\": WavOut(audio: \"in\", path: \"$name\"),
})";
    let path = |target: &str, value: &str| {
        let sets = [Override { target: target.into(), value: value.into() }];
        let loaded = load_text("a.ron", text, Path::new("a.ron"), &LoadOptions::default().overrides(sets));
        let Some(graph) = loaded.graph else { return loaded.diagnostics[0].code.to_owned() };
        let written = graph.nodes[graph.find("out").unwrap()].params.write();
        format!("{:?}", written.iter().find(|(name, _)| *name == "path").unwrap().1)
    };
    for value in ["foo", "take/foo.wav", "7", "None", "Some(7)", "\"foo\"", "true"] {
        let wanted = format!("Text({:?})", value.trim_matches('"'));
        assert_eq!(path("name", value), wanted);
        assert_eq!(path("out.path", value), wanted);
    }
    // Parameters that take no text are read as before.
    assert_eq!(path("out.dither", "foo"), "F014");
    assert_eq!(path("in.duration", "foo"), "F014");
}

#[test]
fn a_slip_inside_one_node_leaves_the_others_planned_and_one_outside_of_all_does_not() {
    let text = |inside: &str, outside: &str| {
        format!(
            "#![schema = \"foley:graph/1\"]
Graph({outside}
    nodes: {{
        \"one\": Noise(rate: 48000, duration: Some(1.0)),
        \"other\": Noise(rate: 44100, duration: Some(1.0)),
        \"slip\": Gain(audio: \"one\"{inside}),
        \"both\": Mix(inputs: [\"one\", \"other\"]),
        \"out\": WavOut(audio: \"both\", path: \"a.wav\"),
    }},
)"
        )
    };
    let codes = |text: &str| -> Vec<&str> {
        let loaded = load_text("a.ron", text, Path::new("a.ron"), &LoadOptions::default());
        let files = DirFiles::new(loaded.root, Limits::default());
        let more = sound_shapes(&loaded.sound.unwrap(), &files, &PlanOptions::default()).1;
        loaded.diagnostics.iter().chain(&more).map(|d| d.code).collect()
    };
    assert_eq!(codes(&text(" gain: 0.5", "")), ["F001", "F045"]);
    assert!(codes(&text("", "title: ],")).iter().all(|code| *code == "F001"));
}

#[test]
fn an_unknown_node_type_leaves_the_rest_checked_and_is_not_blamed_twice() {
    let text = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"odd\": Wobble(a: 1),
    \"soft\": Gain(audio: \"odd\"),
    \"bad\": Gain(audio: \"soft\", gian: 1.0),
    \"out\": WavOut(audio: \"bad\", path: \"a.wav\"),
})";
    let loaded = load_text("a.ron", text, Path::new("a.ron"), &LoadOptions::default());
    let codes: Vec<&str> = loaded.diagnostics.iter().map(|d| d.code).collect();
    assert_eq!(codes, ["F010", "F011"]);
    assert!(loaded.graph.is_none());
}

#[test]
fn lines_and_columns_count_characters_from_one() {
    let path = Path::new(CASES).join("unicode.ron");
    let (found, sources) = findings(&path);
    let text = fs::read_to_string(&path).unwrap();
    let location = |needle: &str| {
        let (line, content) = text.lines().enumerate().find(|(_, l)| l.contains(needle)).unwrap();
        (line + 1, content[..content.find(needle).unwrap()].chars().count() + 1)
    };
    let report = json(&found, &sources);
    let at = |code: &str| {
        let one = report.as_array().unwrap().iter().find(|d| d["code"] == code).unwrap();
        let number = |key: &str| one[key].as_u64().unwrap() as usize;
        [(number("line"), number("column")), (number("end_line"), number("end_column"))]
    };
    let (line, column) = location("1000.0");
    assert_eq!(at("F015"), [(line, column), (line, column + 6)]);
    let (line, column) = location("gian");
    assert_eq!(at("F011"), [(line, column), (line, column + 4)]);
}

#[test]
fn json_has_all_fields_for_every_case() {
    let fields = [
        "code",
        "severity",
        "message",
        "file",
        "line",
        "column",
        "end_line",
        "end_column",
        "node",
        "help",
        "fixes",
    ];
    for path in cases() {
        let (found, sources) = findings(&path);
        let report = json(&found, &sources);
        for (d, one) in found.iter().zip(report.as_array().unwrap()) {
            let object = one.as_object().unwrap();
            assert_eq!(object.len(), fields.len());
            assert!(fields.iter().all(|f| object.contains_key(*f)), "{one}");
            assert_eq!(one["severity"], if d.severity == Severity::Error { "error" } else { "warning" });
            assert_eq!(one["line"].is_u64(), d.location.is_some());
            // Every correction can be made in the text, and leaves RON.
            assert_eq!(one["fixes"].as_array().unwrap().len(), d.fixes.len(), "{one}");
            for fix in &d.fixes {
                let text = &sources.get(fix.file().unwrap()).unwrap().text;
                let parsed = parse(text);
                let fixed = apply(text, &fix.edits(&parsed).unwrap()).unwrap();
                assert!(parse(&fixed).errors().len() <= parsed.errors().len(), "{fix:?}: {fixed}");
            }
        }
    }
}

#[test]
fn a_valid_graph_has_no_diagnostics() {
    let template = foley::cli::template("wind");
    let (name, text) = &template[0];
    let loaded = load_text(name, text, Path::new(name), &LoadOptions::default());
    let reported = render(&loaded.diagnostics, &loaded.sources, false);
    assert!(loaded.graph.is_some() && loaded.diagnostics.is_empty(), "{reported}");
    assert!(!any_error(&loaded.diagnostics));
}
