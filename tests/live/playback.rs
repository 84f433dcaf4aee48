//! A graph that plays produces its offline output.

use super::stand::{OUT, Stand, graph, material, material_in, offline, offline_with};
use foley::live::{Options, Player};
use foley::plan::PlanOptions;

/// Audio nodes only; a loop; look-ahead; a file that is read ahead; values made by folds.
fn samples() -> Vec<String> {
    [
        "\"a\": Noise(rate: 44100, channels: 2), \"last\": HighPass(audio: \"a\", cutoff: 500.0)".to_owned(),
        "\"a\": Tone(frequency: 440.0, rate: 44100), \"m\": Mix(inputs: [\"a\", \"f\"]), \
         \"f\": Feedback(audio: \"m\", like: \"a\", delay: 0.05, gain: 0.5), \"last\": Gain(audio: \"m\", gain: 0.3)"
            .to_owned(),
        "\"a\": Noise(rate: 44100), \"b\": Advance(audio: \"a\", seconds: 0.02), \
         \"last\": Mix(inputs: [\"a\", \"b\"])"
            .to_owned(),
        "\"a\": WavIn(path: \"../assets/recordings/clothing_rustle_land.flac\"), \
         \"last\": LowPass(audio: \"a\", cutoff: 900.0)"
            .to_owned(),
        "\"m\": Metronome(interval: 0.05), \"last\": Impulses(events: \"m\", rate: 44100)".to_owned(),
    ]
    .map(|nodes| graph(&format!("{nodes}, {OUT}")))
    .to_vec()
}

#[test]
fn a_graph_that_plays_gives_the_bits_of_an_offline_run() {
    for text in samples() {
        // Sound that is read ahead comes too early for the cut of an offline run.
        let mut wanted = offline(&text, 0.6);
        wanted.truncate(wanted.len() * 5 / 6);
        for (quantum, block) in [(64, 64), (128, 100), (256, 1000)] {
            let mut stand = Stand::new(&text, quantum);
            let channels = stand.callback.channels();
            let late = stand.player.plan().latency;
            let late = stand.callback.rate().first_at(late) as usize;
            stand.play(wanted.len() / channels + late, block);
            let heard = &stand.heard[late * channels..];
            assert!(stand.heard[..late * channels].iter().all(|x| *x == 0.0));
            let first = heard.iter().zip(&wanted).position(|(a, b)| a != b);
            assert!(first.is_none_or(|k| k >= wanted.len()), "sample {first:?}, quantum {quantum}\n{text}");
            assert_eq!(stand.player.shared().meter.missed.load(std::sync::atomic::Ordering::Relaxed), 0);
        }
    }
}

/// Two planes that slide and a bowl that snaps, from motion to sound, in the forms without look-ahead.
fn cloth() -> String {
    graph(&format!(
        "\"planes\": MeshGenerator(kind: Planes, speed: 0.8, duration: 0.5, size: [0.3, 0.3], vertices: (9, 9)), \
         \"contacts\": ContactDetector(mesh: \"planes\", radius: 0.02), \
         \"speed\": SlidingSpeed(contacts: \"contacts\", gate: Causal, between: Linear), \
         \"cotton\": FrictionModelFile(path: \"../assets/cloth/cotton.friction.json\"), \
         \"friction\": IftNoise(speeds: \"speed\", model: \"cotton\", rate: 48000), \
         \"bowl\": MeshGenerator(kind: Bowl, frequency: 5.0, duration: 0.5, vertices: (9, 9)), \
         \"curvature\": MeanCurvature(mesh: \"bowl\"), \"buckles\": BuckleDetector(curvature: \"curvature\"), \
         \"events\": CrumpleEvents(buckles: \"buckles\"), \
         \"energies\": EnergyCalibrationFile(path: \"../assets/cloth/cotton_sheet.energies.json\"), \
         \"bank\": CrumpleBankFile(path: \"../assets/cloth/clothing.crumple.json\"), \
         \"match\": HistogramMatcher(events: \"events\", bank: \"bank\", calibration: \"energies\", adapt: true), \
         \"crumple\": CrumplePlayer(matched: \"match\", bank: \"bank\", max_voices: 64, rate: 48000), \
         \"both\": Mix(inputs: [\"friction\", \"crumple\"]), \
         \"last\": HighPass(audio: \"both\", cutoff: 100.0), {OUT}"
    ))
}

