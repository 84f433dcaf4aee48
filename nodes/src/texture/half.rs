//! Numbers of 16 bits as IEEE 754 defines them, in which profiles are stored.

/// The nearest number of 16 bits, ties to even; those too large become the greatest finite one.
#[must_use]
pub fn to_half(x: f32) -> u16 {
    let bits = x.to_bits();
    let sign = (bits >> 16 & 0x8000) as u16;
    let size = f32::from_bits(bits & 0x7fff_ffff);
    if size.is_nan() {
        return sign | 0x7e00;
    }
    if size >= 65_504.0 {
        return sign | 0x7bff;
    }
    if size < 6.103_515_6e-5 {
        // Whole multiples of the least number, 2^-24.
        return sign | (size * 16_777_216.0).round_ties_even() as u16;
    }
    // Thirteen bits of the fraction go; what is rounded up may carry into the exponent, as it should.
    let bits = size.to_bits();
    let rounded = bits + 0x0fff + (bits >> 13 & 1);
    sign | ((rounded - (112 << 23)) >> 13) as u16
}

/// The number that 16 bits hold.
#[must_use]
pub fn from_half(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (u32::from(bits >> 10 & 0x1f), u32::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction as f32 / 16_777_216.0,
        0x1f if fraction == 0 => f32::INFINITY,
        0x1f => f32::NAN,
        _ => f32::from_bits((exponent + 112) << 23 | fraction << 13),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_number_of_16_bits_comes_back() {
        for bits in (0..0x7c00).chain(0x8000..0xfc00) {
            assert_eq!(to_half(from_half(bits)), bits, "{bits:04x}");
        }
        assert!(from_half(0x7c00).is_infinite() && from_half(to_half(f32::NAN)).is_nan());
    }

    #[test]
    fn numbers_between_go_to_the_nearest() {
        for (x, right) in [
            (1.0, 0x3c00),
            (1.0 + 0.000_4, 0x3c00),
            (1.0 + 0.000_6, 0x3c01),
            (1.0 + 1.5 / 1024.0, 0x3c02),
            (-2.0, 0xc000),
            (1e9, 0x7bff),
            (6.103_515_6e-5, 0x0400),
            (2.0_f32.powi(-24), 0x0001),
            (65_503.0, 0x7bff),
        ] {
            assert_eq!(to_half(x), right, "{x}");
        }
    }
}
