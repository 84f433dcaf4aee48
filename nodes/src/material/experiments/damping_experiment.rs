//! Errors of estimators against the number of sounds, as a node.

use super::estimators::{Compared, median_and_mean, relative_errors};
use super::synthetic::{Collection, CollectionSize};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::plot::{Chart, Line};
use crate::table::{Cell, ResultTable};
use crate::{params, ports};
use rayon::prelude::*;

params! {
    /// Errors of estimators of damping against the number of sounds, on synthetic sounds of known damping.
    ///
    /// For each of some random materials, sounds of bars, plates and shells on random supports make a collection; each subset of a few
    /// of them is fitted by each estimator. Table and charts have the median and the mean relative error of `a1` and `a2` over materials
    /// and subsets, for dampings without errors, with relative errors, and with spurious features besides. The sounds are features, not
    /// audio: errors of their extraction are those of `noise` alone.
    ///
    /// The defaults are a short run. That of the paper's size is 5 materials, 18 objects, 100 sounds an object and 30 subsets.
    ///
    /// # Randomness
    /// Materials, objects, supports, impacts, errors and subsets are a function of the seed.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), section 5.3 and figure 10.
    pub struct DampingExperimentParams {
        /// Number of random materials.
        materials: usize = 5, unit "", range 1..=100;
        /// Number of objects of each material.
        objects: usize = 18, unit "", range 1..=1000;
        /// Number of supports of each object.
        supports: usize = 10, unit "", range 1..=1000;
        /// Number of sounds of each object; a collection should have many times more sounds than the largest subset.
        sounds: usize = 60, unit "", range 1..=10_000;
        /// Numbers of sounds in a subset.
        counts: Vec<usize> = vec![1, 2, 5, 10, 20, 30, 50, 100], unit "", range 1..=10_000;
        /// Number of subsets of each size and material.
        subsets: usize = 4, unit "", range 1..=10_000;
        /// Relative standard deviations of the dampings: one run each, without spurious features.
        noise: Vec<f64> = vec![0.0, 0.03, 0.1], unit "", range 0.0..=1.0;
        /// Share of spurious features of one more run.
        spurious: f64 = 0.05, unit "", range 0.0..=0.9;
        /// Relative standard deviation of the dampings of that run.
        spurious_noise: f64 = 0.03, unit "", range 0.0..=1.0;
        /// Largest subset that the hierarchical estimator fits; 0 for none. It takes seconds for 100 sounds.
        hierarchical: usize = 10, unit "sounds", range 0..=10_000;
    }
}
ports! {
    pub struct DampingExperimentPorts / DampingExperimentIo {
        in {}
        out {
            /// Errors by noise, number of sounds and estimator.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`errors`].
#[derive(Debug)]
pub struct DampingExperiment;

/// Errors of estimators on subsets of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorsAt {
    /// Relative standard deviation of the dampings.
    pub noise: f64,
    /// Share of spurious features.
    pub spurious: f64,
    /// Number of sounds in a subset.
    pub count: usize,
    /// Each estimator with its relative errors of `a1` and `a2`.
    pub errors: Vec<(Compared, Vec<[f64; 2]>)>,
}

impl ErrorsAt {
    /// Median and mean errors of both parameters by an estimator.
    #[must_use]
    pub fn of(&self, estimator: Compared) -> Option<[[f64; 2]; 2]> {
        median_and_mean(&self.errors.iter().find(|(e, _)| *e == estimator)?.1)
    }
}

/// Runs the experiment: errors for each noise and number of sounds.
///
/// # Complexity
/// `materials subsets` fits of each estimator for each noise and number of sounds, in parallel; a function of the seed for any number of
/// threads.
#[must_use]
pub fn errors(p: &DampingExperimentParams, seed: u64) -> Vec<ErrorsAt> {
    let size = CollectionSize { objects: p.objects, supports: p.supports, sounds: p.sounds };
    let stream = |a: usize, b: usize, c: usize| {
        let key = (a as u64) << 40 | (b as u64) << 20 | c as u64;
        Rng::new(seed ^ (key + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15))
    };
    let collections: Vec<Collection> =
        (0..p.materials).map(|m| Collection::new(&mut stream(1, m, 0), &size)).collect();
    let mut settings: Vec<[f64; 2]> = p.noise.iter().map(|r| [*r, 0.0]).collect();
    if p.spurious > 0.0 {
        settings.push([p.spurious_noise, p.spurious]);
    }
    let mut out = Vec::new();
    for (s, [noise, spurious]) in settings.into_iter().enumerate() {
        let noisy: Vec<Collection> = (collections.iter().enumerate())
            .map(|(m, c)| c.with_errors(&mut stream(2, m, s), noise, spurious))
            .collect();
        for count in &p.counts {
            let fits = |k: usize| {
                let (material, subset) = (&noisy[k % p.materials], k / p.materials);
                let points = material.draw(&mut stream(3 + count, k % p.materials, subset), *count);
                Compared::ALL.map(|estimator| {
                    let done = estimator != Compared::Hierarchical || *count <= p.hierarchical;
                    let found = if done { estimator.estimate(&points) } else { None };
                    found.map(|found| relative_errors(found, material.truth))
                })
            };
            let all: Vec<[Option<[f64; 2]>; 6]> =
                (0..p.materials * p.subsets).into_par_iter().map(fits).collect();
            let errors = Compared::ALL.into_iter().enumerate();
            let errors = errors.map(|(e, estimator)| (estimator, all.iter().filter_map(|x| x[e]).collect()));
            out.push(ErrorsAt { noise, spurious, count: *count, errors: errors.collect() });
        }
    }
    out
}

fn name_of(noise: f64, spurious: f64) -> String {
    let spurious =
        if spurious > 0.0 { format!(", {:.0} % spurious", 100.0 * spurious) } else { String::new() };
    format!("noise {noise}{spurious}")
}

/// The table of an experiment, with a chart for each parameter and noise.
#[must_use]
pub fn table(all: &[ErrorsAt]) -> ResultTable {
    let mut table = ResultTable::new(&[
        "noise",
        "spurious",
        "sounds",
        "estimator",
        "a1_median_error",
        "a1_mean_error",
        "a2_median_error",
        "a2_mean_error",
        "fits",
    ]);
    for at in all {
        for (estimator, errors) in &at.errors {
            if let Some([a1, a2]) = median_and_mean(errors) {
                let head: [Cell; 4] =
                    [at.noise.into(), at.spurious.into(), at.count.into(), estimator.name().into()];
                table.push(
                    head.into_iter()
                        .chain([a1[0], a1[1], a2[0], a2[1]].map(Cell::from))
                        .chain([errors.len().into()]),
                );
            }
        }
    }
    for run in all.chunk_by(|a, b| (a.noise, a.spurious) == (b.noise, b.spurious)) {
        for (j, parameter) in ["a1", "a2"].into_iter().enumerate() {
            let line = |estimator: Compared| {
                let at = |e: &ErrorsAt| Some([e.count as f64, e.of(estimator)?[j][0].max(1e-6)]);
                Line::new(estimator.name(), run.iter().filter_map(at).collect())
            };
            let lines: Vec<Line> =
                Compared::ALL.into_iter().map(line).filter(|l| !l.points.is_empty()).collect();
            let title = format!("{parameter}: {}", name_of(run[0].noise, run[0].spurious));
            table.charts.push(Chart::of(
                title,
                ("number of sounds", true),
                ("median relative error", true),
                lines,
            ));
        }
    }
    table
}

impl Func for DampingExperiment {
    type Params = DampingExperimentParams;
    type Ports = DampingExperimentPorts;
    const NAME: &'static str = "DampingExperiment";

    fn check(
        p: &DampingExperimentParams,
        s: &mut Shape<'_, '_, DampingExperimentPorts>,
    ) -> Result<(), Reject> {
        let sounds = p.objects * p.sounds;
        for count in p.counts.iter().filter(|count| **count > sounds) {
            let message = format!("a subset of {count} sounds out of {sounds}");
            s.wrong(Reject::new("F136", message).at("counts").help("more `sounds` or `objects`"));
        }
        if p.noise.is_empty() && p.spurious == 0.0 {
            s.wrong(
                Reject::new("F136", "there is nothing to run").at("noise").help("a list such as [0, 0.03]"),
            );
        }
        Ok(())
    }

    fn eval(
        p: &DampingExperimentParams,
        cx: &Build<'_>,
        mut io: DampingExperimentIo<'_>,
    ) -> Result<Summary, Fault> {
        let all = errors(p, u64::from(cx.random.words(0, 0, 0)[0]));
        let both = |at: &ErrorsAt| Some((at.of(Compared::Mixture)?, at.of(Compared::Paper)?));
        let compared: Vec<_> = all.iter().filter_map(both).collect();
        let no_worse = |j: usize| {
            let count = compared.iter().filter(|(ours, paper)| ours[j][0] <= paper[j][0]).count();
            format!("{count} of {}", compared.len())
        };
        let ratios = |j: usize| compared.iter().map(move |(ours, paper)| ours[j][0] / paper[j][0].max(1e-12));
        let largest = [ratios(0), ratios(1)].map(|r| r.fold(0.0, f64::max));
        io.table.set(table(&all));
        Ok(vec![
            ("sounds_of_a_material", (p.objects * p.sounds).into()),
            ("mixture_no_worse_than_paper_in_a1", no_worse(0).into()),
            ("mixture_no_worse_than_paper_in_a2", no_worse(1).into()),
            ("largest_ratio_of_a1_errors_mixture_to_paper", largest[0].into()),
            ("largest_ratio_of_a2_errors_mixture_to_paper", largest[1].into()),
        ])
    }

    fn trial(rng: &mut Rng) -> (DampingExperimentParams, MemoryFiles) {
        let p = DampingExperimentParams {
            materials: 1 + rng.below(2),
            objects: 2 + rng.below(2),
            supports: 1 + rng.below(3),
            sounds: 6,
            counts: vec![1 + rng.below(3), 4 + rng.below(5)],
            subsets: 1,
            noise: vec![rng.between(0.01, 0.1)],
            hierarchical: 0,
            ..DampingExperimentParams::trial(rng)
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params() -> DampingExperimentParams {
        DampingExperimentParams::read(&|_| None).unwrap()
    }

    /// The orderings of section 7.3 of the specification.
    fn check_orderings(all: &[ErrorsAt]) {
        let at = |noise: f64, spurious: bool, count: usize, e: Compared| {
            let found = all.iter().find(|a| (a.noise, a.spurious > 0.0, a.count) == (noise, spurious, count));
            found.unwrap().of(e).unwrap().map(|x| x[0])
        };
        let clean = |count, e| at(0.0, false, count, e);
        assert!(clean(50, Compared::Paper)[0] < 0.1 * clean(50, Compared::LeastSquares)[0]);
        assert!(clean(50, Compared::Paper)[0] < clean(2, Compared::Paper)[0]);
        let noisy = |e| at(0.1, false, 50, e);
        assert!(noisy(Compared::LowerBound)[1] > at(0.1, false, 2, Compared::LowerBound)[1]);
        assert!(noisy(Compared::LeastSquares)[0] > 0.4);
        let dirty = |e| at(0.03, true, 50, e);
        assert!(dirty(Compared::Mixture)[0] < 0.15 && dirty(Compared::Mixture)[1] < 0.03);
        assert!(dirty(Compared::Paper)[0] > 3.0 * dirty(Compared::Mixture)[0]);
    }

    #[test]
    fn estimators_are_ordered_as_in_the_specification() {
        let p = DampingExperimentParams { counts: vec![2, 50], subsets: 3, hierarchical: 0, ..params() };
        check_orderings(&errors(&p, 1));
    }

    #[test]
    fn a_run_is_a_function_of_its_seed() {
        let p = DampingExperimentParams {
            materials: 2,
            objects: 2,
            sounds: 10,
            counts: vec![3],
            noise: vec![0.03],
            ..params()
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let (a, b) = (errors(&p, 5), pool.install(|| errors(&p, 5)));
        assert!(a == b && a != errors(&p, 6));
        let table = table(&a);
        assert_eq!((table.rows.len(), table.charts.len()), (12, 4), "{}", table.csv());
    }
}
