//! Butterworth high-pass and low-pass filters as second-order sections.

use std::f64::consts::PI;

use super::section::{Biquad, Section};
use crate::dsp::DspError;
use crate::impl_state;
/// The pass-band of a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Band {
    /// Frequencies above the cutoff.
    HighPass,
    /// Frequencies below the cutoff.
    LowPass,
}

/// The sections of a Butterworth filter of order 1 to 10. Odd orders begin with a first-order section; the second-order sections
/// follow in order of falling damping.
///
/// The analogue poles on the unit circle are mapped by the bilinear transform with a prewarped cutoff. The gain at the cutoff is
/// therefore exactly -3.0103 dB. The total gain equals that of `scipy.signal.butter(..., output='sos')`, which applies the numerator
/// gain in its first section; here every section has gain 1 in its pass-band.
///
/// # Example
/// ```
/// let sections = foley_nodes::dsp::Butterworth::design(foley_nodes::dsp::Band::HighPass, 5, 100.0, 48_000.0)?;
/// assert_eq!(sections.sections().len(), 3);
/// # Ok::<(), foley_nodes::dsp::DspError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Butterworth {
    sections: [Section; 5],
    count: usize,
}

impl Butterworth {
    /// Designs the filter.
    ///
    /// # Errors
    /// Orders outside 1..=10 and cutoffs outside (0, rate / 2).
    pub fn design(band: Band, order: usize, cutoff: f64, rate: f64) -> Result<Self, DspError> {
        DspError::check((1..=10).contains(&order), "order", order as f64, "1 to 10")?;
        DspError::check_frequency(cutoff, rate)?;
        let k = (PI * cutoff / rate).tan();
        let mut sections = [Section::IDENTITY; 5];
        let mut count = 0;
        if order % 2 == 1 {
            sections[0] = match band {
                Band::HighPass => Section::first_order_high_pass(cutoff, rate)?,
                Band::LowPass => Section::first_order_low_pass(cutoff, rate)?,
            };
            count = 1;
        }
        for pair in (0..order / 2).rev() {
            // s^2 + 2 sin(theta) s + 1, with damping from nearly 2 down to nearly 0.
            let damping = 2.0 * (PI * (2 * pair + 1) as f64 / (2 * order) as f64).sin();
            let norm = 1.0 + damping * k + k * k;
            let a = [2.0 * (k * k - 1.0) / norm, (1.0 - damping * k + k * k) / norm];
            let b = match band {
                Band::HighPass => [1.0 / norm, -2.0 / norm, 1.0 / norm],
                Band::LowPass => [k * k / norm, 2.0 * k * k / norm, k * k / norm],
            };
            sections[count] = Section { b, a };
            count += 1;
        }
        Ok(Self { sections, count })
    }

    /// Returns the sections in order of processing.
    #[must_use]
    pub fn sections(&self) -> &[Section] {
        &self.sections[..self.count]
    }

    /// Returns |H| at `frequency`.
    #[must_use]
    pub fn gain_at(&self, frequency: f64, rate: f64) -> f64 {
        self.sections().iter().map(|s| s.gain_at(frequency, rate)).product()
    }
}

/// Sections in series on interleaved channels: causal, in one pass, with f64 between the sections.
///
/// A high-pass of order 5 at 100 Hz prepares cloth recordings and targets for unit selection.
#[derive(Clone, Debug)]
pub struct Cascade {
    stages: Vec<Biquad>,
    channels: usize,
}
impl_state!(Cascade { each stages });

impl Cascade {
    /// Creates a filter with zero state.
    #[must_use]
    pub fn new(design: &Butterworth, channels: usize) -> Self {
        let channels = channels.max(1);
        let stages = design.sections().iter().map(|&s| Biquad::new(s, channels)).collect();
        Self { stages, channels }
    }

    /// Changes the coefficients but not the state. Returns false, and changes nothing, if the number of sections differs.
    pub fn set_design(&mut self, design: &Butterworth) -> bool {
        let fits = design.sections().len() == self.stages.len();
        if fits {
            self.stages.iter_mut().zip(design.sections()).for_each(|(stage, &s)| stage.set_section(s));
        }
        fits
    }

