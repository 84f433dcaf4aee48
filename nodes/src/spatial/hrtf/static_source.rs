//! Binaural rendering of a sound from a static source.

use super::head::{Ear, Head, PINNA_LEVELS, PINNA_MAX_DELAY};
use crate::contact::vector::Vec3;
use crate::spatial::propagation::distance::Distance;
use crate::spatial::propagation::fractional_delay::lagrange;
use serde::{Deserialize, Serialize};

/// Samples processed at a time.
const BLOCK: usize = 64;
/// Decay time of the head shadow, relative to the travel time over the radius: `e^-14` is -120 dB.
const SHADOW_TAIL: f64 = 7.0;

/// A fractional delay with a gain.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Tap {
    /// Integer part of the delay, in samples.
    delay: i64,
    /// Weights of the samples around the delay, newest first, times the gain.
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
    /// The direct sound and the pinna reflections.
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

    /// Renders the signal at the ear from frame `first` of the sound on. Pinna and shadow are linear and time-invariant, so they commute:
    /// the taps come first, since they can be read from the sound itself and need no memory.
    fn process(&mut self, sound: &[f32], first: i64, signal: &mut [f32]) {
        signal.fill(0.0);
        for tap in &self.taps[..self.count] {
            for (k, weight) in (0..).zip(tap.weights) {
                add_from(signal, sound, first - tap.delay + 1 - k, weight);
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

/// Adds a sound from frame `from` on, which may be negative; outside its frames the sound is silent.
fn add_from(out: &mut [f32], sound: &[f32], from: i64, weight: f32) {
    let skip = (-from).clamp(0, out.len() as i64) as usize;
    let Some(sound) = sound.get((from + skip as i64).max(0) as usize..) else { return };
    out[skip..].iter_mut().zip(sound).for_each(|(y, x)| *y += weight * x);
}

/// Renders a sound held in memory from a static source at the two ears of a [`Head`].
///
/// The result is that of [`Binaural`](crate::spatial::Binaural) and [`Distance`] for a source that does not move. The state is four
/// numbers instead of delay lines, so hundreds of sources may play at once. At the centre of the head the sound is not delayed; at the
/// near ear it is up to [`max_advance`](Self::max_advance) samples earlier. Reflections of shoulder and room are omitted.
///
/// # Complexity
/// Four multiplications per sample and ear, and twenty more with a pinna; no allocation.
///
/// # Source
/// Brown and Duda, "A structural model for binaural sound synthesis" (IEEE Trans. Speech and Audio Processing 6(5), 1998).
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct StaticSource {
    ears: [StaticEar; 2],
    gain: f32,
}

impl StaticSource {
    /// Creates a source at a position in local axes of the head, in m, at `fs` hertz. Without `distance` its gain is 1.
    #[must_use]
    pub fn new(head: &Head, distance: Option<Distance>, position: Vec3, fs: f64) -> Self {
        Self {
            ears: [Ear::Left, Ear::Right].map(|ear| StaticEar::new(head, ear, position, fs)),
            gain: distance.map_or(1.0, |law| law.gain_at(position)) as f32,
        }
    }

    /// Returns the largest number of samples by which a sound reaches an ear before its start, for any position.
    #[must_use]
    pub fn max_advance(head: &Head, fs: f64) -> usize {
        // Two more samples for the interpolation.
        (head.centre_delay() * fs).ceil() as usize + 2
    }

    /// Returns the number of samples for which a sound is audible at an ear after its end.
    #[must_use]
    pub fn tail(head: &Head, fs: f64) -> usize {
        let pinna = if head.pinna.is_some() { PINNA_MAX_DELAY } else { 0.0 };
        let max_delay = head.max_delay() - head.centre_delay() + pinna + SHADOW_TAIL * head.centre_delay();
        (max_delay * fs).ceil() as usize + 2
    }

    /// Returns the gain by distance.
    #[must_use]
    pub fn gain(&self) -> f32 {
        self.gain
    }

    /// Adds the signals at the ears from frame `first` of the sound on. `level` maps each sample and its frame to the output. Successive
    /// calls must be contiguous.
    ///
    /// # Shapes
    /// `out: [2 T]`, left and right interleaved.
    pub fn add(&mut self, sound: &[f32], first: i64, out: &mut [f32], level: impl Fn(f32, i64) -> f32) {
        let mut signal = [0.0; BLOCK];
        for (first, out) in (first..).step_by(BLOCK).zip(out.chunks_mut(2 * BLOCK)) {
            for (side, ear) in self.ears.iter_mut().enumerate() {
                let signal = &mut signal[..out.len() / 2];
                ear.process(sound, first, signal);
                for ((frame, y), x) in (first..).zip(out.as_chunks_mut::<2>().0).zip(signal) {
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

    /// A sound below 2.5 kHz at 48 kHz. At higher frequencies the two interpolations of the delay lines differ from one.
    fn low_sound() -> Vec<f32> {
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

    /// Renders both ears from `max_advance` samples before the sound on, in blocks.
    fn play(head: &Head, position: Vec3, fs: f64, block: usize) -> Vec<f32> {
        play_sound(&sound(), head, position, fs, block)
    }

    fn play_sound(sound: &[f32], head: &Head, position: Vec3, fs: f64, block: usize) -> Vec<f32> {
        let (advance, tail) = (StaticSource::max_advance(head, fs), StaticSource::tail(head, fs));
        let mut out = vec![0.0; 2 * (advance + sound.len() + tail)];
        let mut source = StaticSource::new(head, None, position, fs);
        for (at, out) in (-(advance as i64)..).step_by(block).zip(out.chunks_mut(2 * block)) {
            source.add(sound, at, out, |x, _| x);
        }
        out
    }

    #[test]
    fn the_result_is_that_of_delay_lines_for_a_static_source() {
        for (fs, pinna) in
            [(44_100.0, None), (48_000.0, Some(PinnaSet::Set0)), (96_000.0, Some(PinnaSet::Set1))]
        {
            let head = Head { pinna, ..Head::default() };
            for azimuth in [0.0, 35.0, -90.0, 160.0] {
                let found = play_sound(&low_sound(), &head, side(azimuth), fs, 1000);
                let mut binaural = Binaural::new(head, 0.0, fs);
                let shift = binaural.lag() - StaticSource::max_advance(&head, fs).min(binaural.lag());
                let early = StaticSource::max_advance(&head, fs) - (binaural.lag() - shift);
                let mut input = low_sound();
                input.resize(found.len() / 2 + shift, 0.0);
                let mut expected = vec![0.0; 2 * input.len()];
                binaural.process(0, &input, &mut expected, |_| side(azimuth));
                let pairs = found[2 * early..].iter().zip(&expected[2 * shift..]);
                let worst = pairs.fold(0.0_f32, |max, (a, b)| max.max((a - b).abs()));
                assert!(worst < 2e-3, "{fs} {azimuth}: {worst}");
                assert!(found[..2 * early].iter().all(|x| x.abs() < 1e-3));
                // Nothing is cut off at the end.
                assert!(found[found.len() - 2..].iter().all(|x| x.abs() < 1e-5));
            }
        }
    }

    #[test]
    fn mirrored_positions_swap_the_ears_bit_for_bit_and_the_front_is_the_same_in_both() {
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
        let expected = play(&head, side(40.0), 44_100.0, 1000);
        assert!([1, 7, 64, 65].into_iter().all(|block| play(&head, side(40.0), 44_100.0, block) == expected));
    }

    #[test]
    fn the_gain_is_inverse_to_the_distance() {
        let gain = |d: f64| {
            StaticSource::new(&Head::default(), Some(Distance::default()), [d, 0.0, 0.0], 48_000.0).gain()
        };
        assert_eq!([0.01, 0.5, 1.0, 4.0].map(gain), [10.0, 2.0, 1.0, 0.25]);
    }
}
