//! The file of correlation patterns.

use super::patterns::{
    CorrelationPatterns, PATTERNS_VERSION, Pattern, PatternError, Peak, gain_of_steps, gain_steps,
};
use crate::artefact::sealed::{seal, unseal};
use crate::artefact::value_file::Artefact;
use crate::core::node::Summary;
use serde::{Deserialize, Serialize};

/// The first bytes of a file of patterns.
const MAGIC: &[u8] = b"foley:FPAT\n";

/// Patterns whose peaks are small integers, each of one to three bytes.
#[derive(Serialize, Deserialize)]
struct Stored {
    rate: f64,
    dictionary: String,
    patterns: Vec<StoredPattern>,
}

#[derive(Serialize, Deserialize)]
struct StoredPattern {
    /// All but its peaks.
    about: Pattern,
    /// For each peak: samples since the one before, twice the grain plus 1 if it is negative, correlation in 1/255, gain in 1/256 dB.
    peaks: Vec<(u32, u64, u8, i16)>,
}

impl CorrelationPatterns {
    /// The patterns as one file: a signature, the version, a digest, and the fields.
    ///
    /// # Errors
    /// When they cannot be encoded.
    pub fn to_bytes(&self) -> Result<Vec<u8>, String> {
        let stored = |pattern: &Pattern| {
            let mut last = 0;
            let peak = |peak: &Peak| {
                let since = peak.t.wrapping_sub(last);
                last = peak.t;
                let grain = 2 * u64::from(peak.grain) + u64::from(peak.negative);
                (since, grain, (peak.correlation * 255.0).round() as u8, gain_steps(peak.gain.into()))
            };
            let peaks = pattern.peaks.iter().map(peak).collect();
            StoredPattern { about: Pattern { peaks: Vec::new(), ..pattern.clone() }, peaks }
        };
        let all = Stored {
            rate: self.rate,
            dictionary: self.dictionary.clone(),
            patterns: self.patterns.iter().map(stored).collect(),
        };
        let body = postcard::to_allocvec(&all).map_err(|e| e.to_string())?;
        Ok(seal(MAGIC, self.version, &body))
    }

    /// The patterns in such a file.
    ///
    /// # Errors
    /// Other files, other versions, damage.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let other = |found| PatternError::Version { found };
        let body = unseal((MAGIC, PATTERNS_VERSION), "correlation patterns", bytes, other)?;
        let all: Stored = postcard::from_bytes(body).map_err(|e| format!("the patterns are damaged: {e}"))?;
        let pattern = |stored: StoredPattern| {
            let mut t = 0_u32;
            let peak = |(since, grain, correlation, gain): (u32, u64, u8, i16)| {
                t = t.wrapping_add(since);
                Peak {
                    t,
                    grain: u32::try_from(grain / 2).unwrap_or(u32::MAX),
                    correlation: f32::from(correlation) / 255.0,
                    gain: gain_of_steps(gain),
                    negative: grain % 2 == 1,
                }
            };
            let peaks = stored.peaks.into_iter().map(peak).collect();
            Pattern { peaks, ..stored.about }
        };
        let patterns = Self {
            version: PATTERNS_VERSION,
            rate: all.rate,
            dictionary: all.dictionary,
            patterns: all.patterns.into_iter().map(pattern).collect(),
        };
        patterns.check_order().map_err(|e| e.to_string())?;
        Ok(patterns)
    }
}

impl Artefact for CorrelationPatterns {
    const CODE: &'static str = "F151";
    const HELP: Option<&'static str> = Some("write one with --tap patterns=FILE.bin");
    const MAGIC: &'static [u8] = MAGIC;

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        Self::from_bytes(bytes)
    }

    fn summary(&self) -> Summary {
        self.summary()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::random::Rng;

    #[test]
    fn files_return_the_same_patterns_in_seven_bytes_a_peak() {
        let mut patterns = CorrelationPatterns::trial(&mut Rng::new(3));
        patterns.patterns[0].peaks[3].negative = true;
        let bytes = patterns.to_bytes().unwrap();
        assert_eq!(CorrelationPatterns::from_bytes(&bytes).unwrap(), patterns);
        let without = CorrelationPatterns {
            patterns: patterns.patterns.iter().map(|p| Pattern { peaks: Vec::new(), ..p.clone() }).collect(),
            ..patterns.clone()
        };
        let peaks: usize = patterns.patterns.iter().map(|p| p.peaks.len()).sum();
        let per_peak = (bytes.len() - without.to_bytes().unwrap().len()) as f64 / peaks as f64;
        assert!(per_peak <= 7.5, "{per_peak}");
    }

    #[test]
    fn damaged_cut_and_foreign_files_are_refused() {
        let bytes = CorrelationPatterns::trial(&mut Rng::new(4)).to_bytes().unwrap();
        let error = |bytes: &[u8]| CorrelationPatterns::from_bytes(bytes).unwrap_err();
        assert!(error(b"RIFF").contains("no file of correlation patterns"));
        assert!(error(&bytes[..bytes.len() - 1]).contains("digest"));
        let mut version = bytes;
        version[MAGIC.len()] = 9;
        assert!(error(&version).contains("version 9"));
    }
}
