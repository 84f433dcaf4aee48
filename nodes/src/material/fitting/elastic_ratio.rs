//! The stiffness of an object of known shape, from the frequencies of its recordings, as a node.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Data;
use crate::core::node::{Func, Summary};
use crate::core::ports::{Many, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::material::estimation::elastic_ratio::{MatchedMode, elastic_ratio};
use crate::modal::{FeatureSets, Modes};
use crate::plot::{Chart, Line, beside};
use crate::solid::ModalModel;
use crate::table::ResultTable;
use crate::{params, ports};
use serde::{Deserialize, Serialize};

/// Minimum score of the second best scale, relative to the best one, at which the ratio is ambiguous.
const AMBIGUOUS: f64 = 0.8;
/// Share of the frequencies that have to match.
const LEAST_SCORE: f64 = 0.5;

params! {
    /// The ratio of Young's modulus to density of an object of known shape, from the frequencies of its recordings.
    ///
    /// Frequencies of a shape scale with `sqrt(E/rho)`, so the scale at which most measured ones have a computed partner gives `E/rho`.
    /// Their sound does not determine `E` and `rho` themselves. Each link of `models` is the same shape; models of several Poisson's ratios
    /// are compared, and the best one wins. `second_peak` near 1 means that another ratio fits as well. The ratio of the models may be
    /// wrong by a factor of up to 11.
    ///
    /// # Source
    /// Beaton and Tukey, "The fitting of power series, meaning polynomials, illustrated on band-spectroscopic data" (Technometrics 16,
    /// 1974), for the biweight.
    pub struct ElasticRatioParams {
        /// Largest frequency that is used.
        highest: f64 = 20_000.0, unit "Hz", range 20.0..=1_000_000.0;
    }
}
ports! {
    pub struct ElasticRatioPorts / ElasticRatioIo {
        in {
            /// Modes of recordings of the object.
            features: Many<Value<FeatureSets>>,
            /// Modes of the object without uncertainties.
            modes: Many<Value<Modes>>,
            /// Modes of its shape, of one or several Poisson's ratios.
            models: Many<Value<ModalModel>>,
        }
        out {
            /// The ratio, its certainty, and the matched modes.
            report: Value<ElasticRatioReport>,
            /// The matched modes.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`elastic_ratio`].
#[derive(Debug)]
pub struct ElasticRatio;

/// A measured mode beside the computed one that it matches.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatchedFrequencies {
    /// Measured frequency, Hz.
    pub measured_hz: f64,
    /// Frequency of the shape at the ratio found, Hz.
    pub computed_hz: f64,
    /// Index of the mode of the shape, from 0.
    pub mode: usize,
}

/// Result of an [`ElasticRatio`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ElasticRatioReport {
    /// `E/rho`, m^2/s^2.
    pub ratio: f64,
    /// `E/rho` relative to that of the models.
    pub factor: f64,
    /// Poisson's ratio of the model that matches best.
    pub poisson: f64,
    /// Share of the measured frequencies that match, 0 to 1.
    pub score: f64,
    /// Score of the best other scale relative to this one.
    pub second_peak: f64,
    /// Measured frequencies, Hz.
    pub measured_hz: Vec<f64>,
    /// Frequencies of the shape at the ratio found, Hz.
    pub computed_hz: Vec<f64>,
    /// Matched modes.
    pub pairs: Vec<MatchedFrequencies>,
}

impl Data for ElasticRatioReport {
    const NAME: &'static str = "elastic ratio";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let computed: Vec<f64> = (1..8).map(|k| 400.0 * f64::from(k * k)).collect();
        let measured: Vec<f64> = computed.iter().map(|f| f * rng.between(0.99, 1.01)).collect();
        report(&measured, &[(0.3, 2.5e7, computed)]).unwrap_or_default()
    }

    fn plot(&self) -> Option<String> {
        Some(beside(&self.charts().map(|chart| chart.draw())))
    }
}

impl ElasticRatioReport {
    fn charts(&self) -> [Chart; 2] {
        let line = |y: f64, f: &[f64]| f.iter().map(|f| [*f, y]).collect::<Vec<_>>();
        let spectra = Chart::of(
            format!("E/rho = {:.4e} m^2/s^2, {} modes match", self.ratio, self.pairs.len()),
            ("frequency, Hz", true),
            ("computed 0, measured 1", false),
            vec![
                Line::dots("computed", line(0.0, &self.computed_hz)),
                Line::dots("measured", line(1.0, &self.measured_hz)),
            ],
        );
        let difference =
            |p: &MatchedFrequencies| [p.measured_hz, 100.0 * (p.measured_hz / p.computed_hz - 1.0)];
        let pairs = Line::dots("pairs", self.pairs.iter().map(difference).collect());
        let axes = (("frequency, Hz", true), ("measured - computed, %", false));
        [spectra, Chart::of("Matched modes", axes.0, axes.1, vec![pairs])]
    }

    /// The matched modes as a table.
    #[must_use]
    pub fn table(&self) -> ResultTable {
        let mut table = ResultTable::new(&["measured_hz", "computed_hz", "mode", "difference_percent"]);
        for p in &self.pairs {
            let difference = 100.0 * (p.measured_hz / p.computed_hz - 1.0);
            table.push([p.measured_hz.into(), p.computed_hz.into(), p.mode.into(), difference.into()]);
        }
        table.charts = self.charts().to_vec();
        table
    }
}

/// Matches measured frequencies in Hz with those of models: Poisson's ratio, `E/rho` in m^2/s^2, and frequencies in Hz.
///
/// `None` without frequencies.
#[must_use]
pub fn report(measured: &[f64], models: &[(f64, f64, Vec<f64>)]) -> Option<ElasticRatioReport> {
    let weighted: Vec<[f64; 2]> = measured.iter().map(|f| [*f, 1.0]).collect();
    // To one reference ratio, so that models of different ratios can be compared; each is named by its index, as Poisson's ratios may be
    // equal.
    let reference = models.first()?.1;
    let scaled: Vec<(f64, Vec<f64>)> = (models.iter().enumerate())
        .map(|(k, (_, ratio, f))| (k as f64, f.iter().map(|f| f * (reference / ratio).sqrt()).collect()))
        .collect();
    let found = elastic_ratio(&weighted, &scaled)?;
    let best = found.poisson as usize;
    let computed: Vec<f64> = scaled.get(best)?.1.iter().map(|f| f * found.factor.sqrt()).collect();
    let pair = |p: &MatchedMode| MatchedFrequencies {
        measured_hz: measured[p.measured],
        computed_hz: computed[p.computed],
        mode: p.computed,
    };
    Some(ElasticRatioReport {
        ratio: found.factor * reference,
        factor: found.factor,
        poisson: models[best].0,
        score: found.score,
        second_peak: found.second,
        measured_hz: measured.to_vec(),
        pairs: found.pairs.iter().map(pair).collect(),
        computed_hz: computed,
    })
}

impl Func for ElasticRatio {
    type Params = ElasticRatioParams;
    type Ports = ElasticRatioPorts;
    const NAME: &'static str = "ElasticRatio";

    fn check(_: &ElasticRatioParams, s: &mut Shape<'_, '_, ElasticRatioPorts>) -> Result<(), Reject> {
        if !s.linked(ElasticRatioPorts::features) && !s.linked(ElasticRatioPorts::modes) {
            let reject = Reject::new("F078", "there are no measured modes").at("features");
            s.wrong(reject.help("link `features` of a ModalFeatures, or modes"));
        }
        if !s.linked(ElasticRatioPorts::models) {
            let reject = Reject::new("F078", "there is no shape").at("models");
            s.wrong(reject.help("link `model` of a ModalAnalysis"));
        }
        Ok(())
    }

    fn eval(p: &ElasticRatioParams, _: &Build<'_>, mut io: ElasticRatioIo<'_>) -> Result<Summary, Fault> {
        let features = io.features.iter().flat_map(|all| &all.sets).flat_map(|set| &set.features);
        let modes = io.modes.iter().flat_map(|m| m.frequencies.iter().copied());
        let measured: Vec<f64> = (features.map(|f| f.freq_hz).chain(modes))
            .filter(|f| f.is_finite() && *f > 0.0 && *f <= p.highest)
            .collect();
        let model =
            |m: &ModalModel| (m.material.poisson, m.material.young / m.material.density, m.frequencies());
        let models: Vec<(f64, f64, Vec<f64>)> = io.models.iter().map(model).collect();
        let Some(report) = report(&measured, &models) else {
            let message = format!("there are {} measured modes below {} Hz", measured.len(), p.highest);
            return Err(Reject::new("F078", message).at("features").help("a higher `highest`").into());
        };
        let mut summary = vec![
            ("elastic_ratio_m2_per_s2", report.ratio.into()),
            ("relative_to_the_model", report.factor.into()),
            ("poisson", report.poisson.into()),
            ("score", report.score.into()),
            ("second_peak", report.second_peak.into()),
            ("pairs", format!("{} of {}", report.pairs.len(), report.measured_hz.len()).into()),
        ];
        if report.second_peak > AMBIGUOUS {
            summary.push(("warning", "another ratio fits nearly as well: more modes are needed".into()));
        }
        if report.score < LEAST_SCORE {
            summary.push(("warning", "most modes have no partner: is it this shape?".into()));
        }
        io.table.set(report.table());
        io.report.set(report);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (ElasticRatioParams, MemoryFiles) {
        (ElasticRatioParams { highest: rng.between(20_000.0, 50_000.0) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_is_that_of_the_frequencies_whatever_the_models_had() {
        let shape: Vec<f64> = (2..20).map(|k| 37.0 * f64::from(k).powf(1.7)).collect();
        let measured: Vec<f64> = shape.iter().map(|f| f * 1.25).collect();
        let other: Vec<f64> = shape.iter().enumerate().map(|(k, f)| f * (1.0 + 0.01 * k as f64)).collect();
        // The right shape was computed at a quarter of the ratio: half of the frequencies.
        let halved: Vec<f64> = shape.iter().map(|f| 0.5 * f).collect();
        let found = report(&measured, &[(0.2, 4e6, other), (0.3, 1e6, halved)]).unwrap();
        assert!((found.ratio / (4e6 * 1.25 * 1.25) - 1.0).abs() < 1e-6 && found.poisson == 0.3, "{found:?}");
        assert_eq!(found.pairs.len(), measured.len());
        assert!(found.pairs.iter().all(|p| (p.measured_hz / p.computed_hz - 1.0).abs() < 1e-6));
        assert!(report(&[], &[(0.3, 1e6, vec![100.0])]).is_none());
        let few = report(&measured, &[(0.3, 1e6, vec![100.0]), (0.3, 1e6, shape)]).unwrap();
        assert_eq!(few.pairs.len(), measured.len(), "models of one Poisson's ratio are told apart");
    }
}
