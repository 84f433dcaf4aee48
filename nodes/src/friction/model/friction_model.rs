//! The friction model: one power density per sliding speed.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::clip_length::MAX_CLIP_SAMPLES;
use super::conventions::{Conventions, Origin, Rejections, Source};
use super::rebin::rebin;
use super::speed_bracket::Bracket;

/// Version of the format of [`FrictionModel`].
pub const MODEL_VERSION: u32 = 1;

/// Power density of friction sound against sliding speed, for one pair of materials.
///
/// The densities do not depend on the rate or clip length of the synthesis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrictionModel {
    /// [`MODEL_VERSION`].
    pub version: u32,
    /// Names of the two materials that slide on each other.
    pub material_pair: [String; 2],
    /// Sliding speeds in m/s, `[K]`, strictly increasing, the first above 0.
    pub speeds: Vec<f64>,
    /// One-sided power density in full scale squared per hertz, `[K * bins]`, row by row.
    pub psd: Vec<f32>,
    /// Spacing of the bins in hertz; bin 0 is DC, the last is Nyquist.
    pub df: f64,
    /// Sample rate of the source in hertz.
    pub fs: f64,
    /// Subtracted noise floor, `[bins]`, or empty.
    pub floor: Vec<f32>,
    /// Clips averaged per speed, `[K]`.
    pub clips: Vec<u32>,
    /// Numbers of clips that were not used.
    pub rejected: Rejections,
    /// Processing of the spectra.
    pub conventions: Conventions,
    /// Recordings that the spectra were made from.
    pub sources: Vec<Source>,
}

/// Reasons why a friction model cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// Another version of the format.
    #[error("friction model has version {found}; version {MODEL_VERSION} is needed: build it again")]
    Version {
        /// Version found.
        found: u32,
    },
    /// Fewer than two speeds.
    #[error("friction model has {found} speed(s); at least 2 are needed to interpolate")]
    TooFewSpeeds {
        /// Number of speeds.
        found: usize,
    },
    /// A speed that is not above the previous one, or not above 0.
    #[error(
        "speed {index} is {found} m/s; it must be finite and above {above} m/s: speeds are above 0 and strictly increasing"
    )]
    Speed {
        /// Index of the speed.
        index: usize,
        /// Its value.
        found: f64,
        /// Exclusive lower limit.
        above: f64,
    },
    /// A frequency grid that does not fit the rate.
    #[error(
        "{bins} bins of {df} Hz do not span 0 to half the rate of {fs} Hz: `df * (bins - 1)` must be `fs / 2`"
    )]
    Grid {
        /// Bins per speed.
        bins: usize,
        /// Spacing in hertz.
        df: f64,
        /// Sample rate in hertz.
        fs: f64,
    },
    /// A field of the wrong length.
    #[error("`{field}` holds {found} values; {expected} are needed")]
    Length {
        /// Name of the field.
        field: &'static str,
        /// Values found.
        found: usize,
        /// Values needed.
        expected: usize,
    },
    /// A density that is negative or not finite.
    #[error("power density of speed {speed}, bin {bin} is {found}; densities are finite and not negative")]
    Density {
        /// Index of the speed.
        speed: usize,
        /// Index of the bin.
        bin: usize,
        /// Its value.
        found: f32,
    },
    /// A rate or clip length that cannot be resampled to.
    #[error(
        "cannot resample a friction model to clips of {clip_samples} samples at {fs} Hz: an even number from 2 to {MAX_CLIP_SAMPLES} samples and a finite rate above 0 are needed"
    )]
    Target {
        /// Requested samples per clip.
        clip_samples: usize,
        /// Requested rate in hertz.
        fs: f64,
    },
}

/// Refuses clip lengths and rates that spectra cannot be made for.
pub(crate) fn check_target(fs: f64, clip_samples: usize) -> Result<(), ModelError> {
    let length_fits = (2..=MAX_CLIP_SAMPLES).contains(&clip_samples) && clip_samples.is_multiple_of(2);
    if length_fits && fs.is_finite() && fs > 0.0 {
        Ok(())
    } else {
        Err(ModelError::Target { clip_samples, fs })
    }
}

