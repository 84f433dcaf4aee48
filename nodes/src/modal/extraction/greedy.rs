//! Modes one after the other: the loudest peak of spectrograms is fitted by a damped sine and subtracted.

use super::dictionary::Problem;
use super::exponentials::{C, add, energy, exp, products};
use super::extract::without;
use super::noise_floor::NoiseFloor;
use super::refinement::{Limits, Sines};
use super::spectrograms::{Level, NEAR, Spectrograms};
use std::f64::consts::TAU;

/// Time after the onset that is left out, s: the transient of the contact.
const SKIP: f64 = 0.005;
/// Time from there on in which peaks are searched, s.
const SEARCHED: f64 = 0.2;
/// Power of a peak relative to the noise, and of the frames in which it is fitted.
const OVER_NOISE: f64 = 10.0;
/// Rejected candidates in a row that end the search. With few, the search ends beside the first modes that interfere: with 5 and a
/// residual of 0.25, as for modes that stand alone, half of 114 recordings of impacts have no mode.
const MAX_REJECTS: usize = 60;
/// Number of modes after which the amplitudes of all are fitted again.
const REFIT: usize = 10;
/// Largest relative residual of a fit: what it leaves may be other modes.
const MAX_RESIDUAL: f64 = 0.5;
/// Smallest decay over the fitted frames, nepers: 3 dB.
const LEAST_DECAY: f64 = 0.345;
/// Largest decay within a window, nepers.
const MAX_IN_WINDOW: f64 = 8.0;
/// Steps of the fit.
const STEPS: usize = 20;
/// Ratio of decay rates below which two modes of nearly one frequency are the same.
const SIMILAR: f64 = 2.0;

/// A damped sine fitted to one peak.
#[derive(Clone, Copy, Debug)]
struct Fit {
    s: C,
    /// Amplitude at the first frame.
    a: C,
    /// Energy that it leaves unexplained, relative.
    residual: f64,
    /// Duration of the fitted frames, samples.
    duration: f64,
}

