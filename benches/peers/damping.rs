//! Item 4: Maximum likelihood of Rayleigh damping with exponentially modified Gaussian residuals: 752 points, four parameters.
//!
//! The others start a local optimiser at one point; foley scans all shapes, and so finds the global optimum. Its variable is `c = 2 d`, and
//! `nll` is converted to that of `d`. It refuses a damping that is not positive, and the distribution of the points has a few: they are
//! drawn again.

use super::data::Rng;
use super::measure::Item;
use foley_nodes::material::estimation::fit::fit;
use foley_nodes::material::{DampingPoint, Family, FitOptions};
use std::f64::consts::{LN_2, TAU};

const POINTS: usize = 752;

pub fn bench(item: Item) {
    let mut rng = Rng(4);
    let mut point = || {
        let lambda = (TAU * 200.0 * 60_f64.powf(rng.between(0.0, 1.0))).powi(2);
        let d = 0.5 * (8.0 + 2e-7 * lambda) + 6.0 * rng.normal() + 20.0 * rng.exponential();
        DampingPoint::new(lambda, 2.0 * d)
    };
    let points: Vec<DampingPoint> =
        std::iter::repeat_with(&mut point).filter(|p| p.c > 0.0).take(POINTS).collect();
    let options = FitOptions::paper(Family::Rayleigh);
    let fitted = || fit(&points, &options).expect("the points determine a fit");
    let found = fitted();
    let [a1, a2] = found.physical()[..] else { unreachable!("two parameters of Rayleigh damping") };
    item.print("nll", -found.physical_log_likelihood() - POINTS as f64 * LN_2, "nats");
    item.print("alpha(8)", a1, "1/s");
    item.print("beta(2e-7)", a2, "s");
    item.print("iterations", found.effort.iterations as f64, "iterations");
    item.print("evaluations", found.effort.evaluations as f64, "evaluations");
    item.time("fit", 1.0, "s", fitted);
}
