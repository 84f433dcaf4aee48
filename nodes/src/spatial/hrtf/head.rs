//! A structural head model: head shadow, interaural delay, reflections of pinna and shoulder.
//!
//! # Source
//! Brown and Duda, "A structural model for binaural sound synthesis" (IEEE Trans. Speech and Audio Processing 6(5), 1998).

use std::f64::consts::{FRAC_PI_2, PI};

use crate::contact::vector::{Vec3, cross, dot, norm};
use crate::spatial::motion::pose::{interaural, unit};
use crate::spatial::propagation::distance::SPEED_OF_SOUND;

/// Levels of the reflections of the pinna.
pub const PINNA_LEVELS: [f64; 5] = [0.5, -1.0, 0.5, -0.25, 0.25];
/// Amplitudes of the delays of these reflections (A_k of the paper), in samples at [`PINNA_RATE`].
const PINNA_AMPLITUDES: [f64; 5] = [1.0, 5.0, 5.0, 5.0, 5.0];
/// Offsets of these delays (B_k of the paper), in samples at [`PINNA_RATE`].
const PINNA_OFFSETS: [f64; 5] = [2.0, 4.0, 7.0, 11.0, 13.0];
/// Sample rate of the delays of the pinna, in Hz, at any rate of the audio.
const PINNA_RATE: f64 = 44_100.0;
/// Longest delay of a reflection of the pinna, in s.
pub const PINNA_MAX_DELAY: f64 = 18.0 / PINNA_RATE;
/// Longest delay of the shoulder reflection, in s.
pub const SHOULDER_MAX_DELAY: f64 = 0.0012;

/// The left or the right ear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ear {
    /// On the side of positive y.
    Left,
    /// On the side of negative y.
    Right,
}

/// The sets of pinna delays that Brown and Duda fitted to listeners. They differ in the dependence on the elevation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinnaSet {
    /// The first set.
    Set0,
    /// The second set.
    Set1,
}

impl PinnaSet {
    /// Returns the scale of the elevation for each reflection (D_k of the paper).
    fn scales(self) -> [f64; 5] {
        match self {
            Self::Set0 => [1.0, 0.5, 0.5, 0.5, 0.5],
            Self::Set1 => [0.85, 0.35, 0.35, 0.35, 0.35],
        }
    }
}

/// A spherical head with two ears, and its transfer functions for distant sources.
///
/// The model holds for sources that are distant against the head size; below about 1 m it is a rough cue only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Head {
    /// Radius in metres.
    pub radius: f64,
    /// Gain of high frequencies in the deepest shadow.
    pub min_gain: f64,
    /// Angle of incidence of the deepest shadow, in radians.
    pub deepest_angle: f64,
    /// Azimuth of the ears, in radians from the front.
    pub ear_azimuth: f64,
    /// Reflections of the pinna.
    pub pinna: Option<PinnaSet>,
    /// Level of the shoulder reflection; 0 for none.
    pub shoulder: f64,
}

impl Default for Head {
    fn default() -> Self {
        Self {
            radius: 0.0875,
            min_gain: 0.1,
            deepest_angle: 150_f64.to_radians(),
            ear_azimuth: 100_f64.to_radians(),
            pinna: None,
            shoulder: 0.0,
        }
    }
}

/// The transfer function of an ear for one direction and one sample rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EarFilter {
    /// Coefficients of the shadow, `(b0 + b1 z^-1) / (1 + a1 z^-1)`; `a1` does not depend on the direction.
    pub shadow: [f64; 3],
    /// Delay in s; that of the centre of the head is [`Head::centre_delay`].
    pub delay: f64,
    /// Delay of each pinna reflection after the direct sound, in s.
    pub pinna: [f64; 5],
    /// Delay of the shoulder reflection after the direct sound, in s.
    pub shoulder: f64,
}

impl Head {
    /// Returns the delay added to both ears so that neither is negative: the travel time over the radius, in s.
    #[must_use]
    pub fn centre_delay(&self) -> f64 {
        self.radius / SPEED_OF_SOUND
    }

    /// Returns the longest delay of an ear, in s.
    #[must_use]
    pub fn max_delay(&self) -> f64 {
        self.centre_delay() * (1.0 + FRAC_PI_2)
    }

    /// Returns the angle between a direction (of any length, in local axes) and the axis of an ear, in radians from 0 to pi.
    ///
    /// A source at the centre of the head is treated as in front.
    #[must_use]
    pub fn incidence(&self, ear: Ear, direction: Vec3) -> f64 {
        let d = unit(direction).unwrap_or([1.0, 0.0, 0.0]);
        let side = if ear == Ear::Left { 1.0 } else { -1.0 };
        let axis = [libm::cos(self.ear_azimuth), side * libm::sin(self.ear_azimuth), 0.0];
        libm::atan2(norm(cross(axis, d)), dot(axis, d))
    }

