//! A short sound at the two ears, from a place that stays where it is for as long as it lasts.

use super::head::{Ear, Head, PINNA_LEVELS, PINNA_MAX_DELAY};
use crate::contact::vector::Vec3;
use crate::spatial::propagation::distance::Distance;
use crate::spatial::propagation::fractional_delay::lagrange;
use serde::{Deserialize, Serialize};

/// Samples that are worked on at once.
const BLOCK: usize = 64;
/// Time after which the shadow rings no more, over that from the surface to the middle of the head: `e^-14` is -120 dB.
const SHADOW_TAIL: f64 = 7.0;

/// Reads a sound at a delay between its samples.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Tap {
    /// Whole samples of the delay.
    delay: i64,
    /// Weights of the samples around it, the newest first.
    weights: [f32; 4],
}

impl Tap {
    fn new(delay: f64, level: f64) -> Self {
        let whole = delay.floor();
        Self {
            delay: whole as i64,
            weights: lagrange((delay - whole) as f32).map(|weight| level as f32 * weight),
        }
    }
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct StaticEar {
    /// The sound itself and the reflections of the pinna.
    taps: [Tap; 6],
    count: usize,
    shadow: [f64; 3],
    /// Last input and output of the shadow.
    u: f64,
    y: f64,
}

impl StaticEar {
    fn new(head: &Head, ear: Ear, position: Vec3, fs: f64) -> Self {
        let filter = head.ear(ear, position, fs);
        let delay = (filter.delay - head.centre_delay()) * fs;
        let mut taps = [Tap::default(); 6];
        taps[0] = Tap::new(delay, 1.0);
        for ((tap, level), echo) in taps[1..].iter_mut().zip(PINNA_LEVELS).zip(filter.pinna) {
            *tap = Tap::new(delay + echo * fs, level);
        }
        let count = if head.pinna.is_some() { taps.len() } else { 1 };
        Self { taps, count, shadow: filter.shadow, u: 0.0, y: 0.0 }
    }

    /// What the ear hears from frame `at` of the sound on. Pinna and shadow are linear and stand still, so their order is free:
    /// the taps come first, since they can be read from the sound itself and need no memory.
    fn process(&mut self, sound: &[f32], at: i64, signal: &mut [f32]) {
        signal.fill(0.0);
        for tap in &self.taps[..self.count] {
            for (k, weight) in (0..).zip(tap.weights) {
                add_from(signal, sound, at - tap.delay + 1 - k, weight);
            }
        }
        let [b0, b1, a1] = self.shadow;
        for x in signal {
            let u = f64::from(*x);
            self.y = b0 * u + b1 * self.u - a1 * self.y;
            self.u = u;
            *x = self.y as f32;
        }
    }
}

/// Adds a sound from frame `from` on, which may lie before it; it is silent around.
fn add_from(out: &mut [f32], sound: &[f32], from: i64, weight: f32) {
    let skip = (-from).clamp(0, out.len() as i64) as usize;
    let Some(sound) = sound.get((from + skip as i64).max(0) as usize..) else { return };
    out[skip..].iter_mut().zip(sound).for_each(|(y, x)| *y += weight * x);
}

/// A sound that is held whole in memory, at the two ears of a [`Head`], from one place.
///
/// It is that of [`Binaural`](super::Binaural) and [`Distance`] for a source that stands still, but keeps four numbers of state
/// instead of delay lines, so that hundreds may sound at once. The middle of the head hears the sound at its time, and a near
/// ear up to [`max_advance`](Self::max_advance) samples earlier. Echoes of shoulder and room are left out.
///
/// # Complexity
/// Per sample and ear four products for the sound and twenty for a pinna; nothing is allocated.
///
/// # Source
/// Brown and Duda, "A structural model for binaural sound synthesis" (IEEE Trans. Speech and Audio Processing 6(5), 1998).
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct StaticSource {
    ears: [StaticEar; 2],
    gain: f32,
}

impl StaticSource {
    /// A source at a place in own axes of the head, m, at `fs` hertz; without `distance` it is as loud anywhere.
    #[must_use]
    pub fn new(head: &Head, distance: Option<Distance>, position: Vec3, fs: f64) -> Self {
        Self {
            ears: [Ear::Left, Ear::Right].map(|ear| StaticEar::new(head, ear, position, fs)),
            gain: distance.map_or(1.0, |law| law.gain_at(position)) as f32,
        }
    }

    /// Samples before the beginning of a sound in which an ear may hear it, wherever it is.
    #[must_use]
    pub fn max_advance(head: &Head, fs: f64) -> usize {
        // Two samples more, since a value between samples needs the two before it.
        (head.centre_delay() * fs).ceil() as usize + 2
    }

    /// Samples after the end of a sound in which an ear may hear it.
    #[must_use]
    pub fn tail(head: &Head, fs: f64) -> usize {
        let pinna = if head.pinna.is_some() { PINNA_MAX_DELAY } else { 0.0 };
        let max_delay = head.max_delay() - head.centre_delay() + pinna + SHADOW_TAIL * head.centre_delay();
        (max_delay * fs).ceil() as usize + 2
    }

    /// Gain of the distance.
    #[must_use]
    pub fn gain(&self) -> f32 {
        self.gain
    }

