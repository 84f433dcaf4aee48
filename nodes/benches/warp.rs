//! Time to fit a thin-plate warp of 420 nodes and to warp ten minutes of units, and the cost of a head.
//!
//! Run with `cargo bench -p foley-nodes --bench warp`. Budgets: 50 ms and 1 s on one core.

use foley_nodes::friction::Receiver;
use foley_nodes::spatial::{Binaural, Head, HeadReceiver, PinnaSet};
use foley_nodes::warp::{FitError, Pair, Stiffness, Warper, fit};
use std::hint::black_box;
use std::time::Instant;

const NODES: usize = 420;
const UNITS: usize = 144_000;
const DIMS: usize = 3;

/// Milliseconds of the best of five runs: other programs only take time away.
fn best<T>(mut work: impl FnMut() -> T) -> f64 {
    let once = |work: &mut dyn FnMut() -> T| {
        let start = Instant::now();
        black_box(work());
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..5).map(|_| once(&mut work)).fold(f64::INFINITY, f64::min)
}

fn number(k: usize) -> f64 {
    ((k as f64 * 12.9898).sin() * 43_758.545_3).fract()
}

/// Nodes in clusters of 30, as the units of a correspondence are.
fn pairs() -> Vec<Pair> {
    let vector =
        |seed: usize, spread: f64| (0..DIMS).map(|i| spread * number(seed * DIMS + i)).collect::<Vec<f64>>();
    (0..NODES)
        .map(|k| {
            let (middle, near) = (vector(k / 30, 10.0), vector(1000 + k, 1.0));
            let from: Vec<f64> = middle.iter().zip(near).map(|(a, b)| a + b).collect();
            let to = from.iter().zip(vector(5000 + k, 0.5)).map(|(x, e)| 1.2 * x + 3.0 + e).collect();
            Pair { from, to, weight: 1.0 }
        })
        .collect()
}

fn main() -> Result<(), FitError> {
    let pairs = pairs();
    let (warp, report) = fit(&pairs, DIMS, Stiffness::Lambda(100.0))?;
    let fixed = best(|| fit(&pairs, DIMS, Stiffness::Lambda(100.0)));
    let auto = best(|| fit(&pairs, DIMS, Stiffness::Auto));
    println!(
        "fit {NODES} nodes: {fixed:.1} ms, {:.1} degrees of freedom; lambda found in {auto:.1} ms",
        report.freedom
    );

    let units: Vec<f32> = (0..UNITS * DIMS).map(|k| 12.0 * number(k) as f32).collect();
    let mut out = vec![0.0; units.len()];
    let mut warper = Warper::new(&warp);
    let ms = best(|| {
        for (x, y) in units.chunks_exact(DIMS).zip(out.chunks_exact_mut(DIMS)) {
            warper.warp(x, y);
        }
    });
    let kernel = ms * 1e6 / (UNITS * NODES) as f64;
    println!("warp {UNITS} units through {NODES} nodes: {ms:.0} ms, {kernel:.2} ns a kernel");

    for pinna in [None, Some(PinnaSet::Set0)] {
        let head = Head { pinna, ..Head::default() };
        let (fs, second) = (48_000.0, 48_000);
        let audio: Vec<f32> = (0..second).map(|k| number(k) as f32).collect();
        let mut ears = vec![0.0; 2 * second];
        let mut binaural = Binaural::new(head, 0.0, fs);
        let ms = best(|| binaural.process(0, &audio, &mut ears, |n| [1.0, (n as f64 * 1e-4).sin(), 0.0]));
        let mut receiver = HeadReceiver::new(head, fs, 2400, None);
        let (spectrum, mut sum) = (vec![1.0; 1201], [vec![0.0; 1201], vec![0.0; 1201]]);
        let clip = best(|| {
            for channel in 0..2 {
                let [re, im] = &mut sum;
                receiver.add(channel, Some([1.0, 2.0, 0.5]), (&spectrum, &spectrum), (re, im));
            }
        });
        println!(
            "head, {pinna:?}: {:.1} ns a sample, {:.1} us for both ears of one patch and clip",
            ms * 1e6 / second as f64,
            clip * 1e3
        );
    }
    Ok(())
}
