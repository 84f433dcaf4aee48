//! Time to fit a thin-plate warp of 420 nodes, to warp ten minutes of units, to rank 15 correspondences, to suggest correspondences, and
//! to render a head.
//!
//! Run with `cargo bench -p foley-nodes -- warp`. Budgets: 50 ms for the fit and 1 s for the warp on one core, and 1 s from an edit to
//! a new ranking.

use crate::common::best;
use foley_nodes::core::random::Rng;
use foley_nodes::feature::TemporalFilter;
use foley_nodes::friction::Receiver;
use foley_nodes::spatial::{Binaural, Head, HeadReceiver, PinnaSet};
use foley_nodes::unit::{SelectorParams, Units};
use foley_nodes::warp::{
    Baseline, FitError, LeaveOut, Pair, Stiffness, SuggestParams, Tps, Warper, fit, suggest, without,
};
use std::time::Instant;

const NODES: usize = 420;
const UNITS: usize = 144_000;
const DIMS: usize = 3;

fn number(k: usize) -> f64 {
    ((k as f64 * 12.9898).sin() * 43_758.545_3).fract()
}

/// Returns nodes in clusters of 30, like the units of correspondences.
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

/// Returns features with the spread of cloth recordings, filtered by the Gaussian of the paper.
fn features(seed: u64, units: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let (mut slow, mut out) = ([0.0; DIMS], Vec::with_capacity(DIMS * units));
    for _ in 0..units {
        for (slow, spread) in slow.iter_mut().zip([9.0, 3.0, 2.0]) {
            *slow += 0.02 * (spread * 6.0 * rng.between(-1.0, 1.0) - *slow);
            out.push((*slow + rng.between(-1.0, 1.0)) as f32);
        }
    }
    TemporalFilter::new(&[20.0, 50.0, 10.0], false).process_segment(&out)
}

/// Times the diagnosis of 15 correspondences of 24 or 48 units, one of which is wrong, for 1 min of target and 4 min of recordings.
fn diagnosis() -> Result<(), FitError> {
    let (target, database) = (features(5, 14_400), features(6, 57_600));
    let row =
        |unit: usize| -> Vec<f64> { target[DIMS * unit..][..DIMS].iter().map(|x| f64::from(*x)).collect() };
    let mut pairs = Vec::new();
    for k in 0..15_usize {
        for unit in 900 * k..900 * k + 24 * (1 + k % 2) {
            let from = row(unit);
            let wrong = if k == 7 { 8.0 } else { 0.0 };
            let to = from.iter().map(|x| 1.1 * x + wrong + 0.3 * number(unit)).collect();
            pairs.push((k, Pair { from, to, weight: 1.0 }));
        }
    }
    for lambda in [100.0, 1e5] {
        let start = Instant::now();
        let out = LeaveOut::as_stiff(&pairs, DIMS, Stiffness::Lambda(lambda))?;
        let (all, _) = out.all()?;
        let found = out.suspicions(2.0);
        let ranked = start.elapsed().as_secs_f64();
        let rest: Vec<Tps> = (0..15).map(|k| out.without(k)).collect::<Result<_, _>>()?;
        let dropped = start.elapsed().as_secs_f64();
        let n = database.len() / DIMS;
        let units = Units::new(&database, DIMS, vec![(0, n)]);
        let params =
            SelectorParams { look: 5, d_max: 2.0, cool_off: 20, loop_guard: 0, causal: false, effort: None };
        let Ok(Some(baseline)) = Baseline::new(target.clone(), &all, &units, params) else { return Ok(()) };
        let chosen = start.elapsed().as_secs_f64();
        let effects = baseline.effects(&rest).unwrap_or_default();
        let total = start.elapsed().as_secs_f64();
        let moved = effects.iter().map(|e| e.moved).sum::<f64>() / 15.0;
        println!(
            "diagnosis, lambda {lambda}, {} nodes: ranking after {:.2} s, without each {:.2} s, target chosen {:.2} s, effects {total:.2} s \
             ({:.0} % of units moved on average); the wrong one is ranked {}   (aim 1 s)",
            pairs.len(),
            ranked,
            dropped,
            chosen,
            100.0 * moved,
            found[7].rank
        );
        let start = Instant::now();
        let refits: Vec<Tps> = (0..15).map(|k| without(&pairs, k, DIMS, lambda)).collect::<Result<_, _>>()?;
        let refitted = start.elapsed().as_secs_f64();
        let mut probe = Warper::new(&rest[7]);
        let mut reference = Warper::new(&refits[7]);
        let differences = target.chunks_exact(DIMS).map(|unit| {
            let (mut a, mut b) = ([0.0; DIMS], [0.0; DIMS]);
            probe.warp(unit, &mut a);
            reference.warp(unit, &mut b);
            a.iter().zip(b).fold(0.0, |max: f32, (a, b)| max.max((a - b).abs()))
        });
        println!(
            "  without each by 15 fits instead: {refitted:.2} s; units differ by at most {:.1e}",
            differences.fold(0.0, f32::max)
        );
    }
    Ok(())
}

