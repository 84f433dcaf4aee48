//! Features of synthetic sounds of known damping, with or without their audio.

use crate::core::computation::Monitor;
use crate::core::random::Rng;
use crate::material::estimation::point::DampingPoint;
use crate::material::points::gate::Gate;
use crate::modal::extraction::poles::resynthesis;
use crate::modal::{ExtractParams, Feature, FeatureSet, extract};
use crate::statistics::normal::standard_normal;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Range of the fundamental frequencies of objects, Hz.
const FUNDAMENTAL: [f64; 2] = [150.0, 1500.0];
/// Highest frequency of a mode, Hz.
const HIGHEST: f64 = 16_000.0;
/// Maximum number of modes of an object.
const MAX_MODES: usize = 60;
/// Range of `a1`, 1/s, and of `a2`, s: the span of the paper's table 1.
const MATERIALS: [[f64; 2]; 2] = [[1.0, 40.0], [1e-8, 1.5e-7]];
/// Range of the mean support damping, 1/s.
const SUPPORT: [f64; 2] = [2.0, 30.0];
/// Weights of the squared displacement along the normal and along two tangents.
const DIRECTIONS: [f64; 3] = [1.0, 0.25, 0.25];
/// Duration of the half sine of the impact, s.
const IMPACT: f64 = 3e-4;
/// Level of the softest modes that are found, relative to the loudest, dB.
const QUIETEST: f64 = -50.0;
/// Largest damping of a feature, 1/s: twice the `d_max` of the gate.
const FASTEST: f64 = 1000.0;
/// Sample rate of synthetic audio, Hz.
const RATE: f64 = 44_100.0;
/// Duration of a synthetic sound after its onset, s, and of the noise before it.
const DURATION: f64 = 2.0;
const BEFORE: f64 = 0.05;
/// Range of the dampings of spurious features, 1/s.
pub const SPURIOUS: [f64; 2] = [0.5, 500.0];

fn log_uniform(rng: &mut Rng, [low, high]: [f64; 2]) -> f64 {
    low * libm::pow(high / low, rng.uniform())
}

/// A damping of a spurious feature: log-uniform, 1/s.
pub fn spurious_damping(rng: &mut Rng) -> f64 {
    log_uniform(rng, SPURIOUS)
}

/// `n` independent points of a Rayleigh curve `[a1, a2, sigma, eta]` with frequencies log-uniform from 200 Hz to 15 kHz.
pub fn independent_points(rng: &mut Rng, n: usize, [a1, a2, sigma, eta]: [f64; 4]) -> Vec<DampingPoint> {
    (0..n)
        .map(|_| {
            let frequency = 200.0 * libm::pow(75.0, rng.uniform());
            let lambda = (TAU * frequency).powi(2);
            let excess = -libm::log(1.0 - rng.uniform()) / eta;
            let noise = sigma * standard_normal(rng);
            DampingPoint::new(lambda, (a1 + a2 * lambda + excess + noise).max(1e-3))
        })
        .collect()
}

/// Size of a collection of sounds of one material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollectionSize {
    /// Number of objects: bars, plates and shells in turn.
    pub objects: usize,
    /// Number of supports of each object.
    pub supports: usize,
    /// Number of sounds of each object.
    pub sounds: usize,
}

/// Sounds of objects of one material.
#[derive(Clone, Debug, PartialEq)]
pub struct Collection {
    /// `a1` in 1/s and `a2` in s of the material.
    pub truth: [f64; 2],
    /// The features of each sound, without errors.
    pub sounds: Vec<Vec<DampingPoint>>,
}

/// Natural frequencies of an object up to 16 kHz, at most 60, Hz.
///
/// A free bar has `((2 k + 1) / 3)^2` times its fundamental, a simply supported plate `(m^2 + (a n / b)^2) / (1 + (a / b)^2)` times, and
/// a shell modes at random, log-uniform.
fn frequencies(rng: &mut Rng, kind: usize) -> Vec<f64> {
    let fundamental = log_uniform(rng, FUNDAMENTAL);
    let mut all: Vec<f64> = match kind % 3 {
        0 => (1..=MAX_MODES).map(|k| fundamental * ((2 * k + 1) as f64 / 3.0).powi(2)).collect(),
        1 => {
            let aspect = rng.between(1.0, 2.0).powi(2);
            let ratio = |m: usize, n: usize| ((m * m) as f64 + aspect * (n * n) as f64) / (1.0 + aspect);
            (1..=16).flat_map(|m| (1..=16).map(move |n| fundamental * ratio(m, n))).collect()
        }
        _ => (0..40).map(|_| log_uniform(rng, [fundamental, HIGHEST])).collect(),
    };
    all.retain(|f| *f <= HIGHEST);
    all.sort_by(f64::total_cmp);
    all.truncate(MAX_MODES);
    all
}

