//! Bands of a spectrum that overlap by half and together count every bin once.

use crate::feature::MelScale;

/// Triangular bands, equally spaced on the mel scale from 0 to half the sample rate; the weights of each bin add up to 1.
///
/// A bin lies between the centres of two adjacent bands, on which its power is distributed; a value per band is interpolated at it.
#[derive(Clone, Debug)]
pub(super) struct MelBands {
    count: usize,
    /// Per bin: the band below it, and its distance from the centre of this band, of 1 to the next.
    bins: Vec<(usize, f64)>,
}

impl MelBands {
    /// Bands at most `width` mel apart, of the bins of a transform of `length` samples.
    pub fn new(rate: f64, length: usize, width: f64) -> Self {
        let scale = MelScale::Htk;
        let top = scale.mel(rate / 2.0);
        let steps = (top / width).ceil().max(1.0);
        let bin = |k: usize| {
            let along = scale.mel(k as f64 * rate / length as f64) / top * steps;
            let below = along.floor().clamp(0.0, steps - 1.0);
            (below as usize, (along - below).clamp(0.0, 1.0))
        };
        Self { count: steps as usize + 1, bins: (0..=length / 2).map(bin).collect() }
    }

    /// Returns the number of bands.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Writes the weighted sum of a value per bin in each band.
    pub fn sums(&self, of_bin: impl Fn(usize) -> f64, out: &mut [f64]) {
        out.fill(0.0);
        for (k, &(band, along)) in self.bins.iter().enumerate() {
            let value = of_bin(k);
            out[band] += (1.0 - along) * value;
            out[band + 1] += along * value;
        }
    }

    /// Interpolates a value per band at a bin.
    pub fn interpolated(&self, bin: usize, values: &[f64]) -> f64 {
        let (band, along) = self.bins[bin];
        (1.0 - along) * values[band] + along * values[band + 1]
    }

    /// Returns the two bands of a bin with their weights.
    pub fn weights(&self, bin: usize) -> [(usize, f64); 2] {
        let (band, along) = self.bins[bin];
        [(band, 1.0 - along), (band + 1, along)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bin_counts_once_and_a_constant_is_interpolated_exactly() {
        for (rate, length) in [(48_000.0, 1024), (44_100.0, 1024), (100.0, 16)] {
            let bands = MelBands::new(rate, length, 130.0);
            let mut sums = vec![0.0; bands.len()];
            bands.sums(|k| 1.0 + k as f64, &mut sums);
            let total: f64 = (0..=length / 2).map(|k| 1.0 + k as f64).sum();
            assert!((sums.iter().sum::<f64>() - total).abs() < 1e-9 * total);
            let constant = vec![3.0; bands.len()];
            assert!((0..=length / 2).all(|k| (bands.interpolated(k, &constant) - 3.0).abs() < 1e-12));
        }
    }

    #[test]
    fn a_band_is_no_wider_than_half_an_octave_above_the_lowest_ones() {
        let bands = MelBands::new(48_000.0, 1024, 130.0);
        let mut centres = vec![0.0; bands.len()];
        for k in 0..=512 {
            for (band, weight) in bands.weights(k) {
                if weight > 0.5 {
                    centres[band] = k as f64 * 46.875;
                }
            }
        }
        assert!((30..=34).contains(&bands.len()), "{}", bands.len());
        assert!(centres.windows(2).skip(4).all(|c| c[1] / c[0] < 1.42), "{centres:?}");
    }
}
