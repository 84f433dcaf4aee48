//! Time of fits of damping, of their reference methods, and of the features of a recording.
//!
//! Run with `cargo bench -p foley-nodes -- damping`. The paper states 16.3 s for 752 points, of 39,009 steps along the gradient.

use crate::common::best;
use foley_nodes::core::random::Rng;
use foley_nodes::material::estimation::fit::fit;
use foley_nodes::material::estimation::hierarchical::fit_hierarchical;
use foley_nodes::material::estimation::lower_bound::lower_bound;
use foley_nodes::material::estimation::mixture::{MixtureOptions, fit_mixture};
use foley_nodes::material::estimation::point::Sample;
use foley_nodes::material::estimation::uncertainty::{bootstrap, refit};
use foley_nodes::material::{DampingPoint, Family, FitOptions};
use foley_nodes::modal::extraction::poles::resynthesis;
use foley_nodes::modal::{ExtractParams, Feature, extract};
use foley_nodes::statistics::normal::normal_quantile;
use std::f64::consts::TAU;

/// Each figure is the best of this many repetitions, which is least affected by other programs.
const REPETITIONS: usize = 7;

/// Points as those of the paper's figure 8: `a1` 3.9, `a2` 1e-8, noise 0.4, mean support damping 8, 20 recordings.
fn points(n: usize) -> Vec<DampingPoint> {
    let mut rng = Rng::new(8);
    (0..n)
        .map(|k| {
            let lambda = (TAU * 200.0 * 75_f64.powf(rng.uniform())).powi(2);
            let excess = -8.0 * (1.0 - rng.uniform()).ln() + 0.4 * normal_quantile(rng.between(1e-12, 1.0));
            let c = (3.9 + 1e-8 * lambda + excess).max(0.5);
            DampingPoint { recording: (k % 20) as u32, ..DampingPoint::new(lambda, c) }
        })
        .collect()
}

/// The features of 2 s of sound with 40 modes in noise 60 dB below its peak.
fn features() {
    let mut rng = Rng::new(3);
    let modes: Vec<Feature> = (0..40)
        .map(|_| {
            let freq_hz = 200.0 * 75_f64.powf(rng.uniform());
            let decay = 2.0 + 2e-7 * freq_hz * freq_hz + rng.between(0.0, 8.0);
            let (amp, phase) = (0.05 * rng.between(-3.0, 0.0).exp(), rng.between(-3.0, 3.0));
            Feature { freq_hz, decay, amp, phase, ..Feature::default() }
        })
        .collect();
    let sound: Vec<f32> = resynthesis(&modes, 44_100.0, 88_200, |f| f.decay)
        .into_iter()
        .map(|x| (x + 1e-4 * normal_quantile(rng.between(1e-12, 1.0))) as f32)
        .collect();
    let params = ExtractParams::default();
    let found = extract(&sound, 44_100.0, &params).map_or(0, |found| found.features.len());
    let ms = best(REPETITIONS, || extract(&sound, 44_100.0, &params));
    println!("| {found} modes | features of a 2 s recording of {} modes | {ms:.0} |", modes.len());
}

pub fn bench() {
    println!("| points | what | ms |\n|---|---|---|");
    for n in [752, 10_000] {
        let points = points(n);
        let paper = FitOptions::paper(Family::Rayleigh);
        let Ok(found) = fit(&points, &paper) else { return };
        let row = |what: &str, ms: f64| println!("| {n} | {what} | {ms:.3} |");
        println!("| {n} | evaluations of the scan: {} | |", found.effort.evaluations);
        row("scan and polish, Rayleigh", best(REPETITIONS, || fit(&points, &paper)));
        row("from the optimum of other data (live)", best(REPETITIONS, || refit(&found, &found.sample)));
        row(
            "scan and polish, Caughey of 3 terms",
            best(REPETITIONS, || fit(&points, &FitOptions::paper(Family::Caughey(3)))),
        );
        row("17 starts, hybrid", best(REPETITIONS, || fit(&points, &FitOptions::paper(Family::Hybrid))));
        row("mixture, Rayleigh", best(REPETITIONS, || fit_mixture(&points, &MixtureOptions::new(paper))));
        row("hierarchical, 20 recordings", best(REPETITIONS, || fit_hierarchical(&points, &paper)));
        if let Ok(sample) = Sample::new(&points, Family::Rayleigh) {
            row("lower bound", best(REPETITIONS, || lower_bound(&sample)));
        }
        let again = |sample: &Sample| refit(&found, sample);
        row("bootstrap of 500", best(REPETITIONS, || bootstrap(&found.sample, &points, 500, 1, again)));
    }
    features();
}
