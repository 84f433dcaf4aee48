//! A head with two ears: shadow, delay between the ears, echoes of the pinna and of the shoulder.
//!
//! # Source
//! Brown and Duda, "A structural model for binaural sound synthesis" (IEEE Trans. Speech and Audio Processing 6(5), 1998).

use std::f64::consts::{FRAC_PI_2, PI};

use super::pose::{interaural, unit};
use crate::contact::vector::{Vec3, cross, dot, norm};

/// Speed of sound in air, m/s.
pub const SPEED_OF_SOUND: f64 = 343.0;

/// Level of the reflections of the pinna.
pub const PINNA_LEVELS: [f64; 5] = [0.5, -1.0, 0.5, -0.25, 0.25];
/// Swing and least delay of these reflections, in samples at [`PINNA_RATE`] (not in milliseconds, whatever the rate of the audio).
const PINNA_SWINGS: [f64; 5] = [1.0, 5.0, 5.0, 5.0, 5.0];
const PINNA_LEAST: [f64; 5] = [2.0, 4.0, 7.0, 11.0, 13.0];
const PINNA_RATE: f64 = 44_100.0;
/// Longest delay of a reflection of the pinna, in s.
pub const PINNA_LONGEST: f64 = 18.0 / PINNA_RATE;
/// Longest delay of the shoulder's echo, in s.
pub const SHOULDER_LONGEST: f64 = 0.0012;

/// An ear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ear {
    /// On the side of positive y.
    Left,
    /// On the side of negative y.
    Right,
}

/// How the delays of a pinna's reflections follow the elevation: the two sets that Brown and Duda fitted to listeners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinnaSet {
    /// Their first set.
    Set0,
    /// Their second set.
    Set1,
}

impl PinnaSet {
    fn rates(self) -> [f64; 5] {
        match self {
            Self::Set0 => [1.0, 0.5, 0.5, 0.5, 0.5],
            Self::Set1 => [0.85, 0.35, 0.35, 0.35, 0.35],
        }
    }
}

/// A sphere with two ears, and what it does to sound from a direction far away.
///
/// The laws hold for sources far away compared with the head; nearer than about a metre they are a cue and no more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Head {
    /// Radius in metres.
    pub radius: f64,
    /// Gain of high frequencies where the shadow is deepest.
    pub least_gain: f64,
    /// Angle of incidence of the deepest shadow, in radians.
    pub deepest: f64,
    /// Azimuth of the ears, in radians from the front.
    pub ears: f64,
    /// Reflections of the pinna.
    pub pinna: Option<PinnaSet>,
    /// Level of the echo from the shoulder; 0 for none.
    pub shoulder: f64,
}

impl Default for Head {
    fn default() -> Self {
        Self {
            radius: 0.0875,
            least_gain: 0.1,
            deepest: 150_f64.to_radians(),
            ears: 100_f64.to_radians(),
            pinna: None,
            shoulder: 0.0,
        }
    }
}

/// What an ear does to sound from one direction at one rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EarFilter {
    /// Coefficients of the shadow, `(b0 + b1 z^-1) / (1 + a1 z^-1)`; `a1` does not depend on the direction.
    pub shadow: [f64; 3],
    /// Delay in s, [`Head::bias`] being that of the middle of the head.
    pub delay: f64,
    /// Delay of each reflection of the pinna after the sound, in s.
    pub pinna: [f64; 5],
    /// Delay of the echo of the shoulder after the sound, in s.
    pub shoulder: f64,
}

impl Head {
    /// Delay that is added to both ears so that none is negative: the way from the surface to the middle, in s.
    #[must_use]
    pub fn bias(&self) -> f64 {
        self.radius / SPEED_OF_SOUND
    }

    /// Longest delay of an ear, in s.
    #[must_use]
    pub fn longest(&self) -> f64 {
        self.bias() * (1.0 + FRAC_PI_2)
    }

    /// Angle between a direction (any length, own axes of the head) and the axis of an ear, in radians from 0 to pi.
    ///
    /// What is in the middle of the head counts as in front.
    #[must_use]
    pub fn incidence(&self, ear: Ear, direction: Vec3) -> f64 {
        let d = unit(direction).unwrap_or([1.0, 0.0, 0.0]);
        let side = if ear == Ear::Left { 1.0 } else { -1.0 };
        let axis = [libm::cos(self.ears), side * libm::sin(self.ears), 0.0];
        libm::atan2(norm(cross(axis, d)), dot(axis, d))
    }

