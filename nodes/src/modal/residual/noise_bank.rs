//! Bands of decaying noise under a force.

use super::noise_band::NoiseBand;
use crate::core::random::Random;
use crate::impl_state;
use std::f64::consts::TAU;

/// Samples between two changes of the frequencies.
const GRID: i64 = 32;
/// Highest centre of a band, relative to the sample rate.
const HIGHEST: f64 = 0.49;
/// Lane of the random numbers of frequencies, and of phases.
const LANES: [u32; 2] = [0x0010_0000, 0x0010_0001];

/// One band: a mode whose frequency wanders at random between the edges of the band.
#[derive(Clone, Debug)]
struct Band {
    state: [f64; 2],
    /// Rotation and decay by one sample.
    pole: [f64; 2],
    /// Real and imaginary part of the response to a unit force: the gain at a random phase.
    input: [f64; 2],
    radius: f64,
    /// Middle and half width, radians per sample.
    omega: [f64; 2],
    /// Samples between two random frequencies.
    segment: i64,
}
impl_state!(Band { state, pole });

/// Bands of noise that a force excites.
///
/// A band is a mode at its centre whose frequency moves on straight lines between random values within the band, one for each `1 / width`
/// seconds. An impact therefore gives noise with exactly the envelope `gain exp(-d t)`, the same energy each time, and a flat density
/// within the band; a long soft force excites high bands as little as it excites high modes.
///
/// # Source
/// Pumphrey's low-noise noise (JASA 78(S1), 1985, S100) states why an envelope without fluctuation is desirable; the random frequency
/// is a choice.
#[derive(Clone, Debug)]
pub struct NoiseBank {
    bands: Vec<Band>,
    random: Random,
}
impl_state!(NoiseBank { each bands });

impl NoiseBank {
    /// Bands with centres below 0.49 of the sample rate; the others are left out.
    #[must_use]
    pub fn new(bands: &[NoiseBand], rate: f64, random: Random) -> Self {
        let audible = bands.iter().filter(|b| b.centre() < HIGHEST * rate);
        let band = |(k, b): (usize, &NoiseBand)| {
            let width = b.high - b.low;
            let phase = TAU * random.uniform(k as u32, 0, LANES[1]);
            let gain = f64::from(b.gain);
            Band {
                state: [0.0; 2],
                pole: [0.0; 2],
                input: [gain * libm::cos(phase), gain * libm::sin(phase)],
                radius: libm::exp(-b.damping / rate),
                omega: [0.5 * TAU * (b.low + b.high) / rate, 0.5 * TAU * width / rate],
                segment: ((rate / width / GRID as f64).ceil() as i64).max(1) * GRID,
            }
        };
        Self { bands: audible.enumerate().map(band).collect(), random }
    }

    /// Number of bands that sound.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bands.len()
    }

    /// Returns true if no band sounds.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bands.is_empty()
    }

    /// Continues the noise of another bank with as many bands.
    pub fn take_state(&mut self, old: &Self) {
        if old.len() == self.len() {
            self.bands.iter_mut().zip(&old.bands).for_each(|(band, old)| band.state = old.state);
        }
    }

    /// Adds the sound of `force`, in N s per sample, to `out`; both begin with sample `first`.
    ///
    /// # Complexity
    /// O(samples bands).
    pub fn process(&mut self, first: i64, force: &[f32], out: &mut [f32]) {
        for (k, band) in self.bands.iter_mut().enumerate() {
            let mut at = 0;
            while at < out.len() {
                let n = first + at as i64;
                if n.rem_euclid(GRID) == 0 || band.pole == [0.0; 2] {
                    let omega = frequency(&self.random, k as u32, band, n.div_euclid(GRID) * GRID);
                    band.pole = [band.radius * libm::cos(omega), band.radius * libm::sin(omega)];
                }
                let end = (at + (GRID - n.rem_euclid(GRID)) as usize).min(out.len());
                let ([c, s], [a, b], [mut re, mut im]) = (band.pole, band.input, band.state);
                for (f, out) in force[at..end].iter().zip(&mut out[at..end]) {
                    let f = f64::from(*f);
                    (re, im) = (re * c - im * s + a * f, re * s + im * c + b * f);
                    *out += re as f32;
                }
                // At the grid, so that the cut into blocks changes nothing.
                let decayed = (first + end as i64).rem_euclid(GRID) == 0 && re * re + im * im < 1e-30;
                band.state = if decayed { [0.0; 2] } else { [re, im] };
                at = end;
            }
        }
    }
}

