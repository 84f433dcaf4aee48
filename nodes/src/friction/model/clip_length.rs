//! Lengths of clips, in samples.

/// Maximum length of a clip that spectra are made for.
pub const MAX_CLIP_SAMPLES: usize = 1 << 20;

/// Returns the even number of samples nearest to `seconds` at `fs` hertz, at least 2.
#[must_use]
pub fn clip_samples(seconds: f64, fs: f64) -> usize {
    2 * ((0.5 * seconds * fs).round().max(1.0) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clips_are_even_at_every_rate() {
        let lengths = [44100.0, 48000.0, 96000.0].map(|fs| clip_samples(0.05, fs));
        assert_eq!(lengths, [2206, 2400, 4800]);
    }
}
