//! The contact time of an impact, and the shape of its force pulse.

use std::f64::consts::{PI, TAU};

/// Minimum contact time, in s.
pub const SHORTEST: f64 = 1e-4;
/// Maximum contact time, in s.
pub const LONGEST: f64 = 0.02;
/// Length in samples below which a pulse is replaced by a band-limited impulse.
pub(super) const MIN_LENGTH: f64 = 4.0;
/// Length of a band-limited impulse, in samples.
pub(super) const IMPULSE_LENGTH: f64 = 8.0;

/// Law of the contact time over energy and hardness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// `tau (E/E0)^(-1/10) (h/h0)^(-2/5)`, the contact of elastic spheres.
    Hertz,
    /// Always `tau`.
    Fixed,
    /// `tau - slope E`, the slope in s/J.
    LinearEnergy(f64),
}

/// Returns the contact time in s, from 0.1 to 20 ms, of an impact of `energy` J.
///
/// `tau` is the contact time at energy `energy_ref` and hardness 1; `hardness` is relative to that of the reference.
///
/// # Source
/// Hertz's law gives the exponents: stiffness enters as `E*^(-2/5)`, speed as `v^(-1/5)`, and so energy as `E^(-1/10)`.
/// Picard, Tsingos and Faure (VRIPHYS 2008), section 5, state only that energy and hardness modulate the duration.
#[must_use]
pub fn contact_time(law: Law, tau: f64, energy: f64, energy_ref: f64, hardness: f64) -> f64 {
    let time = match law {
        Law::Hertz => tau * (energy / energy_ref).powf(-0.1) * hardness.powf(-0.4),
        Law::Fixed => tau,
        Law::LinearEnergy(slope) => tau - slope * energy,
    };
    // Energy or hardness of 0 makes an infinite contact time.
    if time.is_nan() { LONGEST } else { time.clamp(SHORTEST, LONGEST) }
}

/// Shape of a force pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PulseShape {
    /// `1 - cos`: smooth at both ends.
    Cosine,
    /// Half a period of a sine.
    HalfSine,
    /// A Gaussian, cut off at three standard deviations.
    Gaussian,
    /// A single sample, the first one that is not before the impact.
    Impulse,
}

/// Samples of a pulse that are computed together.
pub(super) const LANES: usize = 8;

impl PulseShape {
    /// Samples the pulse at the phases `first`, `first + step`, ..., each from 0 to 1 over its length.
    ///
    /// # Complexity
    /// A few additions and multiplications per sample: a sine advances by a rotation, a Gaussian by a factor that itself changes by
    /// a constant factor.
    pub(super) fn sample(self, first: f64, step: f64, heights: &mut [[f64; LANES]]) {
        match self {
            Self::Cosine => wave(TAU * first, TAU * step, heights, |cos, _| 1.0 - cos),
            Self::HalfSine => wave(PI * first, PI * step, heights, |_, sin| sin),
            Self::Gaussian => gaussian(6.0 * first - 3.0, 6.0 * step, heights),
            Self::Impulse => heights
                .as_flattened_mut()
                .iter_mut()
                .enumerate()
                .for_each(|(n, x)| *x = f64::from(u8::from(n == 0))),
        }
    }
}

/// Product of two complex numbers.
fn rotated([c, s]: [f64; 2], [dc, ds]: [f64; 2]) -> [f64; 2] {
    [c * dc - s * ds, c * ds + s * dc]
}

/// Heights as a function of cosine and sine at evenly spaced phases.
fn wave(phase: f64, step: f64, heights: &mut [[f64; LANES]], height: impl Fn(f64, f64) -> f64) {
    let point = |x: f64| {
        let (sin, cos) = libm::sincos(x);
        [cos, sin]
    };
    let one = point(step);
    let eight = (0..3).fold(one, |rotation, _| rotated(rotation, rotation));
    let (mut cos, mut sin, mut at) = ([0.0; LANES], [0.0; LANES], point(phase));
    for l in 0..LANES {
        (cos[l], sin[l]) = (at[0], at[1]);
        at = rotated(at, one);
    }
    for heights in heights {
        for l in 0..LANES {
            heights[l] = height(cos[l], sin[l]);
            [cos[l], sin[l]] = rotated([cos[l], sin[l]], eight);
        }
    }
}

