//! The sounds that the cloth graphs put together from recordings follow the motion: where the target is loud they are loud, and
//! where it is soft they are soft.

use crate::common;
use foley::graph::{DirFiles, Limits, LoadOptions, load};
use foley::plan::PlanOptions;
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

#[test]
fn what_is_put_together_from_recordings_is_as_loud_as_its_target_asks() {
    // Graph, its target, what it writes, least correlation, usual slope. One second of trousers hardly changes its level.
    let cases = [
        ("sheet", "cotton.target.sound.out", "sheet.wav", 0.93, 1.05),
        ("couch", "cotton.target.sound.out", "couch.wav", 0.93, 1.31),
        ("live", "target.out", "live.wav", 0.76, 1.05),
        ("first_person", "ears.sound.out", "first_person.wav", 0.91, 1.47),
        ("windbreaker", "windbreaker.target.sound.out", "windbreaker.wav", 0.92, 0.8),
        ("two_materials", "target.out", "two_materials.wav", 0.79, 1.04),
        ("corduroy", "corduroy.friction.audio", "corduroy.wav", 0.92, 1.09),
    ];
    for (name, target, file, least, usual) in cases {
        let out = tempfile::tempdir().unwrap();
        let loaded = load(&common::graphs().join(format!("cloth/{name}.ron")), &LoadOptions::default());
        let files = DirFiles::new(loaded.root, Limits::default());
        let options = PlanOptions { threads: 2, ..PlanOptions::default() };
        let tap = format!("{target}=target.wav");
        common::run_tapped(&loaded.graph.unwrap(), &files, &options, &[tap], out.path()).unwrap();
        let (correlation, slope, pieces) = follows(&out.path().join("target.wav"), &out.path().join(file));
        println!("{name}: {correlation:.3}, {slope:.2} dB for each dB, over {pieces} pieces");
        assert!(correlation > least, "{name}: {correlation}");
        assert!((slope / usual - 1.0).abs() < 0.25, "{name}: {slope}, usually {usual}");
    }
}
