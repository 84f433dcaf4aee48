//! Modes one after the other: the loudest peak of spectrograms is fitted by a damped sine and subtracted.

use super::dictionary::Problem;
use super::exponentials::{C, add, energy, exp, products};
use super::noise_floor::NoiseFloor;
use super::peak_fit::{Fit, FitDomain, OVER_NOISE, fit, start};
use super::refinement::{Limits, Sines, without};
use super::spectrograms::{Level, Spectrograms};
use std::f64::consts::TAU;

/// Time after the onset that is left out, s: the transient of the contact.
const SKIP: f64 = 0.005;
/// Time from there on in which peaks are searched, s.
const SEARCHED: f64 = 0.2;
/// Rejected candidates in a row that end the search. With few, the search ends beside the first modes that interfere: with 5 and a
/// residual of 0.25, as for modes that stand alone, half of 114 recordings of impacts have no mode.
const MAX_REJECTS: usize = 60;
/// Number of modes after which the amplitudes of all are fitted again.
const REFIT: usize = 10;
/// Largest relative residual of a fit: the residual may be other modes.
const MAX_RESIDUAL: f64 = 0.5;
/// Smallest decay over the fitted frames, nepers: 3 dB.
const LEAST_DECAY: f64 = 0.345;
/// Largest decay within a window, nepers.
const MAX_IN_WINDOW: f64 = 8.0;
/// Ratio of decay rates below which two modes of nearly one frequency are the same.
const SIMILAR: f64 = 2.0;

/// Parameters of the search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Request<'a> {
    /// Maximum number of modes.
    pub(super) modes: usize,
    /// Share of the energy above the noise at which the search ends.
    pub(super) target: f64,
    /// Domain of the fit.
    pub(super) domain: FitDomain,
    /// Known exponents: modes are searched in the residual of these.
    pub(super) known: &'a [C],
}

/// Exponents of the modes of a recording that begins with the onset, without the known ones: until all explain `target` of the energy
/// above the noise.
///
/// Each candidate is the bin that stands out most over the noise in Hann spectrograms of five lengths, in the 200 ms from 5 ms after the
/// onset on. Two frames of a damped sine differ by a factor, which is the first estimate. It is refined by the closed form of the
/// windowed sine in seven bins, with the frames that stand above the noise, by Levenberg and Marquardt's method with the amplitude
/// eliminated; of the resolutions the one with the smallest residual counts. The sine is subtracted from the sound, with the phase that
/// explains the most.
///
/// # Complexity
/// O(modes (frames bins + samples)).
///
/// # Source
/// Sterling et al. (IEEE TVCG 25(5), 2019), section 4.1, after Ren, Yeh and Lin, "Example-guided physically based modal sound synthesis"
/// (ACM TOG 32(1), 2013). Both subtract powers; here the sine is subtracted with its phase, since modes interfere.
pub(super) fn greedy(
    x: &[f64],
    rate: f64,
    limits: &Limits,
    request: &Request<'_>,
    noise: &NoiseFloor,
) -> Vec<C> {
    let first = ((SKIP * rate) as usize).min(x.len() / 16);
    let mut spectrograms = Spectrograms::new(x, first, rate, noise);
    let mut residual = x.to_vec();
    if !request.known.is_empty() {
        residual = without_all(x, request.known);
        spectrograms.transform(&residual);
    }
    // What noise explains needs no mode.
    let total = energy(&x[first..]);
    let enough = ((1.0 - request.target) * total).max(noise.power() * (x.len() - first) as f64);
    let largest = 4.0 * x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut found = request.known.to_vec();
    let most = found.len() + request.modes;
    let mut rejects = 0;
    while found.len() < most && rejects < MAX_REJECTS && energy(&residual[first..]) > enough {
        let Some((level, bin)) = candidate(&spectrograms, rate, limits) else { break };
        let fit = best_fit(&spectrograms, level, bin, request.domain)
            .filter(|fit| accepted(fit, rate, limits, &found))
            .map(|fit| (fit.s, fit.a * exp(-fit.s * first as f64)))
            .filter(|(_, a)| a.norm() <= largest);
        let Some((s, a)) = fit else {
            rejects += 1;
            spectrograms.mask(level, bin);
            continue;
        };
        rejects = 0;
        found.push(s);
        if found.len().is_multiple_of(REFIT) {
            residual = without_all(x, &found);
            spectrograms.transform(&residual);
            // What was rejected beside a mode may stand alone now.
            spectrograms.unmask();
        } else {
            add(&mut residual, &[s], &[-a]);
            spectrograms.subtract(s, a);
        }
    }
    found.split_off(request.known.len())
}

