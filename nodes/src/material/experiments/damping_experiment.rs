//! Errors of estimators against the number of sounds, as a node.

use super::estimators::{Compared, median_and_mean, relative_errors};
use super::significance::{SIGNIFICANT, Significance, compare, significance_table};
use super::synthetic::{Collection, CollectionSize};
use crate::core::computation::Monitor;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::dsp::db_to_linear;
use crate::plot::{Chart, Line};
use crate::table::{Cell, ResultTable};
use crate::{params, ports};
use rayon::prelude::*;

params! {
    /// Errors of estimators of damping against the number of sounds, on synthetic sounds of known damping.
    ///
    /// For each of some random materials, sounds of bars, plates and shells on random supports make a collection; each subset of a few
    /// of them is fitted by each estimator. Table and charts have the median and the mean relative error of `a1` and `a2` over materials
    /// and subsets, for dampings without errors, with relative errors, and with spurious features besides. The sounds are features, whose
    /// errors are those of `noise` alone; or audio with white noise, whose features are extracted, once without and once with spurious
    /// features besides.
    ///
    /// `significance` compares the estimators in pairs: the mean error of each for each material and object, on subsets of `paired` sounds of
    /// that object alone, by Wilcoxon's signed-rank test, adjusted by Holm's method for all tests of one noise.
    ///
    /// The defaults are a short run. That of the paper's size is 5 materials, 18 objects, 100 sounds an object and 30 subsets. Audio takes
    /// some tenths of a second for each sound.
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
        /// True to extract the features from audio; `noise` has no effect then.
        audio: bool = false;
        /// RMS of the white noise of the audio, relative to the peak of each sound.
        audio_noise: f64 = -60.0, unit "dB", range -200.0..=0.0;
        /// Number of sounds of one object that a fit of `significance` has; 0 for no tests.
        paired: usize = 0, unit "", range 0..=10_000;
    }
}
ports! {
    pub struct DampingExperimentPorts / DampingExperimentIo {
        in {}
        out {
            /// Errors by noise, number of sounds and estimator.
            table: Value<ResultTable>,
            /// A row for each noise, parameter and two estimators: which of them has the smaller errors, and how likely that is by chance.
            significance: Value<ResultTable>,
        }
    }
}

/// The node over [`Experiment`].
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

/// The sounds of an experiment, as features.
#[derive(Debug)]
pub struct Experiment<'a> {
    params: &'a DampingExperimentParams,
    seed: u64,
    /// Relative standard deviation of the dampings and share of spurious features, with the sounds of each material.
    settings: Vec<([f64; 2], Vec<Collection>)>,
}

impl<'a> Experiment<'a> {
    /// Makes the sounds; a function of the seed for any number of threads. `monitor` watches the analysis of audio.
    ///
    /// # Complexity
    /// An extraction for each sound, if they are audio.
    #[must_use]
    pub fn new(params: &'a DampingExperimentParams, seed: u64, monitor: &Monitor<'_>) -> Self {
        let p = params;
        let size = CollectionSize { objects: p.objects, supports: p.supports, sounds: p.sounds };
        let mut experiment = Self { params, seed, settings: Vec::new() };
        let collection = |m: usize| {
            let mut rng = experiment.stream(1, m, 0);
            if p.audio {
                Collection::of_audio(&mut rng, &size, db_to_linear(p.audio_noise), &|done| {
                    monitor((m as f64 + done) / p.materials as f64)
                })
            } else {
                Collection::new(&mut rng, &size)
            }
        };
        let collections: Vec<Collection> = (0..p.materials).map(collection).collect();
        let noise: &[f64] = if p.audio { &[0.0] } else { &p.noise };
        let mut settings: Vec<[f64; 2]> = noise.iter().map(|r| [*r, 0.0]).collect();
        if p.spurious > 0.0 {
            settings.push([if p.audio { 0.0 } else { p.spurious_noise }, p.spurious]);
        }
        let noisy = |(s, [noise, spurious]): (usize, [f64; 2])| {
            let each = collections.iter().enumerate();
            let each = each.map(|(m, c)| c.with_errors(&mut experiment.stream(2, m, s), noise, spurious));
            ([noise, spurious], each.collect())
        };
        experiment.settings = settings.into_iter().enumerate().map(noisy).collect();
        experiment
    }

