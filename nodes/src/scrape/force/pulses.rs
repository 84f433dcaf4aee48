//! Short pulses of force that begin anywhere between two samples and add up.

use crate::impl_state;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Area of a pulse over its amplitude, s: a crossing of 1 per pixel is 1 N for 1 ms.
pub const PULSE: f64 = 1e-3;
/// Minimum duration of a pulse, samples.
const SHORTEST: f64 = 2.0;
/// Maximum duration of a pulse, s.
pub const LONGEST: f64 = 0.005;

/// Owner of a pulse: pulses that begin at the same sample are added in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct Key {
    first: i64,
    contact: u64,
    jump: u32,
}

/// An active pulse, a raised cosine: `scale (1 - cos)`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Pulse {
    key: Key,
    left: u32,
    scale: f64,
    /// The phase of the next sample as a point on the circle, and that of one step.
    at: [f64; 2],
    step: [f64; 2],
}

/// All active pulses, up to a fixed capacity.
///
/// They have a fixed order, so that their sum does not depend on the order of their arrival.
#[derive(Clone, Debug)]
pub struct Pulses {
    pulses: Vec<Pulse>,
    room: usize,
    rate: f64,
    /// Pulses beyond the capacity.
    pub left_out: u64,
}
impl_state!(Pulses { pulses, left_out });

impl Pulses {
    /// Allocates memory for `room` simultaneous pulses at a sample rate.
    #[must_use]
    pub fn new(room: usize, rate: f64) -> Self {
        Self { pulses: Vec::with_capacity(room), room, rate, left_out: 0 }
    }

    /// Adds a pulse that begins `start` samples after `sample`, lasts `time` seconds, held between two samples and 5 ms, and has an area
    /// of `area` N s, exactly. `owner` is a contact and its jump.
    pub fn add(&mut self, sample: i64, start: f64, time: f64, area: f64, owner: (u64, u32)) {
        if area == 0.0 || !area.is_finite() || !start.is_finite() {
            return;
        }
        if self.pulses.len() >= self.room {
            self.left_out += 1;
            return;
        }
        let length = (time * self.rate).clamp(SHORTEST, (LONGEST * self.rate).max(SHORTEST));
        let first = start.ceil();
        let half = 0.5 * TAU / length;
        let phase = (first - start) * 2.0 * half;
        // The samples strictly inside.
        let count = ((start + length).ceil() - first).max(1.0);
        let ((sin_half, cos_half), (sin, cos)) = (libm::sincos(half), libm::sincos(phase));
        // The sum of 1 - cos over them, in closed form.
        let sum = count - libm::sin(count * half) / sin_half * libm::cos(phase + (count - 1.0) * half);
        let key = Key { first: sample + first as i64, contact: owner.0, jump: owner.1 };
        let step = [1.0 - 2.0 * sin_half * sin_half, 2.0 * sin_half * cos_half];
        let scale = area * self.rate / sum;
        let pulse = Pulse { key, left: count as u32, scale, at: [cos, sin], step };
        let position = self.pulses.partition_point(|other| other.key <= key);
        self.pulses.insert(position, pulse);
    }

    /// Adds the samples from `first` on to `out`; no pulse begins before that.
    pub fn read(&mut self, first: i64, out: &mut [f32]) {
        for pulse in &mut self.pulses {
            let skip = usize::try_from(pulse.key.first - first).unwrap_or(0);
            let Some(out) = out.get_mut(skip..) else { continue };
            for out in out.iter_mut().take(pulse.left as usize) {
                let ([c, s], [dc, ds]) = (pulse.at, pulse.step);
                *out += (pulse.scale * (1.0 - c)) as f32;
                pulse.at = [c * dc - s * ds, c * ds + s * dc];
                pulse.left -= 1;
            }
        }
        self.pulses.retain(|pulse| pulse.left > 0);
    }

    /// Adopts the active pulses of another set.
    pub fn take_state(&mut self, old: &Self) {
        if old.rate == self.rate {
            self.pulses.clear();
            self.pulses.extend(old.pulses.iter().take(self.room));
        }
        self.left_out = old.left_out;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(rate: f64, pulses: &[(f64, f64, f64)], windows: &[usize]) -> Vec<f32> {
        let mut set = Pulses::new(8, rate);
        pulses.iter().for_each(|(start, time, area)| set.add(0, *start, *time, *area, (0, 0)));
        let (mut all, mut first) = (Vec::new(), 0);
        for n in windows {
            let mut out = vec![0.0; *n];
            set.read(first, &mut out);
            all.extend(out);
            first += *n as i64;
        }
        all
    }

    #[test]
    fn a_pulse_has_its_area_and_its_middle_wherever_it_begins() {
        for rate in [8000.0, 44_100.0, 96_000.0] {
            for (start, time) in
                [(0.0, 0.002), (7.3, 0.00195), (12.99, 0.005), (3.5, 0.0), (2.0, 0.0), (5.0, 9.0)]
            {
                let x = drawn(rate, &[(start, time, 0.3)], &[1000]);
                let area: f64 = x.iter().map(|x| f64::from(*x)).sum::<f64>() / rate;
                assert!((area - 0.3).abs() < 1e-7, "{rate} {start} {time}: {area}");
                let moment: f64 = x.iter().enumerate().map(|(n, x)| n as f64 * f64::from(*x)).sum();
                let length = (time * rate).clamp(2.0, 0.005 * rate);
                let middle = moment / rate / area;
                assert!((middle - start - length / 2.0).abs() < 0.26, "{rate} {start} {time}: {middle}");
                assert!(x.iter().take(start.ceil() as usize).all(|x| *x == 0.0));
            }
        }
    }

    #[test]
    fn windows_and_the_order_of_telling_change_nothing() {
        let pulses = [(3.2, 0.002, 1.0), (3.9, 0.001, -0.7), (50.0, 0.005, 0.2)];
        let whole = drawn(44_100.0, &pulses, &[400]);
        assert_eq!(drawn(44_100.0, &pulses, &[1; 400]), whole);
        assert_eq!(drawn(44_100.0, &pulses, &[7, 93, 300]), whole);
        let mut set = Pulses::new(8, 44_100.0);
        let mut other = Pulses::new(8, 44_100.0);
        let reported = [(3.2, 1.0, 5), (3.4, 0.3, 2), (3.1, -0.9, 9)];
        reported.iter().for_each(|(start, area, who)| set.add(10, *start, 0.002, *area, (*who, 0)));
        reported.iter().rev().for_each(|(start, area, who)| other.add(10, *start, 0.002, *area, (*who, 0)));
        let (mut a, mut b) = ([0.0; 200], [0.0; 200]);
        set.read(0, &mut a);
        other.read(0, &mut b);
        assert!(a == b && a.iter().any(|x| *x != 0.0));
    }

    #[test]
    fn what_finds_no_room_is_counted() {
        // A copy has as much.
        let mut set = Pulses::new(1, 1000.0).clone();
        (0..3).for_each(|_| set.add(0, 0.0, 0.002, 1.0, (0, 0)));
        assert_eq!(set.left_out, 2);
        set.add(0, f64::NAN, 0.0, 1.0, (0, 0));
        set.add(0, 0.0, 0.0, 0.0, (0, 0));
        assert_eq!(set.left_out, 2);
    }
}
