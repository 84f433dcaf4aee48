//! Soundtracks that follow motion: the graphs of `graphs/numbers`, through the command.

use crate::common::{foley, npy, wav};
use foley_nodes::likeness::{LikenessRules, Take, compare};
use std::path::Path;

/// Recording and time in s of each pair of samples of a run, and the report of the run.
fn positions(graph: &str, more: &[&str], folder: &Path) -> (Vec<(usize, f64)>, serde_json::Value) {
    let file = folder.join("positions.npy");
    let tap = format!("sound.positions={}", file.display());
    let table = format!("report.table={}", folder.join("table.json").display());
    let report: &[&str] = if graph == "live" { &[] } else { &["--tap", &table] };
    let graph = format!("graphs/numbers/{graph}.ron");
    let arguments: Vec<&str> =
        ["run", &graph, "--tap", &tap].iter().chain(report).chain(more).copied().collect();
    let report = foley(folder, &arguments);
    let rows = npy(&std::fs::read(file).unwrap());
    (rows.into_iter().map(|row| (row[0] as usize, f64::from(row[1]))).collect(), report)
}

fn summary(report: &serde_json::Value, node: &str, name: &str) -> f64 {
    let nodes = &report["nodes"];
    let found = match nodes {
        serde_json::Value::Array(all) => all.iter().find(|n| n["id"] == node).map(|n| &n["summary"]),
        _ => Some(&nodes[node]["summary"]),
    };
    found.and_then(|s| s[name].as_f64()).unwrap_or_else(|| panic!("{node}.{name}: {report}"))
}

/// The share of the positions between two times of the output that are within one of the intervals.
fn share(all: &[(usize, f64)], rate: f64, from: f64, to: f64, intervals: &[(f64, f64)]) -> f64 {
    let own = &all[(from * rate) as usize..(to * rate) as usize];
    let is_in = |(_, t): &&(usize, f64)| intervals.iter().any(|(a, b)| *t > a - 1e-3 && *t < b + 1e-3);
    own.iter().filter(is_in).count() as f64 / own.len() as f64
}

#[test]
fn a_drawn_score_is_followed_exactly_where_it_is_hard() {
    // Figure 4 of the paper: one sound at two plateaus and nowhere else.
    let folder = tempfile::tempdir().unwrap();
    let (all, report) = positions("manual", &[], folder.path());
    let bang = [(0.75, 1.3), (4.4, 5.2)];
    for (from, to) in [(3.2, 5.0), (10.2, 12.0)] {
        assert_eq!(share(&all, 16_000.0, from, to, &bang), 1.0, "{from}");
    }
    // Beyond the ramps, up to the shortest blocks.
    let edges = [(0.76, 1.29), (4.41, 5.19)];
    for (from, to) in [(0.0, 2.9), (5.5, 9.9), (12.5, 16.0)] {
        assert_eq!(share(&all, 16_000.0, from, to, &edges), 0.0, "{from}");
    }
    assert!(share(&all, 16_000.0, 0.0, 2.5, &[(0.0, 0.7)]) > 0.6);
    assert!(summary(&report, "sound", "approximate") < 0.001 * summary(&report, "sound", "steps"));
}

#[test]
fn a_minute_of_texture_repeats_no_second() {
    let source = wav(Path::new("graphs/assets/recordings/birds.ogg"));
    let level =
        |x: &[f32]| 10.0 * (x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len() as f64).log10();
    let rules = |joins| LikenessRules { joins: Some(joins), ..LikenessRules::default() };
    let mut louder = Vec::new();
    for seed in ["1", "2", "3", "4"] {
        let folder = tempfile::tempdir().unwrap();
        let (all, report) = positions("texture", &["--seed", seed], folder.path());
        assert_eq!(all.len(), 960_000);
        assert!(summary(&report, "report", "longest_run_s") <= 1.0);
        assert!(summary(&report, "report", "median_run_s") <= 0.5);
        let sound = wav(&folder.path().join("texture.wav"));
        assert!((level(&sound) - level(&source)).abs() < 2.0, "{} {}", level(&sound), level(&source));
        let is_join = |k: &usize| (all[*k].1 - all[k - 1].1 - 1.0 / 16_000.0).abs() > 1e-5;
        let joins = (1..all.len()).filter(is_join).map(|k| k as f64 / 16_000.0).collect();
        let take = Take { name: "birds".into(), rate: 32_000.0, samples: source.clone() };
        let joins = compare(&sound, 32_000.0, &[take], &rules(joins)).joins.unwrap();
        assert!(joins.count > 60, "{joins:?}");
        louder.push(joins.share_above.unwrap());
    }
    // Of joins that nobody can tell from the recording 5 % are louder above 8 kHz than 95 % of it. Of one minute 3 to 9 % are.
    let mean = louder.iter().sum::<f64>() / louder.len() as f64;
    assert!(mean < 0.07, "{louder:?}");
}

