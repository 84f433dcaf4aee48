//! Fits of damping, as a node.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::material::damping::Family;
use crate::material::estimation::estimate::{Estimator, Settings, estimate};
use crate::material::estimation::fit::{FitOptions, Method};
use crate::material::estimation::least_squares::Space;
use crate::material::estimation::likelihood::Excess;
use crate::material::estimation::mixture::MixtureOptions;
use crate::material::estimation::prior::MaterialPrior;
use crate::material::estimation::report::FitReport;
use crate::material::library::{FitOrigin, Material, Uncertainty, read_material};
use crate::material::points::damping_points::DampingPoints;
use crate::{choices, params, ports};

choices! { @param Estimator {
    /// Maximum likelihood with a background of spurious features.
    Mixture,
    /// Maximum likelihood, as in the paper.
    Likelihood,
    /// Maximum likelihood with a mean support damping for each recording: several objects and supports of one material. All parameters
    /// are estimated at once: those of the material, the noise, and the support of each recording.
    Hierarchical,
    /// Non-negative least squares, which attributes all damping to the material.
    LeastSquares,
    /// The highest curve below all points.
    LowerBound,
} }
choices! { @param Method {
    /// A scan over shapes, or several starts, then Newton steps.
    Scan,
    /// Ascent along the gradient, as in the paper, for comparison.
    GradientAscent,
    /// Expectation-maximisation, for comparison.
    Em,
} }
choices! { @param Space {
    /// Squares of differences.
    Linear,
    /// Squares of differences of logarithms, for `Power`.
    Log,
} }
choices! {
    /// Family of the fitted curve, over `lambda = (2 pi f)^2`.
    pub enum DampingFamily {
        /// `a1 + a2 lambda`.
        Rayleigh,
        /// `g2 lambda^g3`.
        Power,
        /// A polynomial of `order` terms.
        Caughey,
        /// `g1 + g2 lambda^g3`.
        Hybrid,
        /// A non-decreasing spline in `ln lambda` of `order` knots, at least 4.
        Spline,
    }
}
choices! {
    /// Unit that has a support damping of its own, for `Hierarchical`.
    pub enum SupportGroup {
        /// Each recording.
        Recording,
        /// All recordings of one object on one support, where the support is known.
        Support,
    }
}
choices! {
    /// Set of options of the likelihood.
    pub enum FitPreset {
        /// The noise of each feature is added to that of all, and dropped features are taken into account.
        Default,
        /// The paper's likelihood: one noise for all points.
        Paper,
    }
}

params! {
    /// Estimates the damping of a material from points of damping over frequency.
    ///
    /// Each damping is that of the material, plus that of the support, which is exponentially distributed, plus normal noise. The
    /// estimator separates the three. `Mixture` also separates spurious features, a few of which ruin the other estimates. Features
    /// of one frequency that are mostly spurious, as those of a striker that rings, count as a group. The summary lists the parameters,
    /// their 95 % intervals, and the reasons to doubt them. A tap of `report` as SVG is the figure of the fit. Intervals are those of
    /// resampled recordings, so they need several.
    ///
    /// # Randomness
    /// Resampled and simulated data, and so the intervals and the test of the fit, are a function of the seed.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), section 4.
    pub struct DampingFitParams {
        /// The estimator.
        estimator: Estimator = Estimator::Mixture;
        /// Family of the curve.
        model: DampingFamily = DampingFamily::Rayleigh;
        /// Number of terms of `Caughey` (1 to 6), or of knots of `Spline` (4 to 8).
        order: usize = 4, unit "", range 1..=8;
        /// Unit that has a support damping of its own, for `Hierarchical`.
        group: SupportGroup = SupportGroup::Recording;
        /// Options of the likelihood.
        preset: FitPreset = FitPreset::Default;
        /// Method that maximises the likelihood.
        method: Method = Method::Scan;
        /// Relative accuracy of dampings that state none; 0 for none.
        relative_noise: f64 = 0.0, unit "", range 0.0..=1.0;
        /// Gamma shape of the support damping: 1 is exponential, 0.44 suits supports without friction.
        shape: f64 = 1.0, unit "", range 0.05..=20.0;
        /// Lowest damping `c` of a spurious feature: twice `d_min` of the gate.
        lo: f64 = 0.5, unit "1/s", range 0.000001..=1000.0;
        /// Highest damping `c` of a spurious feature; None for the larger of 2000 1/s and twice the largest.
        hi: Option<f64> = None, unit "1/s", range 0.001..=1_000_000_000.0;
        /// Maximum share of spurious features.
        pi_max: f64 = 0.5, unit "", range 0.001..=0.95;
        /// Quantity whose squares `LeastSquares` sums.
        space: Space = Space::Linear;
        /// Number of resampled data sets for the intervals; 0 for standard errors.
        draws: usize = 500, unit "", range 0..=100_000;
        /// Number of simulated data sets for the test of the fit; 0 for none.
        tests: usize = 99, unit "", range 0..=10_000;
        /// Fit the other families as well, for comparison.
        compare: bool = true;
        /// Scan shapes, and exponents, more finely.
        thorough: bool = false;
        /// Name of the material.
        name: Text = Text("material".into());
        /// Provenance of the recordings.
        source: Text = Text(String::new());
        /// Licence of the material's file.
        licence: Text = Text(String::new());
        /// Files of materials with dampings of the family `model`, at least two more than it has parameters: their logarithms have a normal
        /// prior of the mean and the covariance of these materials, which helps where recordings are few. For `Mixture` and `Likelihood`
        /// with `Rayleigh`, `Power` or `Hybrid`. The test of the fit and the effect of single recordings are left out.
        prior: Vec<AssetPath> = Vec::new();
    }
}
ports! {
    pub struct DampingFitPorts / DampingFitIo {
        in {
            /// The points.
            points: Value<DampingPoints>,
            /// A material whose elastic constants the result has.
            base: Option<Value<Material>>,
        }
        out {
            /// The material.
            material: Value<Material>,
            /// Parameters, intervals, tests, and the parts of every point.
            report: Value<FitReport>,
        }
    }
}

