//! Noise as a function of the sample index: the same bits for any block and start.

use std::f64::consts::TAU;

use crate::core::random::Random;

const UNIFORM: u32 = 0x0001_0000;
const GAUSSIAN: u32 = 0x0002_0000;
const PINK: u32 = 0x0003_0000;

/// Calls `write(group, offset)` for each group of four samples that overlaps `first..first + len`. `offset` is the index of the first
/// sample of the group relative to `first`.
fn for_each_group(first: i64, len: usize, mut write: impl FnMut(i64, i64)) {
    let mut group = first >> 2;
    let mut offset = (group << 2).wrapping_sub(first);
    while offset < len as i64 {
        write(group, offset);
        group += 1;
        offset += 4;
    }
}

/// Writes samples `first..` from a generator of groups of four.
fn fill(first: i64, out: &mut [f32], group_samples: impl Fn(i64) -> [f32; 4]) {
    let len = out.len();
    for_each_group(first, len, |group, offset| {
        let samples = group_samples(group);
        if offset >= 0 && offset as usize + 4 <= len {
            out[offset as usize..offset as usize + 4].copy_from_slice(&samples);
        } else {
            for (i, x) in (offset..).zip(samples) {
                if i >= 0 && (i as usize) < len {
                    out[i as usize] = x;
                }
            }
        }
    });
}

/// White noise, uniform on [-1, 1), with rms 1 / sqrt(3). One call of the generator returns four samples.
#[derive(Clone, Copy, Debug)]
pub struct UniformNoise {
    random: Random,
    channel: u32,
}

impl UniformNoise {
    /// Creates the noise of one channel.
    #[must_use]
    pub fn new(random: Random, channel: u32) -> Self {
        Self { random, channel }
    }

    /// Writes samples `first..`.
    pub fn fill(&self, first: i64, out: &mut [f32]) {
        fill(first, out, |group| {
            // 24 bits fill the mantissa of an f32: values are equally spaced and below 1.
            let words = self.random.words(self.channel, group as u64, UNIFORM);
            words.map(|w| ((w >> 8) as i32 - 0x80_0000) as f32 / 8_388_608.0)
        });
    }
}

/// White noise, normal with mean 0 and variance 1. One call of the generator returns four samples.
///
/// # Source
/// Box and Muller, "A Note on the Generation of Random Normal Deviates" (1958). With 32-bit numbers the tails end at 6.8 sigma.
#[derive(Clone, Copy, Debug)]
pub struct GaussianNoise {
    random: Random,
    channel: u32,
}

impl GaussianNoise {
    /// Creates the noise of one channel.
    #[must_use]
    pub fn new(random: Random, channel: u32) -> Self {
        Self { random, channel }
    }

    /// Writes samples `first..`.
    pub fn fill(&self, first: i64, out: &mut [f32]) {
        fill(first, out, |group| {
            normals(self.random.words(self.channel, group as u64, GAUSSIAN)).map(|x| x as f32)
        });
    }
}

/// Returns normal numbers by the Box-Muller transform.
fn normals(w: [u32; 4]) -> [f64; 4] {
    let pair = |a: u32, b: u32| {
        let radius = (-2.0 * libm::log((f64::from(a) + 0.5) / 4_294_967_296.0)).sqrt();
        let (sin, cos) = libm::sincos(TAU * (f64::from(b) + 0.5) / 4_294_967_296.0);
        [radius * cos, radius * sin]
    };
    let ([a, b], [c, d]) = (pair(w[0], w[1]), pair(w[2], w[3]));
    [a, b, c, d]
}

/// Pole and gain of each first-order branch.
const POLES: [(f64, f64); 6] = [
    (0.99886, 0.055_517_9),
    (0.99332, 0.075_075_9),
    (0.969, 0.153_852),
    (0.8665, 0.310_485_6),
    (0.55, 0.532_952_2),
    (-0.7616, -0.016_898),
];
/// Gains of the current and of the previous sample.
const DIRECT: [f64; 2] = [0.5362, 0.115_926];

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct PinkFilter {
    branches: [f64; 6],
    last: f64,
}

