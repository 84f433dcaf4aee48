//! Modes from a recording of one impact.

use super::dictionary::Problem;
use super::exponentials::{C, energy, products};
use super::feature::{Feature, MAX_DECAY};
use super::greedy::{Request, greedy};
use super::noise_bands::noise_bands;
use super::noise_floor::NoiseFloor;
use super::onset::onset;
use super::peak_fit::FitDomain;
use super::refinement::{Limits, Sines, refine, unit_deviations, without};
use super::subband::candidates;
use crate::modal::mode::modes::{MODES_VERSION, Modes};
use crate::modal::residual::noise_band::NoiseBand;
use std::f64::consts::{FRAC_PI_2, TAU};
use thiserror::Error;

/// Method that finds the modes of a recording. All but those by powers are refined jointly afterwards, with the same amplitudes and
/// deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extractor {
    /// ESPRIT in bands, and selection by the energy that modes explain beside each other: for modes that are close or decay fast.
    Subband,
    /// Peaks of spectrograms, one after the other, until they explain a share `target` of the energy above the noise: for modes that stand
    /// alone, as in the paper.
    Greedy {
        /// Share of the energy.
        target: f64,
        /// Domain of the fit. The modes that are fitted to powers are not refined, and their deviations are those of a complex fit, which has
        /// smaller errors.
        domain: FitDomain,
    },
    /// `Subband`, then `Greedy` in the residual of its modes, and the selection among all where it explains more.
    Hybrid {
        /// Share of the energy above the noise.
        target: f64,
    },
}

/// Limits of the search for modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtractParams {
    /// Method of the search.
    pub extractor: Extractor,
    /// Maximum number of modes.
    pub modes: usize,
    /// Lowest frequency, in Hz.
    pub lowest: f64,
    /// Highest frequency, in Hz; at most 0.45 of the rate.
    pub highest: f64,
    /// True to return the parts of the contact too: those that decay faster than 500 1/s or whose decay is uncertain. They explain the onset of
    /// the recording, but a force that lasts must not excite them. Without them, the residual contains them.
    pub contact: bool,
}

impl Default for ExtractParams {
    fn default() -> Self {
        Self { extractor: Extractor::Subband, modes: 64, lowest: 20.0, highest: 20_000.0, contact: false }
    }
}

/// Error of [`extract`].
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ExtractError {
    /// A sample that is not a number.
    #[error("sample {index} is not finite")]
    NotFinite {
        /// Its index.
        index: usize,
    },
    /// All samples are 0.
    #[error("the recording is silent")]
    Silent,
    /// Too few samples after the impact.
    #[error("{found} samples follow the impact; at least {MIN_SAMPLES} are needed")]
    Short {
        /// Samples found.
        found: usize,
    },
    /// No decaying sine was found.
    #[error("nothing in the recording rings and decays")]
    Nothing,
    /// All that was found belongs to the contact.
    #[error(
        "none of {parts} decaying sines decays slower than {MAX_DECAY} 1/s with a certain rate: the object does not ring; `contact: true` returns them"
    )]
    OnlyContact {
        /// Number of decaying sines.
        parts: usize,
    },
}

impl ExtractError {
    /// Advice on how to correct the error.
    #[must_use]
    pub fn help(&self) -> &'static str {
        match self {
            Self::NotFinite { .. } => "export the recording again, or cut the part with the damage",
            Self::Silent => "record again: check the microphone and its gain",
            Self::Short { .. } => "leave 2 s of sound after each impact",
            Self::Nothing => {
                "strike an object that rings, alone in the recording, and hold it such that it can; or widen `lowest` to `highest`"
            }
            Self::OnlyContact { .. } => "hold the object such that it can ring",
        }
    }
}

