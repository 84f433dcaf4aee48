//! Several materials in one scene: each pair of them sounds with its own model, and only where it slides.

use crate::common;
use foley::graph::{DirFiles, Limits, LoadOptions, load_text};
use foley::plan::PlanOptions;
use foley_nodes::io::AudioReader;
use std::path::Path;

/// Nodes of a scene besides the sheet, for each pair of materials.
type PairNodes = fn(&str) -> String;

/// Friction noise of a pair, as a file.
fn noise(id: &str) -> String {
    format!("\"{id}_out\": WavOut(audio: \"{id}_sound\", path: \"{id}.wav\", format: Float32),")
}

/// A sheet that slides over two floors, one after the other, with the nodes of each pair.
fn scene(left: &str, right: &str, heard: PairNodes) -> String {
    let model = |id: &str, name: &str| {
        format!(
            "\"{id}\": FrictionModelFromClips(recordings: [\"clothing_rustle_{name}.flac\"], materials: [\"{id}\", \"{id}\"]),"
        )
    };
    let pair = |id: &str| {
        format!(
            "\"{id}\": MaterialRouter(contacts: \"contacts\", between: [\"cotton\", \"{id}\"]),
            \"{id}_speed\": SlidingSpeed(contacts: \"{id}\"),
            \"{id}_sound\": IftNoise(speeds: \"{id}_speed\", model: \"{id}_model\", rate: 48000),
            {}",
            heard(id)
        )
    };
    let floor = |id: &str, material: &str, x: f64| {
        format!(
            "\"{id}\": MeshGenerator(kind: Sheet, speed: 0.0, duration: 3.0, vertices: [5, 5], place: [{x:?}, 0.0, -0.005], material: \"{material}\"),"
        )
    };
    format!(
        "#![schema = \"foley:graph/1\"]
        Graph(seed: 3, nodes: {{
            \"sheet\": MeshGenerator(kind: Sheet, speed: 0.8, duration: 3.0, vertices: [9, 9], size: [0.5, 0.5], place: [-1.0, 0.0, 0.0], material: \"cotton\"),
            {} {}
            \"contacts\": ContactDetector(mesh: \"sheet\", others: [\"left\", \"right\"], radius: 0.01),
            {} {} {} {}
        }})",
        floor("left", left, -1.5),
        floor("right", right, 1.5),
        model("wool_model", "2"),
        model("nylon_model", "3"),
        pair("wool"),
        pair("nylon"),
    )
}

/// The output sound, in bits.
fn heard(folder: &Path, name: &str) -> Vec<u32> {
    let file = std::fs::File::open(folder.join(name)).unwrap();
    let samples = AudioReader::open(Box::new(file)).unwrap().read_mono().unwrap();
    samples.iter().map(|x| x.to_bits()).collect()
}

fn run(text: &str) -> [Vec<u32>; 2] {
    let folder = run_in_folder(text);
    ["wool.wav", "nylon.wav"].map(|name| heard(folder.path(), name))
}

fn run_one(text: &str) -> Vec<u32> {
    heard(run_in_folder(text).path(), "wool.wav")
}

fn run_in_folder(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = common::graphs().join("assets/recordings/test.ron");
    let loaded = load_text("test.ron", text, &path, &LoadOptions::default());
    let shown = foley::diag::render(&loaded.diagnostics, &loaded.sources, false);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{shown}"));
    let files = DirFiles::new(loaded.root, Limits::default());
    common::run_graph(&graph, &files, &PlanOptions::default(), folder.path()).unwrap();
    folder
}

/// First and last sample that is not silent.
fn sounding(samples: &[u32]) -> Option<(usize, usize)> {
    let loud = |bits: &u32| f32::from_bits(*bits) != 0.0;
    Some((samples.iter().position(loud)?, samples.iter().rposition(loud)?))
}