/// Exponents of the modes of a recording that begins with the onset: at most `modes`, until they explain `target` of the energy above the
/// noise.
///
/// Each candidate is the bin that stands out most over the noise in Hann spectrograms of five lengths, in the 200 ms from 5 ms after the
/// onset on. Two frames of a damped sine differ by a factor, which is the first estimate. It is refined by the closed form of the
/// windowed sine in seven bins, with the frames that stand above the noise, by Levenberg and Marquardt's method with the amplitude
/// eliminated; of the resolutions the one with the smallest residual counts. The sine is subtracted from the sound.
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
    modes: usize,
    target: f64,
    noise: &NoiseFloor,
) -> Vec<C> {
    let first = ((SKIP * rate) as usize).min(x.len() / 16);
    let mut spectrograms = Spectrograms::new(x, first, rate, noise);
    let mut residual = x.to_vec();
    // What noise explains needs no mode.
    let total = energy(&x[first..]);
    let enough = ((1.0 - target) * total).max(noise.power() * (x.len() - first) as f64);
    let largest = 4.0 * x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut found: Vec<C> = Vec::new();
    let mut rejects = 0;
    while found.len() < modes && rejects < MAX_REJECTS && energy(&residual[first..]) > enough {
        let Some((level, bin)) = candidate(&spectrograms, rate, limits) else { break };
        let fit = best_fit(&spectrograms, level, bin)
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
    found
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

/// Number of frames in a row in which a bin stands above the noise.
fn loud_frames(level: &Level, bin: usize) -> usize {
    let loud = |t: &usize| level.at(*t, bin).norm_sqr() > OVER_NOISE * level.noise[bin];
    (0..level.frames).take_while(loud).count()
}

/// The exponent of which the frames of one bin are powers.
fn start(level: &Level, bin: usize) -> Option<C> {
    let frames = loud_frames(level, bin);
    let pairs = |t: usize| (level.at(t, bin), level.at(t + 1, bin));
    let (mut product, mut power) = (C::default(), 0.0);
    for (now, next) in (0..frames.saturating_sub(1)).map(pairs) {
        product += now.conj() * next;
        power += now.norm_sqr();
    }
    if power <= 0.0 || product.norm() <= 0.0 {
        return None;
    }
    let ratio = product / power;
    let hop = level.hop as f64;
    // The angle is known but for whole turns: the frequency nearest to that of the bin.
    let centre = TAU * bin as f64 / level.window as f64;
    let turns = ((centre * hop - ratio.arg()) / TAU).round();
    let decay = (-libm::log(ratio.norm()) / hop).max(1e-7);
    Some(C::new(-decay, (ratio.arg() + TAU * turns) / hop))
}

/// The fit with the smallest residual over the resolutions, each from the largest peak within a bin of the candidate.
fn best_fit(spectrograms: &Spectrograms, level: usize, bin: usize) -> Option<Fit> {
    let window = spectrograms.levels[level].window;
    let of_level = |level: &Level| {
        let centre = level.bin(TAU * bin as f64 / window as f64);
        let reach = level.window.div_ceil(window);
        let power = |bin: &usize| (0..level.frames.min(2)).map(|t| level.at(t, *bin).norm_sqr()).sum::<f64>();
        let near = centre.saturating_sub(reach).max(1)..(centre + reach + 1).min(level.bins() - 1);
        let peak = near.max_by(|a, b| power(a).total_cmp(&power(b)))?;
        start(level, peak)
            .filter(|s| -s.re * level.window as f64 <= MAX_IN_WINDOW)
            .and_then(|s| fit(level, s))
    };
    let fits = spectrograms.levels.iter().filter_map(of_level);
    fits.min_by(|a, b| a.residual.total_cmp(&b.residual))
}

/// Products of the model and the spectra around one bin.
struct Products {
    /// Amplitude that explains the most, and the energy that it leaves.
    a: C,
    left: f64,
    /// Products of the derivatives of the model with each other and with the residual, without their part along the model.
    matrix: [[f64; 2]; 2],
    gradient: [f64; 2],
}

/// `model[t][k] = exp(s t hop) w(s, k)`; the derivatives are those by ln d and by omega.
fn products_at(level: &Level, bins: &std::ops::Range<usize>, frames: usize, s: C) -> Option<Products> {
    let shapes: Vec<[C; 2]> = bins.clone().map(|bin| level.of_exponential(s, bin)).collect();
    let step = exp(s * level.hop as f64);
    let mut factor = C::new(1.0, 0.0);
    // Products of the model m and its derivative m' by s with each other and with the spectra.
    let (mut mm, mut mp, mut pp, mut ms, mut ps, mut ss) =
        (0.0, C::default(), 0.0, C::default(), C::default(), 0.0);
    for t in 0..frames {
        let time = (t * level.hop) as f64;
        for ([w, slope], bin) in shapes.iter().zip(bins.clone()) {
            let (m, p, z) = (factor * w, factor * (slope + w * time), level.at(t, bin));
            mm += m.norm_sqr();
            mp += m.conj() * p;
            pp += p.norm_sqr();
            ms += m.conj() * z;
            ps += p.conj() * z;
            ss += z.norm_sqr();
        }
        factor *= step;
    }
    if !(mm > 0.0 && mm.is_finite()) {
        return None;
    }
    let a = ms / mm;
    // <Pp, Pp> and <Pp, z> with the projection P on the complement of the model.
    let (norm, right) = (pp - mp.norm_sqr() / mm, ps - mp.conj() * ms / mm);
    let columns = [C::new(s.re, 0.0), C::new(0.0, 1.0)].map(|c| a * c);
    let entry = |i: usize, j: usize| (columns[i].conj() * columns[j]).re * norm;
    Some(Products {
        a,
        left: ss - ms.norm_sqr() / mm,
        matrix: [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]],
        gradient: columns.map(|c| (c.conj() * right).re),
    })
}

/// Fits a damped sine to the bins around its frequency in one resolution.
fn fit(level: &Level, start: C) -> Option<Fit> {
    let centre = level.bin(start.im);
    let frames = loud_frames(level, centre);
    if frames < 3 {
        return None;
    }
    let bins = centre.saturating_sub(NEAR)..(centre + NEAR + 1).min(level.bins());
    let total: f64 = (0..frames).flat_map(|t| bins.clone().map(move |k| level.at(t, k).norm_sqr())).sum();
    let mut s = start;
    let mut now = products_at(level, &bins, frames, s)?;
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let [[a, b], [_, d]] = now.matrix;
        let (a, d) = (a * (1.0 + damping), d * (1.0 + damping));
        let det = a * d - b * b;
        if !(det > 0.0 && det.is_finite()) {
            break;
        }
        let [g, h] = now.gradient;
        let step = [(d * g - b * h) / det, (a * h - b * g) / det];
        let width = TAU / level.window as f64;
        let moved = C::new(s.re * libm::exp(step[0].clamp(-1.0, 1.0)), s.im + step[1].clamp(-width, width));
        match products_at(level, &bins, frames, moved).filter(|next| next.left < now.left) {
            Some(next) => {
                let gain = (now.left - next.left) / total.max(f64::MIN_POSITIVE);
                (s, now) = (moved, next);
                damping = (damping / 5.0_f64).max(1e-9);
                if gain < 1e-9 {
                    break;
                }
            }
            None if damping < 1e6 => damping *= 10.0,
            None => break,
        }
    }
    let duration = ((frames - 1) * level.hop) as f64;
    Some(Fit { s, a: now.a, residual: (now.left / total.max(f64::MIN_POSITIVE)).max(0.0), duration })
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
