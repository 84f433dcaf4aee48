//! The modes of a rectangular membrane.

use super::modes::{Modes, ModesError};
use std::f64::consts::PI;

/// Density of air, kg/m^3.
const AIR: f64 = 1.2;

/// A rectangle of cloth under equal tension in all directions, fixed at its rim.
///
/// # Source
/// Morse and Ingard, "Theoretical Acoustics" (1968), section 5.2, for the modes; Rayleigh's integral for the sound pressure at 1 m,
/// of a sheet that is small against the wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Membrane {
    /// Sides, m.
    pub size: [f64; 2],
    /// Tension, N/m.
    pub tension: f64,
    /// Mass per area, kg/m^2.
    pub density: f64,
    /// Decay rate of all modes, 1/s.
    pub damping: f64,
    /// Fraction of its energy that a mode loses per radian, in addition.
    pub loss: f64,
}

impl Membrane {
    /// Wave speed, m/s.
    #[must_use]
    pub fn wave_speed(&self) -> f64 {
        (self.tension / self.density).sqrt()
    }

    /// Frequency of the mode with `m` and `n` half waves along the sides, Hz.
    #[must_use]
    pub fn frequency(&self, [m, n]: [usize; 2]) -> f64 {
        let [a, b] = self.size;
        0.5 * self.wave_speed() * (m as f64 / a).hypot(n as f64 / b)
    }

    /// Sound pressure in Pa at 1 m after an impulse of 1 N s, spread over the sheet, or at a position (0 to 1 along each side).
    ///
    /// Modes with an even number of half waves displace no net volume of air, and radiate nothing.
    fn pressure(&self, half_waves: [usize; 2], position: Option<[f64; 2]>) -> f64 {
        let [m, n] = half_waves;
        if m % 2 == 0 || n % 2 == 0 {
            return 0.0;
        }
        // Mean of a mode over the sheet. The displaced volume is the mean times the area; the modal mass is a quarter of the sheet's.
        let mean = 4.0 / (PI * PI * (m * n) as f64);
        let shape = position.map_or(mean, |[u, v]| (PI * m as f64 * u).sin() * (PI * n as f64 * v).sin());
        let omega = 2.0 * PI * self.frequency(half_waves);
        AIR / (2.0 * PI) * omega * mean * shape * 4.0 / self.density
    }

