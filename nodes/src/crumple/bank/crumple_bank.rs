//! A bank of recorded micro-sounds in order of energy.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::extraction::Extraction;
use crate::core::content::{altered_content, content_digest};
use crate::core::time::Rate;
use crate::dsp::{DspError, Quality, Resampler};

/// Version of the format of [`CrumpleBank`].
pub const BANK_VERSION: u32 = 1;

/// Position of a sample in a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Index of the recording.
    pub recording: u32,
    /// Start of the sample in the recording, s.
    pub start: f64,
}

/// A recording that samples were cut out of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recorded {
    /// Subject and author of the recording.
    pub provenance: String,
    /// Licence.
    pub licence: String,
    /// Length, s.
    pub seconds: f64,
    /// Sample rate, Hz.
    pub fs: f64,
    /// Factor that matched its level to that of the loudest recording.
    pub gain: f64,
    /// Peak in each of up to 480 equal parts, for figures.
    pub outline: Vec<f32>,
}

/// Micro-sounds cut out of recordings of crumpling cloth, sorted by energy.
///
/// Sample `k` is `samples[offsets[k]..offsets[k + 1]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrumpleBank {
    /// [`BANK_VERSION`].
    pub version: u32,
    /// Name of the material.
    pub material: String,
    /// Rate of the samples, Hz.
    pub fs: f64,
    /// Concatenated samples, full scale +-1.
    pub samples: Vec<f32>,
    /// Start of each sample, and end of the last.
    pub offsets: Vec<u32>,
    /// Sum of squares of each sample, in full scale^2, ascending. Divided by `fs` it is the integral over time.
    pub energies: Vec<f64>,
    /// Peak of each sample.
    pub peaks: Vec<f32>,
    /// Position of each sample in its recording.
    pub origins: Vec<Origin>,
    /// The recordings.
    pub recordings: Vec<Recorded>,
    /// Parameters of the extraction.
    pub extraction: Extraction,
    /// Digest of version, rate and extraction.
    pub conventions: String,
    /// Digest of all other fields, which detects changes by hand; empty if none was written.
    #[serde(default)]
    pub content: String,
}

/// Reasons why a bank cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BankError {
    /// Another version of the format.
    #[error("`version` is {found}; {BANK_VERSION} is needed: extract the bank again")]
    Version {
        /// Version found.
        found: u32,
    },
    /// No sample.
    #[error("the bank has no sample; at least one is needed")]
    Empty,
    /// A list of the wrong length.
    #[error("`{field}` has {found} entries; {wanted} are needed for {samples} samples")]
    Length {
        /// Name of the field.
        field: &'static str,
        /// Length found.
        found: usize,
        /// Length needed.
        wanted: usize,
        /// Number of samples in the bank.
        samples: usize,
    },
    /// An invalid entry.
    #[error("`{field}` of sample {index} is {found}; {wanted}")]
    Entry {
        /// Name of the field.
        field: &'static str,
        /// Index of the sample.
        index: usize,
        /// Value found.
        found: f64,
        /// Values that it can have.
        wanted: &'static str,
    },
    /// A rate out of range.
    #[error("`fs` is {found} Hz; it must be from 1000 to 768000 Hz")]
    Rate {
        /// Rate found.
        found: f64,
    },
    /// Fields that were changed by hand.
    #[error("`conventions` is {found}, its fields give {wanted}: they were changed after the extraction")]
    Conventions {
        /// Digest in the file.
        found: String,
        /// Digest of the fields.
        wanted: String,
    },
    /// A rate that the samples cannot be resampled to.
    #[error("`fs`: {0}")]
    Resample(DspError),
}

/// A sample that was cut out of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// Samples, full scale +-1.
    pub samples: Vec<f32>,
    /// Position in its recording.
    pub origin: Origin,
}

impl CrumpleBank {
    /// Creates a bank of samples, sorted by energy.
    #[must_use]
    pub fn new(
        material: &str,
        fs: f64,
        cuts: Vec<Cut>,
        recordings: Vec<Recorded>,
        extraction: Extraction,
    ) -> Self {
        let energy = |cut: &Cut| cut.samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let mut cuts: Vec<(f64, Cut)> = cuts.into_iter().map(|cut| (energy(&cut), cut)).collect();
        // The sort is stable: samples of equal energy are in the order of the recordings.
        cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut bank = Self {
            version: BANK_VERSION,
            material: material.to_owned(),
            fs,
            samples: Vec::new(),
            offsets: vec![0],
            energies: Vec::with_capacity(cuts.len()),
            peaks: Vec::with_capacity(cuts.len()),
            origins: Vec::with_capacity(cuts.len()),
            recordings,
            extraction,
            conventions: String::new(),
            content: String::new(),
        };
        for (energy, cut) in cuts {
            bank.samples.extend_from_slice(&cut.samples);
            bank.offsets.push(bank.samples.len() as u32);
            bank.energies.push(energy);
            bank.peaks.push(cut.samples.iter().fold(0.0, |peak: f32, x| peak.max(x.abs())));
            bank.origins.push(cut.origin);
        }
        bank.conventions = bank.digest();
        bank.sealed()
    }

