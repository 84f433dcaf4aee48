//! The recordings that a sound is compared with.

use crate::core::time::Rate;
use crate::dsp::{DspError, Quality, Resampler};

/// Shortest recording that is split into parts, s.
const LONG_ENOUGH: f64 = 1.0;

/// One channel of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Take {
    /// Its name.
    pub name: String,
    /// Its own rate in Hz: nothing above half of it is compared.
    pub rate: f64,
    /// Samples at the rate of the sound.
    pub samples: Vec<f32>,
}

impl Take {
    /// A recording at any rate, resampled to that of a sound.
    ///
    /// # Errors
    /// A ratio of rates that cannot be resampled.
    pub fn resampled(name: &str, samples: Vec<f32>, from: Rate, to: Rate) -> Result<Self, DspError> {
        let samples =
            if from == to { samples } else { Resampler::new(from, to, Quality::High)?.whole(&samples)? };
        Ok(Self { name: name.into(), rate: from.as_f64(), samples })
    }

    /// The two halves and the four quarters of a recording, in place of takes; none of one that is shorter than a second.
    pub(super) fn parts(&self, rate: f64) -> Vec<Self> {
        let n = self.samples.len();
        if (n as f64) < LONG_ENOUGH * rate {
            return Vec::new();
        }
        let part = |name: &str, k: usize, of: usize| Self {
            name: format!("{name} {} of {}", k + 1, self.name),
            rate: self.rate,
            samples: self.samples[k * n / of..(k + 1) * n / of].to_vec(),
        };
        let quarters = (0..4).map(|k| part("quarter", k, 4));
        (0..2).map(|k| part("half", k, 2)).chain(quarters).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_long_recording_has_six_parts() {
        let take = Take { name: "a.wav".into(), rate: 100.0, samples: vec![0.0; 402] };
        let parts = take.parts(100.0);
        assert_eq!(parts.iter().map(|p| p.samples.len()).collect::<Vec<_>>(), [201, 201, 100, 101, 100, 101]);
        assert_eq!(parts[5].name, "quarter 4 of a.wav");
        assert!(take.parts(1000.0).is_empty());
    }

    #[test]
    fn a_take_at_another_rate_is_resampled() {
        let take = Take::resampled("a", vec![0.5; 441], Rate::hz(44_100), Rate::hz(48_000)).unwrap();
        assert_eq!((take.samples.len(), take.rate), (480, 44_100.0));
    }
}