#[test]
fn an_animation_against_itself_gets_its_own_soundtrack() {
    let folder = tempfile::tempdir().unwrap();
    let same = [
        "--set",
        "after.path=graphs/assets/motion/flash.csv",
        "--set",
        "wanted.least=1.0",
        "--set",
        "score.factor=1.0",
        "--set",
        "sound.duration=6.1",
    ];
    let (all, report) = positions("auto", &same, folder.path());
    let is_own = |(n, (_, t)): &(usize, &(usize, f64))| (t - *n as f64 / 16_000.0).abs() <= 0.05;
    let own = all.iter().enumerate().filter(is_own).count() as f64 / all.len() as f64;
    assert!(own > 0.95, "{own}");
    let fragments = summary(&report, "path", "target_fragments");
    assert_eq!(summary(&report, "path", "consecutive"), fragments - 1.0);
    // The score that was written is the one that was followed.
    let written = std::fs::read_to_string(folder.path().join("auto.score.ron")).unwrap();
    let score = foley_nodes::soundtrack::score::read_score(&written).unwrap();
    assert!(score.targets.len() as f64 >= fragments);
}

#[test]
fn an_animation_that_was_cut_anew_gets_its_sounds_in_the_new_order() {
    let folder = tempfile::tempdir().unwrap();
    let hard = ["--set", "wanted.least=1.0", "--set", "score.factor=1.0"];
    let (all, _) = positions("auto", &hard, folder.path());
    // Start in the new animation, and start and end in the old one, of the parts that it was cut into.
    let parts = [(0.0, 2.0, 4.4), (2.4, 0.75, 2.0), (3.65, 4.4, 6.1), (5.35, 0.0, 0.75), (6.1, 2.9, 4.1)];
    let expected = |t: f64| {
        let part = parts.iter().rev().find(|(start, _, _)| *start <= t).unwrap();
        part.1 + t - part.0
    };
    let near = |(n, (_, t)): &(usize, &(usize, f64))| (t - expected(*n as f64 / 16_000.0)).abs() < 0.15;
    let right = all.iter().enumerate().filter(near).count() as f64 / all.len() as f64;
    assert!(right > 0.8, "{right}");
}

#[test]
fn a_picture_that_was_cut_anew_has_the_sound_of_each_cut() {
    let folder = tempfile::tempdir().unwrap();
    for offset in [0.0, 0.12] {
        let set = format!("score.av_offset={offset}");
        let (all, report) = positions("edit", &["--set", &set], folder.path());
        let cuts = [(0.0, 2.4, 2.0), (2.4, 3.68, 0.72), (3.68, 5.08, 4.4), (5.08, 5.8, 0.0), (5.8, 7.0, 2.8)];
        for (from, to, source) in cuts {
            let interval = [(source + offset, source + offset + to - from)];
            assert_eq!(share(&all, 16_000.0, from, to, &interval), 1.0, "{offset} {from}");
        }
        assert!(summary(&report, "report", "satisfaction") > 0.999);
    }
}

