//! Second- and first-order sections of recursive filters.
//!
//! # Source
//! R. Bristow-Johnson, "Cookbook formulae for audio EQ biquad filter coefficients".

use std::f64::consts::TAU;

use crate::dsp::DspError;
use crate::impl_state;

/// Coefficients of H(z) = (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Numerator.
    pub b: [f64; 3],
    /// Denominator without its leading 1.
    pub a: [f64; 2],
}

/// Intermediate values of all cookbook designs: cos(w0) and alpha = sin(w0) / (2 Q).
struct Cookbook {
    cos: f64,
    alpha: f64,
}

impl Cookbook {
    fn new(frequency: f64, q: f64, rate: f64) -> Result<Self, DspError> {
        DspError::check_frequency(frequency, rate)?;
        DspError::check(q > 0.0, "q", q, "above 0")?;
        let w0 = TAU * frequency / rate;
        Ok(Self { cos: w0.cos(), alpha: w0.sin() / (2.0 * q) })
    }
}

impl Section {
    /// The identity.
    pub const IDENTITY: Self = Self { b: [1.0, 0.0, 0.0], a: [0.0, 0.0] };

    fn normalised(b: [f64; 3], a: [f64; 3]) -> Self {
        Self { b: b.map(|x| x / a[0]), a: [a[1] / a[0], a[2] / a[0]] }
    }

    /// Low-pass; `q` = 1/sqrt(2) is maximally flat.
    ///
    /// # Errors
    /// Frequencies outside (0, rate / 2), and `q` of 0 or less.
    pub fn low_pass(frequency: f64, q: f64, rate: f64) -> Result<Self, DspError> {
        let Cookbook { cos, alpha } = Cookbook::new(frequency, q, rate)?;
        let b = (1.0 - cos) / 2.0;
        Ok(Self::normalised([b, 2.0 * b, b], [1.0 + alpha, -2.0 * cos, 1.0 - alpha]))
    }

    /// High-pass.
    ///
    /// # Errors
    /// As [`Section::low_pass`].
    pub fn high_pass(frequency: f64, q: f64, rate: f64) -> Result<Self, DspError> {
        let Cookbook { cos, alpha } = Cookbook::new(frequency, q, rate)?;
        let b = (1.0 + cos) / 2.0;
        Ok(Self::normalised([b, -2.0 * b, b], [1.0 + alpha, -2.0 * cos, 1.0 - alpha]))
    }

    /// Band-pass with gain 1 at its centre.
    ///
    /// # Errors
    /// As [`Section::low_pass`].
    pub fn band_pass(frequency: f64, q: f64, rate: f64) -> Result<Self, DspError> {
        let Cookbook { cos, alpha } = Cookbook::new(frequency, q, rate)?;
        Ok(Self::normalised([alpha, 0.0, -alpha], [1.0 + alpha, -2.0 * cos, 1.0 - alpha]))
    }

    /// Notch.
    ///
    /// # Errors
    /// As [`Section::low_pass`].
    pub fn notch(frequency: f64, q: f64, rate: f64) -> Result<Self, DspError> {
        let Cookbook { cos, alpha } = Cookbook::new(frequency, q, rate)?;
        Ok(Self::normalised([1.0, -2.0 * cos, 1.0], [1.0 + alpha, -2.0 * cos, 1.0 - alpha]))
    }

    /// Peak of `gain_db` at the centre, 0 dB far from it.
    ///
    /// # Errors
    /// As [`Section::low_pass`].
    pub fn peak(frequency: f64, q: f64, gain_db: f64, rate: f64) -> Result<Self, DspError> {
        let Cookbook { cos, alpha } = Cookbook::new(frequency, q, rate)?;
        let a = amplitude(gain_db)?;
        Ok(Self::normalised(
            [1.0 + alpha * a, -2.0 * cos, 1.0 - alpha * a],
            [1.0 + alpha / a, -2.0 * cos, 1.0 - alpha / a],
        ))
    }

    /// Low shelf: `gain_db` below the corner frequency, half of it at the corner.
    ///
    /// # Errors
    /// As [`Section::low_pass`].
    pub fn low_shelf(frequency: f64, q: f64, gain_db: f64, rate: f64) -> Result<Self, DspError> {
        Ok(Self::shelf(&Cookbook::new(frequency, q, rate)?, amplitude(gain_db)?, 1.0))
    }