/// Relative support damping of a mode: a sum of squares of displacements, of mean 1.
///
/// Its gamma shape by moments is 1, as that of contacts with a friction of 0.5, but it is not exponential.
fn support_damping(rng: &mut Rng) -> f64 {
    let sum: f64 = DIRECTIONS.iter().map(|w| w * standard_normal(rng).powi(2)).sum();
    sum / DIRECTIONS.iter().sum::<f64>()
}

/// Spectrum of the impact, relative to that at 0 Hz.
fn impact_spectrum(frequency: f64) -> f64 {
    let x = 2.0 * frequency * IMPACT;
    let rest = 1.0 - x * x;
    if rest.abs() < 1e-6 { PI / 4.0 } else { (libm::cos(0.5 * PI * x) / rest).abs() }
}

/// A mode of an object that was struck.
struct StruckMode {
    /// Its number.
    index: usize,
    /// Natural frequency, Hz.
    frequency: f64,
    /// Damping with that of the support, 1/s.
    c: f64,
    /// Displacement at the point of the impact, normal with a standard deviation of 1.
    displacement: f64,
}

/// An impact on an object of known damping.
struct Strike {
    object: usize,
    modes: Vec<StruckMode>,
}

impl Strike {
    /// The modes that are found without errors.
    fn points(&self, recording: u32) -> Vec<DampingPoint> {
        let level = |m: &StruckMode| (m.displacement * impact_spectrum(m.frequency)).abs();
        let loudest = self.modes.iter().map(level).fold(0.0, f64::max);
        let quietest = loudest * libm::pow(10.0, QUIETEST / 20.0);
        let point = |m: &StruckMode| {
            let lambda = (TAU * m.frequency).powi(2);
            let found = level(m) >= quietest && m.c <= FASTEST && m.c < 1.999 * lambda.sqrt();
            let mode_cluster = (self.object * MAX_MODES + m.index) as u32;
            found.then_some(DampingPoint { recording, mode_cluster, ..DampingPoint::new(lambda, m.c) })
        };
        self.modes.iter().filter_map(point).collect()
    }

    /// The sound: noise, then the velocity of the modes under a half sine of 0.3 ms.
    ///
    /// `noise` is its RMS relative to the peak of the sound.
    fn audio(&self, rng: &mut Rng, noise: f64) -> Vec<f32> {
        let modes: Vec<Feature> = (self.modes.iter())
            .filter_map(|m| {
                let (omega, decay) = (TAU * m.frequency, 0.5 * m.c);
                let freq_hz = (omega * omega - decay * decay).sqrt() / TAU;
                let (amp, phase) = (m.displacement.abs(), if m.displacement < 0.0 { PI } else { 0.0 });
                freq_hz.is_finite().then_some(Feature { freq_hz, amp, decay, phase, ..Feature::default() })
            })
            .collect();
        let sound = resynthesis(&modes, RATE, (DURATION * RATE) as usize, |f| f.decay);
        let length = (IMPACT * RATE) as usize;
        let force: Vec<f64> = (1..length).map(|k| libm::sin(PI * k as f64 / length as f64)).collect();
        let struck: Vec<f64> = (0..sound.len())
            .map(|n| force.iter().take(n + 1).enumerate().map(|(k, f)| f * sound[n - k]).sum())
            .collect();
        let peak = struck.iter().fold(0.0, |peak: f64, x| peak.max(x.abs())).max(f64::MIN_POSITIVE);
        let before = std::iter::repeat_n(0.0, (BEFORE * RATE) as usize);
        before.chain(struck).map(|x| (0.5 * (x / peak + noise * standard_normal(rng))) as f32).collect()
    }
}

