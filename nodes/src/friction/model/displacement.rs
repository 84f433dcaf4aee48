//! Displacement (quantile) interpolation of spectra: peaks move between frequencies instead of crossfading.
//!
//! # Source
//! Matusik, Zwicker and Durand, "Texture design using a simplicial complex of morphable textures" (SIGGRAPH 2005), as
//! used by An, James and Marschner (SIGGRAPH 2012), section 2, equations 1 to 3. Their integrals run over unnormalised
//! spectra, whose inverse functions have different domains. Here each spectrum is divided by its mass, and the level is
//! interpolated separately.

use serde::{Deserialize, Serialize};

use crate::choices;

/// Level of an interpolated spectrum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Gain {
    /// The sum of amplitudes is linear in speed. Power is lost between spectra of unequal width.
    Mass,
    /// The sum of squared amplitudes is linear in speed.
    #[default]
    Rms,
}

choices! { @param Gain {
    /// The sum of amplitudes is linear in speed, as in the paper. Power is lost between spectra of unequal width.
    Mass,
    /// The sum of squared amplitudes is linear in speed.
    Rms,
} }

/// Fraction of the largest amplitude that is added to every bin, so that the distribution function increases strictly.
pub const EPSILON: f64 = 1e-9;

/// Writes the fraction of the amplitude below each bin edge: `bins + 1` values from exactly 0 to exactly 1.
///
/// A silent spectrum has a straight line, so that it can be one end of an interpolation.
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

/// Writes the mass per bin of the distribution whose quantiles are `(1 - alpha)` times those of `a` plus `alpha` times
/// those of `b`.
///
/// Between two neighbouring knots of either distribution all quantile functions are linear. One merge of the knots
/// therefore inverts the blend exactly. Frequencies are in bins.
fn displaced_masses(a: &[f64], b: &[f64], alpha: f64, out: &mut [f64]) {
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
            let fraction = if span > 0.0 { ((edge + 1) as f64 - q) / span } else { 1.0 };
            let c = p + (next_p - p) * fraction;
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
    // Rounding can leave the topmost edge unreached; its bin holds the remaining mass.
    for mass in &mut out[edge..] {
        *mass = (1.0 - below).max(0.0);
        below = 1.0;
    }
}

/// One end of an interpolation: an amplitude spectrum and its distribution function.
#[derive(Clone, Copy)]
pub(super) struct End<'a> {
    pub amplitude: &'a [f64],
    pub distribution: &'a [f64],
}

/// Writes the spectrum at `alpha` between two ends.
pub(super) fn blend(a: End<'_>, b: End<'_>, alpha: f64, gain: Gain, out: &mut [f64]) {
    let sums = |x: &[f64]| x.iter().fold((0.0, 0.0), |(m, p), v| (m + v, p + v * v));
    let ((mass_a, power_a), (mass_b, power_b)) = (sums(a.amplitude), sums(b.amplitude));
    // A silent spectrum has no shape: the sound fades in or out with the shape of the other one.
    match (mass_a > 0.0, mass_b > 0.0) {
        (false, false) => return out.fill(0.0),
        (false, true) => displaced_masses(b.distribution, b.distribution, alpha, out),
        (true, false) => displaced_masses(a.distribution, a.distribution, alpha, out),
        (true, true) => displaced_masses(a.distribution, b.distribution, alpha, out),
    }
    let (mass, power) = sums(out);
    let scale = match gain {
        Gain::Mass => ((1.0 - alpha) * mass_a + alpha * mass_b) / mass,
        Gain::Rms => (((1.0 - alpha) * power_a + alpha * power_b) / power).sqrt(),
    };
    out.iter_mut().for_each(|v| *v *= scale);
}

/// Writes the amplitude spectrum at `alpha` between `a` (0) and `b` (1). Two silent spectra result in zeros.
///
/// A slice shorter than `out` is continued by zeros.
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