/// Minimum number of samples after the impact.
const MIN_SAMPLES: usize = 1024;
/// Range of the decay rates of modes, 1/s.
const DECAYS: [f64; 2] = [0.1, 8000.0];
/// Least decay of a mode over the recording, in nepers: 3 dB.
const LEAST_DECAY: f64 = 0.35;
/// Part of the energy after which the sound is cut for the search.
const ENERGY: f64 = 0.9999;
/// Maximum duration of the sound in the search, s.
const LONGEST: f64 = 2.0;
/// Maximum duration over which amplitudes are fitted, s.
const LONGEST_AMPLITUDES: f64 = 10.0;
/// Candidates selected per mode, before the weakest are removed.
const SURPLUS: f64 = 1.5;
/// Part of the energy that a mode must explain.
const SMALLEST: f64 = 1e-8;
/// Maximum amplitude of a mode relative to the peak of the recording: larger ones cancel each other.
const MAX_AMPLITUDE: f64 = 4.0;
/// Part of the energy that the penalty of a mode at [`MAX_AMPLITUDE`] amounts to, for each attempt.
const PENALTIES: [f64; 4] = [1e-9, 1e-3, 1e-2, 1e-1];
/// The same for the final amplitudes.
const AMPLITUDE_PENALTIES: [f64; 2] = [1e-9, 1e-2];
/// Relative standard deviation of the decay rate at which a mode is uncertain.
const UNCERTAINTY: f64 = 0.3;
/// Distances from a mode at which the noise around it is measured, in half-power half-widths.
const NEIGHBOURS: [f64; 6] = [-12.0, -9.0, -6.0, 6.0, 9.0, 12.0];
/// Time after the recording in which modes should be silent, in its lengths.
const AFTER: usize = 2;
/// Start of the late residual after the onset, s.
const LATE: f64 = 0.005;

/// The modes of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Extracted {
    /// The modes, in order of frequency.
    pub features: Vec<Feature>,
    /// Index of the first sample of the impact.
    pub onset: usize,
    /// The recording without the modes, from the onset on.
    pub residual: Vec<f64>,
    /// Energy of the residual from the onset to the end, in dB relative to the recording.
    pub residual_db: f64,
    /// The same from 5 ms after the onset on.
    pub late_residual_db: f64,
    /// Bands of noise in place of the residual; their gains are full scale.
    pub noise: Vec<NoiseBand>,
}

impl Extracted {
    /// Converts to modes with one contact point, so that an impact of `impulse` N s sounds like the recording.
    #[must_use]
    pub fn modes(&self, name: &str, impulse: f64, phases: bool) -> Modes {
        let all = &self.features;
        // Modes are sines, features cosines.
        let phase = |f: &Feature| (f.phase + FRAC_PI_2) as f32;
        Modes {
            version: MODES_VERSION,
            name: name.to_owned(),
            frequencies: all.iter().map(|f| f.freq_hz).collect(),
            dampings: all.iter().map(|f| f.decay).collect(),
            gains: all.iter().map(|f| (f.amp / impulse) as f32).collect(),
            phases: if phases { all.iter().map(phase).collect() } else { Vec::new() },
            noise: self
                .noise
                .iter()
                .map(|b| NoiseBand { gain: (f64::from(b.gain) / impulse) as f32, ..*b })
                .collect(),
        }
    }
}