    /// Gain of high frequencies at an angle of incidence; that of low ones is 1.
    #[must_use]
    pub fn high_gain(&self, incidence: f64) -> f64 {
        let half = self.least_gain / 2.0;
        (1.0 + half) + (1.0 - half) * libm::cos(PI * incidence / self.deepest)
    }

    /// Delay of an ear at an angle of incidence, in s: along the straight way, then around the sphere.
    ///
    /// The shadow delays low frequencies by a further `(1 - high gain) / (2 c / a)`, as a head does.
    #[must_use]
    pub fn delay(&self, incidence: f64) -> f64 {
        let way = if incidence < FRAC_PI_2 { -libm::cos(incidence) } else { incidence - FRAC_PI_2 };
        self.bias() * (1.0 + way)
    }

    /// Coefficients `b0, b1, a1` of the shadow at `fs` hertz, by the bilinear transform.
    #[must_use]
    pub fn shadow(&self, incidence: f64, fs: f64) -> [f64; 3] {
        let corner = 1.0 / self.bias();
        let gain = self.high_gain(incidence) * fs;
        let below = corner + fs;
        [(corner + gain) / below, (corner - gain) / below, (corner - fs) / below]
    }

    /// Delays of the pinna's reflections for a direction, in s; zero without pinna.
    #[must_use]
    pub fn pinna_delays(&self, direction: Vec3) -> [f64; 5] {
        let Some(set) = self.pinna else { return [0.0; 5] };
        let (lateral, elevation) = interaural(unit(direction).unwrap_or([1.0, 0.0, 0.0]));
        let (rates, wide) = (set.rates(), libm::cos(lateral / 2.0));
        std::array::from_fn(|k| {
            let swing = PINNA_SWINGS[k] * wide * libm::sin(rates[k] * (FRAC_PI_2 - elevation));
            (swing + PINNA_LEAST[k]) / PINNA_RATE
        })
    }

    /// Delay of the shoulder's echo, in s: Brown and Duda's rough fit.
    #[must_use]
    pub fn shoulder_delay(&self, incidence: f64, direction: Vec3) -> f64 {
        let (_, elevation) = interaural(unit(direction).unwrap_or([1.0, 0.0, 0.0]));
        let (theta, phi) = (incidence.to_degrees(), elevation.to_degrees());
        let way = (phi - 80.0) * 180.0 / (180.0 + theta);
        (SHOULDER_LONGEST * (180.0 - theta) / 180.0 * (1.0 - 0.00004 * way * way)).max(0.0)
    }

    /// Everything that an ear does to sound from a direction (any length, own axes of the head) at `fs` hertz.
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

    /// Complex gain `(re, im)` of an ear at a frequency in hertz, the naive form of what [`Binaural`](super::Binaural) and
    /// [`HeadReceiver`](super::HeadReceiver) compute; the middle of the head has delay 0.
    #[must_use]
    pub fn response(&self, filter: &EarFilter, frequency: f64, fs: f64) -> [f64; 2] {
        let w = 2.0 * PI * frequency;
        let turn = |t: f64| [libm::cos(w * t), -libm::sin(w * t)];
        let [b0, b1, a1] = filter.shadow;
        let z = turn(1.0 / fs);
        let above = [b0 + b1 * z[0], b1 * z[1]];
        let below = [1.0 + a1 * z[0], a1 * z[1]];
        let square = below[0] * below[0] + below[1] * below[1];
        let mut head = times(above, [below[0] / square, -below[1] / square]);
        let echo = turn(filter.shoulder);
        head = [head[0] + self.shoulder * echo[0], head[1] + self.shoulder * echo[1]];
        let mut pinna = [1.0, 0.0];
        if self.pinna.is_some() {
            for (level, delay) in PINNA_LEVELS.iter().zip(filter.pinna) {
                let t = turn(delay);
                pinna = [pinna[0] + level * t[0], pinna[1] + level * t[1]];
            }
        }
        times(times(head, pinna), turn(filter.delay - self.bias()))
    }
}