/// The node over [`estimate`].
#[derive(Debug)]
pub struct DampingFit;

/// Warning where dropped features have no effect on the likelihood.
const UNTRUNCATED: &str = "features below the `d_min` of the gate were dropped, which only the exponential excess of the default preset takes \
                           into account: the constant part may be too high";
/// Maximum number of warnings in a summary.
const MAX_WARNINGS: usize = 8;

fn family(p: &DampingFitParams) -> Result<Family, Reject> {
    let order = |name: &str, low: usize, high: usize| {
        if (low..=high).contains(&p.order) {
            return Ok(p.order);
        }
        let message = format!("`order` is {}; {name} needs {low} to {high}", p.order);
        Err(Reject::new("F136", message).at("order"))
    };
    Ok(match p.model {
        DampingFamily::Rayleigh => Family::Rayleigh,
        DampingFamily::Power => Family::Power,
        DampingFamily::Caughey => Family::Caughey(order("a Caughey model", 1, 6)?),
        DampingFamily::Hybrid => Family::Hybrid,
        DampingFamily::Spline => Family::Spline(order("a spline", 4, 8)?),
    })
}

impl DampingFitParams {
    fn settings(&self, truncated_below: Option<f64>, seed: u64) -> Result<Settings, Reject> {
        let family = family(self)?;
        let paper = self.preset == FitPreset::Paper;
        let fit = FitOptions {
            relative_noise: self.relative_noise,
            truncated_below: truncated_below.filter(|_| !paper && self.shape == 1.0),
            excess: if self.shape == 1.0 { Excess::Exponential } else { Excess::Gamma(self.shape) },
            thorough: self.thorough,
            method: self.method,
            ..if paper { FitOptions::paper(family) } else { FitOptions::new(family) }
        };
        let mixture =
            MixtureOptions { lo: self.lo, hi: self.hi, pi_max: self.pi_max, ..MixtureOptions::new(fit) };
        Ok(Settings {
            mixture,
            space: self.space,
            draws: self.draws,
            ks_draws: self.tests,
            compare: self.compare,
            seed,
            ..Settings::new(self.estimator, fit)
        })
    }
}

/// The prior of materials in files, given their bytes in order; `None` without files.
fn prior(p: &DampingFitParams, files: &[Vec<u8>]) -> Result<Option<MaterialPrior>, Reject> {
    if p.prior.is_empty() {
        return Ok(None);
    }
    let wrong = |message: String| Reject::new("F136", message).at("prior");
    if !matches!(p.estimator, Estimator::Mixture | Estimator::Likelihood) {
        return Err(wrong(format!("the estimator {:?} has no prior", p.estimator))
            .help("set `estimator: Mixture` or `Likelihood`, or leave the prior out"));
    }
    let mut materials = Vec::with_capacity(files.len());
    for (AssetPath(path), bytes) in p.prior.iter().zip(files) {
        materials.push(read_material(bytes).map_err(|e| wrong(format!("{path:?}: {e}")))?);
    }
    let dampings: Vec<_> = materials.iter().map(|m| (m.name.as_str(), &m.damping)).collect();
    MaterialPrior::new(family(p)?, &dampings).map(Some).map_err(wrong)
}

