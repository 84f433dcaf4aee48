//! Windows of overlapping synthesis clips.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::choices;

/// Crossfade of clips that overlap by half.
///
/// Clips with random phases add in power, so the squares of two overlapping windows must sum to one. Two triangles
/// sum to 1/2 in the middle of every overlap, which causes 3 dB dips at the clip rate, audible as roughness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Window {
    /// Square root of the triangle: power complementary.
    #[default]
    SqrtTriangle,
    /// Half a sine: power complementary, with a smooth maximum.
    Sine,
    /// Triangle, for comparison.
    Triangle,
}

choices! { @param Window {
    /// Square root of a triangle: the power of overlapping clips is constant.
    SqrtTriangle,
    /// Half a sine: constant power, with a smooth maximum.
    Sine,
    /// Triangle, for comparison: 3 dB dips at the clip rate.
    Triangle,
} }

impl Window {
    /// Returns the value at sample `n` of a clip of `len` samples.
    #[must_use]
    pub fn at(self, n: usize, len: usize) -> f64 {
        let x = (n as f64 + 0.5) / len as f64;
        let triangle = 1.0 - (2.0 * x - 1.0).abs();
        match self {
            Self::SqrtTriangle => triangle.sqrt(),
            Self::Sine => (PI * x).sin(),
            Self::Triangle => triangle,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_complementary_windows_sum_to_one_in_square_at_every_offset() {
        for window in [Window::SqrtTriangle, Window::Sine] {
            for hop in [1, 2, 1103, 1200, 2400] {
                for n in 0..hop {
                    let sum = window.at(n, 2 * hop).powi(2) + window.at(n + hop, 2 * hop).powi(2);
                    assert!((sum - 1.0).abs() < 1e-12, "{window:?} {hop} {n}: {sum}");
                }
            }
        }
    }

    #[test]
    fn a_triangle_pair_dips_to_half_the_power_in_the_middle_of_the_overlap() {
        let sum = |n| Window::Triangle.at(n, 2000).powi(2) + Window::Triangle.at(n + 1000, 2000).powi(2);
        assert!((sum(500) - 0.5).abs() < 1e-3);
        let mean = (0..1000).map(sum).sum::<f64>() / 1000.0;
        assert!((mean - 2.0 / 3.0).abs() < 1e-3);
    }
}
