//! Force pulses at audio rate, with starts between the samples.

use super::pulse::{IMPULSE_LENGTH, LANES, MIN_LENGTH, PulseShape, impulse, sum};
use crate::impl_state;

/// Sums force pulses ahead of the samples that are read.
///
/// Any number of pulses may overlap. Each is written into a ring buffer when it starts, so the cost of reading a sample does not
/// depend on the number of pulses. Nothing is allocated.
#[derive(Clone, Debug)]
pub struct ForceRing {
    rate: f64,
    /// `[points, frames]`.
    ring: Vec<f64>,
    points: usize,
    /// Frame of the ring that is read next.
    head: usize,
    /// Scratch space for the heights of one pulse.
    pulse: Vec<[f64; LANES]>,
}
impl_state!(ForceRing { ring, head });

impl ForceRing {
    /// A ring at a sample rate in Hz, for `points` contact points and pulses that end at most `max_end` seconds after the next sample.
    #[must_use]
    pub fn new(rate: f64, points: usize, max_end: f64) -> Self {
        let points = points.max(1);
        let frames = (max_end * rate).ceil() as usize + IMPULSE_LENGTH as usize + 2;
        let pulse = vec![[0.0; LANES]; frames.div_ceil(LANES)];
        Self { rate, ring: vec![0.0; frames * points], points, head: 0, pulse }
    }

    /// Adds a pulse that starts `start_samples` samples (more than -1) after the next sample to be read and lasts `time_s` seconds. Returns
    /// false if not all of it was added: one that is not finite or starts before the last sample is left out, and one that ends more than
    /// `max_end` seconds (see [`new`](Self::new)) after the next sample is cut off there, with all of its impulse before.
    ///
    /// The sum of its force in N, times the sample interval, is exactly `impulse_ns`, for any start between the samples. A pulse of
    /// less than four samples becomes a band-limited impulse of eight. A point beyond the last one counts as the last.
    pub fn add(
        &mut self,
        start_samples: f64,
        point: usize,
        impulse_ns: f64,
        time_s: f64,
        shape: PulseShape,
    ) -> bool {
        let (start, time) = (start_samples, time_s);
        let usable = impulse_ns.is_finite() && start.is_finite() && start > -1.0;
        let frames = self.ring.len() / self.points;
        if !usable || start >= frames as f64 {
            return false;
        }
        if impulse_ns == 0.0 {
            return true;
        }
        let single = shape == PulseShape::Impulse;
        let short = !single && ((time * self.rate).is_nan() || time * self.rate < MIN_LENGTH);
        let length = if single {
            1.0
        } else if short {
            IMPULSE_LENGTH
        } else {
            time * self.rate
        };
        let first = start.ceil().max(0.0) as usize;
        let stop = (start + length).ceil() as usize;
        let last = stop.min(frames).max(first);
        let count = last - first;
        let Some(pulse) = self.pulse.get_mut(..count.div_ceil(LANES)) else { return false };
        let (phase, step) = ((first as f64 - start) / length, 1.0 / length);
        if short {
            let at = |n: usize| phase + n as f64 * step;
            pulse.as_flattened_mut().iter_mut().enumerate().for_each(|(n, x)| *x = impulse(at(n)));
        } else {
            shape.sample(phase, step, pulse);
        }
        pulse.as_flattened_mut().iter_mut().skip(count).for_each(|x| *x = 0.0);
        let scale = impulse_ns * self.rate / sum(pulse);
        if !scale.is_finite() {
            return false;
        }
        // To the end of the ring, then from its start.
        let point = point.min(self.points - 1);
        let at = (self.head + first) % frames;
        let heights = &pulse.as_flattened()[..count];
        let (now, later) = heights.split_at(count.min(frames - at));
        let ring = &mut self.ring[point * frames..(point + 1) * frames];
        let (start, end) = ring.split_at_mut(at);
        for (ring, heights) in [(end, now), (start, later)] {
            ring.iter_mut().zip(heights).for_each(|(force, height)| *force += scale * height);
        }
        stop <= frames
    }