/// The figures of a report for the summary of a run.
fn summary(report: &FitReport) -> Summary {
    let mut parameters = serde_json::Map::new();
    for (name, value) in report.model.names().into_iter().zip(report.model.parameters()) {
        parameters.insert(name, value.into());
    }
    let intervals: serde_json::Map<String, serde_json::Value> =
        report.ci.iter().map(|i| (i.name.clone(), serde_json::json!([i.low, i.high]))).collect();
    let warnings: Vec<String> = report.warnings.iter().map(ToString::to_string).take(MAX_WARNINGS).collect();
    let mut out: Summary = vec![
        ("parameters", parameters.into()),
        ("intervals_95", intervals.into()),
        ("noise_per_s", report.sigma.into()),
        ("points", report.n.into()),
        ("recordings", report.n_recordings.into()),
        ("log_likelihood", report.log_lik.into()),
        ("spurious_share", report.pi.into()),
        ("certified", report.certified.into()),
        (
            "t60_s_at_100_300_1k_3k_10k_hz",
            serde_json::json!(report.at.iter().map(|a| a.t60).collect::<Vec<_>>()),
        ),
        ("warnings", serde_json::json!(warnings)),
    ];
    if !report.supports.is_empty() {
        out.push(("support_of_recordings_per_s", serde_json::json!(report.supports)));
    }
    if let Some(eta) = report.eta {
        out.push(("mean_support_per_s", (1.0 / eta).into()));
    }
    out
}

impl Func for DampingFit {
    type Params = DampingFitParams;
    type Ports = DampingFitPorts;
    const NAME: &'static str = "DampingFit";
    const VERSION: u32 = 3;

    fn check(p: &DampingFitParams, s: &mut Shape<'_, '_, DampingFitPorts>) -> Result<(), Reject> {
        s.check(family(p));
        let files = p.prior.iter().map(|path| s.bytes("prior", &path.0).map(|bytes| bytes.to_vec()));
        let files = files.collect::<Result<Vec<_>, _>>()?;
        s.check(prior(p, &files));
        if p.hi.is_some_and(|hi| hi <= p.lo) {
            let message = format!("`hi` is {} 1/s, `lo` {} 1/s", p.hi.unwrap_or(0.0), p.lo);
            s.wrong(Reject::new("F136", message).at("hi").help("it must be more"));
        }
        Ok(())
    }