/// Extracts the modes from a recording of one impact.
///
/// Candidates are the poles that subband ESPRIT finds. Those that explain the most beside each other are selected, one after the other,
/// and the least ones removed until `modes` are left, or until each explains more than noise would: by the Bayesian information
/// criterion with four parameters a mode and the noise before the impact or at the end. Then all are refined jointly.
///
/// No amplitude is above four times the peak of the recording: a small penalty of squared amplitudes prevents close modes from cancelling
/// each other. The standard deviations hold for noise of the density that the residual has around each mode while it rings.
///
/// # Errors
/// A recording that is silent, too short, not finite, or without a decaying sine.
///
/// # Complexity
/// O(samples modes) per step of the refinement, of at most 2 s of sound.
///
/// # Source
/// Sirdey et al. (DAFx 2011) for ESPRIT in bands; Sterling et al. (IEEE TVCG 25(5), 2019), section 4.1, for the definition of a feature.
pub fn extract(samples: &[f32], rate: f64, params: &ExtractParams) -> Result<Extracted, ExtractError> {
    if let Some(index) = samples.iter().position(|x| !x.is_finite()) {
        return Err(ExtractError::NotFinite { index });
    }
    if samples.iter().all(|x| *x == 0.0) {
        return Err(ExtractError::Silent);
    }
    let onset = onset(samples, rate);
    let sound: Vec<f64> = samples[onset..].iter().map(|x| f64::from(*x)).collect();
    let sound = sound.as_slice();
    if sound.len() < MIN_SAMPLES {
        return Err(ExtractError::Short { found: sound.len() });
    }
    let noise = NoiseFloor::new(samples, onset, rate);
    let band = [params.lowest, params.highest.min(0.45 * rate)];
    let short = &sound[..searched(sound, rate)];
    let slowest = (LEAST_DECAY * rate / sound.len() as f64).max(DECAYS[0]);
    let limits = Limits { band, decays: [slowest, DECAYS[1]] };
    // Of several results of a search, the one that explains the most of the sound as a whole.
    let found = search(short, rate, &limits, params, &noise).into_iter().map(|exponents| {
        let sines = with_amplitudes(sound, rate, exponents);
        (without(sound, &sines), sines)
    });
    let best = found.min_by(|(a, _), (b, _)| energy(a).total_cmp(&energy(b)));
    let Some((mut residual, sines)) = best.filter(|(_, sines)| !sines.exponents.is_empty()) else {
        return Err(ExtractError::Nothing);
    };
    let mut features = features(short.len(), rate, &sines, &residual, &noise);
    if !params.contact {
        let parts = features.len();
        let certain = features.iter().zip(&sines.exponents).filter(|(f, _)| f.is_certain(UNCERTAINTY));
        let (certain, exponents): (Vec<Feature>, Vec<C>) = certain.map(|(f, s)| (*f, *s)).unzip();
        // The amplitudes that explain the most without the parts of the contact.
        let sines = with_amplitudes(sound, rate, exponents.clone());
        let of = |s: &C| exponents.iter().position(|e| e == s).map(|k| certain[k]);
        features = sines.exponents.iter().filter_map(of).collect();
        if features.is_empty() {
            return Err(ExtractError::OnlyContact { parts });
        }
        for (feature, a) in features.iter_mut().zip(&sines.amplitudes) {
            (feature.amp, feature.phase) = (a.norm(), a.arg());
        }
        residual = without(sound, &sines);
    }
    let db = |from: usize| {
        let ratio = energy(&residual[from..]) / energy(&sound[from..]).max(f64::MIN_POSITIVE);
        10.0 * ratio.max(1e-30).log10()
    };
    let late = ((LATE * rate) as usize).min(sound.len() / 2);
    let (residual_db, late_residual_db) = (db(0), db(late));
    features.sort_by(|a, b| a.freq_hz.total_cmp(&b.freq_hz));
    let noise = noise_bands(sound, &residual, rate, &noise);
    Ok(Extracted { features, onset, residual, residual_db, late_residual_db, noise })
}

/// Number of samples that hold nearly all of the energy.
fn searched(sound: &[f64], rate: f64) -> usize {
    let total = energy(sound);
    let mut sum = 0.0;
    let passed = sound.iter().position(|x| {
        sum += x * x;
        sum >= ENERGY * total
    });
    (passed.unwrap_or(sound.len()) + 256).max(MIN_SAMPLES).min((LONGEST * rate) as usize).min(sound.len())
}

/// The problem with a penalty of squared amplitudes, at which a mode of the largest amplitude costs a part of the energy.
fn problem(x: &[f64], part: f64) -> Problem {
    let ridge = part * energy(x) / largest_amplitude(x).powi(2);
    Problem { count: x.len(), after: AFTER * x.len(), ridge }
}

fn largest_amplitude(x: &[f64]) -> f64 {
    MAX_AMPLITUDE * x.iter().fold(0.0_f64, |m, x| m.max(x.abs()))
}

/// Exponents of the modes, selected and refined; for `Hybrid` those of the bands, and those of both.
fn search(x: &[f64], rate: f64, limits: &Limits, params: &ExtractParams, noise: &NoiseFloor) -> Vec<Vec<C>> {
    let posed = problem(x, PENALTIES[0]);
    let total = energy(x);
    // BIC: four parameters a mode.
    let information = 4.0 * (x.len() as f64).ln();
    let thresholds = |exponents: &[C]| -> Vec<f64> {
        let least = |s: &C| (information * noise.variance(s.im * rate / TAU)).max(SMALLEST * total);
        exponents.iter().map(least).collect()
    };
    let pick = |from: &[C], chosen: Vec<usize>| chosen.into_iter().map(|i| from[i]).collect::<Vec<C>>();
    let modes = params.modes;
    let without_surplus = |exponents: Vec<C>| {
        let left = posed.backward(&exponents, &products(x, &exponents), &thresholds(&exponents), modes);
        pick(&exponents, left)
    };
    let surplus = ((modes as f64 * SURPLUS) as usize).max(modes + 4);
    let subband = || {
        let all = candidates(x, rate, limits);
        pick(&all, posed.forward(&all, &products(x, &all), &thresholds(&all), surplus))
    };
    let peaks = |request: Request<'_>| greedy(x, rate, limits, &request, noise);
    // The refinement may make some superfluous.
    let selected = |exponents: Vec<C>| without_surplus(refined(x, rate, limits, without_surplus(exponents)));
    match params.extractor {
        Extractor::Subband => vec![selected(subband())],
        Extractor::Greedy { target, domain } => {
            let found = peaks(Request { modes, target, domain, known: &[] });
            vec![match domain {
                FitDomain::Complex => selected(found),
                FitDomain::Power => without_surplus(found),
            }]
        }
        Extractor::Hybrid { target } => {
            let bands = selected(subband());
            let mut all = bands.clone();
            let modes = surplus.saturating_sub(all.len());
            all.extend(peaks(Request { modes, target, domain: FitDomain::Complex, known: &bands }));
            // A refinement of more modes may end in a worse optimum.
            vec![bands, selected(all)]
        }
    }
}

