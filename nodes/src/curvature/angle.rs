//! Angles from 0 to pi by vector instructions.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use fearless_simd::{Level, dispatch};

/// Computes `atan2(y, x)` for `y` of 0 or more, within 2 units in the last place; NaN where both are 0.
///
/// # Source
/// Moshier, *Methods and Programs for Mathematical Functions* (1989): one rational function for angles up to pi / 8.
pub(super) fn angles<const N: usize>(level: Level, y: &[f64; N], x: &[f64; N]) -> [f64; N] {
    let mut out = [0.0; N];
    dispatch!(level, simd => {
        let _ = simd;
        for ((out, y), x) in out.iter_mut().zip(y).zip(x) {
            *out = angle(*y, *x);
        }
    });
    out
}

/// Numerator, from the highest power of the squared tangent to the lowest.
const P: [f64; 5] = [
    -0.875_060_860_003_190_4,
    -16.157_537_187_333_652,
    -75.008_557_923_147_05,
    -122.886_668_449_013_62,
    -64.850_219_049_420_25,
];
/// Denominator, whose highest power has the factor 1.
const Q: [f64; 5] = [
    24.858_464_901_423_062,
    165.027_009_831_698_85,
    432.881_060_491_290_27,
    485.390_399_635_913_7,
    194.550_657_148_261_4,
];

// Without branches, so that the compiler can vectorise it.
#[inline(always)]
fn angle(y: f64, x: f64) -> f64 {
    let a = x.abs();
    let above_diagonal = y > a;
    let (low, high) = if above_diagonal { (a, y) } else { (y, a) };
    let near_diagonal = low > 0.66 * high;
    // Near the diagonal the angle relative to pi / 4.
    let (rise, run) = if near_diagonal { (low - high, low + high) } else { (low, high) };
    let t = rise / run;
    let z = t * t;
    let numerator = (((P[0] * z + P[1]) * z + P[2]) * z + P[3]) * z + P[4];
    let denominator = ((((z + Q[0]) * z + Q[1]) * z + Q[2]) * z + Q[3]) * z + Q[4];
    let angle = t + t * (z * numerator / denominator);
    let angle = if near_diagonal { FRAC_PI_4 + angle } else { angle };
    let angle = if above_diagonal { FRAC_PI_2 - angle } else { angle };
    if x < 0.0 { PI - angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn angles_are_those_of_the_standard_library() {
        let mut rng = Rng::new(3);
        for _ in 0..2000 {
            let size = 10_f64.powf(rng.between(-30.0, 30.0));
            let mut y = [(); 8].map(|()| size * rng.between(1e-9, 1.0));
            let mut x = [(); 8].map(|()| size * rng.between(-1.0, 1.0));
            (x[0], x[1], y[2], y[3]) = (0.0, -y[1], 1e-12 * size, x[3].abs());
            (y[4], x[4]) = (0.66 * size, size);
            for ((found, y), x) in angles(Level::new(), &y, &x).into_iter().zip(y).zip(x) {
                assert!((found - y.atan2(x)).abs() <= 1e-15, "{found} for {y} : {x}");
            }
        }
        let found = angles(Level::new(), &[0.0, 0.0, 0.0], &[1.0, -1.0, 0.0]);
        assert!(found[0] == 0.0 && found[1] == PI && found[2].is_nan(), "{found:?}");
    }
}
