//! Promised properties of surfaces, from graphs to sound.

use crate::common;
use foley::graph::{DirFiles, Limits, LoadOptions, Override, load};
use foley::memo::Memo;
use foley::plan::PlanOptions;
use foley_nodes::core::time::{Rate, ticks};
use foley_nodes::io::AudioReader;
use std::fs::File;
use std::path::Path;

const FS: f64 = 44_100.0;

/// The sound of an example with other numbers, in windows of `window` samples.
fn sound(name: &str, numbers: &[(&str, &str)], seconds: f64, window: usize) -> Vec<f32> {
    sound_cached(name, numbers, seconds, window, None)
}

/// The same with the values of a cache in this folder, which take longer than the sound.
fn sound_cached(
    name: &str,
    numbers: &[(&str, &str)],
    seconds: f64,
    window: usize,
    cache: Option<&Path>,
) -> Vec<f32> {
    let path = common::graphs().join(format!("texture/{name}.ron"));
    let given: Vec<Override> = numbers
        .iter()
        .map(|(key, value)| Override { target: (*key).into(), value: (*value).into() })
        .collect();
    let loaded = load(&path, &LoadOptions::default().overrides(given));
    let shown = foley::diag::render(&loaded.diagnostics, &loaded.sources, false);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{shown}"));
    let window = Rate::hz(44_100).span(window);
    let options = PlanOptions { window, until: Some(ticks(seconds)), ..PlanOptions::default() };
    let dir = tempfile::tempdir().unwrap();
    let files = DirFiles::new(loaded.root, Limits::default());
    let memo = cache.map(|cache| Memo::new(cache.to_owned(), 1 << 30, &path).with_policy(common::VALUES));
    common::run_graph_cached(&graph, &files, &options, memo.as_ref(), dir.path()).unwrap();
    let file = File::open(dir.path().join(format!("{name}.wav"))).unwrap();
    let mut reader = AudioReader::open(Box::new(std::io::BufReader::new(file))).unwrap();
    let mut samples = vec![0.0; reader.info().frames as usize * reader.info().channels];
    reader.read(&mut samples).unwrap();
    samples
}

#[test]
fn a_surface_sounds_the_same_in_windows_of_32_to_4096_samples() {
    // Noise as coarse as the image, and levels at one speed, which are quick to make; between two levels of detail, where there are any.
    let graphs: [(&str, &[(&str, &str)]); 3] = [
        (
            "brick_slide",
            &[("brick.extend", "false"), ("brick.strengths.by_speed", "false"), ("scale", "1.1")],
        ),
        (
            "trajectories",
            &[
                ("profile.extend", "false"),
                ("alike.extend", "false"),
                ("equal.by_speed", "false"),
                ("distance", "14.0"),
            ],
        ),
        (
            "two_textures",
            &[
                ("floor_noise.extend", "false"),
                ("block_noise.extend", "false"),
                ("equal.by_speed", "false"),
                ("distance", "5.2"),
            ],
        ),
    ];
    for (name, numbers) in graphs {
        let whole = sound(name, numbers, 0.7, 44_100);
        assert!(whole.iter().any(|x| x.abs() > 1e-3), "{name} sounds");
        for window in [32, 4096] {
            assert!(sound(name, numbers, 0.7, window) == whole, "{name} in windows of {window}");
        }
        let cache = tempfile::tempdir().unwrap();
        for window in [64, 128, 256, 512, 1024, 2048] {
            let found = sound_cached(name, numbers, 0.7, window, Some(cache.path()));
            assert!(found == whole, "{name} in windows of {window}");
        }
    }
    // The ball falls for a while before it rolls.
    for (name, seconds) in [
        ("grass", 0.3),
        ("impacts", 0.4),
        ("isophotes", 0.3),
        ("isophotes_file", 0.3),
        ("map_file", 0.3),
        ("tiles_ball", 0.5),
        ("tiles_stroke", 0.3),
    ] {
        let whole = sound(name, &[], seconds, 44_100);
        assert!(whole.iter().any(|x| x.abs() > 1e-4), "{name} sounds");
        for window in [32, 480, 4096] {
            assert!(sound(name, &[], seconds, window) == whole, "{name} in windows of {window}");
        }
    }
}

