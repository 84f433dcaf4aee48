//! Tests that nodes that are silent throughout a run report the reason, in the same words as the run.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

const GRAPH: &str = r#"#![schema = "foley:graph/1"]
Graph(
    params: { "gain": 1.0 },
    nodes: {
        "log": ContactLog(path: "contacts.csv", masses: [0.0, 1.0, 1.0]),
        "contacts": ContactClassifier(contacts: "log"),
        "path": ContactPath(contacts: "contacts.states"),
        "image": ImageLuma(path: "tiles.png", depth: 0.001),
        "edges": SobelMap(luma: "image"),
        "scrape": MapExcitation(paths: "path", map: "edges", rate: 44100),
        "strikes": ImpactForce(impacts: "contacts.impacts", rate: 44100),
        "modes": ModesFile(path: "bar.modes.csv"),
        "bank": ModalBank(forces: ["scrape", "strikes"], modes: "modes"),
        "loud": Gain(audio: "bank", gain: "$gain"),
        "out": WavOut(audio: "loud", path: "out.wav"),
    },
)"#;

/// A second of frames at 60 Hz: body 1 drops on body 2 at 1 m/s and slides over it, and body 3 rests on body 2.
fn contacts(slides: bool) -> String {
    let mut text =
        "time,body1,body2,px,py,pz,nx,ny,nz,force_normal,vt_x,vt_y,vt_z,vel_normal,vel_normal_in\n"
            .to_owned();
    for k in 1..60 {
        let (t, x) = (f64::from(k) / 60.0, 0.01 * f64::from(k));
        let v = if slides { 0.6 } else { 0.0 };
        let (x, hits) = if slides { (x, if k == 1 { -1.0 } else { 0.0 }) } else { (0.01, 0.0) };
        writeln!(text, "{t:.6},1,2,{x},0.1,0,0,0,1,10,{v},0,0,0,{hits}").unwrap();
        writeln!(text, "{t:.6},2,3,0.5,0.1,0,0,0,1,10,0,0,0,0,0").unwrap();
    }
    text
}

/// Runs the graph with values from the command line; all that it prints.
fn run(slides: bool, sets: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("g.ron"), GRAPH).unwrap();
    fs::write(path.join("contacts.csv"), contacts(slides)).unwrap();
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/assets");
    for (folder, file) in [("images", "tiles.png"), ("impact", "bar.modes.csv")] {
        fs::copy(assets.join(folder).join(file), path.join(file)).unwrap();
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(path).args(["run", "g.ron", "--out", "out"]);
    sets.iter().for_each(|set| {
        command.args(["--set", set]);
    });
    let first = command.output().unwrap();
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    let text = |output: &std::process::Output| String::from_utf8_lossy(&output.stdout).into_owned();
    // The cache answers the same.
    let second = command.output().unwrap();
    let notes =
        |text: &str| text.lines().filter(|l| l.starts_with("note: ")).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(notes(&text(&first)), notes(&text(&second)), "{sets:?}");
    text(&first)
}

#[test]
fn what_is_heard_has_no_note() {
    let text = run(true, &[]);
    assert!(!text.contains("silent throughout"), "{text}");
}

#[test]
fn a_wrong_pair_of_bodies_is_named_with_those_that_there_are() {
    let text = run(true, &["path.a=2", "path.b=99"]);
    assert!(
        text.contains("note: path: silent throughout: no contact between 2 and 99; there are 1-2, 2-3"),
        "{text}"
    );
    let text = run(true, &["scrape.object=7"]);
    assert!(text.contains("note: scrape: silent throughout: no path has object 7; there are 0"), "{text}");
    let text = run(true, &["strikes.object=77"]);
    assert!(
        text.contains("note: strikes: silent throughout: no impact has object 77; there are 1, 2"),
        "{text}"
    );
}

#[test]
fn a_strength_of_0_is_named() {
    for (set, note) in [
        ("scrape.kappa=0.0", "note: scrape: silent throughout: `kappa` is 0"),
        ("scrape.gain=0.0", "note: scrape: silent throughout: `gain` is 0"),
        ("gain=0.0", "note: loud: silent throughout: `gain` is 0"),
        ("bank.gain=0.0", "note: bank: silent throughout: `gain` is 0"),
    ] {
        let text = run(true, &[set]);
        assert!(text.contains(note), "{set}: {text}");
        assert_eq!(text.matches("silent throughout").count(), 1, "{set}: {text}");
    }
}

#[test]
fn a_log_in_which_nothing_slides_says_what_the_contacts_do() {
    let text = run(false, &["path.unsteady=0.0"]);
    assert!(text.contains("note: path: silent throughout: none of "), "{text}");
    assert!(text.contains(" static"), "{text}");
}
