//! Coefficients of the recursion from frequencies and dampings, in double precision.

use super::lanes::{InputGain, LANES, Lanes};
use crate::modal::mode::modes::Modes;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Maximum frequency of a mode, as a fraction of the sample rate; higher modes are left out.
pub(crate) const MAX_FREQUENCY: f64 = 0.49;

/// Minimum decay, in nepers per sample. Below it, rounding in single precision could let a mode grow. At 44.1 kHz, 60 dB then
/// take eight minutes.
const MIN_DECAY: f64 = 3e-7;

/// Sixteen modes at one sample rate.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Group {
    /// Radians per sample, before the pitch factor.
    angle: [f64; LANES],
    /// Nepers per sample.
    decay: [f64; LANES],
    /// `sin(angle)` after the pitch factor; 0 for a mode above [`MAX_FREQUENCY`].
    sin: [f64; LANES],
    /// `1 - cos(angle)` after the pitch factor, without cancellation; 1 for such a mode.
    versine: [f64; LANES],
    /// Factor of all frequencies.
    pitch: f64,
    /// Factors of the dampings.
    pub factors: [f32; LANES],
    /// Dampings in addition, nepers per sample.
    pub added: [f64; LANES],
}

impl Group {
    /// Up to sixteen modes of frequencies in Hz and dampings in 1/s.
    fn new(modes: impl Iterator<Item = (f64, f64)>, rate: f64) -> Self {
        let zero = [0.0; LANES];
        let mut group = Self {
            angle: zero,
            decay: zero,
            sin: zero,
            versine: zero,
            pitch: 1.0,
            factors: [1.0; LANES],
            added: zero,
        };
        for (l, (frequency, damping)) in modes.take(LANES).enumerate() {
            (group.angle[l], group.decay[l]) = (TAU * frequency / rate, damping / rate);
        }
        group.set_pitch(1.0);
        group
    }

    /// Sets the factor of all frequencies.
    pub fn set_pitch(&mut self, factor: f64) {
        self.pitch = factor;
        for l in 0..LANES {
            let angle = self.angle[l] * factor;
            let sounds = angle < TAU * MAX_FREQUENCY;
            (self.sin[l], self.versine[l]) =
                if sounds { (libm::sin(angle), 2.0 * libm::sin(0.5 * angle).powi(2)) } else { (0.0, 1.0) };
        }
    }

    /// Nepers per sample of a mode, with `damping` times all dampings.
    #[inline(always)]
    fn nepers(&self, l: usize, damping: f64) -> f64 {
        let decay = self.decay[l] * (damping * f64::from(self.factors[l])) + self.added[l];
        if decay > MIN_DECAY { decay } else { MIN_DECAY }
    }

    /// Nepers and radians per sample of a mode, with `damping` times all dampings; none if it has no sound.
    pub fn pole(&self, l: usize, damping: f64) -> Option<(f64, f64)> {
        (self.sin[l] != 0.0).then(|| (self.nepers(l, damping), self.angle[l] * self.pitch))
    }

    /// One step of the recursion, `exp(-decay + i angle) - 1`, as real and imaginary part, with `damping` times all dampings.
    ///
    /// Slow modes rotate little in one sample. The difference from 1 keeps all its digits in single precision, so that neither
    /// frequency nor damping drifts.
    #[inline(always)]
    pub fn steps(&self, damping: f64, less_one: &mut [f32; LANES], sin: &mut [f32; LANES]) {
        let (mut x, mut shrink) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            x[l] = -self.nepers(l, damping);
            shrink[l] = series_expm1(x[l]);
        }
        if x.iter().fold(false, |any, x| any | (*x < SERIES_MIN)) {
            for l in 0..LANES {
                shrink[l] = if x[l] < SERIES_MIN { libm::expm1(x[l]) } else { shrink[l] };
            }
        }
        for l in 0..LANES {
            let radius = 1.0 + shrink[l];
            less_one[l] = (shrink[l] - radius * self.versine[l]) as f32;
            sin[l] = (radius * self.sin[l]) as f32;
        }
    }
}

/// Coefficients that turn sixteen damped sines into their second derivatives over `-|p|^2`, where `p = -d + 2 pi i f` is the pole.
pub(crate) struct Radiation {
    /// `-(p / |p|)^2`, real and imaginary part; 0 for modes without sound.
    turn: [[f32; LANES]; 2],
    /// `1 / (1 - exp(p / fs))`: response of the recursion to a constant force of 1.
    constant: [[f32; LANES]; 2],
}