#[test]
fn a_surface_of_one_colour_is_simple_and_silent() {
    let dir = tempfile::tempdir().unwrap();
    // 8 x 8 grey pixels of 150, as Pillow writes them.
    const FLAT: &[u8] = &[
        137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 8, 0, 0, 0, 8, 8, 0, 0, 0, 0,
        225, 100, 225, 87, 0, 0, 0, 16, 73, 68, 65, 84, 120, 218, 99, 156, 198, 0, 1, 76, 12, 20, 49, 0, 44,
        34, 0, 166, 242, 67, 228, 253, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
    ];
    std::fs::write(dir.path().join("flat.png"), FLAT).unwrap();
    let text = r#"#![schema = "foley:graph/1"]
Graph(
    nodes: {
        "image": ImageLuma(path: "flat.png"),
        "class": HistogramClass(luma: "image"),
        "edges": SobelMap(luma: "image"),
        "curves": Isophotes(luma: "image"),
        "path": Stroke(shape: Circle, from: (0.2, 0.2), radius: 0.1, laps: 1.0, speed: 0.5),
        "scrape": MapExcitation(paths: "path", map: "edges", rate: 44100),
        "cross": IsophoteExcitation(paths: "path", isophotes: "curves", rate: 44100),
        "modes": ModalFromRecording(recording: "glass.flac", impulse: 0.03),
        "glass": ModalBank(forces: ["scrape", "cross"], modes: "modes", gain: 1000.0),
        "out": WavOut(audio: "glass", path: "flat.wav", format: Float32),
    },
)
"#;
    std::fs::copy(
        common::graphs().join("assets/recordings/glass_hit_a1.flac"),
        dir.path().join("glass.flac"),
    )
    .unwrap();
    std::fs::write(dir.path().join("flat.ron"), text).unwrap();
    let graph = dir.path().join("flat.ron");
    let tap = format!("class={}", dir.path().join("class.json").display());
    let report = common::foley(dir.path(), &["run", graph.to_str().unwrap(), "--tap", &tap]);
    let class = &report["nodes"]["class"]["summary"];
    assert_eq!(class["class"], "simple", "{class}");
    assert!((class["bandwidth"].as_f64().unwrap() - 1.0 / 256.0).abs() < 1e-6, "{class}");
    let sound = common::wav(&dir.path().join("flat.wav"));
    assert!(sound.len() > 40_000 && sound.iter().all(|x| *x == 0.0));
}

/// Level of the samples between two times, dB.
fn level(x: &[f32], from: f64, to: f64) -> f64 {
    let part = &x[(from * FS) as usize..(to * FS) as usize];
    let mean = part.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / part.len() as f64;
    10.0 * mean.log10()
}

#[test]
fn a_box_that_slides_faster_and_faster_is_as_loud_on_all_levels() {
    let heard = ["1.0", "7.0", "25.0", "60.0"]
        .map(|distance| sound("brick_slide", &[("distance", distance)], 3.5, 1024));
    // The box moves at 0.2 m/s first and at 1.5 m/s in the end. One line over the bricks is not the mean of all paths,
    // over which levels agree: the shorter a part of it, the less. Matched at one speed they are 12 dB apart.
    for (from, to, bound) in
        [(0.0, 3.4, 2.5), (0.2, 0.7, 5.5), (0.7, 1.2, 5.5), (1.2, 1.7, 5.5), (1.7, 2.2, 5.5)]
    {
        let levels: Vec<f64> = heard.iter().map(|x| level(x, from, to)).collect();
        println!("{from} to {to} s: {levels:.1?} dB");
        assert!(levels.iter().all(|l| (l - levels[0]).abs() < bound), "{from} to {to} s: {levels:?} dB");
    }
}

