//! Tapers of grains.

use crate::choices;

choices! {
    /// Shape of the taper at the ends of a grain.
    pub enum TaperShape {
        /// Raised cosine at half samples: two of them overlapped by their length sum to 1.
        HalfSample,
        /// The usual Tukey window, which is 0 at its ends.
        Symmetric,
    }
}

impl TaperShape {
    /// Value at sample `i` of a rising taper of `len` samples.
    #[must_use]
    pub fn at(self, i: usize, len: usize) -> f64 {
        if i >= len {
            return 1.0;
        }
        let x = match self {
            Self::HalfSample => i as f64 + 0.5,
            Self::Symmetric => i as f64,
        };
        0.5 * (1.0 - (std::f64::consts::PI * x / len as f64).cos())
    }

    /// Window of a grain of `len` samples with tapers at both ends.
    pub fn window(self, len: usize, [start, end]: [usize; 2]) -> impl Iterator<Item = f64> {
        (0..len).map(move |i| self.at(i, start) * self.at(len - 1 - i, end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_sample_tapers_sum_to_1() {
        for len in [1, 3, 30] {
            for i in 0..len {
                let sum = TaperShape::HalfSample.at(i, len) + TaperShape::HalfSample.at(len - 1 - i, len);
                assert!((sum - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_symmetric_window_is_that_of_scipy_up_to_part_of_a_sample() {
        // scipy.signal.windows.tukey(300, 0.02, sym=True) tapers over 0.02 * 299 / 2 samples.
        let width = 0.02 * 299.0 / 2.0;
        let want: Vec<f64> =
            (0..3).map(|i| 0.5 * (1.0 - (std::f64::consts::PI * f64::from(i) / width).cos())).collect();
        let got: Vec<f64> = TaperShape::Symmetric.window(300, [3, 3]).collect();
        // A taper of whole samples differs from that of 2.99 samples by less than a hundredth.
        assert!(got.iter().zip(&want).all(|(a, b)| (a - b).abs() < 0.01), "{:?} {want:?}", &got[..3]);
        assert!(got[0] == 0.0 && got[299] == 0.0 && got[150] == 1.0);
    }
}