/// Impacts on random objects of one random material, and its `a1` and `a2`.
fn strikes(rng: &mut Rng, size: &CollectionSize) -> ([f64; 2], Vec<Strike>) {
    let truth = MATERIALS.map(|range| log_uniform(rng, range));
    let mut all = Vec::new();
    for object in 0..size.objects {
        let modes = frequencies(rng, object);
        let supports: Vec<Vec<f64>> = (0..size.supports.max(1))
            .map(|_| {
                let mean = log_uniform(rng, SUPPORT);
                modes.iter().map(|_| mean * support_damping(rng)).collect()
            })
            .collect();
        for _ in 0..size.sounds {
            let support = &supports[rng.below(supports.len())];
            let mode = |(index, frequency): (usize, &f64)| {
                let c = truth[0] + truth[1] * (TAU * frequency).powi(2) + support[index];
                StruckMode { index, frequency: *frequency, c, displacement: standard_normal(rng) }
            };
            all.push(Strike { object, modes: modes.iter().enumerate().map(mode).collect() });
        }
    }
    (truth, all)
}

impl Collection {
    /// The sounds of one random material.
    ///
    /// `a1` is log-uniform in 1 to 40 1/s and `a2` in 1e-8 to 1.5e-7 s. A support has a mean damping log-uniform in 2 to 30 1/s, and
    /// dampings of its modes that are the same in every sound. A sound is an impact at a random point of a random object on a random one
    /// of its supports: modes within 50 dB of the loudest are found, those that decay faster than 500 1/s are not.
    ///
    /// # Source
    /// Sterling et al. (IEEE TVCG 25(5), 2019), section 5.3, with modes from formulas in place of finite elements.
    #[must_use]
    pub fn new(rng: &mut Rng, size: &CollectionSize) -> Self {
        let (truth, strikes) = strikes(rng, size);
        Self { truth, sounds: (0..).zip(&strikes).map(|(k, s)| s.points(k)).collect() }
    }

    /// The same sounds as audio of 2 s at 44.1 kHz, with white noise of an RMS `noise` relative to the peak; their features are those
    /// that [`extract`] finds and the default [`Gate`] lets pass. A sound in which nothing is found has no features; neither have the sounds
    /// after `monitor` has stopped it.
    ///
    /// # Complexity
    /// An extraction, of some tenths of a second, for each sound, in parallel; a function of `rng` for any number of threads.
    #[must_use]
    pub fn of_audio(rng: &mut Rng, size: &CollectionSize, noise: f64, monitor: &Monitor<'_>) -> Self {
        let (truth, strikes) = strikes(rng, size);
        let seed = rng.below(1 << 30) as u64;
        let (done, all) = (AtomicUsize::new(0), strikes.len());
        let sets: Vec<FeatureSet> = (0..)
            .zip(&strikes)
            .collect::<Vec<(u64, &Strike)>>()
            .into_par_iter()
            .map(|(k, strike)| {
                let mut own = Rng::new((seed << 30).wrapping_add(k));
                let stopped = monitor(done.fetch_add(1, Relaxed) as f64 / all as f64);
                let audio = if stopped { Vec::new() } else { strike.audio(&mut own, noise) };
                let found = extract(&audio, RATE, &ExtractParams::default());
                FeatureSet {
                    recording: k.to_string(),
                    object: strike.object.to_string(),
                    support: String::new(),
                    features: found.map_or_else(|_| Vec::new(), |found| found.features),
                }
            })
            .collect();
        let mut sounds = vec![Vec::new(); sets.len()];
        for point in Gate::default().points(&sets).points {
            sounds[point.recording as usize].push(point);
        }
        Self { truth, sounds }
    }

    /// The sounds of one object; `each` is the number of sounds of each object.
    #[must_use]
    pub fn of_object(&self, object: usize, each: usize) -> Self {
        let sounds = self.sounds.iter().skip(object * each).take(each).cloned().collect();
        Self { truth: self.truth, sounds }
    }