/// Times suggestions for ten minutes of target and of recordings, 12,000 windows each.
fn suggestions() -> Result<(), FitError> {
    let (target, database) = (features(7, UNITS), features(8, UNITS));
    for most in [600, 2000] {
        let p = SuggestParams { most, ..SuggestParams::default() };
        let start = Instant::now();
        let all = 0..UNITS;
        let found = suggest(&target, &database, std::slice::from_ref(&all), DIMS, &p, &[])?;
        println!(
            "suggestions, 12,000 windows a side in {most} clusters: {:.2} s, {} proposals",
            start.elapsed().as_secs_f64(),
            found.len()
        );
    }
    Ok(())
}

pub fn bench() -> Result<(), FitError> {
    diagnosis()?;
    suggestions()?;
    let pairs = pairs();
    let (warp, report) = fit(&pairs, DIMS, Stiffness::Lambda(100.0))?;
    let fixed = best(5, || fit(&pairs, DIMS, Stiffness::Lambda(100.0)));
    let auto = best(5, || fit(&pairs, DIMS, Stiffness::Auto));
    println!(
        "fit {NODES} nodes: {fixed:.1} ms, {:.1} degrees of freedom; lambda found in {auto:.1} ms   (aim 50 ms, paper: negligible)",
        report.freedom
    );

    let units: Vec<f32> = (0..UNITS * DIMS).map(|k| 12.0 * number(k) as f32).collect();
    let mut out = vec![0.0; units.len()];
    let mut warper = Warper::new(&warp);
    let ms = best(5, || {
        for (x, y) in units.chunks_exact(DIMS).zip(out.chunks_exact_mut(DIMS)) {
            warper.warp(x, y);
        }
    });
    let kernel = ms * 1e6 / (UNITS * NODES) as f64;
    println!(
        "warp {UNITS} units through {NODES} nodes: {ms:.0} ms, {kernel:.2} ns a kernel   (aim 1 s; paper: negligible)"
    );

    for pinna in [None, Some(PinnaSet::Set0)] {
        let head = Head { pinna, ..Head::default() };
        let (fs, second) = (48_000.0, 48_000);
        let audio: Vec<f32> = (0..second).map(|k| number(k) as f32).collect();
        let mut ears = vec![0.0; 2 * second];
        let mut binaural = Binaural::new(head, 0.0, fs);
        let ms = best(5, || binaural.process(0, &audio, &mut ears, |n| [1.0, (n as f64 * 1e-4).sin(), 0.0]));
        let mut receiver = HeadReceiver::new(head, fs, 2400, None);
        let (spectrum, mut sum) = (vec![1.0; 1201], [vec![0.0; 1201], vec![0.0; 1201]]);
        let clip = best(5, || {
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
