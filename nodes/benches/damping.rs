//! Time of fits of damping on one core, and of their reference methods.
//!
//! Run with `cargo bench -p foley-nodes --bench damping`. The paper states 16.3 s for 752 points, of 39,009 steps along the gradient.

use foley_nodes::core::random::Rng;
use foley_nodes::material::estimation::fit::fit;
use foley_nodes::material::estimation::hierarchical::fit_hierarchical;
use foley_nodes::material::estimation::lower_bound::lower_bound;
use foley_nodes::material::estimation::mixture::{MixtureOptions, fit_mixture};
use foley_nodes::material::estimation::point::Sample;
use foley_nodes::material::estimation::uncertainty::{bootstrap, refit};
use foley_nodes::material::statistics::normal::normal_quantile;
use foley_nodes::material::{DampingPoint, Family, FitOptions};
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

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

/// Best time of `work` in milliseconds.
fn best<T>(mut work: impl FnMut() -> T) -> f64 {
    let one = |work: &mut dyn FnMut() -> T| {
        let start = Instant::now();
        black_box(work());
        start.elapsed().as_secs_f64()
    };
    1e3 * (0..REPETITIONS).map(|_| one(&mut work)).fold(f64::INFINITY, f64::min)
}

fn main() {
    println!("| points | what | ms |\n|---|---|---|");
    for n in [752, 10_000] {
        let points = points(n);
        let paper = FitOptions::paper(Family::Rayleigh);
        let Ok(found) = fit(&points, &paper) else { return };
        let row = |what: &str, ms: f64| println!("| {n} | {what} | {ms:.3} |");
        row("scan and polish, Rayleigh", best(|| fit(&points, &paper)));
        row("from the optimum of other data (live)", best(|| refit(&found, &found.sample)));
        row(
            "scan and polish, Caughey of 3 terms",
            best(|| fit(&points, &FitOptions::paper(Family::Caughey(3)))),
        );
        row("17 starts, hybrid", best(|| fit(&points, &FitOptions::paper(Family::Hybrid))));
        row("mixture, Rayleigh", best(|| fit_mixture(&points, &MixtureOptions::new(paper))));
        row("hierarchical, 20 recordings", best(|| fit_hierarchical(&points, &paper)));
        if let Ok(sample) = Sample::new(&points, Family::Rayleigh) {
            row("lower bound", best(|| lower_bound(&sample)));
        }
        let again = |sample: &Sample| refit(&found, sample);
        row("bootstrap of 500", best(|| bootstrap(&found.sample, &points, 500, 1, again)));
    }
}