/// `exp(-u^2/2)` at evenly spaced `u`.
fn gaussian(u: f64, step: f64, heights: &mut [[f64; LANES]]) {
    // The ratio of a height to the one eight samples before, and the constant ratio of successive ratios.
    let stride = step * LANES as f64;
    let (mut at, mut factor) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        let u = u + l as f64 * step;
        at[l] = libm::exp(-0.5 * u * u);
        factor[l] = libm::exp(-stride * (u + 0.5 * stride));
    }
    let change = libm::exp(-stride * stride);
    for heights in heights {
        *heights = at;
        for l in 0..LANES {
            at[l] *= factor[l];
            factor[l] *= change;
        }
    }
}

/// A band-limited impulse at phase `x` of its eight samples, 0 to 1: a sinc under a raised cosine.
pub(super) fn impulse(x: f64) -> f64 {
    if !(0.0..1.0).contains(&x) {
        return 0.0;
    }
    let u = PI * IMPULSE_LENGTH * (x - 0.5);
    let sinc = if u.abs() < 1e-6 { 1.0 } else { libm::sin(u) / u };
    sinc * (1.0 - libm::cos(TAU * x))
}

/// The sum of all heights.
pub(super) fn sum(pulse: &[[f64; LANES]]) -> f64 {
    let mut sums = [0.0; LANES];
    for heights in pulse {
        for l in 0..LANES {
            sums[l] += heights[l];
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Heights by their formulas.
    fn height(shape: PulseShape, x: f64) -> f64 {
        match shape {
            PulseShape::Cosine => 1.0 - (TAU * x).cos(),
            PulseShape::HalfSine => (PI * x).sin(),
            PulseShape::Gaussian => (-0.5 * (6.0 * x - 3.0).powi(2)).exp(),
            PulseShape::Impulse => f64::from(u8::from(x <= 0.0)),
        }
    }

    #[test]
    fn sampled_heights_are_those_of_the_formulas() {
        for shape in [PulseShape::Cosine, PulseShape::HalfSine, PulseShape::Gaussian] {
            for length in [4.0, 5.3, 44.1, 882.0, 3840.0, 7679.9] {
                for early in [0.0, 0.3, 0.999] {
                    let (first, step) = (early / length, 1.0 / length);
                    let mut heights = vec![[0.0; LANES]; (length as usize).div_ceil(LANES)];
                    shape.sample(first, step, &mut heights);
                    let heights = &heights.as_flattened()[..length as usize];
                    for (n, found) in heights.iter().enumerate() {
                        let right = height(shape, first + n as f64 * step);
                        assert!((found - right).abs() < 1e-9, "{shape:?} {length} {n}: {found} {right}");
                    }
                }
            }
        }
    }

    #[test]
    fn harder_and_faster_contacts_are_shorter() {
        let time = |e, h| contact_time(Law::Hertz, 1e-3, e, 0.1, h);
        assert!((time(0.1, 1.0) - 1e-3).abs() < 1e-12);
        assert!((time(10.0, 1.0) / 1e-3 - 0.631).abs() < 1e-3, "a hundred times the energy");
        assert!((time(0.1, 0.01) / 1e-3 - 100.0_f64.powf(0.4)).abs() < 1e-9);
        assert_eq!(time(0.0, 1.0), LONGEST);
        assert_eq!(time(0.0, 0.0), LONGEST);
        assert_eq!(time(1e30, 1.0), SHORTEST);
        assert_eq!(contact_time(Law::Fixed, 2e-3, 9.0, 0.1, 0.5), 2e-3);
        assert_eq!(contact_time(Law::LinearEnergy(1e-3), 3e-3, 1.0, 0.1, 1.0), 2e-3);
    }
}