    /// Takes over the state of a filter with the same number of sections and channels.
    pub fn take_state(&mut self, old: &mut Self) {
        if self.stages.len() == old.stages.len() && self.channels == old.channels {
            self.stages.iter_mut().zip(&mut old.stages).for_each(|(new, old)| new.take_state(old));
        }
    }

    /// Clears the state.
    pub fn reset(&mut self) {
        self.stages.iter_mut().for_each(Biquad::reset);
    }

    /// Filters interleaved samples in place.
    pub fn process(&mut self, samples: &mut [f32]) {
        for frame in samples.chunks_exact_mut(self.channels) {
            for (channel, x) in frame.iter_mut().enumerate() {
                *x = self.stages.iter_mut().fold(f64::from(*x), |x, stage| stage.tick(channel, x)) as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dsp::testing::{assert_block_invariant, signal};

    /// `scipy.signal.butter(5, 100, 'hp', fs=fs, output='sos')`: total numerator gain, then every section's denominator.
    #[test]
    fn order_five_at_100_hz_has_the_reference_coefficients() {
        for (rate, first, second, third) in [
            (48_000.0, -0.986994962682, [-1.978872973597, 0.979042522971], [-1.991772121194, 0.991942775765]),
            (96_000.0, -0.993476340643, [-1.989423234855, 0.989465845903], [-1.995920420148, 0.995963170358]),
        ] {
            let design = Butterworth::design(Band::HighPass, 5, 100.0, rate).unwrap();
            let [a, b, c] = design.sections() else { panic!() };
            let close = |x: f64, y: f64| assert!((x - y).abs() < 1e-11, "{x} {y}");
            close(a.a[0], first);
            (0..2).for_each(|i| close(b.a[i], second[i]));
            (0..2).for_each(|i| close(c.a[i], third[i]));
            let gain = a.b[0] * b.b[0] * c.b[0];
            close(gain, if rate < 50_000.0 { 0.97904252296 } else { 0.989465845902 });
            for section in [b, c] {
                close(section.b[1], -2.0 * section.b[0]);
                close(section.b[2], section.b[0]);
            }
        }
    }

    #[test]
    fn order_five_at_100_hz_has_the_stated_gains() {
        for rate in [44_100.0, 48_000.0, 96_000.0] {
            let design = Butterworth::design(Band::HighPass, 5, 100.0, rate).unwrap();
            for (frequency, db, tolerance) in
                [(10.0, -100.0, 0.005), (50.0, -30.11, 0.005), (100.0, -3.0103, 5e-5), (200.0, -0.0042, 5e-5)]
            {
                let found = 20.0 * design.gain_at(frequency, rate).log10();
                assert!((found - db).abs() < tolerance, "{frequency} Hz at {rate}: {found}");
            }
        }
    }

    #[test]
    fn every_order_is_maximally_flat() {
        let rate = 44_100.0;
        let warp = |f: f64| (PI * f / rate).tan();
        for order in 1..=10 {
            for (band, sign) in [(Band::HighPass, -1.0), (Band::LowPass, 1.0)] {
                let design = Butterworth::design(band, order, 1000.0, rate).unwrap();
                for f in [300.0, 1000.0, 2500.0, 15_000.0] {
                    let ratio = (warp(f) / warp(1000.0)).powf(sign * 2.0 * order as f64);
                    let expected = 1.0 / (1.0 + ratio).sqrt();
                    assert!((design.gain_at(f, rate) / expected - 1.0).abs() < 1e-8, "{order} {band:?} {f}");
                }
                for s in design.sections() {
                    assert!(s.a[1].abs() < 1.0 && s.a[0].abs() < 1.0 + s.a[1], "stable");
                }
            }
        }
    }

    #[test]
    fn the_high_pass_removes_constants_and_blocks_do_not_change_a_bit() {
        let design = |order| Butterworth::design(Band::HighPass, order, 100.0, 48_000.0);
        let new = || Cascade::new(&design(5).unwrap(), 2);
        assert_block_invariant(&signal(3000, 2), 2, new, |f, _, x| f.process(x));
        let mut dc = vec![1.0; 96_000];
        new().process(&mut dc);
        assert!(dc[90_000..].iter().all(|x| x.abs() < 1e-9));
        assert_eq!(design(11).unwrap_err().what, "order");
        assert_eq!(design(0).unwrap_err().what, "order");
    }
}
