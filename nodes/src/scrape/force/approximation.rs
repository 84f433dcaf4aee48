//! Powers and logarithms in single precision, from sums and products alone.

/// `x^a` for `x >= 0`, to 1e-6; 0 stays 0.
///
/// Consists of sums and products alone: loops over it become vectors, and every machine computes the same bits.
#[inline(always)]
pub(super) fn power(x: f32, a: f32) -> f32 {
    if x > f32::MIN_POSITIVE { exp2(a * log2(x)) } else { 0.0 }
}

/// Logarithm of a normal number above 0.
#[inline(always)]
pub(in crate::scrape) fn log2(x: f32) -> f32 {
    // The mantissa within a factor of sqrt 2 of 1.
    let bits = x.to_bits().wrapping_sub(0x3f35_04f3);
    let exponent = (bits as i32) >> 23;
    let m = f32::from_bits((bits & 0x007f_ffff).wrapping_add(0x3f35_04f3));
    let t = (m - 1.0) / (m + 1.0);
    let s = t * t;
    // 2 / ln 2 times the series of the inverse hyperbolic tangent.
    let series = 2.885_39 + s * (0.961_796_7 + s * (0.577_078 + s * (0.412_198_6 + s * 0.320_598_9)));
    exponent as f32 + t * series
}

/// `2^y`, held within the range of single precision.
#[inline(always)]
fn exp2(y: f32) -> f32 {
    let y = y.clamp(-126.0, 126.0);
    let whole = (y + 0.5).floor();
    let f = y - whole;
    // Taylor's series; half a power of two to either side.
    let series = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_226_5
                + f * (0.055_504_11 + f * (0.009_618_13 + f * (0.001_333_356 + f * 0.000_154_035)))));
    series * f32::from_bits(((whole as i32 + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_right_to_a_millionth() {
        for k in -40..40 {
            for a in [0.1, 0.37, 0.5, 1.0, 1.7, 2.0] {
                let x = 1.37_f64.powi(k);
                let error = f64::from(power(x as f32, a as f32)) / x.powf(a) - 1.0;
                assert!(error.abs() < 4e-6, "{x}^{a}: {error}");
            }
        }
        assert_eq!([power(0.0, 0.0), power(0.0, 0.5), power(1.0, 0.3)], [0.0, 0.0, 1.0]);
    }
}
