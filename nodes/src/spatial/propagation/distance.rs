//! Level, delay and absorption of sound by distance.

use super::air::Air;
use super::control_interval::control_interval;
use super::fractional_delay::FractionalDelayLine;
use crate::contact::vector::{Vec3, norm};
use crate::impl_state;

/// Speed of sound in air, in m/s.
pub const SPEED_OF_SOUND: f64 = 343.0;

/// The gain of a point source by distance: `reference / max(distance, nearest)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// Distance at which the gain is 1, in metres.
    pub reference: f64,
    /// Distance below which the gain is constant, in metres.
    pub nearest: f64,
}

impl Default for Distance {
    fn default() -> Self {
        Self { reference: 1.0, nearest: 0.1 }
    }
}

impl Distance {
    /// Returns the gain at a distance in metres.
    #[must_use]
    pub fn gain(&self, distance: f64) -> f64 {
        self.reference / distance.max(self.nearest)
    }

    /// Returns the gain of a source at a position relative to the listener.
    #[must_use]
    pub fn gain_at(&self, position: Vec3) -> f64 {
        self.gain(norm(position))
    }
}

/// Gain and, optionally, delay and absorption by air of a source whose distance changes.
///
/// The distance is read once per [`control_interval`]; gain and delay change linearly in between. The delay is fractional, so a uniform
/// approach has a steady Doppler shift.
#[derive(Clone, Debug)]
pub struct DistanceLine {
    distance: Distance,
    fs: f64,
    interval: u64,
    /// One line per channel if sound is delayed.
    lines: Vec<FractionalDelayLine>,
    farthest: f64,
    /// The absorption by air, if enabled.
    air: Option<Air>,
    channels: usize,
    /// Gain, delay in samples and pole of the air filter, at both ends of an interval.
    from: [f64; 3],
    to: [f64; 3],
    started: bool,
}
impl_state!(DistanceLine { each lines, farthest, each air, from, to, started });

impl DistanceLine {
    /// Creates a silent line. With `farthest`, in metres, sound is delayed by its travel time, at most that of `farthest`; with `air` it
    /// is filtered by [`Air`].
    #[must_use]
    pub fn new(distance: Distance, farthest: Option<f64>, air: bool, channels: usize, fs: f64) -> Self {
        let max_delay = farthest.unwrap_or(0.0) / SPEED_OF_SOUND * fs;
        let lines =
            if farthest.is_some() { vec![FractionalDelayLine::new(max_delay); channels] } else { Vec::new() };
        Self {
            distance,
            fs,
            interval: control_interval(fs),
            lines,
            farthest: farthest.unwrap_or(0.0),
            air: air.then(|| Air::new(channels, fs)),
            channels,
            from: [0.0; 3],
            to: [0.0; 3],
            started: false,
        }
    }

    /// Changes the gain by distance from the next control interval on.
    pub fn set_distance(&mut self, distance: Distance) {
        self.distance = distance;
    }

    fn update(&mut self, distance: f64) {
        // The fractional delay is at least one sample: 7 mm at 48 kHz.
        let delay = (distance.min(self.farthest) / SPEED_OF_SOUND * self.fs).max(1.0);
        let pole = self.air.as_ref().map_or(0.0, |air| air.pole(distance));
        let to = [self.distance.gain(distance), delay, pole];
        self.from = if self.started { self.to } else { to };
        self.to = to;
        self.started = true;
    }

    /// Processes samples from index `first` on. `distance` returns the distance at a sample, in metres.
    ///
    /// # Shapes
    /// `input` and `out`: `[T * channels]`, interleaved.
    pub fn process(
        &mut self,
        first: u64,
        input: &[f32],
        out: &mut [f32],
        mut distance: impl FnMut(u64) -> f64,
    ) {
        let width = self.channels.max(1);
        for ((n, x), out) in (first..).zip(input.chunks_exact(width)).zip(out.chunks_exact_mut(width)) {
            let offset = n % self.interval;
            if offset == 0 || !self.started {
                self.update(distance(n));
            }
            let t = (offset + 1) as f64 / self.interval as f64;
            let [gain, delay, pole] = std::array::from_fn(|k| self.from[k] + t * (self.to[k] - self.from[k]));
            if self.lines.is_empty() {
                out.iter_mut().zip(x).for_each(|(out, x)| *out = gain as f32 * x);
            }
            for ((out, x), line) in out.iter_mut().zip(x).zip(&mut self.lines) {
                line.push(*x);
                *out = gain as f32 * line.read(delay);
            }
            if let Some(air) = &mut self.air {
                out.iter_mut().enumerate().for_each(|(channel, out)| *out = air.process(channel, *out, pole));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn the_gain_is_inverse_to_the_distance_and_bounded_by_that_at_the_nearest() {
        let law = Distance::default();
        assert_eq!([0.0, 0.1, 0.5, 1.0, 2.0, 10.0].map(|d| law.gain(d)), [10.0, 10.0, 2.0, 1.0, 0.5, 0.1]);
        assert_eq!(law.gain_at([0.0, 3.0, 4.0]), 0.2);
    }

    #[test]
    fn a_uniform_approach_raises_the_pitch_in_proportion_to_its_speed() {
        let (fs, tone, speed) = (48_000.0, 1000.0, 10.0);
        let x: Vec<f32> = (0..48_000).map(|n| (2.0 * PI * tone * f64::from(n) / fs).sin() as f32).collect();
        let mut line = DistanceLine::new(Distance { reference: 1.0, nearest: 1e9 }, Some(50.0), false, 1, fs);
        let mut y = vec![0.0; x.len()];
        line.process(0, &x, &mut y, |n| 20.0 - speed * n as f64 / fs);
        // The frequency follows from the phase difference between two times.
        let phase = |at: usize| {
            let f = tone * (1.0 + speed / SPEED_OF_SOUND);
            let sum = (0..4800).fold([0.0; 2], |s, k| {
                let (a, w) =
                    (2.0 * PI * f * (at + k) as f64 / fs, 0.5 - 0.5 * (2.0 * PI * k as f64 / 4800.0).cos());
                let y = w * f64::from(y[at + k]);
                [s[0] + y * a.cos(), s[1] + y * a.sin()]
            });
            sum[1].atan2(sum[0])
        };
        let drift = (phase(40_000) - phase(10_000) + PI).rem_euclid(2.0 * PI) - PI;
        assert!(drift.abs() < 0.01, "off by {} Hz", drift / (2.0 * PI) * fs / 30_000.0);
    }

    #[test]
    fn the_delay_is_the_travel_time() {
        let fs = 34_300.0;
        let mut line = DistanceLine::new(Distance::default(), Some(20.0), false, 2, fs);
        let mut x = vec![0.0; 1000];
        (x[0], x[1]) = (1.0, -1.0);
        let mut y = vec![0.0; 1000];
        line.process(0, &x, &mut y, |_| 2.0);
        assert!((y[400] - 0.5).abs() < 1e-6 && (y[401] + 0.5).abs() < 1e-6);
        assert_eq!(y.iter().filter(|y| y.abs() > 1e-6).count(), 2);
    }
}