    /// Returns the number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.energies.len()
    }

    /// Returns true if there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.energies.is_empty()
    }

    /// Returns sample `k`, or an empty slice if there is none.
    #[must_use]
    pub fn sample(&self, k: usize) -> &[f32] {
        match (self.offsets.get(k), self.offsets.get(k + 1)) {
            (Some(from), Some(to)) => self.samples.get(*from as usize..*to as usize).unwrap_or_default(),
            _ => &[],
        }
    }

    /// Returns the length of the longest sample, s.
    #[must_use]
    pub fn longest(&self) -> f64 {
        let longest = self.offsets.windows(2).map(|w| w[1].saturating_sub(w[0])).max();
        f64::from(longest.unwrap_or(0)) / self.fs
    }

    /// Returns the digest for `conventions`.
    fn digest(&self) -> String {
        let text = format!("{} {} {:?}", self.version, self.fs, self.extraction);
        blake3::hash(text.as_bytes()).to_hex()[..16].to_owned()
    }

    /// Returns the bank with the digest of its content.
    #[must_use]
    pub fn sealed(self) -> Self {
        let plain = Self { content: String::new(), ..self };
        Self { content: content_digest(&plain, &[]), ..plain }
    }

    /// Returns an error message if the bank differs from its content digest.
    #[must_use]
    pub fn altered(&self) -> Option<String> {
        let wanted = content_digest(&Self { content: String::new(), ..self.clone() }, &[]);
        altered_content(&self.content, &wanted, "extract it")
    }

    /// Returns a digest of the samples, which identifies the bank that an index of a sample belongs to.
    #[must_use]
    pub fn id(&self) -> u32 {
        let mut hasher = blake3::Hasher::new();
        let numbers = self.samples.iter().map(|x| x.to_bits()).chain(self.offsets.iter().copied());
        for x in numbers {
            hasher.update(&x.to_le_bytes());
        }
        let hash = *hasher.finalize().as_bytes();
        u32::from_le_bytes([hash[0], hash[1], hash[2], hash[3]])
    }

    /// Checks all fields.
    ///
    /// # Errors
    /// Names the first wrong field.
    pub fn validate(&self) -> Result<(), BankError> {
        if self.version != BANK_VERSION {
            return Err(BankError::Version { found: self.version });
        }
        if !(1000.0..=768_000.0).contains(&self.fs) {
            return Err(BankError::Rate { found: self.fs });
        }
        let samples = self.len();
        if samples == 0 {
            return Err(BankError::Empty);
        }
        let lengths = [
            ("offsets", self.offsets.len(), samples + 1),
            ("peaks", self.peaks.len(), samples),
            ("origins", self.origins.len(), samples),
        ];
        if let Some((field, found, wanted)) = lengths.into_iter().find(|(_, found, wanted)| found != wanted) {
            return Err(BankError::Length { field, found, wanted, samples });
        }
        for index in 0..samples {
            self.validate_sample(index)?;
        }
        let wanted = self.digest();
        if self.conventions != wanted {
            return Err(BankError::Conventions {
                found: self.conventions.chars().take(40).collect(),
                wanted,
            });
        }
        Ok(())
    }

    fn validate_sample(&self, index: usize) -> Result<(), BankError> {
        let entry = |field, found, wanted| Err(BankError::Entry { field, index, found, wanted });
        let (from, to) = (self.offsets[index], self.offsets[index + 1]);
        if to <= from || to as usize > self.samples.len() {
            return entry("offsets", f64::from(to), "offsets are increasing, up to the number of samples");
        }
        if let Some(x) = self.sample(index).iter().find(|x| !x.is_finite()) {
            return entry("samples", f64::from(*x), "samples are finite");
        }
        let energy = self.energies[index];
        let previous = if index > 0 { self.energies[index - 1] } else { 0.0 };
        if !(energy.is_finite() && energy >= previous) {
            return entry("energies", energy, "energies are finite, not negative and ascending");
        }
        if self.origins[index].recording as usize >= self.recordings.len() {
            return entry(
                "origins",
                f64::from(self.origins[index].recording),
                "it must be the index of a recording",
            );
        }
        Ok(())
    }

    /// Resamples the bank to another rate. Energies are scaled by the ratio of the rates.
    ///
    /// # Errors
    /// When the rate is invalid or too far from that of the bank.
    pub fn resampled(&self, fs: f64) -> Result<Self, BankError> {
        if fs == self.fs {
            return Ok(self.clone());
        }
        let rate = |fs: f64| Rate::from_f64(fs).ok_or(BankError::Rate { found: fs });
        let resampler =
            Resampler::new(rate(self.fs)?, rate(fs)?, Quality::High).map_err(BankError::Resample)?;
        let mut bank = Self { fs, samples: Vec::new(), offsets: vec![0], peaks: Vec::new(), ..self.clone() };
        for k in 0..self.len() {
            let sample = resampler.whole(self.sample(k)).map_err(BankError::Resample)?;
            bank.peaks.push(sample.iter().fold(0.0, |peak: f32, x| peak.max(x.abs())));
            bank.samples.extend(sample);
            bank.offsets.push(bank.samples.len() as u32);
        }
        bank.energies.iter_mut().for_each(|e| *e *= fs / self.fs);
        bank.conventions = bank.digest();
        Ok(bank.sealed())
    }
}

