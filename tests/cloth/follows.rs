//! The sounds that the cloth graphs put together from recordings follow the motion: where the target is loud they are loud, and
//! where it is soft they are soft.

use crate::common;
use foley::graph::{DirFiles, Limits, LoadOptions, load};
use foley::plan::PlanOptions;
use foley_nodes::statistics::ranks::spearman;
use std::fs;
use std::path::Path;

/// Levels of pieces of 50 ms at 48 kHz, dB.
fn levels(path: &Path) -> Vec<f64> {
    let level = |piece: &[f32]| {
        let energy: f64 = piece.iter().map(|x| f64::from(x * x)).sum();
        10.0 * (energy / piece.len() as f64 + 1e-12).log10()
    };
    common::wav(path).chunks_exact(2400).map(level).collect()
}

/// Correlation of the levels of two sounds where the first is audible, and dB of the second for each dB of the first.
fn follows(target: &Path, sound: &Path) -> (f64, f64, usize) {
    let pairs: Vec<(f64, f64)> =
        levels(target).into_iter().zip(levels(sound)).filter(|(target, _)| *target > -60.0).collect();
    let count = pairs.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (a, b) = (mean(&|p| p.0), mean(&|p| p.1));
    let [aa, bb, ab] = [
        mean(&|p| (p.0 - a) * (p.0 - a)),
        mean(&|p| (p.1 - b) * (p.1 - b)),
        mean(&|p| (p.0 - a) * (p.1 - b)),
    ];
    (ab / (aa * bb).sqrt(), ab / aa, pairs.len())
}

/// Levels of pieces of 100 ms of a sound at 48 kHz, and the sliding and crumpling in each of those in which something moves: the mean over
/// time of the sum of speeds, and the sum of the roots of energies, both relative to their means.
fn drive(folder: &Path, sound: &Path) -> (Vec<f64>, Vec<f64>) {
    let speeds = common::npy(&fs::read(folder.join("speed.npy")).unwrap());
    let sound = common::wav(sound);
    let pieces = (speeds.len() / 4).min(sound.len() / 4800);
    let mut sliding: Vec<f64> = speeds
        .chunks_exact(4)
        .take(pieces)
        .map(|clips| clips.iter().flatten().map(|s| f64::from(*s)).filter(|s| s.is_finite()).sum())
        .collect();
    let mut crumpling = vec![0.0; pieces];
    let events = fs::read_to_string(folder.join("events.csv")).unwrap_or_default();
    for row in events.lines().skip(1) {
        let mut columns = row.split(',');
        let time: f64 = columns.next().unwrap().parse().unwrap();
        let energy: f64 = columns.nth(1).unwrap().parse().unwrap();
        if let Some(sum) = crumpling.get_mut((time / 0.1) as usize) {
            *sum += energy;
        }
    }
    crumpling.iter_mut().for_each(|energy| *energy = energy.sqrt());
    for part in [&mut sliding, &mut crumpling] {
        let mean = part.iter().sum::<f64>() / pieces as f64;
        part.iter_mut().for_each(|x| *x /= mean.max(f64::MIN_POSITIVE));
    }
    let level = |piece: &[f32]| piece.iter().map(|x| f64::from(x * x)).sum::<f64>();
    let levels = sound.chunks_exact(4800).take(pieces).map(level);
    let pairs = levels.zip(sliding.iter().zip(&crumpling).map(|(a, b)| a + b));
    pairs.filter(|(level, drive)| *level > 4800.0 * 1e-6 && *drive > 0.0).unzip()
}