/// Refines exponents with the smallest penalty at which no amplitude exceeds the limit.
fn refined(x: &[f64], rate: f64, limits: &Limits, mut exponents: Vec<C>) -> Vec<C> {
    let limit = largest_amplitude(x);
    for part in PENALTIES {
        let Some(found) = refine(x, &problem(x, part), rate, limits, &exponents) else { break };
        exponents = found.exponents;
        if found.amplitudes.iter().all(|a| a.norm() <= limit) {
            break;
        }
    }
    exponents
}

/// Fits amplitudes to the whole sound, and removes modes until none is above the limit.
fn with_amplitudes(sound: &[f64], rate: f64, mut exponents: Vec<C>) -> Sines {
    let x = &sound[..sound.len().min((LONGEST_AMPLITUDES * rate) as usize)];
    let limit = largest_amplitude(x);
    let mut found = products(x, &exponents);
    while !exponents.is_empty() {
        let fits: Vec<Vec<C>> = AMPLITUDE_PENALTIES
            .iter()
            .filter_map(|part| problem(x, *part).amplitudes(&exponents, &found).map(|fit| fit.0))
            .collect();
        if let Some(amplitudes) = fits.iter().find(|fit| fit.iter().all(|a| a.norm() <= limit)) {
            return Sines { exponents, amplitudes: amplitudes.clone() };
        }
        // The largest amplitude goes, or the last mode if they are linearly dependent.
        let size = |k: &usize| fits.last().map_or(*k as f64, |fit| fit[*k].norm());
        let largest = (0..exponents.len()).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
        exponents.remove(largest);
        found.remove(largest);
    }
    Sines::default()
}

/// The modes with their standard deviations and relative residuals.
fn features(count: usize, rate: f64, sines: &Sines, residual: &[f64], noise: &NoiseFloor) -> Vec<Feature> {
    let problem = Problem { count, after: 0, ridge: 0.0 };
    let short = &residual[..count];
    // White noise of variance v has products of the variance v sum |exp(s n)|^2 with exponentials of any frequency.
    let around = |s: &C| {
        let width = (-s.re).max(2.0 / count as f64);
        NEIGHBOURS.map(|k| C::new(s.re, (s.im + k * width).abs()))
    };
    let neighbours: Vec<C> = sines.exponents.iter().flat_map(around).collect();
    let products = products(short, &neighbours);
    let deviations = unit_deviations(sines, &problem);
    let each = sines.exponents.iter().zip(&sines.amplitudes).zip(products.chunks_exact(NEIGHBOURS.len()));
    each.enumerate()
        .map(|(k, ((s, a), products))| {
            let decays = -libm::expm1(2.0 * s.re * count as f64) / -libm::expm1(2.0 * s.re);
            let mean = products.iter().map(|p| p.norm_sqr()).sum::<f64>() / products.len() as f64;
            let frequency = s.im * rate / TAU;
            let variance = (mean / decays).max(noise.variance(frequency));
            let own = 0.5 * a.norm_sqr() * decays;
            let deviation =
                |i: usize| deviations.as_ref().map_or(0.0, |all| all[k][i]) * variance.sqrt() * rate;
            Feature {
                freq_hz: frequency,
                amp: a.norm(),
                decay: -s.re * rate,
                phase: a.arg(),
                sd_freq: deviation(0) / TAU,
                sd_decay: deviation(1),
                level: 0,
                quality: (2.0 * variance / own.max(f64::MIN_POSITIVE)).min(1e6) as f32,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests;
