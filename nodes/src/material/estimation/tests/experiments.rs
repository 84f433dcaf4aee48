//! Statistics over many data sets: coverage of intervals, and spurious features.

use crate::core::computation::unmonitored;
use crate::material::experiments::interval_coverage::{CoverageSize, METHODS, coverage};
use crate::material::experiments::spurious_features::{Layout, median_errors};

#[test]
#[ignore = "minutes"]
fn intervals_hold_the_truth_in_about_95_percent_of_400_data_sets() {
    println!("| noise | intervals | a1 | a2 | data sets |");
    let size = CoverageSize { sets: 400, features: 750, draws: 200 };
    for sigma in [0.0, 0.4, 2.0] {
        let found = coverage(&size, sigma, 0, &unmonitored).unwrap();
        for (method, of) in METHODS.iter().zip(found) {
            println!("| {sigma} | {method} | {:.3} | {:.3} | {} |", of.shares[0], of.shares[1], of.sets);
        }
        for share in found[2].shares {
            // 0.90 to 0.98, and two standard errors of a share of 400.
            assert!((0.87..=0.994).contains(&share), "{sigma}: {share}");
        }
    }
}

#[test]
#[ignore = "minutes"]
fn spurious_features_cost_the_mixture_less_than_a_factor_of_two() {
    let run = |share: f64, layout| median_errors([100, 752], 0.4, share, layout, 0).map(Option::unwrap);
    let [clean, ..] = run(0.0, Layout::LogUniform);
    println!("clean: {clean:?}\n| planted | share | plain a1, a2 | mixture a1, a2 | times clean |");
    let mut failed = Vec::new();
    for layout in [Layout::LogUniform, Layout::Clustered] {
        for share in [0.05, 0.2, 0.4] {
            let [plain, mixture, ..] = run(share, layout);
            let times = [0, 1].map(|j| mixture[j] / clean[j]);
            println!("| {layout:?} | {share} | {plain:.4?} | {mixture:.4?} | {times:.2?} |");
            if times.iter().any(|t| *t > 2.0) {
                failed.push((layout, share, times));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}
