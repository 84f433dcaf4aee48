//! Coverage of intervals, as a node.

use super::synthetic::independent_points;
use crate::core::computation::Monitor;
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::material::damping::Family;
use crate::material::estimation::estimate::{Estimator, Settings, estimate};
use crate::material::estimation::fit::{FitOptions, fit};
use crate::material::estimation::point::{DampingPoint, Sample};
use crate::material::estimation::uncertainty::{
    Interval, covariance, information, parametric_bootstrap, profile, refit, standard_errors, wald,
};
use crate::plot::{Chart, Line};
use crate::table::ResultTable;
use crate::{params, ports};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// `a1` in 1/s, `a2` in s, and the rate of the support damping in s of the data sets: those of the paper's porcelain plate.
pub const TRUTH: [f64; 3] = [3.9, 1e-8, 0.125];
const NAMES: [&str; 2] = ["a1", "a2"];
/// Methods of intervals, in the order of the table.
pub const METHODS: [&str; 4] = ["standard error", "profile", "simulation", "mixture"];
/// Features of one recording of the resampled ones.
const FEATURES_OF_A_RECORDING: usize = 30;

params! {
    /// Coverage of 95 % intervals over many simulated data sets of known damping.
    ///
    /// Data sets are independent points of a Rayleigh curve with exponential support damping and normal noise. Intervals are standard
    /// errors, profile likelihoods and refits of simulated data, all of the maximum likelihood, and those of the default of `DampingFit`: a
    /// mixture, with recordings of 30 features resampled. Each row has the share of data sets whose interval holds the parameter, with
    /// its own 95 % interval, and their mean width. At a noise of 0 the estimate of the noise is at its floor.
    ///
    /// The defaults are a short run; the shares need 400 data sets and 200 draws.
    ///
    /// # Randomness
    /// The data sets, and those of the intervals, are a function of the seed.
    ///
    /// # Source
    /// Wilson, "Probable inference, the law of succession, and statistical inference" (J. Am. Stat. Assoc. 22, 1927), for the intervals
    /// of shares.
    pub struct IntervalCoverageParams {
        /// Number of data sets.
        sets: usize = 40, unit "", range 2..=100_000;
        /// Number of features of a data set.
        features: usize = 750, unit "", range 30..=100_000;
        /// Number of refits for an interval.
        draws: usize = 60, unit "", range 20..=10_000;
        /// Standard deviations of the noise: a run each.
        noise: Vec<f64> = vec![0.0, 0.4, 2.0], unit "1/s", range 0.0..=100.0;
    }
}
ports! {
    pub struct IntervalCoveragePorts / IntervalCoverageIo {
        in {}
        out {
            /// Shares of intervals that hold the truth, by noise, method and parameter.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`coverage`].
#[derive(Debug)]
pub struct IntervalCoverage;

/// Data sets and refits of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoverageSize {
    /// Number of data sets.
    pub sets: usize,
    /// Number of features of each.
    pub features: usize,
    /// Number of refits for an interval.
    pub draws: usize,
}

/// An interval of a parameter: true if it holds the truth, and its width relative to the truth.
type Held = (bool, f64);

fn held(j: usize, [low, high]: [f64; 2]) -> Held {
    (low <= TRUTH[j] && TRUTH[j] <= high, (high - low) / TRUTH[j])
}

fn both(intervals: &[Interval]) -> Option<[Held; 2]> {
    let own = |j: usize| intervals.get(j).map(|i| held(j, [i.low, i.high]));
    Some([own(0)?, own(1)?])
}

/// The interval of each of [`METHODS`] for `a1` and `a2`; `None` where a method has none.
fn one_set(points: &[DampingPoint], draws: usize, seed: u64) -> [Option<[Held; 2]>; 4] {
    let options = FitOptions::paper(Family::Rayleigh);
    let plain = fit(points, &options).ok().map(|found| {
        let names: Vec<String> = NAMES.map(str::to_owned).to_vec();
        let values = found.sample.physical_with_noise(&found.z);
        let standard = covariance(&found, &information(&found))
            .and_then(|cov| both(&wald(&names, &values, &standard_errors(&cov))));
        let ends = profile(&found, 0).zip(profile(&found, 1));
        let profile = ends.map(|(a1, a2)| [held(0, a1), held(1, a2)]);
        let again = |sample: &Sample| refit(&found, sample);
        let replicates = parametric_bootstrap(&found, draws, seed, again);
        [standard, profile, both(&replicates.intervals(&names, &values))]
    });
    let recordings = points
        .iter()
        .enumerate()
        .map(|(i, p)| DampingPoint { recording: (i / FEATURES_OF_A_RECORDING) as u32, ..*p });
    let settings = Settings {
        draws,
        ks_draws: 0,
        compare: false,
        seed,
        ..Settings::new(Estimator::Mixture, FitOptions::new(Family::Rayleigh))
    };
    let points: Vec<DampingPoint> = recordings.map(|p| DampingPoint { c: p.c.max(0.5), ..p }).collect();
    let mixture = estimate(&points, &settings).ok().and_then(|report| both(&report.ci));
    let [standard, profile, simulated] = plain.unwrap_or_default();
    [standard, profile, simulated, mixture]
}

/// Intervals of one method over data sets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coverage {
    /// Shares of intervals that hold `a1` and `a2`.
    pub shares: [f64; 2],
    /// Mean widths relative to the truth.
    pub widths: [f64; 2],
    /// Number of data sets that have intervals.
    pub sets: usize,
}

/// Intervals of data sets by each of [`METHODS`]; `None` where the monitor stops them. It is given the share that is done.
///
/// # Complexity
/// `sets draws` refits, in parallel; a function of the seed for any number of threads.
#[must_use]
pub fn coverage(size: &CoverageSize, sigma: f64, seed: u64, monitor: &Monitor<'_>) -> Option<[Coverage; 4]> {
    let [a1, a2, eta] = TRUTH;
    let done = AtomicUsize::new(0);
    let all: Option<Vec<[Option<[Held; 2]>; 4]>> = (0..size.sets)
        .into_par_iter()
        .map(|k| {
            if monitor(done.fetch_add(1, Ordering::Relaxed) as f64 / size.sets as f64) {
                return None;
            }
            let own = seed.wrapping_add(1000 + k as u64);
            let points = independent_points(&mut Rng::new(own), size.features, [a1, a2, sigma, eta]);
            Some(one_set(&points, size.draws, own))
        })
        .collect();
    let all = all?;
    Some([0, 1, 2, 3].map(|m| {
        let of: Vec<[Held; 2]> = all.iter().filter_map(|intervals| intervals[m]).collect();
        let count = of.len().max(1) as f64;
        let share = |j: usize| of.iter().filter(|held| held[j].0).count() as f64 / count;
        let width = |j: usize| of.iter().map(|held| held[j].1).sum::<f64>() / count;
        Coverage { shares: [share(0), share(1)], widths: [width(0), width(1)], sets: of.len() }
    }))
}

/// The 95 % interval of a share of `n`, after Wilson.
fn share_interval(share: f64, n: usize) -> [f64; 2] {
    let (n, z) = (n as f64, 1.96_f64);
    let centre = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

impl Func for IntervalCoverage {
    type Params = IntervalCoverageParams;
    type Ports = IntervalCoveragePorts;
    const NAME: &'static str = "IntervalCoverage";
    const VERSION: u32 = 3;

    fn eval(
        p: &IntervalCoverageParams,
        cx: &Build<'_>,
        mut io: IntervalCoverageIo<'_>,
    ) -> Result<Summary, Fault> {
        let seed = u64::from(cx.random.words(0, 0, 0)[0]);
        let size = CoverageSize { sets: p.sets, features: p.features, draws: p.draws };
        let mut table = ResultTable::new(&[
            "noise_per_s",
            "intervals",
            "parameter",
            "share",
            "share_low",
            "share_high",
            "mean_relative_width",
            "data_sets",
        ]);
        let mut lines: Vec<Vec<[f64; 2]>> = vec![Vec::new(); 2 * METHODS.len()];
        for (level, sigma) in p.noise.iter().enumerate() {
            let monitor = |share: f64| (cx.monitor)((level as f64 + share) / p.noise.len() as f64);
            let found = coverage(&size, *sigma, seed, &monitor).ok_or_else(Fault::stopped)?;
            for (m, of) in found.into_iter().enumerate() {
                if of.sets == 0 {
                    continue;
                }
                for (j, share) in of.shares.into_iter().enumerate() {
                    let [low, high] = share_interval(share, of.sets);
                    table.push([
                        (*sigma).into(),
                        METHODS[m].into(),
                        NAMES[j].into(),
                        share.into(),
                        low.into(),
                        high.into(),
                        of.widths[j].into(),
                        of.sets.into(),
                    ]);
                    lines[j * METHODS.len() + m].push([*sigma, share]);
                }
            }
        }
        table.charts = (NAMES.iter().zip(lines.chunks(METHODS.len())))
            .map(|(name, lines)| {
                let lines = METHODS.iter().zip(lines).map(|(m, points)| Line::new(*m, points.clone()));
                let title = format!("{name}: share of 95 % intervals that hold it");
                Chart::of(title, ("noise, 1/s", false), ("share", false), lines.collect())
            })
            .collect();
        io.table.set(table);
        Ok(vec![("data_sets", p.sets.into()), ("features", p.features.into())])
    }

    fn trial(rng: &mut Rng) -> (IntervalCoverageParams, MemoryFiles) {
        let p = IntervalCoverageParams {
            sets: 2,
            features: 60 + rng.below(20),
            draws: 20,
            noise: vec![rng.between(0.2, 1.0)],
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_of_shares_are_those_of_wilson() {
        // statsmodels.stats.proportion.proportion_confint(380, 400, method="wilson").
        let [low, high] = share_interval(0.95, 400);
        assert!((low - 0.924_088).abs() < 1e-4 && (high - 0.967_40).abs() < 1e-4, "{low} {high}");
    }
}
