//! Tests that `foley probe` prints one output, and that no other node runs.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const GRAPH: &str = "#![schema = \"foley:graph/1\"]
Graph(
    params: { \"gain\": 1.0 },
    nodes: {
        \"tone\": Tone(frequency: 100.0, level: 0.5, rate: 8000, duration: Some(2.0)),
        \"late\": Delay(audio: \"tone\", seconds: 0.5),
        \"wide\": Pan(audio: \"late\", position: -0.5),
        \"loud\": Gain(audio: \"wide\", gain: \"$gain\"),
        \"beat\": Metronome(interval: 0.25, duration: Some(2.0)),
        \"level\": Loudness(audio: \"tone\"),
        \"planes\": MeshGenerator(kind: Planes, speed: 1.0, duration: 0.5, size: [0.3, 0.3]),
        \"log\": ContactLog(path: \"none.csv\", masses: [0.0, 1.0]),
        \"contacts\": ContactClassifier(contacts: \"log\"),
        \"endless\": Noise(rate: 8000),
        \"out\": WavOut(audio: \"loud\", path: \"out.wav\"),
    },
)
";

fn foley(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(dir).env("NO_COLOR", "1").args(["probe", "g.ron"]).args(args).output().unwrap()
}

fn project() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let header = "time,body1,body2,px,py,pz,nx,ny,nz,force_normal,vt_x,vt_y,vt_z,vel_normal,vel_normal_in\n";
    fs::write(dir.path().join("none.csv"), format!("{header}0.1,0,1,0,0,0,0,0,1,1,0,0,0,0,0\n")).unwrap();
    fs::write(dir.path().join("g.ron"), GRAPH).unwrap();
    dir
}

