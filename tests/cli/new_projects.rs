//! Projects that `foley new` makes run as they are, also of files of the user.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn foley(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_foley")).current_dir(folder).args(args).output().unwrap()
}

/// Runs the graph of a project, checks that it is laid out, and returns the peak of its sound.
fn peak(project: &Path, name: &str) -> f64 {
    let graph = format!("{name}.ron");
    let checked = foley(project, &["check", &graph]);
    assert!(checked.status.success(), "{name}: {}", String::from_utf8_lossy(&checked.stderr));
    assert!(foley(project, &["fmt", "--check", &graph]).status.success(), "{name} is not formatted");
    let run = foley(project, &["run", &graph, "--report", "report.json"]);
    let text = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(run.status.success(), "{name}: {}", String::from_utf8_lossy(&run.stderr));
    assert!(text.contains(&format!("out/{name}.wav")), "{text}");
    assert!(!text.contains("beyond full scale"), "{name}: {text}");
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(project.join("report.json")).unwrap()).unwrap();
    report["outputs"][0]["peak"].as_f64().unwrap()
}

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/assets")
}

fn asset(file: &str) -> String {
    assets().join(file).display().to_string()
}

#[test]
fn every_template_sounds_as_it_is() {
    let dir = tempfile::tempdir().unwrap();
    for template in ["wind", "cloth", "texture", "impact", "live", "material", "grains", "numbers"] {
        let name = format!("my_{template}");
        let made = foley(dir.path(), &["new", &name, "--template", template]);
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        if template == "live" {
            // It never ends by itself.
            let project = dir.path().join(&name);
            let run = foley(&project, &["run", "my_live.ron", "--until", "2"]);
            assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
            continue;
        }
        let peak = peak(&dir.path().join(&name), &name);
        println!("{template}: peak {peak}");
        assert!(peak > 0.1, "{template}: {peak}");
    }
}

#[test]
fn an_animation_and_recordings_become_a_project_without_reading_outside_of_it() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = asset("cloth/corduroy_trouser_legs_walk.pc2");
    let takes = ["blanket_movement_2", "blanket_movement_4", "blanket_movement_6"]
        .map(|take| asset(&format!("recordings/{take}.flac")));
    let takes: Vec<&str> = takes.iter().map(String::as_str).collect();
    let made = foley(dir.path(), &[&["new", "cape", "--mesh", &mesh, "--recordings"][..], &takes].concat());
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let cape = dir.path().join("cape");
    // The faces of a point cache come along.
    for file in
        ["assets/corduroy_trouser_legs_walk.obj", "recordings/blanket_movement_4.flac", "lib/target.ron"]
    {
        assert!(cape.join(file).is_file(), "{file}");
    }
    let peak = peak(&cape, "cape");
    assert!((peak - 0.708).abs() < 0.01, "normalized to -3 dB: {peak}");
    // Recordings alone, on a synthetic sheet, and an animation alone, of a synthetic material.
    let made = foley(dir.path(), &[&["new", "sheet", "--recordings"][..], &takes].concat());
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    assert!(self::peak(&dir.path().join("sheet"), "sheet") > 0.1);
    assert!(foley(dir.path(), &["new", "legs", "--mesh", &mesh]).status.success());
    assert!(self::peak(&dir.path().join("legs"), "legs") > 0.01);
}

#[test]
fn names_like_the_placeholders_of_a_template_are_unchanged() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("TITLE_FILE_IMAGE.png");
    fs::copy(assets().join("images/tiles.png"), &image).unwrap();
    let made = foley(dir.path(), &["new", "NAME_FILE", "--image", image.to_str().unwrap()]);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let project = dir.path().join("NAME_FILE");
    assert!(project.join("assets/TITLE_FILE_IMAGE.png").is_file());
    assert!(peak(&project, "NAME_FILE") > 0.01);
    // What cannot be copied leaves nothing half made.
    let made = foley(dir.path(), &["new", "NAME_FILE/NAME_FILE.ron/deeper"]);
    assert_eq!(made.status.code(), Some(1));
}

#[test]
fn an_image_and_a_log_become_a_project() {
    let dir = tempfile::tempdir().unwrap();
    let (image, log) = (asset("images/sk_brick.png"), asset("contacts/box_slide_slope.contacts.csv"));
    assert!(foley(dir.path(), &["new", "floor", "--image", &image]).status.success());
    assert!(peak(&dir.path().join("floor"), "floor") > 0.01);
    assert!(foley(dir.path(), &["new", "box", "--image", &image, "--contacts", &log]).status.success());
    let peak = peak(&dir.path().join("box"), "box");
    assert!(peak > 0.4, "{peak}");
}

#[test]
fn own_knocks_grains_and_textures_become_projects() {
    let dir = tempfile::tempdir().unwrap();
    let recording = |name: &str| asset(&format!("recordings/{name}.flac"));
    let (knock, scrape) = (recording("perc_bell"), recording("scrape_stone_gate"));
    // A block of steel of 60 mm has no mode that is heard; one of 480 mm rings.
    let text = fs::read_to_string(asset("meshes/block.obj")).unwrap();
    let number = |word: &str| word.parse::<f64>().map_or_else(|_| word.to_owned(), |x| (8.0 * x).to_string());
    let larger = |line: &str| match line.strip_prefix("v ") {
        Some(numbers) => format!("v {}\n", numbers.split(' ').map(number).collect::<Vec<_>>().join(" ")),
        None => format!("{line}\n"),
    };
    fs::write(dir.path().join("block.obj"), text.lines().map(larger).collect::<String>()).unwrap();
    let block = dir.path().join("block.obj").display().to_string();
    let knocks = ["new", "blocks", "--template", "material", "--mesh", &block, "--recordings", &knock];
    assert!(foley(dir.path(), &knocks).status.success());
    assert!(peak(&dir.path().join("blocks"), "blocks") > 0.4);
    let log = asset("contacts/box_slide_slope.contacts.csv");
    let (hit, other) = (recording("wood_hit_a1"), recording("wood_hit_a2"));
    let grains =
        ["new", "slope", "--template", "grains", "--contacts", &log, "--recordings", &hit, &other, &scrape];
    assert!(foley(dir.path(), &grains).status.success());
    assert!(peak(&dir.path().join("slope"), "slope") > 0.4);
    let texture = ["new", "gate", "--template", "numbers", "--recordings", &scrape];
    assert!(foley(dir.path(), &texture).status.success());
    assert!(peak(&dir.path().join("gate"), "gate") > 0.01);
}

#[test]
fn wrong_files_leave_no_project() {
    let dir = tempfile::tempdir().unwrap();
    let image = asset("images/tiles.png");
    for (args, text) in [
        (&["--mesh", "nothing.abc"][..], "nothing.abc is not a file"),
        (&["--template", "impact", "--image", &image], "`impact` has no use for --image"),
        (&["--image", &image, "--recordings", &image], "no template uses all of these files"),
        (&["--mesh", &image], "these files do not make a project"),
        (&["--recordings", &image, &image], "two files would become recordings/tiles.png"),
    ] {
        let made = foley(dir.path(), &[&["new", "piece"], args].concat());
        let errors = String::from_utf8_lossy(&made.stderr);
        assert_eq!(made.status.code(), Some(2), "{errors}");
        assert!(errors.contains(text), "{text}: {errors}");
        assert!(!dir.path().join("piece").exists());
    }
}
