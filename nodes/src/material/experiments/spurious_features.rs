//! Errors of estimators due to spurious features, as a node.

use super::estimators::{Compared, median_and_mean, relative_errors};
use super::interval_coverage::TRUTH;
use super::synthetic::{independent_points, spurious_damping};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::material::points::gate::cluster;
use crate::plot::{Chart, Line};
use crate::table::ResultTable;
use crate::{params, ports};
use rayon::prelude::*;
use std::f64::consts::TAU;

params! {
    /// Errors of estimators due to spurious features: medians for both parameters of a Rayleigh curve over many simulated data sets.
    ///
    /// Some of the features belong to no mode: their damping is log-uniform from 0.5 to 500 1/s, at any frequency or clustered at three.
    /// Each row has the median relative errors, and how many times those of the plain fit of clean data they are.
    ///
    /// The defaults are a short run; the medians need 100 data sets.
    ///
    /// # Randomness
    /// The data sets are a function of the seed.
    pub struct SpuriousFeaturesParams {
        /// Number of data sets.
        sets: usize = 10, unit "", range 1..=100_000;
        /// Number of features of a data set.
        features: usize = 752, unit "", range 20..=100_000;
        /// Standard deviation of the noise.
        noise: f64 = 0.4, unit "1/s", range 0.0..=100.0;
        /// Shares of spurious features.
        shares: Vec<f64> = vec![0.05, 0.2, 0.4], unit "", range 0.0..=0.9;
    }
}
ports! {
    pub struct SpuriousFeaturesPorts / SpuriousFeaturesIo {
        in {}
        out {
            /// Errors by layout, share and estimator.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`median_errors`].
#[derive(Debug)]
pub struct SpuriousFeatures;

/// Frequencies of spurious features.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// The frequencies of the features that they replace.
    LogUniform,
    /// Within 0.1 % of one of three.
    Clustered,
}

impl Layout {
    fn name(self) -> &'static str {
        match self {
            Self::LogUniform => "log-uniform",
            Self::Clustered => "three clusters",
        }
    }
}

/// Estimators of the table.
const ESTIMATORS: [Compared; 4] =
    [Compared::Paper, Compared::Mixture, Compared::LeastSquares, Compared::LowerBound];

/// Median relative errors of `a1` and `a2` by each estimator, over `sets` data sets of `features` features.
#[must_use]
pub fn median_errors(
    [sets, features]: [usize; 2],
    noise: f64,
    share: f64,
    layout: Layout,
    seed: u64,
) -> [Option<[f64; 2]>; 4] {
    let [a1, a2, eta] = TRUTH;
    let errors: Vec<[Option<[f64; 2]>; 4]> = (0..sets)
        .into_par_iter()
        .map(|k| {
            let mut rng = Rng::new(seed.wrapping_add(7000 + k as u64));
            let mut points = independent_points(&mut rng, features, [a1, a2, noise, eta]);
            let count = (share * features as f64).round() as usize;
            let centres: Vec<f64> = (0..3).map(|_| points[rng.below(features)].lambda).collect();
            for p in points.iter_mut().take(count) {
                p.c = spurious_damping(&mut rng);
                if layout == Layout::Clustered {
                    p.lambda = centres[rng.below(3)] * (1.0 + 1e-3 * rng.uniform());
                }
            }
            points.iter_mut().for_each(|p| p.c = p.c.max(0.5));
            // As a gate does for the features of one object.
            let frequencies: Vec<(usize, f64)> = points.iter().map(|p| (0, p.lambda.sqrt() / TAU)).collect();
            cluster(&mut points, &frequencies);
            ESTIMATORS.map(|e| e.estimate(&points).map(|found| relative_errors(found, [a1, a2])))
        })
        .collect();
    [0, 1, 2, 3].map(|e| {
        let own: Vec<[f64; 2]> = errors.iter().filter_map(|x| x[e]).collect();
        median_and_mean(&own).map(|[a1, a2]| [a1[0], a2[0]])
    })
}

impl Func for SpuriousFeatures {
    type Params = SpuriousFeaturesParams;
    type Ports = SpuriousFeaturesPorts;
    const NAME: &'static str = "SpuriousFeatures";
    const VERSION: u32 = 2;

    fn eval(
        p: &SpuriousFeaturesParams,
        cx: &Build<'_>,
        mut io: SpuriousFeaturesIo<'_>,
    ) -> Result<Summary, Fault> {
        let seed = u64::from(cx.random.words(0, 0, 0)[0]);
        let size = [p.sets, p.features];
        let run = |share: f64, layout: Layout| median_errors(size, p.noise, share, layout, seed);
        let clean = run(0.0, Layout::LogUniform);
        let mut table = ResultTable::new(&[
            "planted",
            "share",
            "estimator",
            "a1_median_error",
            "a2_median_error",
            "a1_times_clean",
            "a2_times_clean",
        ]);
        let reference = clean[0];
        let mut largest = [0.0_f64; 2];
        let mut add = |table: &mut ResultTable, planted: &str, share: f64, found: [Option<[f64; 2]>; 4]| {
            for (estimator, error) in ESTIMATORS.iter().zip(found) {
                let times = |j: usize| Some(error?[j] / reference?[j]);
                if *estimator == Compared::Mixture {
                    [0, 1].iter().for_each(|j| largest[*j] = largest[*j].max(times(*j).unwrap_or(0.0)));
                }
                table.push([
                    planted.into(),
                    share.into(),
                    estimator.name().into(),
                    error.map(|e| e[0]).into(),
                    error.map(|e| e[1]).into(),
                    times(0).into(),
                    times(1).into(),
                ]);
            }
        };
        add(&mut table, "none", 0.0, clean);
        let mut charts = Vec::new();
        for layout in [Layout::LogUniform, Layout::Clustered] {
            let mut lines = vec![vec![Vec::new(); ESTIMATORS.len()]; 2];
            let mut at = |share: f64, found: &[Option<[f64; 2]>; 4]| {
                for (e, error) in found.iter().enumerate() {
                    for (j, x) in error.iter().flatten().enumerate() {
                        lines[j][e].push([share, x.max(1e-6)]);
                    }
                }
            };
            at(0.0, &clean);
            for share in &p.shares {
                let found = run(*share, layout);
                at(*share, &found);
                add(&mut table, layout.name(), *share, found);
            }
            for (parameter, lines) in ["a1", "a2"].into_iter().zip(lines) {
                let lines = ESTIMATORS.iter().zip(lines).map(|(e, points)| Line::new(e.name(), points));
                let title = format!("{parameter}: {}", layout.name());
                let x = ("share of spurious features", false);
                charts.push(Chart::of(title, x, ("median relative error", true), lines.collect()));
            }
        }
        table.charts = charts;
        io.table.set(table);
        Ok(vec![
            ("data_sets", p.sets.into()),
            ("largest_a1_error_of_mixture_times_clean", largest[0].into()),
            ("largest_a2_error_of_mixture_times_clean", largest[1].into()),
        ])
    }

    fn trial(rng: &mut Rng) -> (SpuriousFeaturesParams, MemoryFiles) {
        let p = SpuriousFeaturesParams {
            sets: 1,
            features: 40 + rng.below(20),
            noise: rng.between(0.2, 0.6),
            shares: vec![rng.between(0.05, 0.2)],
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mixture_withstands_spurious_features() {
        let of = |share| median_errors([7, 400], 0.4, share, Layout::LogUniform, 0);
        let ([clean, ..], [plain, mixture, ..]) = (of(0.0), of(0.2));
        let [clean, plain, mixture] = [clean, plain, mixture].map(|e| e.unwrap()[0]);
        assert!(mixture < 3.0 * clean.max(0.02), "{clean} {mixture}");
        assert!(plain > 2.0 * mixture, "{plain} {mixture}");
    }
}