pub(crate) fn times(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn toward(azimuth: f64, elevation: f64) -> Vec3 {
        // Azimuth to the right, as the tables have it.
        let (a, e) = (azimuth.to_radians(), elevation.to_radians());
        [a.cos() * e.cos(), -a.sin() * e.cos(), e.sin()]
    }

    #[test]
    fn the_shadow_has_the_gains_and_coefficients_of_the_table() {
        let head = Head::default();
        let rows = [
            (0.0, 2.0, 6.02, Some([1.960_769, -1.882_306])),
            (90.0, 0.7564, -2.42, Some([0.765_989, -0.687_527])),
            (150.0, 0.1, -20.0, Some([0.135_308, -0.056_845])),
            (180.0, 0.2814, -11.01, None),
        ];
        for (degrees, alpha, db, coefficients) in rows {
            let theta = f64::to_radians(degrees);
            let gain = head.high_gain(theta);
            assert!((gain - alpha).abs() < 5e-5, "{degrees}: {gain}");
            assert!((20.0 * gain.log10() - db).abs() < 0.01, "{degrees}: {gain}");
            let [b0, b1, a1] = head.shadow(theta, 96_000.0);
            assert!((a1 + 0.921_537).abs() < 1e-6);
            assert!(((b0 + b1) / (1.0 + a1) - 1.0).abs() < 1e-12, "low frequencies pass");
            assert!(((b0 - b1) / (1.0 - a1) - gain).abs() < 1e-12);
            if let Some([c0, c1]) = coefficients {
                assert!((b0 - c0).abs() < 1e-6 && (b1 - c1).abs() < 1e-6, "{degrees}: {b0} {b1}");
            }
        }
    }

    #[test]
    fn the_ears_differ_in_time_and_level_as_in_the_table() {
        let head = Head::default();
        let rows = [(30.0, 265.3, 388.7, 16.0), (60.0, 507.1, 706.7, 22.9), (90.0, 607.4, 836.6, 20.7)];
        for (azimuth, geometric, low, level) in rows {
            let [near, far] = [Ear::Right, Ear::Left].map(|ear| head.incidence(ear, toward(azimuth, 0.0)));
            let itd = 1e6 * (head.delay(far) - head.delay(near));
            assert!((itd - geometric).abs() < 0.1, "{azimuth}: {itd}");
            let group = |theta: f64| 1e6 * (1.0 - head.high_gain(theta)) * head.bias() / 2.0;
            let itd = itd + group(far) - group(near);
            assert!((itd - low).abs() < 0.1, "{azimuth}: {itd}");
            let found = 20.0 * (head.high_gain(near) / head.high_gain(far)).log10();
            assert!((found - level).abs() < 0.06, "{azimuth}: {found}");
        }
        let side = Head { ears: FRAC_PI_2, ..head };
        let [near, far] = [Ear::Right, Ear::Left].map(|ear| side.incidence(ear, toward(90.0, 0.0)));
        assert!((1e6 * (side.delay(far) - side.delay(near)) - 655.8).abs() < 0.1);
        assert!((1e6 * head.longest() - 655.8).abs() < 0.1);
    }

    #[test]
    fn the_levels_at_the_ears_differ_as_the_law_of_the_shadow_has_it_to_a_hundredth_of_a_decibel() {
        // The law in degrees, with the angle between two unit vectors by its cosine.
        let alpha = |azimuth: f64, elevation: f64, ear: f64| {
            let cosine = elevation.to_radians().cos() * (azimuth - ear).to_radians().cos();
            let theta = cosine.acos().to_degrees();
            1.05 + 0.95 * (1.2 * theta).to_radians().cos()
        };
        let decibels = |near: f64, far: f64| 20.0 * (near / far).log10();
        let mut greatest = 0.0_f64;
        for azimuth in (-180..180).step_by(5).map(f64::from) {
            for elevation in [-40.0, 0.0, 25.0, 70.0] {
                let expected = decibels(alpha(azimuth, elevation, 100.0), alpha(azimuth, elevation, -100.0));
                let [right, left] = [Ear::Right, Ear::Left]
                    .map(|ear| Head::default().ear(ear, toward(azimuth, elevation), 96_000.0));
                // What the filters do at half the rate.
                let high = |f: EarFilter| (f.shadow[0] - f.shadow[1]) / (1.0 - f.shadow[2]);
                let found = decibels(high(right), high(left));
                assert!((found - expected).abs() < 0.01, "{azimuth}, {elevation}: {found} for {expected}");
                greatest = greatest.max(found);
            }
        }
        assert!(greatest > 20.0, "{greatest}");
        for (azimuth, level) in [(30.0, 16.0), (60.0, 22.9), (90.0, 20.7)] {
            let found = decibels(alpha(azimuth, 0.0, 100.0), alpha(azimuth, 0.0, -100.0));
            assert!((found - level).abs() < 0.05, "{azimuth}: {found}");
        }
    }

    #[test]
    fn mirrored_directions_give_the_other_ear_bit_for_bit_and_the_front_gives_both_the_same() {
        let head = Head { pinna: Some(PinnaSet::Set0), shoulder: 0.2, ..Head::default() };
        for k in 0..400 {
            let d = toward(f64::from(k) * 7.3, f64::from(k % 37) * 5.0 - 90.0);
            let mirrored = [d[0], -d[1], d[2]];
            let (left, right) = (head.ear(Ear::Left, d, 48_000.0), head.ear(Ear::Right, mirrored, 48_000.0));
            assert_eq!(left, right);
            assert!(left.delay >= 0.0 && left.delay <= head.longest() + 1e-15);
            assert!(left.pinna.iter().all(|t| *t >= 2.0 / PINNA_RATE - 1e-12 && *t <= PINNA_LONGEST + 1e-12));
            assert!((0.0..=SHOULDER_LONGEST).contains(&left.shoulder));
        }
        for d in [[1.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]] {
            assert_eq!(head.ear(Ear::Left, d, 48_000.0), head.ear(Ear::Right, d, 48_000.0));
        }
    }

    #[test]
    fn inside_of_the_head_a_source_is_heard_as_from_its_surface() {
        let head = Head { pinna: Some(PinnaSet::Set0), shoulder: 0.2, ..Head::default() };
        let distance = crate::spatial::Distance::default();
        let at = |azimuth: f64, d: f64| toward(azimuth, 15.0).map(|x| x * d);
        for azimuth in [0.0, 40.0, -110.0, 180.0] {
            for ear in [Ear::Left, Ear::Right] {
                let surface = head.ear(ear, at(azimuth, head.radius), 48_000.0);
                for d in [1e-9, 0.01, 0.04, 0.087] {
                    let inside = head.ear(ear, at(azimuth, d), 48_000.0);
                    let numbers = |f: &EarFilter| [&f.shadow[..], &[f.delay, f.shoulder], &f.pinna].concat();
                    let apart =
                        numbers(&inside).into_iter().zip(numbers(&surface)).map(|(a, b)| (a - b).abs());
                    assert!(apart.fold(0.0, f64::max) < 1e-12, "{azimuth} {d}: {inside:?} {surface:?}");
                    // Nor is it louder than at 0.1 m.
                    assert_eq!(distance.gain_of(at(azimuth, d)), 10.0);
                }
                assert!(distance.gain_of(at(azimuth, 0.101)) < 10.0);
            }
        }
        // The middle has no direction: it counts as in front, and nothing there is no number.
        let middle = head.ear(Ear::Left, [0.0; 3], 48_000.0);
        assert_eq!(middle, head.ear(Ear::Left, [head.radius, 0.0, 0.0], 48_000.0));
    }

    #[test]
    fn the_pinna_delays_are_samples_at_44100() {
        let head = Head { pinna: Some(PinnaSet::Set0), ..Head::default() };
        // Straight ahead: cos 0 = 1, sin 90 = 1 for the first and sin 45 for the others.
        let expected = [1.0 + 2.0, 5.0 * 0.5_f64.sqrt() + 4.0, 5.0 * 0.5_f64.sqrt() + 7.0];
        for (found, samples) in head.pinna_delays([1.0, 0.0, 0.0]).iter().zip(expected) {
            assert!((found * 44_100.0 - samples).abs() < 1e-9, "{found}");
        }
        assert!((head.pinna_delays([0.0, 0.0, 1.0])[4] * 44_100.0 - 13.0).abs() < 1e-9);
        let other = Head { pinna: Some(PinnaSet::Set1), ..head };
        let angle = 0.35 * FRAC_PI_2;
        assert!((other.pinna_delays([1.0, 0.0, 0.0])[1] * 44_100.0 - 5.0 * angle.sin() - 4.0).abs() < 1e-9);
        assert!(PINNA_LEVELS.iter().sum::<f64>().abs() < 1e-15, "low frequencies pass");
    }

    #[test]
    fn the_response_is_one_at_low_and_the_shadow_at_high_frequencies() {
        let head = Head::default();
        let filter = head.ear(Ear::Left, toward(-60.0, 0.0), 48_000.0);
        let [re, im] = head.response(&filter, 0.0, 48_000.0);
        assert!((re - 1.0).abs() < 1e-12 && im.abs() < 1e-12);
        let [re, im] = head.response(&filter, 24_000.0, 48_000.0);
        let gain = head.high_gain(head.incidence(Ear::Left, toward(-60.0, 0.0)));
        assert!((re.hypot(im) - gain).abs() < 1e-9);
    }
}