#[test]
fn each_pair_is_heard_only_while_it_slides_and_swapped_materials_swap_places() {
    let [wool, nylon] = run(&scene("wool", "nylon", noise));
    // The floors are 1 m wide and 2 m apart: the sheet leaves the left one before it comes to the right one.
    let (first, second) = (sounding(&wool).unwrap(), sounding(&nylon).unwrap());
    assert!(first.1 < second.0, "{first:?} {second:?}");
    let [wool, nylon] = run(&scene("nylon", "wool", noise));
    let (later, earlier) = (sounding(&wool).unwrap(), sounding(&nylon).unwrap());
    assert!(earlier.0.abs_diff(first.0) < 60 && later.0.abs_diff(second.0) < 60, "{earlier:?} {later:?}");
    // The same material on both sides is one material.
    let one = scene("wool", "wool", noise).replace("\"cotton\", \"nylon\"", "\"cotton\", \"wool\"");
    let [both, _] = run(&one);
    assert_eq!(sounding(&both), Some((first.0, later.1)));
}

/// Units of recordings in place of the noise of a pair: those of all recordings that have its name as their tag.
fn units(id: &str) -> String {
    chosen(id, "all", &format!(", tags: [\"{id}\"]"))
}

/// As `units`, from a database that holds nothing else.
fn own_units(id: &str) -> String {
    chosen(id, &format!("{id}_alone"), "")
}

fn chosen(id: &str, database: &str, tags: &str) -> String {
    format!(
        "\"{id}_mfcc\": Mfcc(audio: \"{id}_sound\"),
        \"{id}_features\": TemporalGaussian(features: \"{id}_mfcc.features\"),
        \"{id}_picks\": UnitSelector(features: \"{id}_features\", database: \"{database}\", d_max: 6.0{tags}),
        \"{id}_units\": UnitConcatenator(picks: \"{id}_picks\", database: \"{database}\", target: \"{id}_sound\"),
        \"{id}_out\": WavOut(audio: \"{id}_units\", path: \"{id}.wav\", format: Float32),"
    )
}

/// The scene with recordings: of wool, of nylon, and of both with tags.
fn with_databases(scene: &str) -> String {
    let database = |id: &str, names: &[&str], tags: &str| {
        let files: Vec<_> = names.iter().map(|n| format!("\"clothing_rustle_{n}.flac\"")).collect();
        format!("\"{id}\": UnitDatabase(recordings: [{}], tags: [{tags}]),\n", files.join(", "))
    };
    let all = database("all", &["2", "3"], "\"wool\", \"nylon\"");
    let (wool, nylon) = (database("wool_alone", &["2"], ""), database("nylon_alone", &["3"], ""));
    scene.replacen("nodes: {", &format!("nodes: {{ {all} {wool} {nylon}"), 1)
}

/// The last start of a sound: after a tenth of a second of silence, or at its beginning.
fn wakes(samples: &[u32]) -> usize {
    let (first, last) = sounding(samples).unwrap();
    let (mut woken, mut silent) = (first, 0);
    for (n, bits) in samples.iter().enumerate().take(last + 1).skip(first) {
        let loud = f32::from_bits(*bits) != 0.0;
        if loud && silent >= 4800 {
            woken = n;
        }
        silent = if loud { 0 } else { silent + 1 };
    }
    woken
}

#[test]
fn a_pair_is_made_of_its_own_recordings_and_sleeps_where_it_is_silent() {
    let of = |heard| run(&with_databases(&scene("wool", "nylon", heard)));
    let [wool, nylon] = of(units);
    // Half a second after its noise has ended a pair has faded out; the other one wakes with its noise, about 2 s after the beginning.
    let (ends, woken) = (sounding(&wool).unwrap().1, wakes(&nylon));
    assert!(ends < 60_000 && woken > 80_000, "{ends} {woken}");
    // The same bits as from a database that holds its recordings only, and others than from all of them.
    assert!(of(own_units) == [wool.clone(), nylon.clone()]);
    let [free_wool, free_nylon] = of(|id| chosen(id, "all", ""));
    assert!(free_wool != wool || free_nylon != nylon);
}

#[test]
fn swapped_materials_swap_the_units_that_are_heard() {
    let [wool, nylon] = run(&with_databases(&scene("wool", "nylon", units)));
    // The material that was on the right is now on the left, and sounds first.
    let [later, earlier] = run(&with_databases(&scene("nylon", "wool", units)));
    // To a unit or two: seeds are those of the nodes, which are named after the materials.
    for (swapped, there) in [(earlier, wool), (later, nylon)] {
        let differences = [
            wakes(&swapped).abs_diff(wakes(&there)),
            sounding(&swapped).unwrap().1.abs_diff(sounding(&there).unwrap().1),
        ];
        assert!(differences.iter().all(|n| *n < 480), "{differences:?}");
    }
}

