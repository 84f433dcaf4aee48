//! Arrays of sub-graphs.

use foley::Session;
use std::fs;
use std::path::Path;

const HEAD: &str = "#![schema = \"foley:graph/1\"]\n";
const VOICE: &str = "Graph(params: {\"frequency\": Required, \"level\": 0.5}, nodes: {
    \"tone\": Tone(frequency: \"$frequency\", level: \"$level\", duration: Some(0.05)),
})";

fn session(folder: &Path, uses: &str, nodes: &str) -> Session {
    fs::write(folder.join("voice.ron"), format!("{HEAD}{VOICE}\n")).unwrap();
    let text = format!("{HEAD}Graph(use: {{{uses}}}, nodes: {{{nodes}}})\n");
    fs::write(folder.join("chord.ron"), text).unwrap();
    Session::from_file(folder.join("chord.ron"))
}

const ARRAY: &str = "\"v\": Array(path: \"voice.ron\", params: {\"level\": 0.1}, items: [
    {\"frequency\": 220.0}, {\"frequency\": 330.0}, {\"frequency\": 440.0, \"level\": 0.2}])";
const MIX: &str =
    "\"m\": Mix(inputs: [\"v.*.tone\", \"v.1.tone\"]), \"o\": WavOut(audio: \"m\", path: \"o.wav\")";

#[test]
fn a_sub_graph_is_used_for_each_item_and_a_star_links_all() {
    let folder = tempfile::tempdir().unwrap();
    let mut chord = session(folder.path(), ARRAY, MIX);
    assert!(chord.check().diagnostics.is_empty());
    let graph = chord.load().0.graph.unwrap();
    let ids: Vec<&str> = graph.nodes.iter().map(|node| &*node.id).collect();
    assert_eq!(ids, ["v.0.tone", "v.1.tone", "v.2.tone", "m", "o"]);
    let from: Vec<usize> = graph.nodes[3].links[0].iter().map(|link| link.node).collect();
    assert_eq!(from, [0, 1, 2, 1]);
    let values = |session: &Session| -> Vec<String> {
        let graph = session.load().0.graph.unwrap();
        graph.nodes[..3].iter().map(|node| format!("{:?}", node.params)).collect()
    };
    let found = values(&chord);
    assert!(found[0].contains("frequency: 220.0, level: 0.1"), "{found:?}");
    assert!(found[2].contains("frequency: 440.0, level: 0.2"), "{found:?}");
    chord.set("v.level", "0.3");
    chord.set("v.1.level", "0.4");
    let found = values(&chord);
    assert!(found[0].contains("level: 0.3") && found[1].contains("level: 0.4"), "{found:?}");
    assert!(found[2].contains("level: 0.3"), "{found:?}");
    chord.render_to_memory().unwrap();
}

#[test]
fn mistakes_in_an_array_stand_at_their_items() {
    let folder = tempfile::tempdir().unwrap();
    let wrong = |uses: &str, nodes: &str| {
        let found = session(folder.path(), uses, nodes).check();
        let first = found.diagnostics.first().unwrap().clone();
        let at = first.location.unwrap();
        let text = found.sources.get(at.file).unwrap().text[at.span].to_owned();
        (first.code, text, first.help.unwrap_or_default())
    };
    let (code, text, _) = wrong(&ARRAY.replace("{\"frequency\": 330.0}", "{}"), MIX);
    assert_eq!((code, &*text), ("F032", "{}"));
    let (code, text, _) = wrong(&ARRAY.replace("330.0", "-3.0"), MIX);
    assert_eq!((code, &*text), ("F015", "-3.0"));
    let (code, text, _) = wrong(&ARRAY.replace("{\"frequency\": 330.0}", "330.0"), MIX);
    assert_eq!((code, &*text), ("F030", "330.0"));
    let (code, ..) = wrong("\"v\": Array(path: \"voice.ron\")", MIX);
    assert_eq!(code, "F030");
    let gain = "\"g\": Gain(audio: \"v.*.tone\"), \"o\": WavOut(audio: \"g\", path: \"o.wav\")";
    let (code, text, help) = wrong(ARRAY, gain);
    assert_eq!((code, &*text), ("F020", "\"v.*.tone\""));
    assert!(help.contains("means all items"), "{help}");
    let (code, text, _) = wrong(ARRAY, &MIX.replace("v.1", "v.7"));
    assert_eq!((code, &*text), ("F020", "\"v.7.tone\""));
    // Rates that do not meet: the place of the link, not of another item.
    let nodes = format!("\"x\": Noise(rate: 44100), {}", MIX.replace("v.1.tone", "x"));
    let (code, text, _) = wrong(ARRAY, &nodes);
    assert_eq!((code, &*text), ("F045", "\"x\""));
}