impl PinkFilter {
    fn tick(&mut self, white: f64) -> f64 {
        let mut sum = DIRECT[0] * white + DIRECT[1] * self.last;
        for (state, (pole, gain)) in self.branches.iter_mut().zip(POLES) {
            *state = pole * *state + gain * white;
            sum += *state;
        }
        self.last = white;
        sum
    }
}

/// Samples between two anchors, at which the state of the filter is redefined.
const ANCHOR_INTERVAL: i64 = 65_536;
/// Samples before an anchor that define the state at it: by then the slowest pole has decayed to 8e-9.
const WARM_UP: i64 = 16_384;

/// Pink noise: power density 1 / f, rms 1.
///
/// Within +-0.05 dB of 1 / f from 0.0002 to 0.45 of the rate (10 Hz to 20 kHz at 44.1 kHz), flat below.
///
/// The state of a recursive filter depends on all earlier samples. Here the state at every 65,536th sample, the anchor, is that after
/// the 16,384 samples before it, from zero. Any start therefore produces the same bits; the step at an anchor is below
/// 1e-8.
///
/// # Complexity
/// O(1) per sample in order, without bursts, since the filter for the next anchor runs in parallel. A jump costs up to 81,920 samples.
///
/// # Source
/// P. Kellet's sum of first-order filters, music-dsp list (1999), normalised to rms 1.
#[derive(Clone, Debug)]
pub struct PinkNoise {
    random: Random,
    channel: u32,
    scale: f64,
    next: Option<i64>,
    filter: PinkFilter,
    /// The filter that takes over at the next anchor.
    next_filter: PinkFilter,
    group: i64,
    white: [f64; 4],
}

impl PinkNoise {
    /// Creates the noise of one channel.
    #[must_use]
    pub fn new(random: Random, channel: u32) -> Self {
        let mut impulse = PinkFilter::default();
        let power: f64 = (0..32_768).map(|n| impulse.tick(if n == 0 { 1.0 } else { 0.0 }).powi(2)).sum();
        let idle = PinkFilter::default();
        Self {
            random,
            channel,
            scale: 1.0 / power.sqrt(),
            next: None,
            filter: idle,
            next_filter: idle,
            group: i64::MIN,
            white: [0.0; 4],
        }
    }

    /// Writes samples `first..`.
    pub fn fill(&mut self, first: i64, out: &mut [f32]) {
        if self.next != Some(first) {
            let anchor = first.div_euclid(ANCHOR_INTERVAL) * ANCHOR_INTERVAL;
            for n in anchor - WARM_UP..first {
                self.tick(n);
            }
        }
        let mut n = first;
        for x in out {
            *x = (self.scale * self.tick(n)) as f32;
            n += 1;
        }
        self.next = Some(n);
    }

