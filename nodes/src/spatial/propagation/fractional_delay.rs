//! A delay line read at fractional delays.

use crate::impl_state;

/// The last samples of a signal, read at any delay by 4-point Lagrange interpolation.
///
/// # Source
/// Laakso, Valimaki, Karjalainen and Laine, "Splitting the Unit Delay" (IEEE SPM 13(1), 1996), section 3.
#[derive(Clone, Debug)]
pub(crate) struct FractionalDelayLine {
    samples: Vec<f32>,
    /// Index of the newest sample.
    newest: usize,
}
impl_state!(FractionalDelayLine { samples, newest });

impl FractionalDelayLine {
    /// Creates a silent line for delays from 1 to `max_delay` samples.
    pub fn new(max_delay: f64) -> Self {
        let needed = max_delay.max(1.0).ceil() as usize + 4;
        Self { samples: vec![0.0; needed.next_power_of_two()], newest: 0 }
    }

    #[inline]
    fn mask(&self) -> usize {
        self.samples.len() - 1
    }

    /// Appends a sample.
    #[inline]
    pub fn push(&mut self, x: f32) {
        self.newest = (self.newest + 1) & self.mask();
        self.samples[self.newest] = x;
    }

    /// Returns the sample `delay` samples before the newest.
    #[inline]
    pub fn sample(&self, delay: usize) -> f32 {
        self.samples[self.newest.wrapping_sub(delay) & self.mask()]
    }

    /// Returns the signal `delay` samples before the newest. The delay is clamped to at least 1, since the cubic needs a later sample, and
    /// to the maximum.
    #[inline]
    pub fn read(&self, delay: f64) -> f32 {
        let max_delay = self.samples.len() as f64 - 4.0;
        // Not `clamp`, which would let NaN through.
        let delay = delay.max(1.0).min(max_delay);
        let whole = delay as usize;
        let fraction = (delay - whole as f64) as f32;
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| self.sample(whole - 1 + k));
        let [wa, wb, wc, wd] = lagrange(fraction);
        wa * a + wb * b + wc * c + wd * d
    }
}

/// Returns the weights of four samples, newest first, for a delay at a fraction `f` between the second and the third.
#[inline]
pub(crate) fn lagrange(f: f32) -> [f32; 4] {
    // Common factors of the weights.
    let (p, m, n) = (f + 1.0, f - 1.0, f - 2.0);
    let (mn, pf) = (m * n, p * f);
    [-f * mn / 6.0, p * mn / 2.0, -(pf * n / 2.0), pf * m / 6.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_read_exactly_between_samples() {
        let cubic = |t: f64| 1.0 + 0.1 * t - 0.02 * t * t + 0.001 * t * t * t;
        let mut line = FractionalDelayLine::new(20.0);
        (0..100).for_each(|n| line.push(cubic(f64::from(n)) as f32));
        for delay in [1.0, 1.25, 2.5, 7.999, 13.0, 20.0] {
            let (found, expected) = (f64::from(line.read(delay)), cubic(99.0 - delay));
            assert!((found / expected - 1.0).abs() < 1e-6, "{delay}: {found} {expected}");
        }
        assert_eq!(line.read(1.0), line.sample(1));
    }

    #[test]
    fn delays_out_of_range_are_clamped() {
        let mut line = FractionalDelayLine::new(3.0);
        (0..50).for_each(|n| line.push(n as f32));
        assert_eq!(line.read(-5.0), 48.0);
        assert!(line.read(1e9).is_finite() && line.read(f64::NAN).is_finite());
    }
}