#[test]
fn cloth_gives_the_same_bits_in_blocks_of_1_37_64_and_4096_samples_offline_and_while_it_plays() {
    let text = cloth();
    let at = |samples: usize, threads| {
        let window = foley_nodes::core::time::Rate::hz(48_000).tick(samples as i64);
        offline_with(&text, &PlanOptions { window, threads, ..PlanOptions::default() })
    };
    let wanted = at(1, 1);
    let loudest = |part: &[f32]| part.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    assert!(wanted.len() >= 24_000 && loudest(&wanted) > 0.01, "{} {}", wanted.len(), loudest(&wanted));
    // Both are in it: neither alone is the sound.
    for one in ["friction", "crumple"] {
        let alone = text.replace("[\"friction\", \"crumple\"]", &format!("[\"{one}\"]"));
        let heard = offline(&alone, 0.5);
        assert!(alone != text && heard[..24_000] != wanted[..24_000], "{one} is all");
    }
    for (block, threads) in [(37, 1), (64, 2), (4096, 2)] {
        assert!(at(block, threads) == wanted, "windows of {block}");
    }
    for block in [1, 37, 64, 4096] {
        let mut stand = Stand::new(&text, block);
        let late = stand.callback.rate().first_at(stand.player.plan().latency) as usize;
        stand.play(wanted.len() + late, block);
        let heard = &stand.heard[late..];
        let first = heard.iter().zip(&wanted).position(|(a, b)| a != b);
        assert_eq!(first, None, "of {}, blocks of {block}", heard.len());
    }
}

#[test]
fn a_node_that_runs_offline_only_is_refused_where_it_stands() {
    let text =
        graph("\"a\": Tone(frequency: 100.0, rate: 48000), \"o\": WavOut(audio: \"a\", path: \"o.wav\")");
    let mut material = material(&text);
    let tone = material.graph.nodes.iter_mut().find(|n| n.id == "a").unwrap();
    let mut heavy = foley_nodes::core::node::NodeType::of::<foley_nodes::dsp::nodes::ToneNode>("dsp");
    heavy.class = foley_nodes::core::node::Class::Offline;
    tone.ty = std::sync::Arc::new(heavy);
    let Err(refused) = Player::start(material, Options::default()) else { panic!("an offline node plays") };
    let [only] = refused.as_slice() else { panic!("{refused:?}") };
    assert_eq!((only.code, only.node.as_deref()), ("F053", Some("a")));
    assert!(only.help.iter().any(|help| help.contains("foley run")), "{only:?}");
    let location = only.location.as_ref().unwrap();
    assert_eq!(&text[location.span.clone()], "\"a\"", "{only:?}");
}

#[test]
fn a_search_over_the_whole_take_is_refused_while_it_plays_and_the_online_one_is_not() {
    let start = |name: &str| {
        // A report of the whole take is for files as well.
        let nodes = "nodes: { \"report\": None }";
        let text = format!("#![schema = \"foley:graph/1\"]\nGraph(extends: {name:?}, {nodes})");
        Player::start(material_in("cloth", &text), Options::default()).map(|_| ())
    };
    let refused = start("units_global.ron").unwrap_err();
    let found: Vec<_> = refused.iter().map(|d| (d.code, d.node.as_deref())).collect();
    assert_eq!(found, [("F053", Some("selector"))], "{refused:?}");
    if let Err(refused) = start("units_online.ron") {
        assert!(refused.iter().all(|d| d.code != "F053"), "{refused:?}");
    }
}
