//! The messages of `examples/rolling_ball`, captured to a log, sound in the graph that receives them: the ball sounds
//! at the joints of the floor.

use crate::common;
use foley::graph::{DirFiles, Limits, LoadOptions, Override, load_text};
use foley::plan::PlanOptions;
use foley_nodes::io::AudioReader;
use serde_json::Value;
use std::fs::File;
use std::path::Path;

const FS: f64 = 44_100.0;
/// Number of samples of a level.
const HOP: usize = 44;
/// Start of the rolling, and end of the log, s.
const ROLLS: [f64; 2] = [1.1, 3.15];

fn samples(path: &Path) -> Vec<f32> {
    let mut reader = AudioReader::open(Box::new(std::io::BufReader::new(File::open(path).unwrap()))).unwrap();
    let mut samples = vec![0.0; reader.info().frames as usize * reader.info().channels];
    reader.read(&mut samples).unwrap();
    samples
}

/// Times and places of the ball on the floor.
fn log() -> Vec<(f64, [f64; 2])> {
    let text = std::fs::read_to_string(common::graphs().join("assets/contacts/rolling_ball.jsonl")).unwrap();
    let rows = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let floor = rows.filter(|row| row["a"] == 0 && row["b"] == 1);
    let number = |value: &Value| value.as_f64().unwrap();
    floor.map(|row| (number(&row["time_s"]), [0, 1].map(|k| number(&row["point"][k])))).collect()
}

/// Rise of the level in each millisecond in which the ball rolls, relative to the largest rise.
fn rises(x: &[f32]) -> Vec<(f64, f64)> {
    let levels: Vec<f64> = x.chunks(HOP).map(|x| x.iter().map(|x| f64::from(x.abs())).sum()).collect();
    let all =
        levels.windows(2).enumerate().map(|(k, w)| (k as f64 * HOP as f64 / FS, (w[1] - w[0]).max(0.0)));
    let rolling: Vec<(f64, f64)> = all.filter(|(t, _)| (ROLLS[0]..ROLLS[1]).contains(t)).collect();
    let most = rolling.iter().fold(0.0_f64, |most, (_, rise)| most.max(*rise));
    rolling.into_iter().map(|(t, rise)| (t, rise / most)).collect()
}

/// Distance to the nearest joint: they lie at 0.05 m, 0.15 m, ...
fn off([x, y]: [f64; 2]) -> f64 {
    let off = |c: f64| (c.rem_euclid(0.1) - 0.05).abs();
    off(x).min(off(y))
}

#[test]
fn a_ball_that_was_sent_is_heard_where_it_meets_the_joints_of_its_floor() {
    let path = common::graphs().join("texture/live.ron");
    // The log in place of the sender.
    let text = std::fs::read_to_string(&path).unwrap();
    let sent = "LiveContacts(channel: \"ball\")";
    assert!(text.contains(sent));
    let text = text.replace(sent, "ContactLog(path: \"../assets/contacts/rolling_ball.jsonl\")");
    let given = [
        ("bell.gain", "0.0"),
        ("profile.extend", "false"),
        ("alike.extend", "false"),
        ("equal.by_speed", "false"),
    ]
    .map(|(key, value)| Override { target: key.into(), value: value.into() });
    let loaded = load_text(path.to_str().unwrap(), &text, &path, &LoadOptions::default().overrides(given));
    let shown = foley::diag::render(&loaded.diagnostics, &loaded.sources, false);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{shown}"));
    let folder = tempfile::tempdir().unwrap();
    let files = DirFiles::new(loaded.root, Limits::default());
    let taps = ["full.force=force.wav".to_owned()];
    common::run_tapped(&graph, &files, &PlanOptions::default(), &taps, folder.path()).unwrap();
    let [force, sound] = ["force.wav", "live.wav"].map(|name| rises(&samples(&folder.path().join(name))));

    let log = log();
    let at = |time: f64| {
        let k = log.partition_point(|(t, _)| *t <= time).clamp(1, log.len() - 1);
        let ((a, p), (b, q)) = (log[k - 1], log[k]);
        [0, 1].map(|axis| p[axis] + (time - a) / (b - a) * (q[axis] - p[axis]))
    };
    // The tiles produce force at their joints alone, 4 mm wide and as wide again by the interpolation of an image of 2
    // mm.
    let knocks: Vec<f64> = force.iter().filter(|(_, rise)| *rise > 0.12).map(|(t, _)| *t).collect();
    assert!(knocks.len() >= 8, "{knocks:?}");
    for t in knocks {
        assert!(off(at(t)) < 0.009, "{t} s: a knock {} m from a joint", off(at(t)));
    }
    // And each joint that the ball crosses in x sounds when the ball reaches its edge.
    let tile = |x: f64| ((x - 0.05) / 0.1).floor();
    let met: Vec<f64> = log
        .windows(2)
        .filter(|w| w[1].0 < ROLLS[1] && w[0].0 > ROLLS[0] && tile(w[0].1[0]) != tile(w[1].1[0]))
        .map(|w| w[1].0)
        .collect();
    assert!(met.len() >= 6, "{met:?}");
    for t in met {
        let near = sound.iter().filter(|(at, _)| (t - 0.02..t + 0.005).contains(at));
        let most = near.fold(0.0_f64, |most, (_, rise)| most.max(*rise));
        assert!(most > 0.12, "{t} s: a joint is passed and sounds with {most} of the loudest");
    }
}
