//! Displacement (quantile) interpolation of spectra: peaks move from one frequency to the other instead of cross-fading.
//!
//! # Source
//! Matusik, Zwicker and Durand, "Texture design using a simplicial complex of morphable textures" (SIGGRAPH 2005), as
//! used by An, James and Marschner (SIGGRAPH 2012), section 2, equations 1 to 3. Their integrals run over unnormalised
//! spectra, whose inverse functions have different domains; here each is divided by its mass and the level is set apart.

use serde::{Deserialize, Serialize};

use crate::choices;

/// Level of an interpolated spectrum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Gain {
    /// The sum of amplitudes is linear in speed; loses power between spectra of unequal width.
    Mass,
    /// The sum of squared amplitudes is linear in speed.
    #[default]
    Rms,
}

choices! { @param Gain {
    /// The sum of amplitudes is linear in speed, the paper's reading; loses power between spectra of unequal width.
    Mass,
    /// The sum of squared amplitudes is linear in speed.
    Rms,
} }

/// Share of the largest amplitude that is added to every bin, so that the distribution function increases strictly.
pub const EPSILON: f64 = 1e-9;

/// Running share of the amplitude below each bin edge: `bins + 1` values from exactly 0 to exactly 1.
///
/// Zero amplitude everywhere gives a line, so that such a spectrum can still be one end of an interpolation.
pub(super) fn distribution(amplitude: &[f64], epsilon: f64, out: &mut [f64]) {
    let largest = amplitude.iter().copied().fold(0.0, f64::max);
    let lift = if largest > 0.0 { epsilon * largest } else { 1.0 };
    let mass: f64 = amplitude.iter().map(|a| a + lift).sum();
    let mut sum = 0.0;
    out[0] = 0.0;
    for (c, a) in out[1..].iter_mut().zip(amplitude) {
        sum += a + lift;
        *c = sum / mass;
    }
    if let Some(c) = out.last_mut() {
        *c = 1.0;
    }
}

/// Shares per bin of the distribution whose quantiles lie a part `alpha` of the way from those of `a` to those of `b`.
///
/// Between two neighbouring knots of either distribution all quantile functions are linear, so one merge of the knots
/// inverts the blend exactly. Frequencies are in bins.
fn displaced_shares(a: &[f64], b: &[f64], alpha: f64, out: &mut [f64]) {
    let bins = out.len();
    let (mut i, mut j, mut edge) = (0, 0, 0);
    let (mut p, mut q, mut below) = (0.0, 0.0, 0.0);
    while i < bins && j < bins {
        let (pa, pb) = (a[i + 1], b[j + 1]);
        let next_p = pa.min(pb);
        let quantile = |c: &[f64], k: usize| {
            let width = c[k + 1] - c[k];
            if next_p < c[k + 1] && width > 0.0 { k as f64 + (next_p - c[k]) / width } else { (k + 1) as f64 }
        };
        let next_q = (1.0 - alpha) * quantile(a, i) + alpha * quantile(b, j);
        while edge < bins && (edge + 1) as f64 <= next_q {
            let span = next_q - q;
            let along = if span > 0.0 { ((edge + 1) as f64 - q) / span } else { 1.0 };
            let c = p + (next_p - p) * along;
            out[edge] = (c - below).max(0.0);
            below = c;
            edge += 1;
        }
        (p, q) = (next_p, next_q);
        match pa.partial_cmp(&pb) {
            Some(std::cmp::Ordering::Less) => i += 1,
            Some(std::cmp::Ordering::Greater) => j += 1,
            _ => (i, j) = (i + 1, j + 1),
        }
    }
    // Rounding can leave the topmost edge unreached; it holds what is left of the whole.
    for share in &mut out[edge..] {
        *share = (1.0 - below).max(0.0);
        below = 1.0;
    }
}

/// One end of an interpolation: a spectrum and its distribution.
#[derive(Clone, Copy)]
pub(super) struct End<'a> {
    pub amplitude: &'a [f64],
    pub distribution: &'a [f64],
}

pub(super) fn blend(a: End<'_>, b: End<'_>, alpha: f64, gain: Gain, out: &mut [f64]) {
    let sums = |x: &[f64]| x.iter().fold((0.0, 0.0), |(m, p), v| (m + v, p + v * v));
    let ((mass_a, power_a), (mass_b, power_b)) = (sums(a.amplitude), sums(b.amplitude));
    // Silence has no shape of its own: the sound fades in or out with the shape of the other end.
    match (mass_a > 0.0, mass_b > 0.0) {
        (false, false) => return out.fill(0.0),
        (false, true) => displaced_shares(b.distribution, b.distribution, alpha, out),
        (true, false) => displaced_shares(a.distribution, a.distribution, alpha, out),
        (true, true) => displaced_shares(a.distribution, b.distribution, alpha, out),
    }
    let (mass, power) = sums(out);
    let scale = match gain {
        Gain::Mass => ((1.0 - alpha) * mass_a + alpha * mass_b) / mass,
        Gain::Rms => (((1.0 - alpha) * power_a + alpha * power_b) / power).sqrt(),
    };
    out.iter_mut().for_each(|v| *v *= scale);
}

/// The amplitude spectrum a part `alpha` of the way from `a` to `b`; both all zero give zeros.
///
/// Shorter than `out`, `a` or `b` count as continued by zeros.
///
/// # Shapes
/// `a, b, out: [bins]`, amplitudes per bin on one uniform grid.
///
/// # Complexity
/// O(bins); allocates the two distributions.
pub fn displace(a: &[f64], b: &[f64], alpha: f64, gain: Gain, out: &mut [f64]) {
    displace_with(a, b, alpha, gain, EPSILON, out);
}

fn displace_with(a: &[f64], b: &[f64], alpha: f64, gain: Gain, epsilon: f64, out: &mut [f64]) {
    let bins = out.len();
    if bins == 0 {
        return;
    }
    let end = |x: &[f64]| {
        let amplitude: Vec<f64> = (0..bins).map(|k| x.get(k).copied().unwrap_or(0.0)).collect();
        let mut knots = vec![0.0; bins + 1];
        distribution(&amplitude, epsilon, &mut knots);
        (amplitude, knots)
    };
    let ((a, ca), (b, cb)) = (end(a), end(b));
    let (a, b) = (End { amplitude: &a, distribution: &ca }, End { amplitude: &b, distribution: &cb });
    blend(a, b, alpha, gain, out);
}

#[cfg(test)]
mod tests;
