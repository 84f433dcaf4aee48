//! Absorption of sound by air.

use crate::impl_state;
use std::f64::consts::PI;

/// Returns the absorption in dB per metre at a frequency in hertz, in air of 20 °C and 50 % relative humidity at sea level.
///
/// # Source
/// ISO 9613-1 (1993), equations 3 to 6.
#[must_use]
pub fn loss(f: f64) -> f64 {
    const KELVIN: f64 = 293.15;
    const TRIPLE_POINT: f64 = 273.16;
    // Molar concentration of water vapour, in percent.
    let saturated = 10f64.powf(-6.8346 * (TRIPLE_POINT / KELVIN).powf(1.261) + 4.6151);
    let water = 50.0 * saturated;
    let oxygen = 24.0 + 4.04e4 * water * (0.02 + water) / (0.391 + water);
    let nitrogen = 9.0 + 280.0 * water;
    let relaxation =
        |strength: f64, kelvin: f64, at: f64| strength * (-kelvin / KELVIN).exp() / (at + f * f / at);
    8.686 * f * f * (1.84e-11 + relaxation(0.012_75, 2239.1, oxygen) + relaxation(0.1068, 3352.0, nitrogen))
}

/// Number of low-pass sections in series: one alone is not steep enough.
const SECTIONS: usize = 4;
/// Frequency at which their loss equals that of air, in Hz.
const MATCHED_FREQUENCY: f64 = 8000.0;

/// A low-pass filter that models the absorption of air for a source at a known distance.
///
/// Below 12 kHz it is within 0.6 dB of [`loss`] up to 20 m. At larger distances very weak high frequencies lose less than in air.
#[derive(Clone, Debug)]
pub struct Air {
    /// State of each channel.
    state: Vec<[f64; SECTIONS]>,
    /// Cosine of the matched frequency.
    cosine: f64,
    /// Loss of one section at that frequency, in dB per metre.
    section_loss: f64,
}
impl_state!(Air { state });

impl Air {
    /// Creates the filter for `channels` channels at `fs` hertz.
    #[must_use]
    pub fn new(channels: usize, fs: f64) -> Self {
        let matched = MATCHED_FREQUENCY.min(0.4 * fs);
        let cosine = (2.0 * PI * matched / fs).cos();
        Self { state: vec![[0.0; SECTIONS]; channels], cosine, section_loss: loss(matched) / SECTIONS as f64 }
    }

    /// Returns the pole of each section for a distance in metres; 0 leaves the sound unchanged.
    #[must_use]
    pub fn pole(&self, metres: f64) -> f64 {
        // Larger losses than this are inaudible.
        let remaining = 10f64.powf(-(self.section_loss * metres).clamp(0.0, 60.0) / 10.0);
        let (a, b) = (1.0 - remaining, 1.0 - remaining * self.cosine);
        // The smaller root of a p^2 - 2 b p + a, without cancellation.
        a / (b + (b * b - a * a).max(0.0).sqrt())
    }

    /// Filters the next sample of a channel.
    #[inline]
    pub fn process(&mut self, channel: usize, x: f32, pole: f64) -> f32 {
        let Some(state) = self.state.get_mut(channel) else { return x };
        let mut y = f64::from(x);
        for memory in state {
            y += pole * (*memory - y);
            // Inaudible, and larger than the denormal numbers, which are slow.
            *memory = if y.abs() < 1e-30 { 0.0 } else { y };
        }
        y as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loss_is_that_of_the_standard() {
        // Table 1 of ISO 9613-1, dB per kilometre at 20 °C and 50 %.
        let table =
            [(125.0, 0.440), (500.0, 2.73), (1000.0, 4.66), (2000.0, 9.89), (4000.0, 29.7), (8000.0, 105.0)];
        for (f, expected) in table {
            let found = 1000.0 * loss(f);
            assert!((found / expected - 1.0).abs() < 0.005, "{f} Hz: {found} dB/km, expected {expected}");
        }
    }

    /// Returns the measured loss in dB of a steady tone.
    fn measured(metres: f64, f: f64, fs: f64) -> f64 {
        let mut air = Air::new(1, fs);
        let pole = air.pole(metres);
        let count = fs as usize;
        let (mut sum, mut input) = (0.0, 0.0);
        for n in 0..2 * count {
            let x = (2.0 * PI * f * n as f64 / fs).sin();
            let y = f64::from(air.process(0, x as f32, pole));
            if n >= count {
                (sum, input) = (sum + y * y, input + x * x);
            }
        }
        -10.0 * (sum / input).log10()
    }

    #[test]
    fn the_filter_has_the_loss_of_air_up_to_8_khz_and_up_to_12_khz_at_20_m() {
        for fs in [44_100.0, 96_000.0] {
            for metres in [0.0, 5.0, 20.0, 100.0] {
                for f in [500.0, 2000.0, 4000.0, 8000.0] {
                    let (found, expected) = (measured(metres, f, fs), metres * loss(f));
                    assert!(
                        (found - expected).abs() < 0.6,
                        "{metres} m, {f} Hz: {found} dB, expected {expected}"
                    );
                }
            }
            assert!((measured(20.0, 12_000.0, fs) - 20.0 * loss(12_000.0)).abs() < 0.6);
        }
        assert_eq!(Air::new(1, 48_000.0).pole(0.0), 0.0);
        let far = Air::new(1, 48_000.0).pole(1e9);
        assert!((0.9..1.0).contains(&far), "{far}");
    }
}