impl FrictionModel {
    /// Creates a model from given densities. `psd` holds one row of bins from 0 to `fs / 2` per speed.
    ///
    /// # Errors
    /// As [`validate`](Self::validate).
    pub fn from_psd(
        material_pair: [String; 2],
        speeds: Vec<f64>,
        psd: Vec<f32>,
        fs: f64,
    ) -> Result<Self, ModelError> {
        let bins = psd.len() / speeds.len().max(1);
        let model = Self {
            version: MODEL_VERSION,
            material_pair,
            clips: vec![1; speeds.len()],
            speeds,
            psd,
            df: 0.5 * fs / bins.saturating_sub(1) as f64,
            fs,
            floor: Vec::new(),
            rejected: Rejections::default(),
            conventions: Conventions {
                origin: Origin::Given,
                clip_samples: 2 * bins.saturating_sub(1) as u32,
                hop: 0.0,
                high_pass: 0.0,
                floor_subtracted: false,
                contact_area: 1e-4,
            },
            sources: Vec::new(),
        };
        model.validate()?;
        Ok(model)
    }

    /// Checks all fields.
    ///
    /// # Errors
    /// Names the first wrong field, its value and the values it can have.
    pub fn validate(&self) -> Result<(), ModelError> {
        if self.version != MODEL_VERSION {
            return Err(ModelError::Version { found: self.version });
        }
        let speeds = self.speeds.len();
        if speeds < 2 {
            return Err(ModelError::TooFewSpeeds { found: speeds });
        }
        let mut above = 0.0;
        for (index, &found) in self.speeds.iter().enumerate() {
            if !(found.is_finite() && found > above) {
                return Err(ModelError::Speed { index, found, above });
            }
            above = found;
        }
        let bins = self.bins();
        if self.psd.len() != bins * speeds {
            return Err(ModelError::Length { field: "psd", found: self.psd.len(), expected: bins * speeds });
        }
        let highest = self.df * bins.saturating_sub(1) as f64;
        let fits = (highest - 0.5 * self.fs).abs() <= 1e-6 * self.fs;
        let count_fits = (2..=MAX_CLIP_SAMPLES / 2 + 1).contains(&bins);
        if !(count_fits && self.df > 0.0 && self.fs.is_finite() && fits) {
            return Err(ModelError::Grid { bins, df: self.df, fs: self.fs });
        }
        if self.clips.len() != speeds {
            return Err(ModelError::Length { field: "clips", found: self.clips.len(), expected: speeds });
        }
        if !(self.floor.is_empty() || self.floor.len() == bins) {
            return Err(ModelError::Length { field: "floor", found: self.floor.len(), expected: bins });
        }
        match self.psd.iter().position(|s| !(s.is_finite() && *s >= 0.0)) {
            Some(i) => Err(ModelError::Density { speed: i / bins, bin: i % bins, found: self.psd[i] }),
            None => Ok(()),
        }
    }

