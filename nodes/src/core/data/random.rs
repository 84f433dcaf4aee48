//! Counter-based randomness: a number is a function of its purpose, not of earlier numbers.
//!
//! # Source
//! Salmon, Moraes, Dror and Shaw, "Parallel Random Numbers: As Easy as 1, 2, 3" (SC 2011), Philox4x32-10.

/// A source of random numbers keyed by graph seed and node id.
///
/// Every rng names its entity (vertex, emitter, channel), its index (clip, event, sample) and a lane, so results do
/// not depend on block size, thread count or the order in which nodes run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Random {
    key: [u32; 2],
}

impl Random {
    /// A source for one node of one graph.
    #[must_use]
    pub fn new(seed: u64, node: &str) -> Self {
        let hash = blake3::hash(node.as_bytes());
        let mut id = [0; 8];
        id.copy_from_slice(&hash.as_bytes()[..8]);
        let mixed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ u64::from_le_bytes(id);
        Self { key: [mixed as u32, (mixed >> 32) as u32] }
    }

    /// Four independent 32-bit words for `(entity, index, lane)`.
    #[must_use]
    pub fn words(&self, entity: u32, index: u64, lane: u32) -> [u32; 4] {
        philox4x32([index as u32, (index >> 32) as u32, entity, lane], self.key)
    }

    /// Uniform on `[0, 1)` with 53 bits.
    #[must_use]
    pub fn uniform(&self, entity: u32, index: u64, lane: u32) -> f64 {
        let w = self.words(entity, index, lane);
        let bits = (u64::from(w[0]) << 21) ^ u64::from(w[1] >> 11);
        bits as f64 * (1.0 / 9_007_199_254_740_992.0)
    }
}

/// A sequence of random numbers, for trials and searches that are not part of a signal.
#[derive(Clone, Debug)]
pub struct Rng {
    random: Random,
    next: u64,
}

impl Rng {
    /// The sequence of one seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { random: Random::new(seed, "draw"), next: 0 }
    }

    /// Uniform on `[0, 1)`.
    pub fn uniform(&mut self) -> f64 {
        self.next += 1;
        self.random.uniform(0, self.next, 0)
    }

    /// Uniform on `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// A whole number below `n`; 0 where `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.uniform() * n as f64) as usize
    }
}

/// Philox4x32 with ten rounds.
#[must_use]
pub fn philox4x32(mut ctr: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for round in 0..10 {
        if round > 0 {
            key[0] = key[0].wrapping_add(0x9E37_79B9);
            key[1] = key[1].wrapping_add(0xBB67_AE85);
        }
        let a = u64::from(ctr[0]) * 0xD251_1F53;
        let b = u64::from(ctr[2]) * 0xCD9E_8D57;
        ctr = [(b >> 32) as u32 ^ ctr[1] ^ key[0], b as u32, (a >> 32) as u32 ^ ctr[3] ^ key[1], a as u32];
    }
    ctr
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn philox_gives_the_published_known_answers() {
        assert_eq!(philox4x32([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(
            philox4x32([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox4x32([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344], [0xa409_3822, 0x299f_31d0]),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn uniform_draws_fill_the_unit_interval_evenly() {
        let random = Random::new(7, "noise");
        let n = 100_000_u64;
        let draws: Vec<f64> = (0..n).map(|i| random.uniform(3, i, 0)).collect();
        assert!(draws.iter().all(|u| (0.0..1.0).contains(u)));
        let mean = draws.iter().sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 5.0 / (12.0 * n as f64).sqrt(), "{mean}");
    }

    #[test]
    fn nodes_and_seeds_are_independent() {
        let rng = |seed, node| Random::new(seed, node).words(0, 0, 0);
        assert_ne!(rng(1, "a"), rng(1, "b"));
        assert_ne!(rng(1, "a"), rng(2, "a"));
    }
}
