//! Item 3: A smoothing thin-plate spline through 419 nodes in three dimensions with three outputs, and its values at 140,000 points.
//!
//! foley's kernel is `r^2 ln r^2`, twice that of the others, so its lambda is twice as great. Its fit reports degrees of freedom and residuals
//! too. It takes and returns points in single precision and computes in double.

use super::data::{Rng, noise};
use super::measure::Item;
use foley_nodes::warp::{Pair, Stiffness, Warper, fit};

const NODES: usize = 419;
const POINTS: usize = 140_000;
const LAMBDA: f64 = 0.02;

pub fn bench(item: Item) {
    let mut rng = Rng(3);
    let pair = |_| {
        let x = [(); 3].map(|()| rng.normal());
        let f = x[0].sin() + x[1] * x[2] + 0.1 * rng.normal();
        Pair { from: x.to_vec(), to: vec![f, f * f, -f], weight: 1.0 }
    };
    let pairs: Vec<Pair> = (0..NODES).map(pair).collect();
    let fitted = || fit(&pairs, 3, Stiffness::Lambda(LAMBDA)).expect("the nodes are apart");
    let (spline, report) = fitted();
    item.print("residual", report.residual, "rms");
    item.time("fit.419x3out", 1.0, "s", fitted);
    let points = noise(33, 3 * POINTS);
    let mut out = vec![0.0; points.len()];
    let mut warper = Warper::new(&spline);
    item.time("eval.140k.3out", 1.0, "s", || {
        for (x, y) in points.chunks_exact(3).zip(out.chunks_exact_mut(3)) {
            warper.warp(x, y);
        }
    });
}