    /// Returns the number of bins per speed, `N/2 + 1`.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.psd.len() / self.speeds.len().max(1)
    }

    /// Returns the power density at measured speed `k`.
    #[must_use]
    pub fn row(&self, k: usize) -> &[f32] {
        self.psd.chunks_exact(self.bins().max(1)).nth(k).unwrap_or_default()
    }

    /// Returns the slowest and the fastest measured speed.
    #[must_use]
    pub fn speed_range(&self) -> (f64, f64) {
        (self.speeds.first().copied().unwrap_or(0.0), self.speeds.last().copied().unwrap_or(0.0))
    }

    /// Returns the mean square of the sound at measured speed `k`.
    #[must_use]
    pub fn row_power(&self, k: usize) -> f64 {
        self.row(k).iter().map(|&s| f64::from(s)).sum::<f64>() * self.df
    }

    /// Returns the mean square of the sound at any speed, with [`Gain::Rms`](super::Gain::Rms).
    ///
    /// It is linear between measured speeds, proportional to `s^4` below the slowest, and constant above the fastest.
    ///
    /// # Complexity
    /// O(bins + log K).
    #[must_use]
    pub fn power(&self, speed: f64) -> f64 {
        match Bracket::of(&self.speeds, speed) {
            Bracket::AtRest => 0.0,
            Bracket::Below { ratio } => self.row_power(0) * ratio.powi(4),
            Bracket::Between { low, alpha } => {
                (1.0 - alpha) * self.row_power(low) + alpha * self.row_power(low + 1)
            }
            Bracket::Above => self.row_power(self.speeds.len() - 1),
        }
    }
    /// Returns the model on the bins of another rate and clip length, zero above the source's Nyquist frequency.
    ///
    /// # Errors
    /// When the model is invalid, or the rate or clip length cannot be used.
    ///
    /// # Complexity
    /// O(K (bins + clip_samples)).
    pub fn resampled(&self, fs: f64, clip_samples: usize) -> Result<Self, ModelError> {
        self.validate()?;
        check_target(fs, clip_samples)?;
        let (bins, df) = (clip_samples / 2 + 1, fs / clip_samples as f64);
        let resample_row = |row: &[f32]| {
            let power: Vec<f64> = row.iter().map(|&s| f64::from(s) * self.df).collect();
            let mut out = vec![0.0; bins];
            rebin(&power, self.df, &mut out, df);
            out.into_iter().map(move |p| (p / df) as f32)
        };
        Ok(Self {
            psd: (0..self.speeds.len()).flat_map(|k| resample_row(self.row(k))).collect(),
            floor: if self.floor.is_empty() { Vec::new() } else { resample_row(&self.floor).collect() },
            df,
            fs,
            conventions: Conventions { clip_samples: clip_samples as u32, ..self.conventions.clone() },
            ..self.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> FrictionModel {
        let pair = ["cotton".to_owned(), "floor".to_owned()];
        FrictionModel::from_psd(pair, vec![0.1, 0.2], vec![0.0, 1.0, 2.0, 1.0, 0.0, 4.0, 4.0, 2.0], 600.0)
            .unwrap()
    }

    #[test]
    fn power_is_linear_between_speeds_quartic_below_and_constant_above() {
        let m = model();
        assert_eq!((m.df, m.bins()), (100.0, 4));
        assert!((m.power(0.15) - 700.0).abs() < 1e-9);
        assert!((m.power(0.05) - 400.0 / 16.0).abs() < 1e-9);
        assert_eq!((m.power(0.0), m.power(5.0), m.power(0.2)), (0.0, 1000.0, 1000.0));
    }

    #[test]
    fn serialisation_preserves_a_model() {
        let m = model();
        let bytes = postcard::to_allocvec(&m).unwrap();
        assert_eq!(postcard::from_bytes::<FrictionModel>(&bytes).unwrap(), m);
        let json = serde_json::to_string(&m).unwrap();
        assert_eq!(serde_json::from_str::<FrictionModel>(&json).unwrap(), m);
    }

    #[test]
    fn a_finer_grid_and_a_higher_rate_preserve_the_power() {
        let m = model();
        let fine = m.resampled(1200.0, 100).unwrap();
        assert_eq!((fine.bins(), fine.df), (51, 12.0));
        for k in 0..2 {
            assert!((fine.row_power(k) / m.row_power(k) - 1.0).abs() < 1e-6);
            assert!(fine.row(k)[26..].iter().all(|&s| s == 0.0), "nothing above 300 Hz");
        }
        assert_eq!(m.resampled(600.0, 6).unwrap(), m);
    }

    #[test]
    fn a_lower_rate_drops_the_power_above_its_nyquist_frequency() {
        let low = model().resampled(400.0, 4).unwrap();
        assert!((low.row_power(0) - 200.0).abs() < 1e-3, "{}", low.row_power(0));
    }

    #[test]
    fn errors_name_the_field_and_the_index() {
        let mut m = model();
        m.speeds[1] = 0.1;
        let error = m.validate().unwrap_err();
        assert_eq!(error, ModelError::Speed { index: 1, found: 0.1, above: 0.1 });
        assert!(error.to_string().contains("speed 1 is 0.1 m/s"));
        let mut m = model();
        m.psd[5] = f32::NAN;
        assert!(matches!(m.validate(), Err(ModelError::Density { speed: 1, bin: 1, .. })));
        let mut m = model();
        m.psd.pop();
        assert!(matches!(m.validate(), Err(ModelError::Length { field: "psd", .. })));
        let m = FrictionModel { version: 9, ..model() };
        assert_eq!(m.validate(), Err(ModelError::Version { found: 9 }));
        let m = FrictionModel { df: 10.0, ..model() };
        assert!(matches!(m.validate(), Err(ModelError::Grid { .. })));
        let m = FrictionModel { speeds: vec![1.0], ..model() };
        assert_eq!(m.validate(), Err(ModelError::TooFewSpeeds { found: 1 }));
        assert!(matches!(model().resampled(48000.0, 7), Err(ModelError::Target { .. })));
    }

    #[test]
    fn conventions_that_differ_have_different_hashes() {
        let a = model().conventions;
        let b = Conventions { high_pass: 20.0, ..a.clone() };
        assert_ne!(a.hash(), b.hash());
        assert_eq!(a.hash(), a.clone().hash());
        let text = serde_json::to_string(&a).unwrap();
        assert_eq!(serde_json::from_str::<Conventions>(&text).unwrap(), a);
        let changed = text.replace("\"high_pass\":0.0", "\"high_pass\":20.0");
        assert_ne!(changed, text);
        let refused = serde_json::from_str::<Conventions>(&changed).unwrap_err().to_string();
        assert!(refused.contains("changed by hand"), "{refused}");
        let bare = text.split(",\"hash\"").next().unwrap().to_owned() + "}";
        assert_eq!(serde_json::from_str::<Conventions>(&bare).unwrap(), a);
    }
}
