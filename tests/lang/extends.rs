//! Graphs that add to and change others.

use foley::Session;
use foley::diag::Severity;
use foley::run::StreamTap;
use std::fs;
use std::path::Path;
use std::sync::Arc;

const HEAD: &str = "#![schema = \"foley:graph/1\"]\n";
const BASE: &str = "Graph(title: \"base\", seed: 7, params: {\"level\": 0.5, \"idle\": 1.0}, nodes: {
    \"noise\": Noise(colour: Pink, duration: Some(0.1)),
    \"soft\": Gain(audio: \"noise\", gain: \"$level\"),
    \"report\": Loudness(audio: \"soft\"),
    \"out\": WavOut(audio: \"soft\", path: \"base.wav\"),
})";

/// Writes files, and loads the first.
fn session(folder: &Path, files: &[(&str, &str)]) -> Session {
    for (name, text) in files {
        fs::write(folder.join(name), format!("{HEAD}{text}\n")).unwrap();
    }
    Session::from_file(folder.join(files[0].0))
}

fn sound(session: &mut Session) -> Vec<f32> {
    let tap = Arc::new(StreamTap::<f32>::new());
    session.tap("soft", &tap);
    session.render_to_memory().unwrap();
    tap.take().unwrap().data
}

/// Codes and messages of the mistakes.
fn found(session: &Session) -> Vec<(&'static str, String)> {
    session.check().diagnostics.into_iter().map(|d| (d.code, d.message)).collect()
}

#[test]
fn fields_parameters_and_nodes_replace_those_of_the_base() {
    let folder = tempfile::tempdir().unwrap();
    let base = ("base.ron", BASE);
    let plain = sound(&mut session(folder.path(), &[base]));
    let changed = "Graph(extends: \"base.ron\", params: {\"level\": 0.25}, nodes: {
        \"out\": WavOut(path: \"other.wav\"),
        \"report\": None,
    })";
    let mut changed = session(folder.path(), &[("changed.ron", changed), base]);
    assert_eq!(found(&changed), []);
    let (loaded, _) = changed.load();
    let graph = loaded.graph.unwrap();
    assert_eq!((&*graph.title, graph.seed), ("base", 7));
    let ids: Vec<&str> = graph.nodes.iter().map(|node| &*node.id).collect();
    assert_eq!(ids, ["noise", "soft", "out"]);
    // The noise has the same seed.
    let half: Vec<f32> = plain.iter().map(|x| x * 0.5).collect();
    assert_eq!(sound(&mut changed), half);
    let report = changed.render(folder.path().join("out")).unwrap();
    assert!(report.outputs[0].path.ends_with("other.wav"));

    // Another type replaces the node with its fields; a third graph extends the second.
    let second = "Graph(title: \"second\", extends: \"base.ron\", nodes: {\"soft\": LowPass(audio: \"noise\", cutoff: \"$level\")})";
    let third = "Graph(extends: \"second.ron\", seed: 8, params: {\"level\": 900.0}, nodes: {\"soft\": LowPass(order: 4)})";
    let third = session(folder.path(), &[("third.ron", third), ("second.ron", second), base]);
    assert_eq!(found(&third), []);
    let graph = third.load().0.graph.unwrap();
    assert_eq!((&*graph.title, graph.seed), ("second", 8));
    let soft = &graph.nodes[graph.find("soft").unwrap()];
    assert_eq!(soft.ty.name, "LowPass");
    let values = format!("{:?}", soft.params);
    assert!(values.contains("900") && values.contains("order: 4"), "{values}");
    // `--set` wins.
    let mut set = third.clone();
    set.set("level", "500.0");
    assert!(format!("{:?}", set.load().0.graph.unwrap().nodes[1].params).contains("500"));
}

#[test]
fn a_sub_graph_may_extend_another_and_take_values() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("lib")).unwrap();
    fs::write(folder.path().join("lib/base.ron"), format!("{HEAD}{BASE}\n")).unwrap();
    let inner = format!(
        "{HEAD}Graph(extends: \"base.ron\", nodes: {{\"out\": None, \"noise\": Noise(rate: 44100)}})\n"
    );
    fs::write(folder.path().join("lib/inner.ron"), inner).unwrap();
    let outer = "Graph(use: {\"s\": Sub(path: \"lib/inner.ron\", params: {\"level\": 0.1, \"noise.colour\": White})}, nodes: {
        \"out\": WavOut(audio: \"s.soft\", path: \"o.wav\")})";
    let outer = session(folder.path(), &[("outer.ron", outer)]);
    assert_eq!(found(&outer), []);
    let graph = outer.load().0.graph.unwrap();
    let noise = format!("{:?}", graph.nodes[graph.find("s.noise").unwrap()].params);
    assert!(noise.contains("White") && noise.contains("44100"), "{noise}");
}

#[test]
fn mistakes_stand_where_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let wrong = |text: &str| {
        let session = session(folder.path(), &[("wrong.ron", text), ("base.ron", BASE)]);
        let found = session.check();
        let first =
            found.diagnostics.first().unwrap_or_else(|| panic!("nothing is wrong with {text}")).clone();
        assert_eq!(first.severity, Severity::Error);
        let at = first.location.unwrap();
        let source = found.sources.get(at.file).unwrap();
        (first.code, source.name.rsplit('/').next().unwrap().to_owned(), source.text[at.span].to_owned())
    };
    let own = |code, text: &str| (code, "wrong.ron".to_owned(), text.to_owned());
    let extends = |rest: &str| format!("Graph(extends: \"base.ron\", nodes: {{{rest}}})");
    assert_eq!(wrong(&extends("\"soft\": Gain(gain: \"x\", audio: \"noise\")")), own("F020", "\"x\""));
    assert_eq!(wrong(&extends("\"noise\": Noise(colour: Red)")), own("F017", "Red"));
    assert_eq!(wrong(&extends("\"other\": None")), own("F010", "None"));
    // The base reads a node that is gone.
    assert_eq!(wrong(&extends("\"noise\": None")), ("F020", "base.ron".into(), "\"noise\"".into()));
    assert_eq!(wrong("Graph(extends: 3, nodes: {})"), own("F008", "3"));
    assert_eq!(wrong("Graph(extends: \"no.ron\", nodes: {})"), own("F060", "\"no.ron\""));
    assert_eq!(wrong("Graph(extends: \"wrong.ron\", nodes: {})"), own("F031", "\"wrong.ron\""));
    assert_eq!(wrong("Graph(extends: \"/etc/passwd\", nodes: {})"), own("F062", "\"/etc/passwd\""));
    let twice = extends("\"a\": Noise(), \"a\": Noise()");
    assert_eq!(wrong(&twice), own("F006", "\"a\""));
}
