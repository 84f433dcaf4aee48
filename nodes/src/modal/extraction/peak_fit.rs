//! A damped sine fitted to one peak of a spectrogram.

use super::exponentials::{C, exp};
use super::spectrograms::{Level, NEAR};
use crate::choices;
use std::f64::consts::TAU;
use std::ops::Range;

/// Power of a peak relative to the noise, and of the frames in which it is fitted.
pub(super) const OVER_NOISE: f64 = 10.0;
/// Steps of the fit.
const STEPS: usize = 20;

choices! {
    /// Domain in which a peak of a spectrogram is fitted.
    pub enum FitDomain {
        /// The complex spectra, which separate modes that interfere.
        Complex,
        /// Their squared magnitudes, without the noise, as in the paper: for comparison. Interference counts as decay.
        Power,
    }
}

/// A damped sine fitted to one peak.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub(super) s: C,
    /// Amplitude at the first frame.
    pub(super) a: C,
    /// Energy that it leaves unexplained, relative.
    pub(super) residual: f64,
    /// Duration of the fitted frames, samples.
    pub(super) duration: f64,
}

/// Number of frames in a row in which a bin stands above the noise.
fn loud_frames(level: &Level, bin: usize) -> usize {
    let loud = |t: &usize| level.at(*t, bin).norm_sqr() > OVER_NOISE * level.noise[bin];
    (0..level.frames).take_while(loud).count()
}

/// The exponent whose powers are the frames of one bin.
pub(super) fn start(level: &Level, bin: usize) -> Option<C> {
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

/// Products of the model and the data around one bin.
struct Products {
    /// Energy that the best amplitude leaves.
    left: f64,
    /// Products of the derivatives of the model with each other and with the residual, without their part along the model.
    matrix: [[f64; 2]; 2],
    gradient: [f64; 2],
}

/// The bins and frames of a spectrogram in which a sine is fitted.
struct Part<'a> {
    level: &'a Level,
    bins: Range<usize>,
    frames: usize,
}

impl Part<'_> {
    /// The amplitude that explains most of the spectra, and the products: `model[t][k] = exp(s t hop) w(s, k)` with a complex amplitude; the
    /// derivatives are those by ln d and by omega.
    fn complex(&self, s: C) -> Option<(C, Products)> {
        let level = self.level;
        let shapes: Vec<[C; 2]> = self.bins.clone().map(|bin| level.of_exponential(s, bin)).collect();
        let step = exp(s * level.hop as f64);
        let mut factor = C::new(1.0, 0.0);
        // Products of the model m and its derivative m' by s with each other and with the spectra.
        let (mut mm, mut mp, mut pp, mut ms, mut ps, mut ss) =
            (0.0, C::default(), 0.0, C::default(), C::default(), 0.0);
        for t in 0..self.frames {
            let time = (t * level.hop) as f64;
            for ([w, slope], bin) in shapes.iter().zip(self.bins.clone()) {
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
        let products = Products {
            left: ss - ms.norm_sqr() / mm,
            matrix: [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]],
            gradient: columns.map(|c| (c.conj() * right).re),
        };
        Some((a, products))
    }

    /// The products for the powers without the noise: `model[t][k] = exp(2 Re s t hop) |w(s, k)|^2`, with a real factor.
    fn powers(&self, s: C) -> Option<Products> {
        let level = self.level;
        // |w|^2, and half of its derivatives by Re s and by Im s.
        let of_bin = |bin: usize| {
            let [w, slope] = level.of_exponential(s, bin);
            let product = w.conj() * slope;
            [w.norm_sqr(), product.re, -product.im]
        };
        let shapes: Vec<[f64; 3]> = self.bins.clone().map(of_bin).collect();
        let step = libm::exp(2.0 * s.re * level.hop as f64);
        let mut factor = 1.0;
        let (mut mm, mut my, mut yy) = (0.0, 0.0, 0.0);
        let (mut mp, mut py, mut pp) = ([0.0; 2], [0.0; 2], [[0.0; 2]; 2]);
        for t in 0..self.frames {
            let time = (t * level.hop) as f64;
            for ([power, decay, frequency], bin) in shapes.iter().zip(self.bins.clone()) {
                let m = factor * power;
                let p = [2.0 * s.re * factor * (decay + power * time), 2.0 * factor * frequency];
                let y = level.at(t, bin).norm_sqr() - level.noise[bin];
                mm += m * m;
                my += m * y;
                yy += y * y;
                for i in 0..2 {
                    mp[i] += m * p[i];
                    py[i] += p[i] * y;
                    (0..2).for_each(|j| pp[i][j] += p[i] * p[j]);
                }
            }
            factor *= step;
        }
        if !(mm > 0.0 && my > 0.0 && mm.is_finite()) {
            return None;
        }
        let a = my / mm;
        let entry = |i: usize, j: usize| a * a * (pp[i][j] - mp[i] * mp[j] / mm);
        Some(Products {
            left: yy - my * my / mm,
            matrix: [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]],
            gradient: [0, 1].map(|i| a * (py[i] - mp[i] * my / mm)),
        })
    }

    fn products(&self, s: C, domain: FitDomain) -> Option<Products> {
        match domain {
            FitDomain::Complex => self.complex(s).map(|(_, products)| products),
            FitDomain::Power => self.powers(s),
        }
    }

    /// Energy of the data.
    fn energy(&self, domain: FitDomain) -> f64 {
        let of = |(t, bin): (usize, usize)| {
            let power = self.level.at(t, bin).norm_sqr();
            match domain {
                FitDomain::Complex => power,
                FitDomain::Power => (power - self.level.noise[bin]).powi(2),
            }
        };
        (0..self.frames).flat_map(|t| self.bins.clone().map(move |bin| (t, bin))).map(of).sum()
    }
}

/// Fits a damped sine to the bins around its frequency in one resolution.
pub(super) fn fit(level: &Level, start: C, domain: FitDomain) -> Option<Fit> {
    let centre = level.bin(start.im);
    let frames = loud_frames(level, centre);
    if frames < 3 {
        return None;
    }
    let bins = centre.saturating_sub(NEAR)..(centre + NEAR + 1).min(level.bins());
    let part = Part { level, bins, frames };
    let total = part.energy(domain);
    let mut s = start;
    let mut now = part.products(s, domain)?;
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
        match part.products(moved, domain).filter(|next| next.left < now.left) {
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
    let (a, _) = part.complex(s)?;
    Some(Fit { s, a, residual: (now.left / total.max(f64::MIN_POSITIVE)).max(0.0), duration })
}