#[test]
fn all_gestures_that_are_like_the_marked_one_sound() {
    let folder = tempfile::tempdir().unwrap();
    let (all, report) = positions("semi", &[], folder.path());
    assert_eq!(summary(&report, "matches", "matches"), 4.0);
    assert!(summary(&report, "calls", "spots") >= 2.0);
    let is_call = |t: f64| share(&all, 16_000.0, t, t + 0.2, &[(2.4, 4.2)]);
    for swoop in [2.2, 5.1, 7.6, 10.3] {
        assert!(is_call(swoop) > 0.99, "{swoop}: {}", is_call(swoop));
    }
}

#[test]
fn contacts_direct_a_texture() {
    let folder = tempfile::tempdir().unwrap();
    let (all, _) = positions("physics", &[], folder.path());
    let scraping = |from: f64, to: f64| {
        let own = &all[(from * 22_050.0) as usize..(to * 22_050.0) as usize];
        own.iter().filter(|(recording, _)| *recording == 0).count() as f64 / own.len() as f64
    };
    // The box slides for two seconds and a half, and has come to rest after three.
    assert!(
        scraping(1.0, 1.8) > 0.9 && scraping(3.6, 6.0) < 0.05,
        "{} {}",
        scraping(1.0, 1.8),
        scraping(3.6, 6.0)
    );
}

#[test]
fn weights_of_a_control_hold_throughout() {
    let folder = tempfile::tempdir().unwrap();
    let quiet = positions("live", &[], folder.path()).0;
    // Offline a live control has its initial weights: no bangs.
    assert_eq!(share(&quiet, 16_000.0, 0.0, 6.0, &[(0.76, 6.09)]), 0.0);
    let loud = positions("live", &["--set", "weights.initial=[1.0, 0.0]"], folder.path()).0;
    assert_eq!(share(&loud, 16_000.0, 0.0, 6.0, &[(0.75, 6.1)]), 1.0);
}

/// Level and centroid of the spectrum of a second of sound, dB and Hz.
fn colour(sound: &[f32], rate: usize, second: usize) -> (f64, f64) {
    let x: Vec<f64> = sound[second * rate..(second + 1) * rate].iter().map(|x| f64::from(*x)).collect();
    let power = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>();
    let (whole, slope) = (power(&mut x.iter().copied()), power(&mut x.windows(2).map(|p| p[1] - p[0])));
    // The root mean square of the frequency, by the power of the difference.
    let angle = 2.0 * (0.5 * (slope / whole.max(1e-30)).sqrt()).min(1.0).asin();
    (10.0 * (whole / rate as f64).max(1e-30).log10(), angle * rate as f64 / (2.0 * std::f64::consts::PI))
}

#[test]
fn ramps_that_cross_turn_one_sound_into_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let (all, report) = positions("morph", &[], folder.path());
    let sound = wav(&folder.path().join("morph.wav"));
    let seconds: Vec<(f64, f64)> = (0..12).map(|k| colour(&sound, 32_000, k)).collect();
    // Neither is silent in between, and the spectrum rises from that of the first to that of the second.
    assert!(seconds[3..9].iter().all(|(level, _)| *level > -40.0), "{seconds:?}");
    let mean = |part: &[(f64, f64)]| part.iter().map(|x| x.1).sum::<f64>() / part.len() as f64;
    let parts = [mean(&seconds[..3]), mean(&seconds[3..6]), mean(&seconds[6..9])];
    assert!(parts.windows(2).all(|pair| pair[0] < 0.8 * pair[1]), "{seconds:?}");
    // Nothing but the two sounds is heard: each of its recording.
    let is_first = |(recording, _): &(usize, f64)| *recording == 0;
    assert!(all[..48_000].iter().all(is_first) && !all[144_000..].iter().any(is_first));
    // Half of the time of each ramp the other sound has the greater share.
    assert!(summary(&report, "report", "satisfaction") > 0.6);
}