#[test]
fn what_is_put_together_from_recordings_is_as_loud_as_its_target_asks() {
    // Graph, its target, what it writes, least correlation, usual slope. One second of trousers hardly changes its level.
    let cases = [
        ("sheet", "cotton.target.sound.out", "sheet.wav", 0.93, 1.05),
        ("couch", "cotton.target.sound.out", "couch.wav", 0.93, 1.31),
        ("polyester_sheet", "polyester.target.sound.out", "polyester_sheet.wav", 0.85, 1.0),
        ("live", "target.out", "live.wav", 0.85, 1.31),
        ("first_person", "ears.sound.out", "first_person.wav", 0.91, 1.47),
        ("windbreaker", "windbreaker.target.sound.out", "windbreaker.wav", 0.92, 0.8),
        ("two_materials", "target.out", "two_materials.wav", 0.79, 1.04),
        ("corduroy", "corduroy.friction.audio", "corduroy.wav", 0.92, 1.09),
    ];
    // Those whose motion is tapped, and the least rank correlation of level with it.
    let steered: [(_, &[&str], _); 5] = [
        ("sheet", &["cotton.target.speed=speed.npy", "cotton.target.events=events.csv"], 0.8),
        ("couch", &["cotton.target.speed=speed.npy", "cotton.target.events=events.csv"], 0.65),
        ("polyester_sheet", &["polyester.target.speed=speed.npy", "polyester.target.events=events.csv"], 0.8),
        (
            "windbreaker",
            &["windbreaker.target.speed=speed.npy", "windbreaker.target.events=events.csv"],
            0.65,
        ),
        ("corduroy", &["corduroy.speed=speed.npy"], 0.8),
    ];
    for (name, target, file, least, usual) in cases {
        let out = tempfile::tempdir().unwrap();
        let loaded = load(&common::graphs().join(format!("cloth/{name}.ron")), &LoadOptions::default());
        let files = DirFiles::new(loaded.root, Limits::default());
        let options = PlanOptions { threads: 2, ..PlanOptions::default() };
        let mut taps = vec![format!("{target}=target.wav")];
        let moves = steered.iter().find(|(of, ..)| *of == name);
        taps.extend(moves.iter().flat_map(|(_, taps, _)| taps.iter().map(|tap| (*tap).to_owned())));
        common::run_tapped(&loaded.graph.unwrap(), &files, &options, &taps, out.path()).unwrap();
        if let Some((_, _, least)) = moves {
            let (levels, drive) = drive(out.path(), &out.path().join(file));
            let rank = spearman(&levels, &drive);
            println!("{name}: {rank:.2} between level and motion, over {} pieces", levels.len());
            assert!(rank > *least, "{name}: {rank}");
        }
        let (correlation, slope, pieces) = follows(&out.path().join("target.wav"), &out.path().join(file));
        println!("{name}: {correlation:.3}, {slope:.2} dB for each dB, over {pieces} pieces");
        assert!(correlation > least, "{name}: {correlation}");
        assert!((slope / usual - 1.0).abs() < 0.25, "{name}: {slope}, usually {usual}");
    }
}

#[test]
fn the_same_motion_at_half_speed_is_softer_among_the_energies_of_the_fast_one() {
    // Mean power of the frames of 25 ms within 40 dB of the loudest, in dB.
    let level = |path: &Path| {
        let sound = common::wav(path);
        let powers: Vec<f64> = sound
            .chunks_exact(1200)
            .map(|frame| frame.iter().map(|x| f64::from(x * x)).sum::<f64>() / 1200.0)
            .collect();
        let loudest = powers.iter().copied().fold(0.0, f64::max);
        let active: Vec<f64> = powers.into_iter().filter(|power| *power > 1e-4 * loudest).collect();
        10.0 * (active.iter().sum::<f64>() / active.len() as f64).log10()
    };
    let levels = ["polyester_sheet", "polyester_slow"].map(|name| {
        let out = tempfile::tempdir().unwrap();
        let loaded = load(&common::graphs().join(format!("cloth/{name}.ron")), &LoadOptions::default());
        let files = DirFiles::new(loaded.root, Limits::default());
        let options = PlanOptions { threads: 2, ..PlanOptions::default() };
        let taps = ["target.sound", "recomposed.audio"].map(|tap| format!("polyester.{tap}={tap}.wav"));
        common::run_tapped(&loaded.graph.unwrap(), &files, &options, &taps, out.path()).unwrap();
        ["target.sound.wav", "recomposed.audio.wav"].map(|file| level(&out.path().join(file)))
    });
    let [fast, slow] = levels;
    for (what, fast, slow) in [("target", fast[0], slow[0]), ("sound", fast[1], slow[1])] {
        println!("{what}: {fast:.1} dB, at half speed {slow:.1} dB");
        assert!((1.5..6.0).contains(&(fast - slow)), "{what}: {fast} dB, at half speed {slow} dB");
    }
}