impl Radiation {
    /// Coefficients of modes whose steps are set, with `damping` times all dampings.
    #[inline(always)]
    pub fn new(group: &Group, damping: f64, lanes: &Lanes) -> Self {
        let mut radiation = Self { turn: [[0.0; LANES]; 2], constant: [[0.0; LANES]; 2] };
        for l in 0..LANES {
            let d = (group.decay[l] * damping) as f32 * group.factors[l] + group.added[l] as f32;
            let w = (group.angle[l] * group.pitch) as f32;
            let power = (d * d + w * w).max(f32::MIN_POSITIVE);
            let sounds = if group.sin[l] != 0.0 { 1.0 / power } else { 0.0 };
            radiation.turn[0][l] = (w * w - d * d) * sounds;
            radiation.turn[1][l] = 2.0 * d * w * sounds;
            let (re, im) = (-lanes.less_one[l], lanes.sin[l]);
            let power = (re * re + im * im).max(f32::MIN_POSITIVE);
            radiation.constant[0][l] = re / power;
            radiation.constant[1][l] = im / power;
        }
        radiation
    }

    /// Turns input gains, and returns the sum of the responses to a constant force of 1.
    #[inline(always)]
    pub fn apply(&self, gain: &InputGain, turned: &mut InputGain) -> f32 {
        let sums: [f32; LANES] = std::array::from_fn(|l| {
            let [x, y] = [self.turn[0][l], self.turn[1][l]];
            turned.re[l] = gain.re[l] * x - gain.im[l] * y;
            turned.im[l] = gain.re[l] * y + gain.im[l] * x;
            turned.re[l] * self.constant[1][l] + turned.im[l] * self.constant[0][l]
        });
        sums.iter().sum()
    }
}

/// Lower limit of the Taylor series.
const SERIES_MIN: f64 = -0.125;

/// `exp(x) - 1` between [`SERIES_MIN`] and 0 by a Taylor series: dampings change many times a second.
#[inline(always)]
fn series_expm1(x: f64) -> f64 {
    // The next term, x^9/9!, is less than 2e-13 of the first.
    const INVERSE: [f64; 7] = [1.0 / 8.0, 1.0 / 7.0, 1.0 / 6.0, 1.0 / 5.0, 1.0 / 4.0, 1.0 / 3.0, 1.0 / 2.0];
    INVERSE.iter().fold(1.0, |sum, k| 1.0 + x * k * sum) * x
}

/// Indices of the audible modes of an object, and these modes in groups of sixteen.
///
/// A mode is audible if it lies below [`MAX_FREQUENCY`] times the rate, and its largest gain over all contact points is at
/// least `min_gain` times the largest of all modes.
pub(crate) fn audible(modes: &Modes, rate: f64, min_gain: f64) -> (Vec<usize>, Vec<Group>) {
    let mut loudness = vec![0.0_f32; modes.len()];
    for point in 0..modes.points() {
        loudness.iter_mut().zip(modes.row(point)).for_each(|(max, gain)| *max = max.max(gain.abs()));
    }
    let threshold = min_gain * f64::from(loudness.iter().copied().fold(0.0, f32::max));
    let all = modes.frequencies.iter().zip(&loudness);
    let sounds = |f: f64, gain: f32| f < MAX_FREQUENCY * rate && f64::from(gain) >= threshold;
    let indices: Vec<usize> =
        (0..).zip(all).filter(|(_, (f, gain))| sounds(**f, **gain)).map(|(i, _)| i).collect();
    let mode = |i: &usize| (modes.frequencies[*i], modes.dampings[*i]);
    let groups = indices.chunks(LANES).map(|group| Group::new(group.iter().map(mode), rate));
    let groups = groups.collect();
    (indices, groups)
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
    fn the_series_is_as_accurate_as_the_library() {
        for k in 0..=1250 {
            let x = -0.0001 * f64::from(k);
            assert!(x < SERIES_MIN || (series_expm1(x) - libm::expm1(x)).abs() <= 2e-13 * x.abs(), "{x}");
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
    fn a_mode_whose_pitch_is_beyond_half_the_rate_is_silent() {
        let mut mode = Group::new([(15_000.0, 3.0)].into_iter(), 44_100.0);
        mode.set_pitch(2.0);
        assert_eq!(step(&mode, 1.0), (-1.0, 0.0));
        mode.set_pitch(1.0);
        assert_ne!(step(&mode, 1.0), (-1.0, 0.0));
    }
}