    fn stream(&self, a: usize, b: usize, c: usize) -> Rng {
        let key = (a as u64) << 40 | (b as u64) << 20 | c as u64;
        Rng::new(self.seed ^ (key + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }

    /// The relative errors of each estimator on `count` sounds out of a collection.
    fn fits(&self, sounds: &Collection, rng: &mut Rng, count: usize) -> [Option<[f64; 2]>; 6] {
        let points = sounds.draw(rng, count);
        Compared::ALL.map(|estimator| {
            let done = estimator != Compared::Hierarchical || count <= self.params.hierarchical;
            let found = if done { estimator.estimate(&points) } else { None };
            found.map(|found| relative_errors(found, sounds.truth))
        })
    }

    /// Errors for each noise and number of sounds.
    ///
    /// # Complexity
    /// `materials subsets` fits of each estimator for each noise and number of sounds, in parallel.
    #[must_use]
    pub fn errors(&self) -> Vec<ErrorsAt> {
        let p = self.params;
        let at = |&([noise, spurious], ref sounds): &([f64; 2], Vec<Collection>), count: usize| {
            let fits = |k: usize| {
                let (m, subset) = (k % p.materials, k / p.materials);
                self.fits(&sounds[m], &mut self.stream(3 + count, m, subset), count)
            };
            let all: Vec<[Option<[f64; 2]>; 6]> =
                (0..p.materials * p.subsets).into_par_iter().map(fits).collect();
            let errors = Compared::ALL.into_iter().enumerate();
            let errors = errors.map(|(e, estimator)| (estimator, all.iter().filter_map(|x| x[e]).collect()));
            ErrorsAt { noise, spurious, count, errors: errors.collect() }
        };
        self.settings
            .iter()
            .flat_map(|setting| p.counts.iter().map(move |count| at(setting, *count)))
            .collect()
    }

    /// Compares the estimators in pairs over materials and objects, for each noise; empty if `paired` is 0.
    ///
    /// # Complexity
    /// `materials objects subsets` fits of each estimator for each noise, in parallel.
    #[must_use]
    pub fn significance(&self) -> Vec<Significance> {
        if self.params.paired == 0 {
            return Vec::new();
        }
        self.settings.iter().flat_map(|(setting, sounds)| self.tests(*setting, sounds)).collect()
    }

    fn tests(&self, [noise, spurious]: [f64; 2], sounds: &[Collection]) -> Vec<Significance> {
        let p = self.params;
        let pair = |k: usize| {
            let (m, object) = (k / p.objects, k % p.objects);
            let own = sounds[m].of_object(object, p.sounds);
            let fits: Vec<[Option<[f64; 2]>; 6]> = (0..p.subsets)
                .map(|subset| self.fits(&own, &mut self.stream((1 << 15) + object, m, subset), p.paired))
                .collect();
            std::array::from_fn(|e| {
                let errors: Vec<[f64; 2]> = fits.iter().filter_map(|x| x[e]).collect();
                Some(median_and_mean(&errors)?.map(|[_, mean]| mean))
            })
        };
        let pairs: Vec<[Option<[f64; 2]>; 6]> =
            (0..p.materials * p.objects).into_par_iter().map(pair).collect();
        compare(&pairs, noise, spurious)
    }
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
    const VERSION: u32 = 2;

    fn check(
        p: &DampingExperimentParams,
        s: &mut Shape<'_, '_, DampingExperimentPorts>,
    ) -> Result<(), Reject> {
        let sounds = p.objects * p.sounds;
        for count in p.counts.iter().filter(|count| **count > sounds) {
            let message = format!("a subset of {count} sounds out of {sounds}");
            s.wrong(Reject::new("F136", message).at("counts").help("more `sounds` or `objects`"));
        }
        if p.paired > p.sounds {
            let message = format!("a subset of {} sounds out of the {} of an object", p.paired, p.sounds);
            s.wrong(Reject::new("F136", message).at("paired").help("more `sounds`"));
        }
        if !p.audio && p.noise.is_empty() && p.spurious == 0.0 {
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
        let experiment = Experiment::new(p, u64::from(cx.random.words(0, 0, 0)[0]), cx.monitor);
        if (cx.monitor)(1.0) {
            return Err(Fault::stopped());
        }
        let (all, tests) = (experiment.errors(), experiment.significance());
        let both = |at: &ErrorsAt| Some((at.of(Compared::Mixture)?, at.of(Compared::Paper)?));
        let compared: Vec<_> = all.iter().filter_map(both).collect();
        let no_worse = |j: usize| {
            let count = compared.iter().filter(|(ours, paper)| ours[j][0] <= paper[j][0]).count();
            format!("{count} of {}", compared.len())
        };
        let ratios = |j: usize| compared.iter().map(move |(ours, paper)| ours[j][0] / paper[j][0].max(1e-12));
        let largest = [ratios(0), ratios(1)].map(|r| r.fold(0.0, f64::max));
        io.table.set(table(&all));
        io.significance.set(significance_table(&tests));
        let significant = tests.iter().filter(|t| t.adjusted < SIGNIFICANT).count();
        Ok(vec![
            ("sounds_of_a_material", (p.objects * p.sounds).into()),
            ("mixture_no_worse_than_paper_in_a1", no_worse(0).into()),
            ("mixture_no_worse_than_paper_in_a2", no_worse(1).into()),
            ("largest_ratio_of_a1_errors_mixture_to_paper", largest[0].into()),
            ("largest_ratio_of_a2_errors_mixture_to_paper", largest[1].into()),
            ("significant_differences", format!("{significant} of {}", tests.len()).into()),
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
            audio: false,
            paired: rng.below(3),
            ..DampingExperimentParams::trial(rng)
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::computation::unmonitored;

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
        check_orderings(&Experiment::new(&p, 1, &unmonitored).errors());
    }

    #[test]
    fn a_run_is_a_function_of_its_seed() {
        let p = DampingExperimentParams {
            materials: 2,
            objects: 2,
            sounds: 10,
            counts: vec![3],
            noise: vec![0.03],
            paired: 3,
            ..params()
        };
        let errors = |p: &DampingExperimentParams, seed| {
            let experiment = Experiment::new(p, seed, &unmonitored);
            (experiment.errors(), experiment.significance())
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let (a, b) = (errors(&p, 5), pool.install(|| errors(&p, 5)));
        assert!(a == b && a != errors(&p, 6));
        let table = table(&a.0);
        assert_eq!((table.rows.len(), table.charts.len()), (12, 4), "{}", table.csv());
        // Two noises, two parameters, and 15 pairs of six estimators.
        assert_eq!(a.1.len(), 60);
    }

    #[test]
    fn maximum_likelihood_and_lower_bound_are_better_than_least_squares() {
        let p = DampingExperimentParams {
            counts: Vec::new(),
            noise: vec![0.0],
            spurious: 0.0,
            subsets: 1,
            hierarchical: 0,
            paired: 10,
            ..params()
        };
        let tests = Experiment::new(&p, 1, &unmonitored).significance();
        for estimator in [Compared::Paper, Compared::Mixture, Compared::LowerBound] {
            let test = tests
                .iter()
                .find(|t| t.parameter == 0 && (t.better, t.worse) == (estimator, Compared::LeastSquares));
            assert!(test.is_some_and(|t| t.adjusted < 0.001 && t.pairs == 90), "{estimator:?} {test:?}");
        }
    }
}
