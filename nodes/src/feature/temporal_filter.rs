//! A Gaussian filter over time with a separate width for each dimension.

/// Taps of one dimension, from the earliest to the latest item.
#[derive(Clone, Debug, PartialEq)]
struct Taps {
    look_behind: usize,
    look_ahead: usize,
    weights: Vec<f64>,
}

impl Taps {
    /// Creates the taps: the standard deviation is a quarter of the width; the kernel is truncated at half the width.
    fn new(width: f64, causal: bool) -> Self {
        if width <= 1.0 {
            return Self { look_behind: 0, look_ahead: 0, weights: vec![1.0] };
        }
        let (sigma, radius) = (width / 4.0, (width / 2.0 + 0.5).floor() as usize);
        let look_ahead = if causal { 0 } else { radius };
        let weight = |k: usize| (-0.5 * ((k as f64 - radius as f64) / sigma).powi(2)).exp();
        let weights: Vec<f64> = (0..=radius + look_ahead).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        Self { look_behind: radius, look_ahead, weights: weights.iter().map(|w| w / sum).collect() }
    }
}

/// Filters vectors over time by a normalised Gaussian of standard deviation `width / 4`, truncated at `width / 2`, per dimension.
///
/// The causal form is the half without look-ahead; it lags by 0.18 widths.
///
/// # Shapes
/// Items are `vectors` vectors with one dimension for each width.
///
/// # Source
/// An, James and Marschner (SIGGRAPH 2012), section 4.2. The symmetric form equals
/// `scipy.ndimage.gaussian_filter1d(x, width / 4, truncate=2.0, mode='nearest')`.
#[derive(Clone, Debug, PartialEq)]
pub struct TemporalFilter {
    taps: Vec<Taps>,
    look_behind: usize,
    look_ahead: usize,
}

impl TemporalFilter {
    /// Creates a filter with one width per dimension, in units; widths of up to 1 leave their dimension unchanged.
    #[must_use]
    pub fn new(widths: &[f64], causal: bool) -> Self {
        let taps: Vec<Taps> = widths.iter().map(|&width| Taps::new(width, causal)).collect();
        let look_behind = taps.iter().map(|t| t.look_behind).max().unwrap_or(0);
        let look_ahead = taps.iter().map(|t| t.look_ahead).max().unwrap_or(0);
        Self { taps, look_behind, look_ahead }
    }

    /// Returns the number of earlier items on which an item depends.
    #[must_use]
    pub fn look_behind(&self) -> usize {
        self.look_behind
    }

    /// Returns the number of later items on which an item depends.
    #[must_use]
    pub fn look_ahead(&self) -> usize {
        self.look_ahead
    }

    /// Filters the items of `around` that have `look_behind` items before and `look_ahead` items after them.
    ///
    /// # Shapes
    /// `around`: `[look_behind + len + look_ahead, vectors, dims]`; `out`: `[len, vectors, dims]`.
    pub fn process(&self, around: &[f32], vectors: usize, out: &mut [f32]) {
        let dims = self.taps.len();
        let width = (vectors * dims).max(1);
        for (i, item) in out.chunks_exact_mut(width).enumerate() {
            for (index, out) in item.iter_mut().enumerate() {
                let taps = &self.taps[index % dims];
                let first = (i + self.look_behind - taps.look_behind) * width + index;
                let values = around.iter().skip(first).step_by(width);
                *out = values.zip(&taps.weights).map(|(&x, w)| f64::from(x) * w).sum::<f64>() as f32;
            }
        }
    }