    /// The modes that radiate, with up to `orders` odd numbers of half waves along each side, in order of frequency.
    ///
    /// # Shapes
    /// One row of gains for each of `positions`; a single row, of an impulse spread over the sheet, if there are none.
    ///
    /// # Errors
    /// Sides, tension, density or dampings whose modes are not finite and above 0.
    pub fn modes(&self, orders: usize, positions: &[[f64; 2]], full_scale: f64) -> Result<Modes, ModesError> {
        let odd = |k: usize| 2 * k + 1;
        let mut all: Vec<[usize; 2]> =
            (0..orders).flat_map(|m| (0..orders).map(move |n| [odd(m), odd(n)])).collect();
        all.sort_by(|a, b| self.frequency(*a).total_cmp(&self.frequency(*b)));
        let frequencies: Vec<f64> = all.iter().map(|mode| self.frequency(*mode)).collect();
        let dampings = frequencies.iter().map(|f| self.damping + PI * f * self.loss).collect();
        let row = |position: Option<[f64; 2]>| {
            all.iter()
                .map(move |mode| (self.pressure(*mode, position) / full_scale) as f32)
                .collect::<Vec<f32>>()
        };
        let gains = match positions {
            [] => row(None),
            _ => positions.iter().flat_map(|position| row(Some(*position))).collect(),
        };
        let [a, b] = self.size;
        Modes::new(format!("membrane of {a} m by {b} m"), frequencies, dampings, gains)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHEET: Membrane =
        Membrane { size: [0.5, 0.3], tension: 60.0, density: 0.15, damping: 20.0, loss: 0.02 };

    #[test]
    fn frequencies_are_those_of_a_rectangle() {
        // c = 20 m/s.
        assert!((SHEET.wave_speed() - 20.0).abs() < 1e-12);
        let expected = 10.0 * ((1.0 / 0.5_f64).powi(2) + (1.0 / 0.3_f64).powi(2)).sqrt();
        let modes = SHEET.modes(3, &[], 1.0).unwrap();
        assert_eq!(modes.len(), 9);
        assert!((modes.frequencies[0] - expected).abs() < 1e-9);
        let of = |m: f64, n: f64| 10.0 * ((m / 0.5).powi(2) + (n / 0.3).powi(2)).sqrt();
        let mut all = [
            of(1.0, 1.0),
            of(3.0, 1.0),
            of(5.0, 1.0),
            of(1.0, 3.0),
            of(3.0, 3.0),
            of(5.0, 3.0),
            of(1.0, 5.0),
            of(3.0, 5.0),
            of(5.0, 5.0),
        ];
        all.sort_by(f64::total_cmp);
        assert!(
            modes.frequencies.iter().zip(all).all(|(a, b)| (a - b).abs() < 1e-9),
            "{:?}",
            modes.frequencies
        );
        // Four times the tension, or half the size, is an octave.
        let tight = Membrane { tension: 240.0, ..SHEET }.modes(1, &[], 1.0).unwrap();
        let small = Membrane { size: [0.25, 0.15], ..SHEET }.modes(1, &[], 1.0).unwrap();
        assert!(
            (tight.frequencies[0] - 2.0 * expected).abs() < 1e-9 && tight.frequencies == small.frequencies
        );
        assert!((modes.dampings[0] - 20.0 - PI * expected * 0.02).abs() < 1e-9);
    }

    #[test]
    fn an_impulse_spread_over_the_sheet_is_the_mean_of_impulses_at_all_positions() {
        let n = 40;
        let positions: Vec<[f64; 2]> =
            (0..n * n).map(|k| [k % n, k / n].map(|k| (k as f64 + 0.5) / n as f64)).collect();
        let (all, each) = (SHEET.modes(3, &[], 1.0).unwrap(), SHEET.modes(3, &positions, 1.0).unwrap());
        for mode in 0..all.len() {
            let mean = (0..n * n).map(|p| f64::from(each.row(p)[mode])).sum::<f64>() / (n * n) as f64;
            assert!((mean / f64::from(all.row(0)[mode]) - 1.0).abs() < 0.02, "{mode}");
        }
        // In the middle the third half wave has the opposite sign.
        let middle = SHEET.modes(2, &[[0.5, 0.5]], 1.0).unwrap();
        assert_eq!(middle.row(0).iter().filter(|g| **g < 0.0).count(), 2);
        assert!(SHEET.modes(1, &[[0.0, 0.5]], 1.0).unwrap().row(0)[0].abs() < 1e-9, "the rim does not move");
    }

    #[test]
    fn the_pressure_follows_from_the_volume_acceleration() {
        // One mode: its speed is J mean / mass, and p = air / (2 pi) times the time derivative of the volume flow.
        let f = SHEET.frequency([1, 1]);
        let (area, mean) = (0.15, 4.0 / (PI * PI));
        let speed = 1.0 * mean / (0.25 * SHEET.density * area);
        let pressure = AIR / (2.0 * PI) * (2.0 * PI * f) * speed * mean * area;
        let modes = SHEET.modes(1, &[], 2.0).unwrap();
        assert!((f64::from(modes.gains[0]) / (pressure / 2.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn sides_without_length_are_refused() {
        assert!(Membrane { size: [0.0, 1.0], ..SHEET }.modes(2, &[], 1.0).is_err());
        assert!(Membrane { damping: 0.0, loss: 0.0, ..SHEET }.modes(2, &[], 1.0).is_err());
    }
}