    /// The same with errors: dampings times `1 + noise N(0, 1)`, with their standard deviation, and a share of spurious features, whose
    /// damping is log-uniform from 0.5 to 500 1/s.
    #[must_use]
    pub fn with_errors(&self, rng: &mut Rng, noise: f64, spurious: f64) -> Self {
        let mut out = self.clone();
        for p in out.sounds.iter_mut().flatten() {
            // Points of audio have errors of their own.
            let uncertainty = if noise > 0.0 { noise } else { p.sd_c / p.c };
            p.c *= (1.0 + noise * standard_normal(rng)).max(0.01);
            p.sd_c = uncertainty * p.c;
            if rng.uniform() < spurious {
                p.c = spurious_damping(rng);
                p.sd_c = uncertainty * p.c;
            }
            p.c = p.c.max(SPURIOUS[0]);
        }
        out
    }

    /// The features of `count` different sounds, drawn at random.
    #[must_use]
    pub fn draw(&self, rng: &mut Rng, count: usize) -> Vec<DampingPoint> {
        let mut order: Vec<usize> = (0..self.sounds.len()).collect();
        let count = count.min(order.len());
        for k in 0..count {
            let other = k + rng.below(order.len() - k);
            order.swap(k, other);
        }
        let chosen = order[..count].iter().enumerate();
        let own = |(recording, sound): (usize, &usize)| {
            let features = self.sounds[*sound].iter();
            features.map(move |p| DampingPoint { recording: recording as u32, ..*p })
        };
        chosen.flat_map(own).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::computation::unmonitored;

    #[test]
    fn sounds_lie_above_the_curve_of_their_material() {
        let size = CollectionSize { objects: 3, supports: 4, sounds: 20 };
        let all = Collection::new(&mut Rng::new(3), &size);
        assert_eq!(all.sounds.len(), 60);
        let curve = |lambda: f64| all.truth[0] + all.truth[1] * lambda;
        assert!(all.sounds.iter().flatten().all(|p| p.c >= curve(p.lambda)));
        let mean = all.sounds.iter().map(Vec::len).sum::<usize>() as f64 / 60.0;
        assert!((5.0..60.0).contains(&mean), "{mean}");
        let noisy = all.with_errors(&mut Rng::new(4), 0.1, 0.2);
        assert!(noisy.sounds.iter().flatten().any(|p| p.c < curve(p.lambda)));
    }

    #[test]
    fn audio_has_the_features_of_its_modes() {
        let size = CollectionSize { objects: 3, supports: 2, sounds: 2 };
        let exact = Collection::new(&mut Rng::new(11), &size);
        let found = Collection::of_audio(&mut Rng::new(11), &size, 1e-3, &unmonitored);
        assert!(found.truth == exact.truth && found.sounds.len() == 6);
        let (mut near, mut all) = (0, 0);
        for (sound, modes) in found.sounds.iter().zip(&exact.sounds) {
            for p in sound {
                let mode = modes.iter().min_by(|a, b| {
                    (a.lambda / p.lambda).ln().abs().total_cmp(&(b.lambda / p.lambda).ln().abs())
                });
                all += 1;
                near += usize::from(mode.is_some_and(|m| (m.c / p.c - 1.0).abs() < 0.1));
            }
        }
        assert!(all > 60 && near * 10 > all * 9, "{near} of {all}");
        assert!(found == Collection::of_audio(&mut Rng::new(11), &size, 1e-3, &unmonitored));
    }

    #[test]
    fn support_dampings_have_the_shape_of_friction() {
        let mut rng = Rng::new(5);
        let all: Vec<f64> = (0..20_000).map(|_| support_damping(&mut rng)).collect();
        let mean = all.iter().sum::<f64>() / 20_000.0;
        let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 20_000.0;
        assert!(
            (mean - 1.0).abs() < 0.03 && (mean * mean / variance - 1.0).abs() < 0.06,
            "{mean} {variance}"
        );
    }

    #[test]
    fn a_draw_has_each_sound_once() {
        let size = CollectionSize { objects: 2, supports: 1, sounds: 5 };
        let all = Collection::new(&mut Rng::new(7), &size);
        let points = all.draw(&mut Rng::new(1), 10);
        assert_eq!(points.len(), all.sounds.iter().map(Vec::len).sum::<usize>());
        assert!(all.draw(&mut Rng::new(1), 1).iter().all(|p| p.recording == 0));
    }
}