    /// Filters one segment without gaps. The first and the last item are repeated beyond its ends.
    ///
    /// # Shapes
    /// `items` and the result: `[len, dims]`.
    #[must_use]
    pub fn process_segment(&self, items: &[f32]) -> Vec<f32> {
        let dims = self.taps.len().max(1);
        let (Some(first), Some(last)) = (items.get(..dims), items.len().checked_sub(dims)) else {
            return Vec::new();
        };
        let mut around = first.repeat(self.look_behind);
        around.extend_from_slice(items);
        around.extend(items[last..].repeat(self.look_ahead));
        let mut out = vec![0.0; items.len()];
        self.process(&around, 1, &mut out);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use proptest::prelude::*;

    #[test]
    fn widths_have_the_taps_of_the_paper() {
        for (width, taps) in [(10.0, 11), (20.0, 21), (30.0, 31), (50.0, 51), (1.0, 1), (0.0, 1)] {
            assert_eq!(Taps::new(width, false).weights.len(), taps);
        }
    }

    /// `gaussian_filter1d([0, 0, 1, 0, 2, 5, -1, 3], w / 4, truncate=2.0, mode='nearest')` for w = 4 and 10.
    #[test]
    fn the_filter_equals_the_reference_including_the_edges() {
        let x = [0.0, 0.0, 1.0, 0.0, 2.0, 5.0, -1.0, 3.0];
        for (width, expected) in [(4.0, REFERENCE_4), (10.0, REFERENCE_10)] {
            let found = TemporalFilter::new(&[width], false).process_segment(&x);
            for (f, w) in found.iter().zip(expected) {
                assert!((f64::from(*f) - w).abs() < 1e-6, "{width}: {found:?}");
            }
        }
    }

    const REFERENCE_4: [f64; 8] = [
        0.05448868454964294,
        0.24420134200323332,
        0.5115973159935333,
        1.0050474487579146,
        2.0262466038046614,
        2.4207671301233993,
        1.823434211879834,
        2.1321720010863525,
    ];
    const REFERENCE_10: [f64; 8] = [
        0.3211953719988713,
        0.5167380765918699,
        0.8221361545014112,
        1.1729328154567773,
        1.527511333295526,
        1.850975015753078,
        2.1306042889144026,
        2.371726516640441,
    ];

    /// Some taps of the first half of `scipy.ndimage._filters._gaussian_kernel1d(w / 4, 0, radius)`.
    #[test]
    fn taps_are_those_of_scipy_to_the_last_digit() {
        let (ten, fifty) = (Taps::new(10.0, false).weights, Taps::new(50.0, false).weights);
        let found = [ten[0], ten[3], fifty[0], fifty[9], fifty[18]];
        let expected = [
            0.022190548492442997,
            0.11906462996609925,
            0.004505330132539327,
            0.014673764476065616,
            0.028458906504602907,
        ];
        assert!(found.iter().zip(expected).all(|(f, w)| (f - w).abs() < 2e-16), "{found:?}");
        for taps in [ten, fifty] {
            assert!(taps.iter().eq(taps.iter().rev()) && (taps.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn the_causal_half_lags_by_less_than_a_fifth_of_its_width() {
        let taps = Taps::new(50.0, true);
        let lag: f64 = taps.weights.iter().enumerate().map(|(k, w)| w * (taps.look_behind - k) as f64).sum();
        // The half is truncated at two standard deviations; without truncation it would lag by 0.2 widths.
        assert!((lag / 50.0 - 0.176).abs() < 0.001 && taps.look_ahead == 0, "{lag}");
    }

    proptest! {
        /// Checks several vectors against single dimensions.
        #[test]
        fn dimensions_and_vectors_do_not_mix(seed in 0_u64..1000, len in 1_usize..40) {
            let mut rng = Rng::new(seed);
            let x: Vec<f32> = (0..len * 4).map(|_| rng.between(-1.0, 1.0) as f32).collect();
            let filter = TemporalFilter::new(&[6.0, 0.0], false);
            let single = |index: usize| -> Vec<f32> { x.iter().skip(index).step_by(4).copied().collect() };
            let mut around = x[..4].repeat(filter.look_behind());
            around.extend(&x);
            around.extend(x[x.len() - 4..].repeat(filter.look_ahead()));
            let mut out = vec![0.0; x.len()];
            filter.process(&around, 2, &mut out);
            for index in 0..4 {
                let alone = TemporalFilter::new(&[[6.0, 0.0][index % 2]], false).process_segment(&single(index));
                let found: Vec<f32> = out.iter().skip(index).step_by(4).copied().collect();
                prop_assert_eq!(found, alone);
            }
        }
    }
}