    fn eval(p: &DampingFitParams, cx: &Build<'_>, mut io: DampingFitIo<'_>) -> Result<Summary, Fault> {
        let seed = u64::from(cx.random.words(0, 0, 0)[0]);
        let files = p.prior.iter().map(|path| cx.bytes("prior", &path.0).map(|bytes| bytes.to_vec()));
        let prior = prior(p, &files.collect::<Result<Vec<_>, _>>()?)?;
        let settings = Settings { prior, ..p.settings(io.points.truncated_below, seed)? };
        let points = match p.group {
            SupportGroup::Support if p.estimator == Estimator::Hierarchical => io.points.by_support(),
            _ => io.points.points.clone(),
        };
        let report =
            estimate(&points, &settings).map_err(|e| Fault::new("F136", e.to_string()).at("points"))?;
        let finite =
            report.model.parameters().iter().chain([&report.sigma, &report.log_lik]).all(|x| x.is_finite());
        if !finite {
            return Err(Fault::new("F136", "the fit did not converge to finite parameters").at("points"));
        }
        let uncertainty = report.ci.iter().filter(|i| i.low.is_finite() && i.high.is_finite());
        let material = Material {
            elastic: io.base.and_then(|base| base.elastic.clone()),
            uncertainty: uncertainty
                .map(|i| Uncertainty { parameter: i.name.clone(), low: i.low, high: i.high })
                .collect(),
            fit: Some(FitOrigin {
                estimator: report.estimator.clone(),
                points: report.n as u32,
                recordings: report.n_recordings as u32,
                noise: report.sigma,
                support: report.eta.map_or(0.0, |eta| 1.0 / eta),
            }),
            source: p.source.0.clone(),
            licence: p.licence.0.clone(),
            ..Material::new(p.name.0.clone(), report.model.clone())
        };
        let mut summary = summary(&report);
        summary.extend(report.warnings.iter().take(MAX_WARNINGS).map(|w| ("warning", w.to_string().into())));
        if io.points.truncated_below.is_some() && settings.mixture.fit.truncated_below.is_none() {
            summary.push(("warning", UNTRUNCATED.into()));
        }
        io.material.set(material);
        io.report.set(report);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (DampingFitParams, MemoryFiles) {
        let p = DampingFitParams {
            order: 4 + rng.below(2),
            draws: rng.below(4),
            tests: rng.below(4),
            compare: rng.below(4) == 0,
            method: Method::Scan,
            thorough: false,
            shape: 1.0,
            lo: rng.between(0.01, 0.5),
            hi: None,
            pi_max: rng.between(0.2, 0.6),
            prior: Vec::new(),
            ..DampingFitParams::trial(rng)
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Datum;
    use crate::core::standalone::Standalone;
    use crate::material::damping::DampingModel;
    use crate::material::points::damping_points::read_points;

    fn shipped() -> DampingPoints {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/assets/material/golden.points.csv");
        read_points(&std::fs::read(path).unwrap()).unwrap()
    }

    fn params(given: &[(&str, Datum)]) -> DampingFitParams {
        let quick = [("draws", Datum::Int(4)), ("tests", Datum::Int(0)), ("compare", Datum::Bool(false))];
        let find = |name: &str| given.iter().chain(&quick).find(|(n, _)| *n == name).map(|(_, d)| d.clone());
        DampingFitParams::read(&find).unwrap()
    }

    #[test]
    fn the_shipped_points_give_the_known_estimates() {
        let paper =
            [("estimator", Datum::Name("Likelihood".into())), ("preset", Datum::Name("Paper".into()))];
        let standalone =
            Standalone::func::<DampingFit>(params(&paper)).value(DampingFitPorts::points, shipped());
        let run = standalone.run().unwrap();
        let material = run.value(0).unwrap().get::<Material>().cloned().unwrap();
        let DampingModel::Rayleigh { a1, a2 } = material.damping else { panic!("{material:?}") };
        assert!(
            (a1 / 3.761_058_300 - 1.0).abs() < 1e-7 && (a2 / 1.003_043_334e-8 - 1.0).abs() < 1e-7,
            "{a1} {a2}"
        );
        let report = run.value(1).unwrap().get::<FitReport>().cloned().unwrap();
        assert!(report.certified && report.n == 200);
    }

    #[test]
    fn a_prior_of_materials_moves_a_fit_of_few_points() {
        let names = ["porcelain", "stone", "wood", "steel"];
        let list = names.map(|name| Datum::Text(format!("{name}.material.ron"))).to_vec();
        let run = |prior: Vec<Datum>, few: usize| {
            let p = params(&[("prior", Datum::List(prior)), ("estimator", Datum::Name("Likelihood".into()))]);
            let points =
                DampingPoints { points: shipped().points[..few].to_vec(), ..DampingPoints::default() };
            let mut standalone = Standalone::func::<DampingFit>(p).value(DampingFitPorts::points, points);
            for (name, (a1, a2)) in
                names.iter().zip([(4.0, 1e-8), (1.5, 2.5e-8), (40.0, 1.3e-7), (2.0, 7e-8)])
            {
                let material = Material::new(*name, DampingModel::Rayleigh { a1, a2 });
                let text = crate::material::library::write_material(&material, &[]);
                standalone.files.insert(format!("{name}.material.ron"), text);
            }
            standalone.run().map(|run| run.value(0).unwrap().get::<Material>().cloned().unwrap())
        };
        let a = |m: Material| m.damping.parameters();
        let change = |few: usize| {
            let (with, without) = (a(run(list.clone(), few).unwrap()), a(run(Vec::new(), few).unwrap()));
            (0..2).map(|j| (with[j] / without[j]).ln().abs()).fold(0.0, f64::max)
        };
        let (few, many) = (change(8), change(200));
        assert!(few > 5.0 * many && many < 0.1, "{few} {many}");
        let found = run(list.clone(), 200).unwrap();
        assert_eq!(found.fit.unwrap().estimator, "Likelihood with a prior of 4 materials");
        let fault = run(list[..2].to_vec(), 200).err().unwrap();
        assert!(
            fault.code == "F136" && fault.message.contains("2 materials; a prior of 2 parameters"),
            "{fault:?}"
        );
    }

    #[test]
    fn bad_inputs_are_named() {
        let few = DampingPoints { points: shipped().points[..3].to_vec(), ..DampingPoints::default() };
        let fault = Standalone::func::<DampingFit>(params(&[]))
            .value(DampingFitPorts::points, few)
            .run()
            .err()
            .unwrap();
        assert!(
            fault.code == "F136"
                && fault.message.contains("3 points; a fit of 2 parameters needs at least 4"),
            "{fault}"
        );
        let p = params(&[("model", Datum::Name("Spline".into())), ("order", Datum::Int(3))]);
        let standalone = Standalone::func::<DampingFit>(p).value(DampingFitPorts::points, shipped());
        assert_eq!(standalone.shape().unwrap_err().code, "F136");
        let p = params(&[("lo", Datum::Float(10.0))]);
        let fault =
            Standalone::func::<DampingFit>(p).value(DampingFitPorts::points, shipped()).run().err().unwrap();
        assert!(fault.message.contains("background of the mixture covers 10 to"), "{fault}");
    }
}
