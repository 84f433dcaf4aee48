//! From frequencies and dampings to the numbers of the recursion, in double precision.

use super::kernel::LANES;
use crate::modal::mode::modes::Modes;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Share of the sample rate above which a mode is left out: so near to half the rate it is no tone any more.
pub(crate) const HIGHEST: f64 = 0.49;

/// Least decay, in nepers per sample: below it, rounding in single precision could let a mode grow. At 44.1 kHz, 60 dB then
/// take eight minutes.
const SLOWEST: f64 = 3e-7;

/// Sixteen modes at one sample rate.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Group {
    /// Radians per sample.
    angle: [f64; LANES],
    /// Nepers per sample.
    decay: [f64; LANES],
    /// `sin(angle)`, after the pitch; 0 for a mode that the pitch takes beyond half the rate.
    sin: [f64; LANES],
    /// `1 - cos(angle)`, after the pitch, without cancellation; 1 for such a mode.
    versine: [f64; LANES],
    /// Factors of the dampings.
    pub factors: [f32; LANES],
}

impl Group {
    /// Up to sixteen modes of frequencies in Hz and dampings in 1/s.
    fn new(modes: impl Iterator<Item = (f64, f64)>, rate: f64) -> Self {
        let zero = [0.0; LANES];
        let mut group = Self { angle: zero, decay: zero, sin: zero, versine: zero, factors: [1.0; LANES] };
        for (l, (frequency, damping)) in modes.take(LANES).enumerate() {
            (group.angle[l], group.decay[l]) = (TAU * frequency / rate, damping / rate);
        }
        group.set_pitch(1.0);
        group
    }

    /// Multiplies the frequencies.
    pub fn set_pitch(&mut self, factor: f64) {
        for l in 0..LANES {
            let angle = self.angle[l] * factor;
            let sounds = angle < TAU * HIGHEST;
            (self.sin[l], self.versine[l]) =
                if sounds { (libm::sin(angle), 2.0 * libm::sin(0.5 * angle).powi(2)) } else { (0.0, 1.0) };
        }
    }

    /// One step of the recursion, `exp(-decay + i angle) - 1`, as real and imaginary part, with all dampings multiplied.
    ///
    /// Slow modes hardly turn in one sample: what is left after taking away 1 keeps all its digits in single precision, so
    /// that neither their frequency nor their damping moves.
    #[inline(always)]
    pub fn steps(&self, damping: f64, less_one: &mut [f32; LANES], sin: &mut [f32; LANES]) {
        let (mut x, mut shrink) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let decay = self.decay[l] * (damping * f64::from(self.factors[l]));
            x[l] = -if decay > SLOWEST { decay } else { SLOWEST };
            shrink[l] = short_expm1(x[l]);
        }
        if x.iter().fold(false, |any, x| any | (*x < SHORT)) {
            for l in 0..LANES {
                shrink[l] = if x[l] < SHORT { libm::expm1(x[l]) } else { shrink[l] };
            }
        }
        for l in 0..LANES {
            let radius = 1.0 + shrink[l];
            less_one[l] = (shrink[l] - radius * self.versine[l]) as f32;
            sin[l] = (radius * self.sin[l]) as f32;
        }
    }
}

/// Where the short series ends.
const SHORT: f64 = -0.125;

/// `exp(x) - 1` between [`SHORT`] and 0 by a Taylor series, for dampings move many times a second.
#[inline(always)]
fn short_expm1(x: f64) -> f64 {
    // The next term, x^9/9!, is less than 2e-13 of the first.
    const INVERSE: [f64; 7] = [1.0 / 8.0, 1.0 / 7.0, 1.0 / 6.0, 1.0 / 5.0, 1.0 / 4.0, 1.0 / 3.0, 1.0 / 2.0];
    INVERSE.iter().fold(1.0, |sum, k| 1.0 + x * k * sum) * x
}

/// The places of the modes of an object that can sound at a rate and whose gain, at the contact point where it is greatest, is
/// at least the share `faintest` of the greatest of all; and these modes by sixteens.
pub(crate) fn audible(modes: &Modes, rate: f64, faintest: f64) -> (Vec<usize>, Vec<Group>) {
    let mut loudness = vec![0.0_f32; modes.len()];
    for point in 0..modes.points() {
        loudness.iter_mut().zip(modes.row(point)).for_each(|(most, gain)| *most = most.max(gain.abs()));
    }
    let least = faintest * f64::from(loudness.iter().copied().fold(0.0, f32::max));
    let all = modes.frequencies.iter().zip(&loudness);
    let sounds = |f: f64, gain: f32| f < HIGHEST * rate && f64::from(gain) >= least;
    let places: Vec<usize> =
        (0..).zip(all).filter(|(_, (f, gain))| sounds(**f, **gain)).map(|(i, _)| i).collect();
    let mode = |i: &usize| (modes.frequencies[*i], modes.dampings[*i]);
    let groups = places.chunks(LANES).map(|group| Group::new(group.iter().map(mode), rate));
    let groups = groups.collect();
    (places, groups)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(group: &Group, damping: f64) -> (f32, f32) {
        let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
        group.steps(damping, &mut re, &mut im);
        (re[0], im[0])
    }

    #[test]
    fn the_short_series_is_as_good_as_the_library() {
        for k in 0..=1250 {
            let x = -0.0001 * f64::from(k);
            assert!(x < SHORT || (short_expm1(x) - libm::expm1(x)).abs() <= 2e-13 * x.abs(), "{x}");
        }
    }

    #[test]
    fn a_step_is_the_complex_exponential_less_one() {
        for (f, d) in [(20.0, 0.5), (440.0, 5.0), (15_000.0, 300.0), (100.0, 20_000.0)] {
            let (re, im) = step(&Group::new([(f, d)].into_iter(), 44_100.0), 2.0);
            let (r, w) = ((-2.0 * d / 44_100.0).exp(), TAU * f / 44_100.0);
            assert!((f64::from(re) - (r * w.cos() - 1.0)).abs() < 1e-7, "{f}");
            assert!((f64::from(im) - r * w.sin()).abs() < 1e-7, "{f}");
        }
    }

    #[test]
    fn a_mode_that_the_pitch_takes_beyond_half_the_rate_falls_silent() {
        let mut mode = Group::new([(15_000.0, 3.0)].into_iter(), 44_100.0);
        mode.set_pitch(2.0);
        assert_eq!(step(&mode, 1.0), (-1.0, 0.0));
        mode.set_pitch(1.0);
        assert_ne!(step(&mode, 1.0), (-1.0, 0.0));
    }
}