    /// High shelf: `gain_db` above the corner frequency, half of it at the corner.
    ///
    /// # Errors
    /// As [`Section::low_pass`].
    pub fn high_shelf(frequency: f64, q: f64, gain_db: f64, rate: f64) -> Result<Self, DspError> {
        Ok(Self::shelf(&Cookbook::new(frequency, q, rate)?, amplitude(gain_db)?, -1.0))
    }

    /// Low shelf for `side` = 1; high shelf for `side` = -1, with the frequency axis mirrored.
    fn shelf(&Cookbook { cos, alpha }: &Cookbook, a: f64, side: f64) -> Self {
        let c = side * cos;
        let s = 2.0 * a.sqrt() * alpha;
        let (plus, minus) = (a + 1.0, a - 1.0);
        Self::normalised(
            [a * (plus - minus * c + s), side * 2.0 * a * (minus - plus * c), a * (plus - minus * c - s)],
            [plus + minus * c + s, -side * 2.0 * (minus + plus * c), plus + minus * c - s],
        )
    }

    /// First-order low-pass, -3 dB at `frequency` (bilinear with prewarping).
    ///
    /// # Errors
    /// Frequencies outside (0, rate / 2).
    pub fn first_order_low_pass(frequency: f64, rate: f64) -> Result<Self, DspError> {
        DspError::check_frequency(frequency, rate)?;
        let k = (TAU / 2.0 * frequency / rate).tan();
        Ok(Self { b: [k / (1.0 + k), k / (1.0 + k), 0.0], a: [(k - 1.0) / (1.0 + k), 0.0] })
    }

    /// First-order high-pass, -3 dB at `frequency` (bilinear with prewarping).
    ///
    /// # Errors
    /// Frequencies outside (0, rate / 2).
    pub fn first_order_high_pass(frequency: f64, rate: f64) -> Result<Self, DspError> {
        DspError::check_frequency(frequency, rate)?;
        let k = (TAU / 2.0 * frequency / rate).tan();
        Ok(Self { b: [1.0 / (1.0 + k), -1.0 / (1.0 + k), 0.0], a: [(k - 1.0) / (1.0 + k), 0.0] })
    }

    /// Returns |H| at `frequency`.
    #[must_use]
    pub fn gain_at(&self, frequency: f64, rate: f64) -> f64 {
        let w = TAU * frequency / rate;
        let abs = |c: [f64; 3]| {
            let re = c[0] + c[1] * w.cos() + c[2] * (2.0 * w).cos();
            let im = c[1] * w.sin() + c[2] * (2.0 * w).sin();
            re.hypot(im)
        };
        abs(self.b) / abs([1.0, self.a[0], self.a[1]])
    }
}

fn amplitude(gain_db: f64) -> Result<f64, DspError> {
    DspError::check(gain_db.abs() <= 120.0, "gain_db", gain_db, "between -120 and 120")?;
    Ok(10_f64.powf(gain_db / 40.0))
}

/// One section with the state of every channel, in transposed direct form II.
///
/// State and arithmetic are f64: in f32, poles within 1e-3 of z = 1, as at 96 kHz, lose their precision.
#[derive(Clone, Debug)]
pub struct Biquad {
    section: Section,
    state: Vec<[f64; 2]>,
}
impl_state!(Biquad { state });

impl Biquad {
    /// Creates a section with zero state.
    #[must_use]
    pub fn new(section: Section, channels: usize) -> Self {
        Self { section, state: vec![[0.0; 2]; channels] }
    }

    /// Changes the coefficients but not the state.
    pub fn set_section(&mut self, section: Section) {
        self.section = section;
    }

    /// Takes over the state of a section with the same number of channels.
    pub fn take_state(&mut self, old: &mut Self) {
        if self.state.len() == old.state.len() {
            std::mem::swap(&mut self.state, &mut old.state);
        }
    }

    /// Clears the state.
    pub fn reset(&mut self) {
        self.state.fill([0.0; 2]);
    }

    /// Sets the state of all channels to that after an endless constant input.
    pub fn settle(&mut self, x: f64) {
        let Section { b, a } = self.section;
        let y = x * b.iter().sum::<f64>() / (1.0 + a[0] + a[1]);
        let last = b[2] * x - a[1] * y;
        self.state.fill([b[1] * x - a[0] * y + last, last]);
    }

    /// Filters one sample of one channel in f64.
    #[inline]
    pub fn tick(&mut self, channel: usize, x: f64) -> f64 {
        let Section { b, a } = self.section;
        let s = &mut self.state[channel];
        let y = b[0] * x + s[0];
        s[0] = b[1] * x - a[0] * y + s[1];
        s[1] = b[2] * x - a[1] * y;
        y
    }

