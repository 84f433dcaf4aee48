//! Random phases as points on the unit circle, in blocks.

use std::f32::consts::PI;
use std::sync::LazyLock;

use crate::core::random::Random;

/// Number of bins computed together, so that the compiler can use vector registers.
pub(crate) const BLOCK: usize = 64;

/// Lane bit that separates magnitudes from phases.
const MAGNITUDE: u32 = 1 << 31;

/// Returns 16 random bits for each of [`BLOCK`] bins, from draws of 8 bins each.
fn bits(random: &Random, entity: u32, index: u64, lane: u32) -> [u16; BLOCK] {
    let mut out = [0; BLOCK];
    for (i, chunk) in out.chunks_exact_mut(8).enumerate() {
        let words = random.words(entity, index, lane + i as u32);
        for (pair, word) in chunk.chunks_exact_mut(2).zip(words) {
            pair[0] = word as u16;
            pair[1] = (word >> 16) as u16;
        }
    }
    out
}

/// Returns `(cos, sin)` of half a turn times `u`, `|u| <= 1/2`: least squares on Chebyshev nodes, with an error of at
/// most 3e-7.
fn half_turn(u: f32) -> (f32, f32) {
    let x = u * u;
    let sin = u * (PI + x * (-5.167_707 + x * (2.550_031_2 + x * (-0.598_044_2 + x * 0.077_218_39))));
    let cos =
        1.0 + x * (-4.934_802 + x * (4.058_709 + x * (-1.335_212 + x * (0.234_937_31 - x * 0.024_396_325))));
    (cos, sin)
}

/// Returns uniform phases of the bins from `BLOCK * block`, keyed by emitter and clip, in 65,536 steps per turn.
///
/// The half angle is evaluated and doubled, so the loop has no branch or table.
pub(crate) fn phasors(random: &Random, entity: u32, clip: u64, block: usize) -> ([f32; BLOCK], [f32; BLOCK]) {
    let bits = bits(random, entity, clip, (block * BLOCK / 8) as u32);
    let (mut re, mut im) = ([0.0; BLOCK], [0.0; BLOCK]);
    for i in 0..BLOCK {
        let (c, s) = half_turn(f32::from(bits[i] as i16) * (1.0 / 65536.0));
        re[i] = 1.0 - 2.0 * s * s;
        im[i] = 2.0 * s * c;
    }
    (re, im)
}

/// Rayleigh magnitudes of mean square 1 for all random numbers of 16 bits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rayleigh(&'static [f32; 1 << 16]);

impl Rayleigh {
    /// The table; the first call computes it, which takes about a millisecond.
    pub fn new() -> Self {
        static MAGNITUDES: LazyLock<Box<[f32; 1 << 16]>> = LazyLock::new(|| {
            let mut all = Box::new([0.0; 1 << 16]);
            for (b, magnitude) in all.iter_mut().enumerate() {
                *magnitude = libm::sqrtf(-libm::logf((b as f32 + 0.5) * (1.0 / 65536.0)));
            }
            all
        });
        Self(&MAGNITUDES)
    }

    /// Returns the magnitudes of the bins from `BLOCK * block`.
    pub fn magnitudes(self, random: &Random, entity: u32, clip: u64, block: usize) -> [f32; BLOCK] {
        bits(random, entity, clip, MAGNITUDE | (block * BLOCK / 8) as u32).map(|b| self.0[usize::from(b)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_turns_match_sine_and_cosine() {
        for i in -32768..=32767_i32 {
            let u = i as f32 / 65536.0;
            let (c, s) = half_turn(u);
            let (es, ec) = (std::f64::consts::PI * f64::from(u)).sin_cos();
            assert!((f64::from(c) - ec).abs() < 3e-7 && (f64::from(s) - es).abs() < 3e-7, "{u}");
        }
    }

    #[test]
    fn phasors_lie_on_the_circle_and_spread_evenly() {
        let random = Random::new(3, "phase");
        let (mut re_sum, mut im_sum, mut square) = (0.0_f64, 0.0_f64, 0.0_f64);
        for clip in 0..200 {
            let (re, im) = phasors(&random, 5, clip, 2);
            for (a, b) in re.iter().zip(&im) {
                assert!((a * a + b * b - 1.0).abs() < 2e-6);
                re_sum += f64::from(*a);
                im_sum += f64::from(*b);
                square += f64::from(a * a - b * b);
            }
        }
        let bound = 5.0 * (200.0 * BLOCK as f64 / 2.0).sqrt();
        assert!(re_sum.abs() < bound && im_sum.abs() < bound && square.abs() < bound);
    }

    #[test]
    fn phases_differ_between_emitters_clips_and_bins() {
        let random = Random::new(3, "phase");
        let all = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)].map(|(e, c, b)| phasors(&random, e, c, b).0);
        for i in 0..4 {
            for j in 0..i {
                assert_ne!(all[i], all[j]);
            }
        }
    }

    #[test]
    fn rayleigh_magnitudes_have_mean_square_one() {
        let (random, table) = (Random::new(3, "phase"), Rayleigh::new());
        let squares: f64 =
            (0..1000).flat_map(|clip| table.magnitudes(&random, 0, clip, 0)).map(|m| f64::from(m * m)).sum();
        assert!((squares / (1000.0 * BLOCK as f64) - 1.0).abs() < 0.02);
        // Over all 65,536 equally likely magnitudes the mean square is 1 but for the tail beyond them.
        let all: f64 = table.0.iter().map(|m| f64::from(m * m)).sum();
        assert!((all / 65536.0 - 1.0).abs() < 1e-4, "{all}");
    }
}