#[test]
fn figures_of_a_step_and_of_a_score_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    foley(folder.path(), &["run", "graphs/numbers/step.ron"]);
    let table = std::fs::read_to_string(folder.path().join("step.csv")).unwrap();
    for role in ["ancestors", "predecessors", "by ancestors", "drawn", "its children"] {
        assert!(table.lines().any(|line| line.split(',').nth(1) == Some(role)), "{role}: {table}");
    }
    let step = std::fs::read_to_string(folder.path().join("step.svg")).unwrap();
    assert!(step.contains(">by predecessors<") && step.contains(">recordings<"));
    let file = folder.path().join("edit.svg");
    let tap = format!("report.table={}", file.display());
    foley(folder.path(), &["run", "graphs/numbers/edit.ron", "--tap", &tap]);
    let edit = std::fs::read_to_string(file).unwrap();
    for title in ["fireworks.ogg", "score", "output", "where the sound comes from"] {
        assert!(edit.contains(&format!(">{title}<")), "{title}");
    }
}

#[test]
fn frames_of_the_picture_direct_its_sound() {
    let folder = tempfile::tempdir().unwrap();
    let (all, report) = positions("frames", &[], folder.path());
    let text = std::fs::read_to_string(folder.path().join("frames.csv")).unwrap();
    let frames: Vec<f64> =
        text.lines().skip(1).map(|row| row.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert!(frames.len() > 200, "{}", frames.len());
    // The sound is that of the frame that is shown, within five frames for 95 % of the time.
    let is_near = |(n, (_, t)): &(usize, &(usize, f64))| {
        let k = (*n as f64 / 16_000.0 * 30.0) as usize;
        frames.get(k).is_none_or(|frame| (t - frame / 30.0).abs() < 5.0 / 30.0)
    };
    let near = all.iter().enumerate().filter(is_near).count() as f64 / all.len() as f64;
    assert!(near > 0.95, "{near}");
    assert!(summary(&report, "report", "satisfaction") > 0.95);
}

#[test]
fn a_gesture_is_recognised_as_it_comes() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("positions.npy");
    let tap = format!("sound.positions={}", file.display());
    let report = foley(folder.path(), &["run", "graphs/numbers/gesture.ron", "--tap", &tap]);
    assert_eq!(summary(&report, "gesture", "gestures"), 4.0);
    let rows = npy(&std::fs::read(file).unwrap());
    let all: Vec<(usize, f64)> = rows.into_iter().map(|row| (row[0] as usize, f64::from(row[1]))).collect();
    let is_call = |from: f64, to: f64| share(&all, 16_000.0, from, to, &[(2.4, 4.2)]);
    // The swoops end at about 2.8, 5.6, 8.6 and 10.8 s.
    let calls = (0..115).filter(|k| is_call(0.1 * f64::from(*k), 0.1 * f64::from(*k) + 0.1) > 0.9).count();
    assert!((20..=32).contains(&calls), "{calls}");
    assert!(is_call(0.0, 2.2) < 0.01);
}

#[test]
fn an_object_of_a_scene_directs_a_texture() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["positions", "weight"].map(|name| folder.path().join(format!("{name}.npy")));
    let taps = [("sound.positions", &files[0]), ("weight.curve", &files[1])];
    let taps = taps.map(|(port, file)| format!("{port}={}", file.display()));
    foley(folder.path(), &["run", "graphs/numbers/scene.ron", "--tap", &taps[0], "--tap", &taps[1]]);
    let [positions, weights] = files.map(|file| npy(&std::fs::read(file).unwrap()));
    let is_call = |row: &[f32]| (2.4..4.2).contains(&row[1]);
    // The swing is fast in the middle and turns at its ends: in fast thirds of a second more is the call.
    let thirds = (0..17).map(|k| {
        let weight = weights[20 * k..20 * k + 20].iter().map(|row| f64::from(row[0])).sum::<f64>() / 20.0;
        let own = &positions[5333 * k..5333 * (k + 1)];
        (weight, own.iter().filter(|row| is_call(row)).count() as f64 / own.len() as f64)
    });
    let mut thirds: Vec<(f64, f64)> = thirds.collect();
    thirds.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mean = |part: &[(f64, f64)]| part.iter().map(|(_, share)| share).sum::<f64>() / part.len() as f64;
    let (slow, fast) = (mean(&thirds[..6]), mean(&thirds[11..]));
    assert!(fast > slow + 0.1, "{slow} {fast} {thirds:?}");
}