#[test]
fn one_material_is_heard_as_without_any_routing() {
    let text = |contacts: &str| {
        let scene =
            with_databases(&scene("wool", "wool", |id| if id == "wool" { units(id) } else { String::new() }));
        let nylon = scene.find("\"nylon\": MaterialRouter").unwrap();
        let scene = format!("{} }})", &scene[..nylon]);
        scene.replace("SlidingSpeed(contacts: \"wool\")", &format!("SlidingSpeed(contacts: \"{contacts}\")"))
    };
    let (routed, plain) = (run_one(&text("wool")), run_one(&text("contacts")));
    assert!(sounding(&routed).is_some() && routed == plain);
}

/// A cotton sheet that lies on both floors and slides over them at once; pairs of cotton with `pairs` sound as wool and as nylon.
fn at_once(floors: [&str; 2], pairs: [&str; 2], heard: PairNodes) -> String {
    let changes = [
        ("speed: 0.8", "speed: 0.2".to_owned()),
        ("duration: 3.0", "duration: 1.5".to_owned()),
        ("size: [0.5, 0.5], place: [-1.0,", "size: [0.8, 0.5], place: [-0.2,".to_owned()),
        ("place: [-1.5,", "place: [-0.5,".to_owned()),
        ("place: [1.5,", "place: [0.5,".to_owned()),
        ("[\"cotton\", \"wool\"]", format!("[\"cotton\", \"{}\"]", pairs[0])),
        ("[\"cotton\", \"nylon\"]", format!("[\"cotton\", \"{}\"]", pairs[1])),
    ];
    changes.iter().fold(scene(floors[0], floors[1], heard), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    })
}

#[test]
fn pairs_that_slide_at_once_are_made_of_their_own_recordings_alone() {
    let materials = ["cotton", "polyester"];
    let of = |heard| run(&with_databases(&at_once(materials, materials, heard)));
    let [itself, other] = of(units);
    let both = [sounding(&itself).unwrap(), sounding(&other).unwrap()];
    let together = both[0].1.min(both[1].1).saturating_sub(both[0].0.max(both[1].0));
    assert!(together > 60_000, "{both:?}");
    assert!(itself != other && of(own_units) == [itself.clone(), other.clone()]);
    let [free, free_other] = of(|id| chosen(id, "all", ""));
    assert!(free != itself || free_other != other, "tags leave something out");
}

#[test]
fn swapped_materials_swap_what_is_heard_of_them_bit_for_bit() {
    for heard in [noise, units] as [PairNodes; 2] {
        let of = |floors, pairs| run(&with_databases(&at_once(floors, pairs, heard)));
        let (order, swapped) = (["cotton", "polyester"], ["polyester", "cotton"]);
        let [one, two] = of(order, order);
        let [other_one, other_two] = of(swapped, order);
        assert!(one != other_one && two != other_two, "they slide over other floors");
        // The same as if each read the other's pair.
        assert!(of(order, swapped) == [other_one, other_two]);
        assert!(of(swapped, swapped) == [one, two]);
    }
}

#[test]
fn every_class_of_the_example_finds_what_it_needs_by_a_warp_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let fallbacks = |set: &[&str]| {
        let report =
            common::foley(folder.path(), &[&["run", "graphs/cloth/two_materials.ron"], set].concat());
        ["itself", "cover", "crumple"].map(|class| {
            let reported = &report["nodes"][format!("{class}_units.selector")]["summary"];
            reported["fallback_share"].as_f64().unwrap()
        })
    };
    let warped = fallbacks(&[]);
    println!("fallbacks of each class: {warped:.3?}");
    assert!(warped.iter().all(|share| *share < 0.02), "{warped:?}");
    // Without the marked moments, most snaps have no similar unit in the recordings.
    let none = "graphs/assets/cloth/none.correspondences.ron";
    let sets = ["itself", "cover", "crumple"].map(|class| format!("{class}_units.correspondences={none}"));
    let plain = fallbacks(&sets.each_ref().map(|set| ["--set", set]).concat());
    assert!(plain.iter().zip(warped).all(|(plain, warped)| *plain > warped + 0.05), "{plain:?}");
}