/// Returns a small constant bank, to which the events of trials refer.
pub(crate) fn trial_bank() -> CrumpleBank {
    let click = |n: usize, gain: f32| {
        let sample = |k: usize| gain * (-(k as f32) / 20.0).exp() * (0.9 * k as f32).sin();
        Cut { samples: (0..n).map(sample).collect(), origin: Origin::default() }
    };
    let recordings = vec![Recorded { seconds: 1.0, fs: 8000.0, gain: 1.0, ..Recorded::default() }];
    let cuts = vec![click(40, 0.1), click(70, 0.3), click(110, 0.8)];
    CrumpleBank::new("trial", 8000.0, cuts, recordings, Extraction::default())
}

#[cfg(test)]
impl CrumpleBank {
    /// Creates a bank of one-value samples with these energies.
    pub(crate) fn testing(energies: &[f64]) -> Self {
        let cut = |e: &f64| Cut { samples: vec![e.sqrt() as f32], origin: Origin::default() };
        let mut bank = Self::new(
            "test",
            48_000.0,
            energies.iter().map(cut).collect(),
            vec![Recorded::default()],
            Extraction::default(),
        );
        bank.energies = energies.to_vec();
        bank.sealed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_sorted_by_energy_and_preserved_by_a_file() {
        let cut = |gain: f32| Cut {
            samples: vec![gain, -gain],
            origin: Origin { recording: 0, start: f64::from(gain) },
        };
        let recordings = vec![Recorded::default()];
        let bank = CrumpleBank::new(
            "silk",
            48e3,
            vec![cut(0.5), cut(0.1), cut(0.3)],
            recordings,
            Extraction::default(),
        );
        bank.validate().unwrap();
        assert_eq!((bank.len(), bank.sample(0), bank.sample(2)), (3, &[0.1, -0.1][..], &[0.5, -0.5][..]));
        assert!(bank.sample(3).is_empty() && (bank.energies[2] - 0.5).abs() < 1e-7);
        let json = serde_json::to_string(&bank).unwrap();
        assert_eq!(serde_json::from_str::<CrumpleBank>(&json).unwrap(), bank);
        let bytes = postcard::to_allocvec(&bank).unwrap();
        assert_eq!(postcard::from_bytes::<CrumpleBank>(&bytes).unwrap(), bank);
    }

    #[test]
    fn another_rate_scales_energies_and_lengths() {
        let bank = trial_bank();
        let up = bank.resampled(16_000.0).unwrap();
        up.validate().unwrap();
        assert!((up.longest() / bank.longest() - 1.0).abs() < 0.01);
        for k in 0..3 {
            let sum: f64 = up.sample(k).iter().map(|x| f64::from(*x).powi(2)).sum();
            assert!((sum / up.energies[k] - 1.0).abs() < 0.02, "{sum} {}", up.energies[k]);
            assert!((up.energies[k] / bank.energies[k] - 2.0).abs() < 1e-12);
        }
        assert_eq!(bank.resampled(8000.0).unwrap(), bank);
        assert_ne!(up.id(), bank.id());
        assert!(matches!(bank.resampled(1e9), Err(BankError::Rate { .. } | BankError::Resample(_))));
    }

    #[test]
    fn invalid_fields_are_named() {
        let good = trial_bank();
        let error = |bank: CrumpleBank| bank.validate().unwrap_err().to_string();
        assert!(error(CrumpleBank { version: 2, ..good.clone() }).contains("`version` is 2"));
        assert!(error(CrumpleBank { fs: 0.0, ..good.clone() }).contains("`fs` is 0"));
        assert!(error(CrumpleBank { fs: 44_100.0, ..good.clone() }).contains("`conventions`"));
        assert!(error(CrumpleBank { peaks: vec![], ..good.clone() }).contains("`peaks` has 0 entries; 3"));
        assert!(
            error(CrumpleBank { offsets: vec![0, 40, 30, 220], ..good.clone() })
                .contains("`offsets` of sample 1")
        );
        assert!(
            error(CrumpleBank { energies: vec![2.0, 1.0, 3.0], ..good.clone() })
                .contains("`energies` of sample 1")
        );
        assert!(error(CrumpleBank { recordings: vec![], ..good.clone() }).contains("`origins` of sample 0"));
        let mut broken = good.clone();
        broken.samples[50] = f32::NAN;
        assert!(error(broken).contains("`samples` of sample 1"));
        let none = CrumpleBank { energies: vec![], ..good };
        assert!(error(none).contains("no sample"));
    }
}