    /// Adds frames of what the ears hear, from frame `at` of the sound on, each times what `level` makes of it; frames come one
    /// after the other.
    ///
    /// # Shapes
    /// `out: [2 T]`, left and right interleaved.
    pub fn add(&mut self, sound: &[f32], at: i64, out: &mut [f32], level: impl Fn(f32, i64) -> f32) {
        let mut signal = [0.0; BLOCK];
        for (at, out) in (at..).step_by(BLOCK).zip(out.chunks_mut(2 * BLOCK)) {
            for (side, ear) in self.ears.iter_mut().enumerate() {
                let signal = &mut signal[..out.len() / 2];
                ear.process(sound, at, signal);
                for ((frame, y), x) in (at..).zip(out.as_chunks_mut::<2>().0).zip(signal) {
                    y[side] += level(self.gain * *x, frame);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::super::binaural::Binaural;
    use super::super::head::PinnaSet;
    use super::*;

    /// Nothing above 2.5 kHz at 48 kHz: higher up, reading between samples twice, as delay lines do, is not what reading once is.
    fn low() -> Vec<f32> {
        let wave = |n: f32| (0.31 * n).sin() + (0.17 * n + 1.0).sin();
        (0..300).map(|n| wave(n as f32) * (n as f32 / 300.0 * PI).sin().powi(2)).collect()
    }

    fn sound() -> Vec<f32> {
        (0..300).map(|n| ((n * n) as f32 * 0.37).sin() * (1.0 - n as f32 / 300.0)).collect()
    }

    fn side(azimuth: f64) -> Vec3 {
        let a = azimuth.to_radians();
        [2.0 * a.cos(), -2.0 * a.sin(), 0.3]
    }

    /// Both ears from `lead` samples before the sound on, in blocks.
    fn play(head: &Head, position: Vec3, fs: f64, block: usize) -> Vec<f32> {
        play_sound(&sound(), head, position, fs, block)
    }

    fn play_sound(sound: &[f32], head: &Head, position: Vec3, fs: f64, block: usize) -> Vec<f32> {
        let (lead, ring) = (StaticSource::max_advance(head, fs), StaticSource::tail(head, fs));
        let mut out = vec![0.0; 2 * (lead + sound.len() + ring)];
        let mut source = StaticSource::new(head, None, position, fs);
        for (at, out) in (-(lead as i64)..).step_by(block).zip(out.chunks_mut(2 * block)) {
            source.add(sound, at, out, |x, _| x);
        }
        out
    }

    #[test]
    fn it_is_what_delay_lines_give_for_a_source_that_stands_still() {
        for (fs, pinna) in
            [(44_100.0, None), (48_000.0, Some(PinnaSet::Set0)), (96_000.0, Some(PinnaSet::Set1))]
        {
            let head = Head { pinna, ..Head::default() };
            for azimuth in [0.0, 35.0, -90.0, 160.0] {
                let found = play_sound(&low(), &head, side(azimuth), fs, 1000);
                let mut binaural = Binaural::new(head, 0.0, fs);
                let shift = binaural.lag() - StaticSource::max_advance(&head, fs).min(binaural.lag());
                let early = StaticSource::max_advance(&head, fs) - (binaural.lag() - shift);
                let mut input = low();
                input.resize(found.len() / 2 + shift, 0.0);
                let mut expected = vec![0.0; 2 * input.len()];
                binaural.process(0, &input, &mut expected, |_| side(azimuth));
                let pairs = found[2 * early..].iter().zip(&expected[2 * shift..]);
                let worst = pairs.fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
                assert!(worst < 2e-3, "{fs} {azimuth}: {worst}");
                assert!(found[..2 * early].iter().all(|x| x.abs() < 1e-3));
                // Nothing is cut off at the end.
                assert!(found[found.len() - 2..].iter().all(|x| x.abs() < 1e-5));
            }
        }
    }

    #[test]
    fn mirrored_places_swap_the_ears_bit_for_bit_and_the_front_is_the_same_in_both() {
        let head = Head { pinna: Some(PinnaSet::Set0), ..Head::default() };
        let ear = |out: &[f32], k: usize| out.iter().skip(k).step_by(2).copied().collect::<Vec<_>>();
        for azimuth in [12.0, 80.0, 171.0] {
            let (one, other) =
                (play(&head, side(azimuth), 48_000.0, 64), play(&head, side(-azimuth), 48_000.0, 64));
            assert!(ear(&one, 0) == ear(&other, 1) && ear(&one, 1) == ear(&other, 0));
            assert!(ear(&one, 0) != ear(&one, 1));
        }
        let front = play(&head, side(0.0), 48_000.0, 64);
        assert!(ear(&front, 0) == ear(&front, 1));
    }

    #[test]
    fn blocks_of_any_length_give_the_same_bits() {
        let head = Head { pinna: Some(PinnaSet::Set1), ..Head::default() };
        let whole = play(&head, side(40.0), 44_100.0, 1000);
        assert!([1, 7, 64, 65].into_iter().all(|block| play(&head, side(40.0), 44_100.0, block) == whole));
    }

    #[test]
    fn twice_as_far_is_half_as_loud() {
        let gain = |d: f64| {
            StaticSource::new(&Head::default(), Some(Distance::default()), [d, 0.0, 0.0], 48_000.0).gain()
        };
        assert_eq!([0.01, 0.5, 1.0, 4.0].map(gain), [10.0, 2.0, 1.0, 0.25]);
    }
}