/// Frequency of a band at a sample, radians per sample.
fn frequency(random: &Random, band: u32, b: &Band, n: i64) -> f64 {
    let segment = n.div_euclid(b.segment);
    let target = |segment: i64| 2.0 * random.uniform(band, segment as u64, LANES[0]) - 1.0;
    let part = n.rem_euclid(b.segment) as f64 / b.segment as f64;
    let (from, to) = (target(segment), target(segment + 1));
    b.omega[0] + b.omega[1] * (from + part * (to - from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use foley_fft::RealFftPlanner;

    const RATE: f64 = 48_000.0;

    fn band(centre: f64, damping: f64) -> NoiseBand {
        let edge = 2.0_f64.powf(1.0 / 6.0);
        NoiseBand { low: centre / edge, high: centre * edge, damping, gain: 2.0 }
    }

    fn impact(bands: &[NoiseBand], at: usize, samples: usize) -> Vec<f32> {
        let mut force = vec![0.0; samples];
        force[at] = 0.5;
        let mut out = vec![0.0; samples];
        NoiseBank::new(bands, RATE, Random::new(3, "noise")).process(0, &force, &mut out);
        out
    }

    #[test]
    fn an_impact_has_the_energy_and_the_decay_of_the_band_each_time() {
        for (centre, damping) in [(200.0, 8.0), (1000.0, 20.0), (1000.0, 200.0), (10_000.0, 60.0)] {
            for at in [0, 333, 4800] {
                let out = impact(&[band(centre, damping)], at, 48_000);
                let energy = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
                let expected = RATE / (4.0 * damping);
                assert!(
                    (energy(&out) / expected - 1.0).abs() < 0.05,
                    "{centre} {damping}: {}",
                    energy(&out) / expected
                );
                // 8.7 dB in 1 / d seconds.
                let late = at + (RATE / damping) as usize;
                let db = 10.0 * (energy(&out[late..]) / energy(&out[at..])).log10();
                assert!((db + 8.69).abs() < 0.4, "{db}");
            }
        }
    }

    #[test]
    fn the_energy_lies_between_the_edges_and_fills_the_band() {
        let b = band(2000.0, 4.0);
        let mut out = impact(&[b], 0, 1 << 16);
        let mut spectrum = vec![Default::default(); out.len() / 2 + 1];
        RealFftPlanner::<f32>::new().plan_fft_forward(out.len()).process(&mut out, &mut spectrum).unwrap();
        let power = |low: f64, high: f64| -> f64 {
            let bin = |f: f64| (f * 65_536.0 / RATE) as usize;
            spectrum[bin(low)..bin(high)].iter().map(|z| f64::from(z.norm_sqr())).sum()
        };
        let all = power(0.0, 24_000.0);
        assert!(power(b.low, b.high) > 0.8 * all, "{}", power(b.low, b.high) / all);
        // Four parts of the band hold about the same.
        let edge = |k: f64| b.low + 0.25 * k * (b.high - b.low);
        for k in 0..4 {
            let part = power(edge(f64::from(k)), edge(f64::from(k) + 1.0)) / all;
            assert!((0.08..0.5).contains(&part), "{k}: {part}");
        }
    }

    #[test]
    fn bands_above_the_rate_are_left_out_and_silence_stays_silent() {
        let bank = NoiseBank::new(&[band(1000.0, 9.0), band(30_000.0, 9.0)], RATE, Random::new(3, "noise"));
        assert_eq!(bank.len(), 1);
        let mut out = vec![0.0; 1000];
        bank.clone().process(0, &[0.0; 1000], &mut out);
        assert!(out.iter().all(|x| *x == 0.0));
    }

    #[test]
    fn blocks_do_not_change_the_samples() {
        let bands = [band(500.0, 9.0), band(3000.0, 50.0)];
        let force: Vec<f32> = (0..2000).map(|n| if n % 701 == 5 { 1.0 } else { 0.001 }).collect();
        let mut whole = vec![0.0; 2000];
        NoiseBank::new(&bands, RATE, Random::new(3, "noise")).process(7, &force, &mut whole);
        for block in [1, 13, 64, 480] {
            let mut bank = NoiseBank::new(&bands, RATE, Random::new(3, "noise"));
            let mut parts = vec![0.0; 2000];
            for (k, (force, out)) in force.chunks(block).zip(parts.chunks_mut(block)).enumerate() {
                bank.process(7 + (k * block) as i64, force, out);
            }
            assert_eq!(whole, parts, "{block}");
        }
    }
}