    fn tick(&mut self, n: i64) -> f64 {
        let offset = n.rem_euclid(ANCHOR_INTERVAL);
        if offset == 0 {
            self.filter = self.next_filter;
        } else if offset == ANCHOR_INTERVAL - WARM_UP {
            self.next_filter = PinkFilter::default();
        }
        if n >> 2 != self.group {
            self.group = n >> 2;
            self.white = normals(self.random.words(self.channel, self.group as u64, PINK));
        }
        let white = self.white[(n & 3) as usize];
        if offset >= ANCHOR_INTERVAL - WARM_UP {
            self.next_filter.tick(white);
        }
        self.filter.tick(white)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dsp::testing::assert_block_invariant;

    fn random() -> Random {
        Random::new(5, "noise")
    }

    fn moments(x: &[f32]) -> (f64, f64, f64) {
        let mean = |p: i32| x.iter().map(|&x| f64::from(x).powi(p)).sum::<f64>() / x.len() as f64;
        (mean(1), mean(2), mean(4))
    }

    #[test]
    fn uniform_noise_has_the_moments_of_its_distribution() {
        let mut x = vec![0.0; 400_000];
        UniformNoise::new(random(), 0).fill(-7, &mut x);
        assert!(x.iter().all(|x| (-1.0..1.0).contains(x)));
        let (mean, square, fourth) = moments(&x);
        assert!(mean.abs() < 0.005 && (square - 1.0 / 3.0).abs() < 0.003 && (fourth - 0.2).abs() < 0.003);
    }

    #[test]
    fn gaussian_noise_has_the_moments_of_its_distribution() {
        let mut x = vec![0.0; 400_000];
        GaussianNoise::new(random(), 0).fill(3, &mut x);
        let (mean, square, fourth) = moments(&x);
        assert!(mean.abs() < 0.008 && (square - 1.0).abs() < 0.012 && (fourth - 3.0).abs() < 0.08);
    }

    #[test]
    fn neighbours_and_channels_are_uncorrelated() {
        let (mut x, mut y) = (vec![0.0; 100_000], vec![0.0; 100_000]);
        GaussianNoise::new(random(), 0).fill(0, &mut x);
        GaussianNoise::new(random(), 1).fill(0, &mut y);
        let correlation = |a: &[f32], b: &[f32]| {
            a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>() / a.len() as f64
        };
        for lag in 1..=5 {
            assert!(correlation(&x[lag..], &x).abs() < 0.02);
        }
        assert!(correlation(&x, &y).abs() < 0.02);
    }

    #[test]
    fn any_block_and_any_start_give_the_same_bits() {
        let silence = vec![0.0; 3000];
        for start in [0, -5, 1_000_003, ANCHOR_INTERVAL - 1500] {
            let uniform = UniformNoise::new(random(), 2);
            assert_block_invariant(&silence, 1, || uniform, |g, at, x| g.fill(start + at, x));
            let gaussian = GaussianNoise::new(random(), 2);
            assert_block_invariant(&silence, 1, || gaussian, |g, at, x| g.fill(start + at, x));
            let pink = PinkNoise::new(random(), 2);
            assert_block_invariant(&silence, 1, || pink.clone(), |g, at, x| g.fill(start + at, x));
        }
        let (mut run, mut jump) = (vec![0.0; 70_000], vec![0.0; 10_000]);
        let mut pink = PinkNoise::new(random(), 0);
        pink.fill(0, &mut run);
        PinkNoise::new(random(), 0).fill(60_000, &mut jump);
        assert!(run[60_000..] == jump);
        pink.fill(60_000, &mut jump);
        assert!(run[60_000..] == jump, "going back");
    }

    /// Checks the response of the filter itself, without statistical error.
    #[test]
    fn pink_noise_follows_one_over_f_within_a_twentieth_of_a_decibel() {
        let response = |f: f64| {
            let w = TAU * f;
            let (mut re, mut im) = (DIRECT[0] + DIRECT[1] * w.cos(), -DIRECT[1] * w.sin());
            for (pole, gain) in POLES {
                let (a, b) = (1.0 - pole * w.cos(), pole * w.sin());
                re += gain * a / (a * a + b * b);
                im -= gain * b / (a * a + b * b);
            }
            10.0 * ((re * re + im * im) * f).log10()
        };
        let levels: Vec<f64> =
            (0..=200).map(|i| response(2e-4 * (0.45_f64 / 2e-4).powf(f64::from(i) / 200.0))).collect();
        let (low, high) = levels.iter().fold((f64::MAX, f64::MIN), |(l, h), &x| (l.min(x), h.max(x)));
        assert!(high - low < 0.1, "{low} {high}");
        let mut x = vec![0.0; 500_000];
        PinkNoise::new(random(), 0).fill(0, &mut x);
        assert!((moments(&x).1 - 1.0).abs() < 0.1, "{}", moments(&x).1);
    }
}
