//! Scores of candidate materials on knocks that are left out of a fit.

use crate::material::damping::{DampingModel, Family};
use crate::material::estimation::emg::Emg;
use crate::material::estimation::fit::FitOptions;
use crate::material::estimation::mixture::{MixtureOptions, fit_mixture};
use crate::material::estimation::point::DampingPoint;
use crate::material::points::gate::Gate;
use crate::modal::extraction::comparison::spectral_distance_db;
use crate::modal::extraction::poles::resynthesis;
use crate::modal::{Feature, FeatureSet};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Share of spurious features in the likelihood of a take.
const SPURIOUS: f64 = 0.05;
/// Range of their dampings, 1/s.
const BACKGROUND: [f64; 2] = [0.5, 2000.0];

/// One take of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Take {
    /// Its modes.
    pub features: FeatureSet,
    /// Its sound from the onset on.
    pub sound: Vec<f64>,
    /// Sample rate, Hz.
    pub rate: f64,
}

/// An object with its takes.
#[derive(Clone, Debug, PartialEq)]
pub struct KnockedObject {
    /// Its name.
    pub name: String,
    /// Its takes.
    pub takes: Vec<Take>,
    /// True if it is synthetic.
    pub synthetic: bool,
}

/// A material that a take may be of.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Its name.
    pub name: String,
    /// Its damping.
    pub model: DampingModel,
    /// Mean support damping of its recordings, 1/s.
    pub support: f64,
    /// Standard deviation of the noise of its dampings, 1/s.
    pub noise: f64,
}

impl Candidate {
    /// Fits the material of takes: a mixture with a Rayleigh curve, as `DampingFit` does by default.
    ///
    /// `None` if there are too few features.
    #[must_use]
    pub fn fit(name: &str, sets: &[FeatureSet]) -> Option<Self> {
        let points = Gate::default().points(sets);
        let options =
            FitOptions { truncated_below: points.truncated_below, ..FitOptions::new(Family::Rayleigh) };
        let found = fit_mixture(&points.points, &MixtureOptions::new(options)).ok()?.fit;
        Some(Self {
            name: name.to_owned(),
            model: Family::Rayleigh.model(&found.physical(), &[]),
            support: 1.0 / found.eta(),
            noise: found.sigma(),
        })
    }

    /// Decay rate `d` in 1/s of a mode of the material on its mean support: `(c + 1/eta) / 2`.
    fn decay(&self, feature: &Feature) -> f64 {
        0.5 * (self.model.c((TAU * feature.freq_hz).powi(2)) + self.support)
    }

    /// Mean log-likelihood of points, with 5 % of spurious ones.
    fn log_likelihood(&self, points: &[DampingPoint]) -> f64 {
        let [lo, hi] = BACKGROUND;
        let density = |p: &DampingPoint| {
            let sigma = libm::hypot(self.noise, p.sd_c);
            let eta = 1.0 / self.support.max(1e-3);
            let own = Emg { c: self.model.c(p.lambda), sigma, eta }.log_density(p.c);
            let spurious = 1.0 / (p.c * libm::log(hi / lo));
            libm::log((1.0 - SPURIOUS) * libm::exp(own) + SPURIOUS * spurious)
        };
        points.iter().map(density).sum::<f64>() / points.len().max(1) as f64
    }
}

/// Scores of a candidate on a take.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Name of the candidate.
    pub candidate: String,
    /// True if it was fitted to the other takes of the object.
    pub right: bool,
    /// Log-likelihood of the take's dampings, for each feature.
    pub log_likelihood: f64,
    /// Root mean square difference of thirds of an octave in the first 300 ms, dB.
    pub spectral_distance_db: f64,
}

/// A take with the scores of all candidates.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOut {
    /// Name of the object.
    pub object: String,
    /// Name of the take.
    pub take: String,
    /// True if it is synthetic.
    pub synthetic: bool,
    /// Number of its features.
    pub features: usize,
    /// Scores of the candidates, the right one first.
    pub scores: Vec<Score>,
}

impl HeldOut {
    /// Number of candidates that are better than the right one, by likelihood and by spectral distance.
    #[must_use]
    pub fn better(&self) -> [usize; 2] {
        let Some(right) = self.scores.first() else { return [0; 2] };
        let likelier = self.scores.iter().filter(|s| s.log_likelihood > right.log_likelihood).count();
        let nearer =
            self.scores.iter().filter(|s| s.spectral_distance_db < right.spectral_distance_db).count();
        [likelier, nearer]
    }
}

/// Leaves each take of each object out once.
///
/// The candidates are the material fitted to the other takes of the object, those fitted to all takes of each other object, and `given`
/// ones. The take's frequencies, amplitudes and phases are resynthesised with the decay rates of each, and compared with its sound. What
/// the take's own modes leave of its sound, as the click of the impact, is added to each resynthesis, so that the distance is that of the
/// decays alone. Takes without a fit of the others, or without features, are left out.
///
/// # Complexity
/// One mixture fit for each take and object, and one resynthesis for each take and candidate, in parallel.
#[must_use]
pub fn held_out(objects: &[KnockedObject], given: &[Candidate]) -> Vec<HeldOut> {
    let sets = |object: &KnockedObject, without: Option<usize>| -> Vec<FeatureSet> {
        let takes = object.takes.iter().enumerate().filter(|(k, _)| Some(*k) != without);
        takes.map(|(_, t)| t.features.clone()).collect()
    };
    let whole: Vec<Option<Candidate>> =
        objects.par_iter().map(|o| Candidate::fit(&o.name, &sets(o, None))).collect();
    let one = |(o, t): (usize, usize)| {
        let (object, take) = (&objects[o], &objects[o].takes[t]);
        let right = Candidate::fit(&object.name, &sets(object, Some(t)))?;
        let others = whole.iter().enumerate().filter(|(k, _)| *k != o).filter_map(|(_, c)| c.as_ref());
        let points = Gate::default().points(std::slice::from_ref(&take.features)).points;
        if points.is_empty() {
            return None;
        }
        let modes = &take.features.features;
        let own = resynthesis(modes, take.rate, take.sound.len(), |f| f.decay);
        let rest: Vec<f64> = take.sound.iter().zip(&own).map(|(x, own)| x - own).collect();
        let score = |(k, candidate): (usize, &Candidate)| {
            let decay = |f: &Feature| candidate.decay(f);
            let mut audio = resynthesis(modes, take.rate, take.sound.len(), decay);
            audio.iter_mut().zip(&rest).for_each(|(x, rest)| *x += rest);
            Score {
                candidate: candidate.name.clone(),
                right: k == 0,
                log_likelihood: candidate.log_likelihood(&points),
                spectral_distance_db: spectral_distance_db(&take.sound, &audio, take.rate),
            }
        };
        Some(HeldOut {
            object: object.name.clone(),
            take: take.features.recording.clone(),
            synthetic: object.synthetic,
            features: points.len(),
            scores: std::iter::once(&right).chain(others).chain(given).enumerate().map(score).collect(),
        })
    };
    let takes: Vec<(usize, usize)> =
        objects.iter().enumerate().flat_map(|(o, x)| (0..x.takes.len()).map(move |t| (o, t))).collect();
    takes.into_par_iter().filter_map(one).collect()
}