fn text(dir: &Path, args: &[&str]) -> String {
    let output = foley(dir, args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn json(dir: &Path, args: &[&str]) -> Value {
    serde_json::from_str(&text(dir, &[args, &["--json"]].concat())).unwrap()
}

#[test]
fn audio_has_its_level_length_and_pauses_and_no_file_is_written() {
    let dir = project();
    let sound = json(dir.path(), &["loud"]);
    assert_eq!(
        (&sound["kind"], &sound["output"], &sound["channels"]),
        (&"sound".into(), &"loud.out".into(), &2.into())
    );
    assert_eq!(sound["rate"], 8000.0);
    assert!((sound["seconds"].as_f64().unwrap() - 2.5).abs() < 1e-9, "{sound}");
    let first = sound["first_sound"].as_f64().unwrap();
    assert!((first - 0.5).abs() < 2e-3, "{first}");
    let share = sound["active_share"].as_f64().unwrap();
    assert!((share - 0.8).abs() < 0.02, "{share}");
    assert_eq!(sound["per_channel"].as_array().unwrap().len(), 2);
    // A gain of 2 raises all levels by 6.02 dB.
    let louder = json(dir.path(), &["loud", "--set", "gain=2.0"]);
    for level in ["peak_db", "rms_db", "lufs", "dba"] {
        let rise = louder[level].as_f64().unwrap() - sound[level].as_f64().unwrap();
        assert!((rise - 6.02).abs() < 0.01, "{level}: {rise}");
    }
    assert!(!dir.path().join("out").exists(), "a file of the graph was written");
    // The cache of `foley run` is beside the graph; an endless node elsewhere in the graph does not matter.
    let shown = text(dir.path(), &["loud.out"]);
    assert!(shown.starts_with("loud.out: audio, 8000 Hz, stereo\n") && shown.contains("LUFS"), "{shown}");
    let endless = foley(dir.path(), &["endless"]);
    assert_eq!(endless.status.code(), Some(2));
    let cut = json(dir.path(), &["endless", "--until", "0.5"]);
    assert_eq!(cut["frames"], 4000);
}

#[test]
fn a_probe_agrees_with_foley_levels() {
    let dir = project();
    let sound = json(dir.path(), &["loud"]);
    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
        let output = command.current_dir(dir.path()).args(args).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    fs::write(dir.path().join("g.ron"), GRAPH.replace("        \"endless\": Noise(rate: 8000),\n", ""))
        .unwrap();
    run(&["run", "g.ron", "--tap", "loud.out=loud.wav", "--quiet"]);
    let levels: Value = serde_json::from_slice(&run(&["levels", "loud.wav", "--json"])).unwrap();
    for key in ["lufs", "rms_db", "peak_db", "centroid_hz", "dba"] {
        let [a, b] = [&sound[key], &levels[0]["figures"][key]].map(|x| x.as_f64().unwrap());
        assert!((a - b).abs() < 1e-6 * b.abs(), "{key}: {a} {b}");
    }
}

#[test]
fn a_time_restricts_the_figures() {
    let dir = project();
    let silent = json(dir.path(), &["loud", "--to", "0.4"]);
    assert_eq!((silent["frames"].as_u64(), silent["peak"].as_f64()), (Some(3200), Some(0.0)));
    let part = json(dir.path(), &["loud", "--from", "1", "--to", "1.5"]);
    assert_eq!((part["frames"].as_u64(), part["active_share"].as_f64()), (Some(4000), Some(1.0)));
    let shown = text(dir.path(), &["loud", "--to", "0.4"]);
    assert!(shown.contains("silent throughout"), "{shown}");
    let wrong = foley(dir.path(), &["loud", "--from", "2", "--to", "1"]);
    assert_eq!(wrong.status.code(), Some(2));
    let beats = json(dir.path(), &["beat", "--from", "0.5", "--to", "1.1"]);
    assert_eq!(beats["count"], 3);
}

#[test]
fn events_values_and_meshes_have_figures_of_their_own() {
    let dir = project();
    let beats = json(dir.path(), &["beat", "--first", "3"]);
    assert_eq!((beats["count"].as_u64(), beats["per_second"].as_f64()), (Some(8), Some(4.0)));
    assert_eq!(beats["intervals"]["median"], 0.25);
    assert_eq!(beats["first"].as_array().unwrap().len(), 3);
    assert_eq!(beats["fields"][0]["name"], "gain");
    let level = json(dir.path(), &["level"]);
    assert!((level["json"]["peak"].as_f64().unwrap() - 0.5).abs() < 1e-3, "{level}");
    let mesh = json(dir.path(), &["planes"]);
    let names: Vec<&str> =
        mesh["columns"].as_array().unwrap().iter().filter_map(|c| c["name"].as_str()).collect();
    assert_eq!((mesh["kind"].as_str(), &names[..]), (Some("stream"), &["x", "y", "z"][..]));
    assert!(mesh["format"].as_str().unwrap().contains("vertices"), "{mesh}");
    for (output, line) in
        [("beat", "0.25 to 0.25 s"), ("level", "peak: 0.5"), ("planes", "elements of x, y, z")]
    {
        let shown = text(dir.path(), &[output]);
        assert!(shown.contains(line), "{output}: {shown}");
    }
}

#[test]
fn every_kind_with_a_drawing_is_drawn() {
    let dir = project();
    for output in ["loud", "beat", "planes"] {
        text(dir.path(), &[output, "--svg", "drawn.svg"]);
        let drawn = fs::read_to_string(dir.path().join("drawn.svg")).unwrap();
        assert!(drawn.starts_with("<svg") && drawn.contains(&format!("{output}.")), "{output}");
    }
    let none = foley(dir.path(), &["level", "--svg", "level.svg"]);
    assert!(none.status.code() == Some(2) && !dir.path().join("level.svg").exists());
    let graph = foley(dir.path(), &["loud", "--svg", "g.ron"]);
    assert_eq!(graph.status.code(), Some(2));
    assert_eq!(fs::read_to_string(dir.path().join("g.ron")).unwrap(), GRAPH);
}

#[test]
fn a_wrong_name_says_what_would_be_right() {
    let dir = project();
    for (name, advice) in [
        ("loudd", "did you mean `loud`?"),
        ("loud.ot", "did you mean `loud.out`?"),
        ("contacts", "write `contacts.states` or `contacts.impacts`"),
        ("out", "it reads `loud.out`"),
        ("nothing", "outputs: tone."),
    ] {
        let wrong = foley(dir.path(), &[name]);
        let message = String::from_utf8_lossy(&wrong.stderr).into_owned();
        assert_eq!(wrong.status.code(), Some(2), "{name}: {message}");
        assert!(message.contains("F083") && message.contains(advice), "{name}: {message}");
    }
}