    /// Returns the gain of high frequencies at an angle of incidence; that of low frequencies is 1.
    #[must_use]
    pub fn high_gain(&self, incidence: f64) -> f64 {
        let half = self.min_gain / 2.0;
        (1.0 + half) + (1.0 - half) * libm::cos(PI * incidence / self.deepest_angle)
    }

    /// Returns the delay of an ear at an angle of incidence, in s: along the straight path, then around the sphere.
    ///
    /// The head shadow delays low frequencies by another `(1 - high gain) / (2 c / a)`, as a real head does.
    #[must_use]
    pub fn delay(&self, incidence: f64) -> f64 {
        let path = if incidence < FRAC_PI_2 { -libm::cos(incidence) } else { incidence - FRAC_PI_2 };
        self.centre_delay() * (1.0 + path)
    }

    /// Returns the coefficients `b0, b1, a1` of the head shadow at `fs` hertz, by the bilinear transform.
    #[must_use]
    pub fn shadow(&self, incidence: f64, fs: f64) -> [f64; 3] {
        let corner = 1.0 / self.centre_delay();
        let gain = self.high_gain(incidence) * fs;
        let denominator = corner + fs;
        [(corner + gain) / denominator, (corner - gain) / denominator, (corner - fs) / denominator]
    }

    /// Returns the delays of the pinna reflections for a direction, in s; zero without pinna.
    #[must_use]
    pub fn pinna_delays(&self, direction: Vec3) -> [f64; 5] {
        let Some(set) = self.pinna else { return [0.0; 5] };
        let (lateral, elevation) = interaural(unit(direction).unwrap_or([1.0, 0.0, 0.0]));
        let (scales, lateral_factor) = (set.scales(), libm::cos(lateral / 2.0));
        std::array::from_fn(|k| {
            let variation =
                PINNA_AMPLITUDES[k] * lateral_factor * libm::sin(scales[k] * (FRAC_PI_2 - elevation));
            (variation + PINNA_OFFSETS[k]) / PINNA_RATE
        })
    }

    /// Returns the delay of the shoulder reflection, in s, by the approximate fit of Brown and Duda.
    #[must_use]
    pub fn shoulder_delay(&self, incidence: f64, direction: Vec3) -> f64 {
        let (_, elevation) = interaural(unit(direction).unwrap_or([1.0, 0.0, 0.0]));
        let (theta, phi) = (incidence.to_degrees(), elevation.to_degrees());
        let angle = (phi - 80.0) * 180.0 / (180.0 + theta);
        (SHOULDER_MAX_DELAY * (180.0 - theta) / 180.0 * (1.0 - 0.00004 * angle * angle)).max(0.0)
    }

    /// Returns the transfer function of an ear for a direction (of any length, in local axes) at `fs` hertz.
    #[must_use]
    pub fn ear(&self, ear: Ear, direction: Vec3, fs: f64) -> EarFilter {
        let incidence = self.incidence(ear, direction);
        EarFilter {
            shadow: self.shadow(incidence, fs),
            delay: self.delay(incidence),
            pinna: self.pinna_delays(direction),
            shoulder: self.shoulder_delay(incidence, direction),
        }
    }

    /// Returns the complex gain `(re, im)` of an ear at a frequency in hertz. The centre of the head has delay 0.
    ///
    /// This is the reference for [`Binaural`](crate::spatial::Binaural) and [`HeadReceiver`](crate::spatial::HeadReceiver).
    #[must_use]
    pub fn response(&self, filter: &EarFilter, frequency: f64, fs: f64) -> [f64; 2] {
        let w = 2.0 * PI * frequency;
        let phasor = |t: f64| [libm::cos(w * t), -libm::sin(w * t)];
        let [b0, b1, a1] = filter.shadow;
        let z = phasor(1.0 / fs);
        let numerator = [b0 + b1 * z[0], b1 * z[1]];
        let denominator = [1.0 + a1 * z[0], a1 * z[1]];
        let square = denominator[0] * denominator[0] + denominator[1] * denominator[1];
        let mut head = complex_product(numerator, [denominator[0] / square, -denominator[1] / square]);
        let echo = phasor(filter.shoulder);
        head = [head[0] + self.shoulder * echo[0], head[1] + self.shoulder * echo[1]];
        let mut pinna = [1.0, 0.0];
        if self.pinna.is_some() {
            for (level, delay) in PINNA_LEVELS.iter().zip(filter.pinna) {
                let t = phasor(delay);
                pinna = [pinna[0] + level * t[0], pinna[1] + level * t[1]];
            }
        }
        complex_product(complex_product(head, pinna), phasor(filter.delay - self.centre_delay()))
    }
}

pub(crate) fn complex_product(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

#[cfg(test)]
mod tests;