#[test]
fn two_surfaces_of_any_size_are_as_loud_on_all_levels() {
    let cache = tempfile::tempdir().unwrap();
    for scale in ["0.5", "1.0", "2.0"] {
        let levels = ["1.0", "10.0", "25.0", "60.0"].map(|distance| {
            let numbers = [("scale", scale), ("distance", distance)];
            level(&sound_cached("two_textures", &numbers, 4.2, 1024, Some(cache.path())), 0.1, 4.1)
        });
        println!("{scale} times as large: {levels:.1?} dB");
        assert!(levels.iter().all(|l| (l - levels[0]).abs() < 2.0), "{scale}: {levels:?} dB");
    }
}

#[test]
fn levels_of_detail_are_as_strong_along_another_path_as_along_those_they_were_matched_on() {
    for image in ["sk_gravel", "sk_brick", "tiles"] {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str| dir.path().join(format!("{name}.csv"));
        let mut words = vec!["run".into(), "graphs/lib/levels.ron".into(), "--set".into()];
        words.push(format!("image=graphs/assets/images/{image}.png"));
        let names = ["full", "isophotes", "split", "noise", "spectrum"];
        for name in names {
            words.extend(["--tap".into(), format!("{name}_levels={}", file(name).display())]);
        }
        common::foley(dir.path(), &words.iter().map(String::as_str).collect::<Vec<_>>());
        // For each sixtieth of a second: its time, the peak and the root mean square.
        let levels = names.map(|name| {
            let text = std::fs::read_to_string(file(name)).unwrap();
            let rms = |row: &str| row.rsplit(',').next().unwrap().parse::<f64>().unwrap();
            let squares: Vec<f64> = text.lines().skip(1).map(|row| rms(row).powi(2)).collect();
            10.0 * (squares.iter().sum::<f64>() / squares.len() as f64).log10()
        });
        println!("{image}: {:.1?} dB", levels.map(|level| level - levels[0]));
        assert!(levels.iter().all(|level| (level - levels[0]).abs() < 2.0), "{image}: {levels:.1?} dB");
    }
}

/// Correlation of a level with itself at a lag, about its mean.
fn alike(levels: &[f64], lag: usize) -> f64 {
    let mean = levels.iter().sum::<f64>() / levels.len() as f64;
    levels.iter().zip(&levels[lag..]).map(|(a, b)| (a - mean) * (b - mean)).sum()
}

#[test]
fn a_ball_over_tiles_clicks_once_for_each() {
    for (speed, period) in [("0.5", 0.2), ("1.0", 0.1)] {
        // From the middle of a joint to half way between two.
        // The floor rings so shortly that joints do not overlap.
        let numbers = [("speed", speed), ("floor.damping", "5.0")];
        let x = sound("tiles_stroke", &numbers, 1.4 - 0.5 * period, 1024);
        // Milliseconds; a click is a rise of the level.
        let levels: Vec<f64> =
            x.chunks(44).map(|x| x.iter().map(|x| f64::from(x.abs())).sum::<f64>()).collect();
        let lags = [0.5 * period, 1.5 * period].map(|t| (t * FS / 44.0) as usize);
        let best =
            (lags[0]..lags[1]).max_by(|a, b| alike(&levels, *a).total_cmp(&alike(&levels, *b))).unwrap();
        let found = best as f64 * 44.0 / FS;
        assert!((found - period).abs() <= 0.002, "{speed} m/s: every {found} s");
        let rises: Vec<f64> = levels.windows(2).map(|w| (w[1] - w[0]).max(0.0)).collect();
        let loud = 0.3 * rises.iter().fold(0.0_f64, |m, x| m.max(*x));
        let (mut clicks, mut last) = (0, 0);
        for (k, _) in rises.iter().enumerate().filter(|(_, x)| **x > loud) {
            clicks += i32::from(clicks == 0 || k > last + 40);
            last = k;
        }
        let right = (1.4 / period).round() as i32 - 1; // One for each joint.
        assert_eq!(clicks, right, "{speed} m/s");
    }
}
