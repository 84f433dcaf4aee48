//! The thin-plate kernel r^2 ln r^2 for many radii at once.

const SQRT_HALF: u64 = 0x3FE6_A09E_667F_3BCD;
const EXPONENT: u64 = 0xFFF0_0000_0000_0000;
/// A number of this exponent holds whole numbers in its low bits.
const WHOLE: u64 = 0x4330_0000_0000_0000;

/// Natural logarithm of a positive normal number, off by less than 1e-12 relative to the larger of it and 1.
///
/// Without branches or tables, so that a loop over it is computed in vector registers; the same bits on every machine. Zero and
/// denormal numbers result in a finite number near -709, which a factor of zero removes.
#[inline(always)]
fn ln(x: f64) -> f64 {
    let bits = x.to_bits();
    // Mantissa in [sqrt(1/2), sqrt 2), so that the series is short on both sides of 1.
    let above = bits.wrapping_sub(SQRT_HALF);
    let mantissa = f64::from_bits(bits.wrapping_sub(above & EXPONENT));
    let biased = (above.wrapping_add(2048 << 52) >> 52) & 0xFFF;
    let exponent = f64::from_bits(WHOLE | biased) - (f64::from_bits(WHOLE) + 2048.0);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let q = s * s;
    // ln m = 2 artanh s.
    let series = 2.0
        + q * (2.0 / 3.0
            + q * (2.0 / 5.0
                + q * (2.0 / 7.0
                    + q * (2.0 / 9.0 + q * (2.0 / 11.0 + q * (2.0 / 13.0 + q * (2.0 / 15.0)))))));
    exponent * std::f64::consts::LN_2 + s * series
}

/// r^2 ln r^2 of a squared radius; 0 at 0.
#[inline(always)]
pub fn thin_plate(square: f64) -> f64 {
    square * ln(square)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_is_that_of_the_library() {
        for k in 0..200_000 {
            let x = f64::from_bits(0x3000_0000_0000_0000 + k * 0x0000_1A2F_0000_1D27);
            assert!((ln(x) - x.ln()).abs() < 1e-12 * x.ln().abs().max(1.0), "{x}: {} {}", ln(x), x.ln());
        }
        assert_eq!(ln(1.0), 0.0);
        for x in [0.5, 2.0, 0.7, 1.4, 1.42, 1e-300, 1e300, f64::MIN_POSITIVE, f64::MAX] {
            assert!((ln(x) / x.ln() - 1.0).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn the_kernel_is_zero_at_its_node_and_at_radius_1() {
        assert_eq!([thin_plate(0.0), thin_plate(1.0)], [0.0, 0.0]);
        assert!((thin_plate(4.0) - 4.0 * 4_f64.ln()).abs() < 1e-12);
        assert!(thin_plate(f64::MIN_POSITIVE / 4.0).abs() < 1e-300);
    }
}