/// The sound without the modes, with the amplitudes that explain the most.
fn without_all(x: &[f64], exponents: &[C]) -> Vec<f64> {
    let problem = Problem { count: x.len(), after: 0, ridge: 1e-9 * energy(x) };
    match problem.amplitudes(exponents, &products(x, exponents)) {
        Some((amplitudes, _)) => without(x, &Sines { exponents: exponents.to_vec(), amplitudes }),
        None => x.to_vec(),
    }
}

/// Level and bin of the peak that stands out most over the noise.
fn candidate(spectrograms: &Spectrograms, rate: f64, limits: &Limits) -> Option<(usize, usize)> {
    let mut best = (OVER_NOISE, None);
    for (index, level) in spectrograms.levels.iter().enumerate() {
        let frames = ((SEARCHED * rate) as usize / level.hop + 1).min(level.frames);
        let [low, high] = limits.band.map(|f| level.bin(TAU * f / rate));
        for t in 0..frames {
            for bin in low..=high {
                let power = level.at(t, bin).norm_sqr();
                let score = power / level.noise[bin];
                let is_peak =
                    || power >= level.at(t, bin - 1).norm_sqr() && power >= level.at(t, bin + 1).norm_sqr();
                if score > best.0 && !level.masked[bin] && is_peak() {
                    best = (score, Some((index, bin)));
                }
            }
        }
    }
    best.1
}

/// The fit with the smallest residual over the resolutions, each from the largest peak within a bin of the candidate.
fn best_fit(spectrograms: &Spectrograms, level: usize, bin: usize, domain: FitDomain) -> Option<Fit> {
    let window = spectrograms.levels[level].window;
    let of_level = |level: &Level| {
        let centre = level.bin(TAU * bin as f64 / window as f64);
        let reach = level.window.div_ceil(window);
        let power = |bin: &usize| (0..level.frames.min(2)).map(|t| level.at(t, *bin).norm_sqr()).sum::<f64>();
        let near = centre.saturating_sub(reach).max(1)..(centre + reach + 1).min(level.bins() - 1);
        let peak = near.max_by(|a, b| power(a).total_cmp(&power(b)))?;
        start(level, peak)
            .filter(|s| -s.re * level.window as f64 <= MAX_IN_WINDOW)
            .and_then(|s| fit(level, s, domain))
    };
    let fits = spectrograms.levels.iter().filter_map(of_level);
    fits.min_by(|a, b| a.residual.total_cmp(&b.residual))
}

/// Returns true if a fit is a mode that was not found before.
fn accepted(fit: &Fit, rate: f64, limits: &Limits, found: &[C]) -> bool {
    let (d, f) = (-fit.s.re * rate, fit.s.im * rate / TAU);
    let [slowest, fastest] = limits.decays;
    let [low, high] = limits.band;
    let near = |other: &C| {
        let similar = (other.re / fit.s.re).max(fit.s.re / other.re) < SIMILAR;
        similar && (other.im - fit.s.im).abs() < 0.5 * TAU / fit.duration.max(1.0)
    };
    fit.residual <= MAX_RESIDUAL
        && -fit.s.re * fit.duration >= LEAST_DECAY
        && (slowest..=fastest).contains(&d)
        && (low..=high).contains(&f)
        && !found.iter().any(near)
}