    /// Filters interleaved samples in place.
    ///
    /// # Shapes
    /// `samples`: a whole number of frames of the channels passed to [`Biquad::new`].
    pub fn process(&mut self, samples: &mut [f32]) {
        let channels = self.state.len();
        for frame in samples.chunks_exact_mut(channels.max(1)) {
            for (channel, x) in frame.iter_mut().enumerate().take(channels) {
                *x = self.tick(channel, f64::from(*x)) as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dsp::testing::{assert_block_invariant, signal};

    const RATE: f64 = 48_000.0;

    fn db(section: Section, frequency: f64) -> f64 {
        20.0 * section.gain_at(frequency, RATE).log10()
    }

    #[test]
    fn designs_have_their_gains_where_the_cookbook_puts_them() {
        let half = 0.5_f64.sqrt();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        close(db(Section::low_pass(1000.0, half, RATE).unwrap(), 1000.0), 20.0 * half.log10());
        close(db(Section::high_pass(1000.0, half, RATE).unwrap(), 1000.0), 20.0 * half.log10());
        close(db(Section::low_pass(1000.0, 2.0, RATE).unwrap(), 1e-6), 0.0);
        close(db(Section::high_pass(1000.0, 2.0, RATE).unwrap(), 24_000.0), 0.0);
        close(db(Section::band_pass(1000.0, 5.0, RATE).unwrap(), 1000.0), 0.0);
        assert!(db(Section::notch(1000.0, 5.0, RATE).unwrap(), 1000.0) < -200.0);
        close(db(Section::peak(1000.0, 3.0, 7.5, RATE).unwrap(), 1000.0), 7.5);
        close(db(Section::peak(1000.0, 3.0, 7.5, RATE).unwrap(), 24_000.0), 0.0);
        let low = Section::low_shelf(1000.0, half, -9.0, RATE).unwrap();
        let high = Section::high_shelf(1000.0, half, -9.0, RATE).unwrap();
        for (shelf, at_zero, at_nyquist) in [(low, -9.0, 0.0), (high, 0.0, -9.0)] {
            close(db(shelf, 1e-6), at_zero);
            close(db(shelf, 1000.0), -4.5);
            close(db(shelf, 24_000.0), at_nyquist);
        }
        close(db(Section::first_order_low_pass(1000.0, RATE).unwrap(), 1000.0), 20.0 * half.log10());
        close(db(Section::first_order_high_pass(1000.0, RATE).unwrap(), 1000.0), 20.0 * half.log10());
    }

    #[test]
    fn a_sine_is_scaled_by_the_magnitude_response() {
        let section = Section::peak(3000.0, 2.0, 6.0, RATE).unwrap();
        let mut filter = Biquad::new(section, 1);
        let mut x: Vec<f32> = (0..48_000).map(|i| (TAU * 2500.0 * i as f64 / RATE).sin() as f32).collect();
        filter.process(&mut x);
        let power: f64 = x[24_000..].iter().map(|&x| f64::from(x).powi(2)).sum::<f64>() / 24_000.0;
        assert!(((2.0 * power).sqrt() - section.gain_at(2500.0, RATE)).abs() < 1e-6);
    }

    #[test]
    fn blocks_do_not_change_a_bit_and_channels_are_independent() {
        let section = Section::low_shelf(300.0, 0.9, 8.0, RATE).unwrap();
        let stereo = signal(2500, 2);
        assert_block_invariant(&stereo, 2, || Biquad::new(section, 2), |f, _, x| f.process(x));
        let mut both = stereo.clone();
        Biquad::new(section, 2).process(&mut both);
        let mut right: Vec<f32> = stereo.iter().skip(1).step_by(2).copied().collect();
        Biquad::new(section, 1).process(&mut right);
        assert!(both.iter().skip(1).step_by(2).eq(&right));
    }

    #[test]
    fn wrong_parameters_are_errors() {
        assert_eq!(Section::low_pass(24_000.0, 1.0, RATE).unwrap_err().what, "frequency");
        assert_eq!(Section::notch(100.0, 0.0, RATE).unwrap_err().what, "q");
        assert_eq!(Section::peak(100.0, 1.0, f64::NAN, RATE).unwrap_err().what, "gain_db");
        assert!(Section::first_order_high_pass(f64::NAN, RATE).is_err());
    }
}