    /// Reads the forces of the next samples in N, interleaved by contact point, into `out`.
    pub fn read(&mut self, out: &mut [f32]) {
        let (frames, points) = (self.ring.len() / self.points, self.points);
        let mut out = out;
        while out.len() >= points {
            let count = (out.len() / points).min(frames - self.head);
            let (now, later) = out.split_at_mut(count * points);
            for (point, ring) in self.ring.chunks_exact_mut(frames).enumerate() {
                let ring = &mut ring[self.head..self.head + count];
                let out = now.iter_mut().skip(point).step_by(points);
                out.zip(ring).for_each(|(out, force)| *out = std::mem::take(force) as f32);
            }
            self.head = (self.head + count) % frames;
            out = later;
        }
    }

    /// Takes over the remaining samples of another ring of the same size.
    pub fn take_state(&mut self, old: &Self) {
        if (old.ring.len(), old.points, old.rate) == (self.ring.len(), self.points, self.rate) {
            self.ring.copy_from_slice(&old.ring);
            self.head = old.head;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_1_SQRT_2, TAU};

    fn pulse(start: f64, impulse: f64, time: f64, shape: PulseShape, rate: f64) -> Vec<f32> {
        let mut ring = ForceRing::new(rate, 1, 0.04);
        assert!(ring.add(start, 0, impulse, time, shape));
        let mut out = vec![0.0; (0.05 * rate) as usize];
        ring.read(&mut out);
        out
    }

    #[test]
    fn a_pulse_has_the_area_of_its_impulse_wherever_it_lands() {
        for shape in [PulseShape::Cosine, PulseShape::HalfSine, PulseShape::Gaussian] {
            for rate in [8000.0, 44_100.0, 192_000.0] {
                for (start, time) in [(0.0, 0.001), (-0.7, 0.001), (7.9, 0.0101), (2.5, 0.0001), (3.0, 0.02)]
                {
                    let samples = pulse(start, 0.25, time, shape, rate);
                    let area = samples.iter().map(|f| f64::from(*f)).sum::<f64>() / rate;
                    assert!((area - 0.25).abs() < 1e-7, "{shape:?} {rate} {start} {time}: {area}");
                }
            }
        }
    }

    /// Size of the Fourier transform at `f` Hz, where each sample stands for `1/rate` seconds.
    fn spectrum(samples: &[f32], f: f64, rate: f64) -> f64 {
        let sum = samples.iter().enumerate().fold((0.0, 0.0), |(a, b), (n, x)| {
            let w = TAU * f * n as f64 / rate;
            (a + f64::from(*x) * w.cos(), b + f64::from(*x) * w.sin())
        });
        sum.0.hypot(sum.1) / rate
    }

    #[test]
    fn the_cosine_pulse_has_its_spectrum() {
        // J |sinc(f tau) / (1 - (f tau)^2)|
        let (rate, tau) = (192_000.0, 0.004);
        let samples = pulse(0.37, 1.0, tau, PulseShape::Cosine, rate);
        for (ft, want) in [(0.5, 0.848_83), (1.0, 0.5), (1.5, 0.169_77), (0.7203, FRAC_1_SQRT_2)] {
            let found = spectrum(&samples, ft / tau, rate);
            assert!((found - want).abs() < 0.002, "{ft}: {found}");
        }
        for ft in [2.0, 3.0, 4.0] {
            assert!(spectrum(&samples, ft / tau, rate) < 1e-4, "a zero at {ft}");
        }
    }

    #[test]
    fn a_half_sine_is_3_db_down_where_it_should_be() {
        let (rate, tau) = (192_000.0, 0.004);
        let samples = pulse(0.0, 1.0, tau, PulseShape::HalfSine, rate);
        let found = spectrum(&samples, 0.594 / tau, rate);
        assert!((found - FRAC_1_SQRT_2).abs() < 0.005, "{found}");
    }

    #[test]
    fn a_band_limited_impulse_is_flat_in_the_audible_range() {
        let samples = pulse(1.4, 1.0, 0.0, PulseShape::Cosine, 44_100.0);
        for f in [100.0, 5000.0, 12_000.0] {
            let db = 20.0 * spectrum(&samples, f, 44_100.0).log10();
            assert!(db.abs() < 1.0, "{f}: {db}");
        }
    }

    #[test]
    fn pulses_start_at_a_fraction_of_a_sample() {
        let centre = |start| {
            let samples = pulse(start, 1.0, 0.002, PulseShape::Cosine, 44_100.0);
            let moment = samples.iter().enumerate().map(|(n, f)| n as f64 * f64::from(*f)).sum::<f64>();
            moment / 44_100.0
        };
        for start in [0.0, 0.25, 10.5, 33.9] {
            assert!((centre(start) - start - 44.1).abs() < 0.002, "{start}: {}", centre(start));
        }
    }

    #[test]
    fn overlapping_pulses_add_up_at_their_points() {
        let mut ring = ForceRing::new(1000.0, 2, 0.02);
        ring.add(0.5, 0, 1.0, 0.01, PulseShape::Cosine);
        ring.add(3.0, 1, 2.0, 0.01, PulseShape::Cosine);
        ring.add(4.0, 7, 4.0, 0.01, PulseShape::HalfSine);
        let mut out = vec![0.0; 60];
        ring.read(&mut out[..10]);
        ring.read(&mut out[10..]);
        let area = |p: usize| out.iter().skip(p).step_by(2).sum::<f32>() / 1000.0;
        assert!((area(0) - 1.0).abs() < 1e-6 && (area(1) - 6.0).abs() < 1e-5);
        ring.read(&mut out);
        assert!(out.iter().all(|f| *f == 0.0), "read samples are gone");
    }

    #[test]
    fn an_impulse_is_one_sample() {
        for (start, at) in [(0.0, 0), (3.0, 3), (3.2, 4), (-0.5, 0)] {
            let samples = pulse(start, 0.5, 0.001, PulseShape::Impulse, 1000.0);
            let found: Vec<(usize, f32)> =
                samples.iter().copied().enumerate().filter(|(_, x)| *x != 0.0).collect();
            assert_eq!(found, [(at, 500.0)], "{start}");
        }
    }

    #[test]
    fn a_pulse_beyond_the_end_of_the_ring_is_cut_off_with_its_impulse_and_says_so() {
        let mut ring = ForceRing::new(1000.0, 1, 0.02);
        assert!(ring.add(0.0, 0, 1.0, 0.02, PulseShape::Cosine));
        assert!(!ring.add(25.0, 0, 1.0, 0.02, PulseShape::Cosine));
        assert!(!ring.add(400.0, 0, 1.0, 0.02, PulseShape::Cosine));
        let mut out = vec![0.0; 60];
        ring.read(&mut out);
        assert!((out.iter().sum::<f32>() / 1000.0 - 2.0).abs() < 1e-6, "{}", out.iter().sum::<f32>());
    }

    #[test]
    fn invalid_pulses_add_nothing() {
        let mut ring = ForceRing::new(1000.0, 1, 0.01);
        for (start, impulse, time) in
            [(f64::NAN, 1.0, 0.01), (1e9, 1.0, 0.01), (-1.0, 1.0, 0.01), (0.0, f64::INFINITY, 0.01)]
        {
            assert!(!ring.add(start, 0, impulse, time, PulseShape::Cosine), "{start} {impulse}");
        }
        let mut out = vec![1.0; 50];
        ring.read(&mut out);
        assert!(out.iter().all(|f| *f == 0.0));
    }
}
