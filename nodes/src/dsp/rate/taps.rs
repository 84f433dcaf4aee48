//! Weighted sums of the samples around a position, in lanes.

use crate::dsp::fold_lanes;
use fearless_simd::{Level, dispatch};

/// Frames that are summed together.
const LANES: usize = 8;

/// Weights of the frames around a position.
#[derive(Clone, Copy)]
pub(super) struct Taps<'a> {
    pub here: &'a [f64],
    /// The taps of the next phase, and the position between the two; none at a phase.
    pub next: Option<(&'a [f64], f64)>,
}

impl Taps<'_> {
    /// Weight `k`.
    #[inline(always)]
    fn at(&self, k: usize) -> f64 {
        match self.next {
            None => self.here[k],
            Some((next, fraction)) => self.here[k] + fraction * (next[k] - self.here[k]),
        }
    }
}

/// Sums of the weighted frames of a window, for each channel; all instruction sets compute the same bits.
///
/// # Shapes
/// `window`: `[taps * channels]`, interleaved. `frame`: `[channels]`.
pub(super) fn weighted_sums(level: Level, taps: Taps<'_>, window: &[f32], frame: &mut [f32]) {
    match frame {
        [y] => [*y] = dispatch!(level, _simd => in_lanes(taps, window)),
        [left, right] => [*left, *right] = dispatch!(level, _simd => in_lanes(taps, window)),
        _ => of_channels(taps, window, frame),
    }
}

/// The sums of a fixed number of channels.
#[inline(always)]
fn in_lanes<const CHANNELS: usize>(taps: Taps<'_>, window: &[f32]) -> [f32; CHANNELS] {
    let mut lanes = [[0.0; LANES]; CHANNELS];
    let (frames, _) = window.as_chunks::<CHANNELS>();
    let (chunks, rest) = frames.as_chunks::<LANES>();
    let (here, _) = taps.here.as_chunks::<LANES>();
    match taps.next {
        None => {
            for (frames, taps) in chunks.iter().zip(here) {
                add(&mut lanes, frames, taps);
            }
        }
        Some((next, fraction)) => {
            for ((frames, here), next) in chunks.iter().zip(here).zip(next.as_chunks::<LANES>().0) {
                let taps = std::array::from_fn(|k| here[k] + fraction * (next[k] - here[k]));
                add(&mut lanes, frames, &taps);
            }
        }
    }
    for (k, frame) in rest.iter().enumerate() {
        let tap = taps.at(chunks.len() * LANES + k);
        lanes.iter_mut().zip(frame).for_each(|(lanes, x)| lanes[k] += f64::from(*x) * tap);
    }
    lanes.map(total)
}

#[inline(always)]
fn add<const CHANNELS: usize>(
    lanes: &mut [[f64; LANES]; CHANNELS],
    frames: &[[f32; CHANNELS]; LANES],
    taps: &[f64; LANES],
) {
    for (channel, lanes) in lanes.iter_mut().enumerate() {
        for k in 0..LANES {
            lanes[k] += f64::from(frames[k][channel]) * taps[k];
        }
    }
}

#[inline(always)]
fn total(lanes: [f64; LANES]) -> f32 {
    fold_lanes(lanes, |a, b| a + b) as f32
}

/// The sums of any number of channels, one after the other.
fn of_channels(taps: Taps<'_>, window: &[f32], frame: &mut [f32]) {
    let channels = frame.len();
    for (channel, y) in frame.iter_mut().enumerate() {
        let count = window.len() / channels;
        let lanes = std::array::from_fn(|lane| {
            let frames = (lane..count).step_by(LANES);
            frames.map(|k| f64::from(window[k * channels + channel]) * taps.at(k)).sum()
        });
        *y = total(lanes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn sums_are_those_of_the_definition_and_the_same_among_any_number_of_channels() {
        let mut rng = Rng::new(5);
        for count in [1, 7, 8, 30, 108, 196] {
            let [here, next] = [0, 1].map(|_| (0..count).map(|_| rng.between(-1.0, 1.0)).collect::<Vec<_>>());
            for taps in [None, Some((&*next, 0.3))].map(|next| Taps { here: &here, next }) {
                for channels in 1..5 {
                    let window: Vec<f32> =
                        (0..count * channels).map(|_| rng.between(-1.0, 1.0) as f32).collect();
                    let mut frame = vec![0.0; channels];
                    weighted_sums(Level::new(), taps, &window, &mut frame);
                    for (channel, y) in frame.iter().enumerate() {
                        let own: Vec<f32> = window.iter().skip(channel).step_by(channels).copied().collect();
                        let sum: f64 = own.iter().enumerate().map(|(k, x)| f64::from(*x) * taps.at(k)).sum();
                        assert!((f64::from(*y) - sum).abs() < 1e-6 * (1.0 + sum.abs()), "{count} {channels}");
                        let mut alone = [0.0];
                        weighted_sums(Level::new(), taps, &own, &mut alone);
                        assert_eq!(alone[0], *y);
                        // Without instructions that the machine may have.
                        assert_eq!(in_lanes(taps, &own), alone);
                    }
                }
            }
        }
    }
}
