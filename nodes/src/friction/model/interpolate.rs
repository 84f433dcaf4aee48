//! Spectra of a friction model at any speed.

use super::displacement::{EPSILON, End, Gain, blend, distribution};
use super::friction_model::{FrictionModel, ModelError};
use super::speed_bracket::Bracket;

/// Interpolates the spectra of a friction model.
///
/// Between measured speeds the spectra are displaced. Below the slowest speed `s_0` its amplitude is scaled by `(s /
/// s_0)^2`, so power falls with the fourth power of speed. Above the fastest speed its spectrum is held. The result is
/// continuous in speed, with kinks at measured speeds.
#[derive(Clone, Debug)]
pub struct SpectrumInterpolator {
    speeds: Vec<f64>,
    bins: usize,
    gain: Gain,
    amplitude: Vec<f64>,
    distribution: Vec<f64>,
}

impl SpectrumInterpolator {
    /// Prepares the distributions of all measured speeds.
    ///
    /// # Errors
    /// When the model is invalid.
    pub fn new(model: &FrictionModel, gain: Gain) -> Result<Self, ModelError> {
        model.validate()?;
        let bins = model.bins();
        let amplitude: Vec<f64> = model.psd.iter().map(|&s| (f64::from(s) * model.df).sqrt()).collect();
        let mut knots = vec![0.0; (bins + 1) * model.speeds.len()];
        for (row, c) in amplitude.chunks_exact(bins).zip(knots.chunks_exact_mut(bins + 1)) {
            distribution(row, EPSILON, c);
        }
        Ok(Self { speeds: model.speeds.clone(), bins, gain, amplitude, distribution: knots })
    }

    /// Returns the number of bins per spectrum.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.bins
    }

    /// Returns the measured speeds in m/s.
    #[must_use]
    pub fn speeds(&self) -> &[f64] {
        &self.speeds
    }

    fn end(&self, k: usize) -> End<'_> {
        End {
            amplitude: &self.amplitude[k * self.bins..(k + 1) * self.bins],
            distribution: &self.distribution[k * (self.bins + 1)..(k + 1) * (self.bins + 1)],
        }
    }

    /// Writes the amplitude per bin, `sqrt(S df)`, at `speed`; zeros when it is not above 0.
    ///
    /// # Shapes
    /// `out: [bins]`; a slice of another length is filled with zeros.
    ///
    /// # Complexity
    /// O(bins + log K); no allocation.
    pub fn amplitude(&self, speed: f64, out: &mut [f64]) {
        out.fill(0.0);
        if out.len() != self.bins {
            return;
        }
        match Bracket::of(&self.speeds, speed) {
            Bracket::AtRest => {}
            Bracket::Below { ratio } => {
                out.iter_mut().zip(self.end(0).amplitude).for_each(|(o, a)| *o = ratio * ratio * a);
            }
            Bracket::Between { low, alpha } => {
                blend(self.end(low), self.end(low + 1), alpha, self.gain, out);
            }
            Bracket::Above => out.copy_from_slice(self.end(self.speeds.len() - 1).amplitude),
        }
    }
}

impl FrictionModel {
    /// Writes the amplitude per bin, `sqrt(S df)`, at one speed. For many speeds use a [`SpectrumInterpolator`].
    ///
    /// # Errors
    /// As [`validate`](Self::validate), and when `out` does not have [`bins`](Self::bins) values.
    pub fn amplitude(&self, speed: f64, gain: Gain, out: &mut [f64]) -> Result<(), ModelError> {
        if out.len() != self.bins() {
            return Err(ModelError::Length { field: "out", found: out.len(), expected: self.bins() });
        }
        SpectrumInterpolator::new(self, gain)?.amplitude(speed, out);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
