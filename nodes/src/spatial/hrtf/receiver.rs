//! The head model in the frequency domain: complex gains instead of filters and delays.

use std::f64::consts::PI;

use super::head::{Ear, Head, PINNA_LEVELS, complex_product};
use crate::friction::Receiver;
use crate::spatial::motion::pose::Pose;
use crate::spatial::propagation::distance::Distance;

/// Bins per block. The phases in a block are those of one table times one complex number, so the inner loop has no dependences.
const BLOCK: usize = 64;

/// Two ears that receive the spectra of emitters, each multiplied by the gains of its direction.
///
/// Delays are circular in a clip; those of a head, below 1.5 ms in 50 ms, make this inaudible. Both ears receive the same phases of an
/// emitter. The centre of the head has delay 0.
///
/// # Complexity
/// Per emitter, ear and bin, six complex multiplications with a pinna and two without.
#[derive(Clone, Debug)]
pub struct HeadReceiver {
    head: Head,
    fs: f64,
    len: usize,
    listener: Pose,
    distance: Option<Distance>,
    /// `1 / (1 + a1 / z)` and `1 / (z + a1)` per bin: the shadow is a sum of these two.
    pole: [Vec<f32>; 2],
    delayed_pole: [Vec<f32>; 2],
    /// Gains of one ear.
    gains: [Vec<f32>; 2],
    echo: [Vec<f32>; 2],
}

impl HeadReceiver {
    /// Creates a head for clips of `len` samples (even) at `fs` hertz.
    #[must_use]
    pub fn new(head: Head, fs: f64, len: usize, distance: Option<Distance>) -> Self {
        let bins = len / 2 + 1;
        let a1 = head.shadow(0.0, fs)[2];
        let empty = || [vec![0.0; bins], vec![0.0; bins]];
        let (mut pole, mut delayed_pole) = (empty(), empty());
        for k in 0..bins {
            let w = 2.0 * PI * k as f64 / len as f64;
            let z = [libm::cos(w), -libm::sin(w)];
            let denominator = [1.0 + a1 * z[0], a1 * z[1]];
            let square = denominator[0] * denominator[0] + denominator[1] * denominator[1];
            let inverse = [denominator[0] / square, -denominator[1] / square];
            let shifted = complex_product(inverse, z);
            for part in 0..2 {
                pole[part][k] = inverse[part] as f32;
                delayed_pole[part][k] = shifted[part] as f32;
            }
        }
        Self {
            head,
            fs,
            len,
            listener: Pose::default(),
            distance,
            pole,
            delayed_pole,
            gains: empty(),
            echo: empty(),
        }
    }

    /// Sets the pose of the head.
    pub fn set_listener(&mut self, listener: Pose) {
        self.listener = listener;
    }

    /// Returns the complex gains of an ear for a source at a position, including distance.
    ///
    /// # Shapes
    /// `[bins]` real and `[bins]` imaginary parts.
    pub fn response(&mut self, ear: Ear, position: Option<[f32; 3]>) -> (&[f32], &[f32]) {
        let local = position.map_or([1.0, 0.0, 0.0], |p| self.listener.to_local(p.map(f64::from)));
        let level = match (&self.distance, position) {
            (Some(distance), Some(_)) => distance.gain_at(local),
            _ => 1.0,
        };
        let filter = self.head.ear(ear, local, self.fs);
        let delay = filter.delay - self.head.centre_delay();
        let step = |t: f64| -2.0 * PI * t * self.fs / self.len as f64;
        self.gains.iter_mut().for_each(|g| g.fill(0.0));
        add_phasors(level, step(delay), &mut self.gains);
        if self.head.pinna.is_some() {
            for (rho, echo) in PINNA_LEVELS.iter().zip(filter.pinna) {
                add_phasors(level * rho, step(delay + echo), &mut self.gains);
            }
        }
        self.echo.iter_mut().for_each(|e| e.fill(0.0));
        if self.head.shoulder > 0.0 {
            add_phasors(self.head.shoulder, step(filter.shoulder), &mut self.echo);
        }
        self.apply_shadow(filter.shadow);
        (&self.gains[0], &self.gains[1])
    }

    /// Multiplies the gains by the shadow and the shoulder reflection.
    fn apply_shadow(&mut self, [b0, b1, _]: [f64; 3]) {
        let (b0, b1) = (b0 as f32, b1 as f32);
        let [re, im] = &mut self.gains;
        let pole = self.pole[0].iter().zip(&self.pole[1]);
        let delayed_pole = self.delayed_pole[0].iter().zip(&self.delayed_pole[1]);
        let echo = self.echo[0].iter().zip(&self.echo[1]);
        let shadow = pole.zip(delayed_pole).zip(echo);
        for ((re, im), (((pr, pi), (dr, di)), (er, ei))) in re.iter_mut().zip(im).zip(shadow) {
            let (sr, si) = (b0 * pr + b1 * dr + er, b0 * pi + b1 * di + ei);
            (*re, *im) = (*re * sr - *im * si, *re * si + *im * sr);
        }
    }
}

/// Adds `level e^(i step k)` to bin `k`.
fn add_phasors(level: f64, step: f64, sum: &mut [Vec<f32>; 2]) {
    let phasor = |angle: f64| [libm::cos(angle), libm::sin(angle)];
    let first = phasor(step);
    let (mut cos, mut sin, mut z) = ([0.0_f32; BLOCK], [0.0_f32; BLOCK], [1.0, 0.0]);
    for (cos, sin) in cos.iter_mut().zip(&mut sin) {
        (*cos, *sin) = (z[0] as f32, z[1] as f32);
        z = complex_product(z, first);
    }
    let mut base = [level, 0.0];
    let [re, im] = sum;
    for (re, im) in re.chunks_mut(BLOCK).zip(im.chunks_mut(BLOCK)) {
        let (br, bi) = (base[0] as f32, base[1] as f32);
        for ((re, im), (tr, ti)) in re.iter_mut().zip(im).zip(cos.iter().zip(&sin)) {
            *re += br * tr - bi * ti;
            *im += br * ti + bi * tr;
        }
        base = complex_product(base, z);
    }
}

impl Receiver for HeadReceiver {
    fn channels(&self) -> usize {
        2
    }

    fn add(
        &mut self,
        channel: usize,
        position: Option<[f32; 3]>,
        (re, im): (&[f32], &[f32]),
        (sum_re, sum_im): (&mut [f32], &mut [f32]),
    ) {
        let ear = if channel == 0 { Ear::Left } else { Ear::Right };
        let (gr, gi) = self.response(ear, position);
        let emitter = re.iter().zip(im).zip(gr.iter().zip(gi));
        for ((sr, si), ((re, im), (gr, gi))) in sum_re.iter_mut().zip(sum_im).zip(emitter) {
            *sr += re * gr - im * gi;
            *si += re * gi + im * gr;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::head::PinnaSet;
    use super::*;

    #[test]
    fn the_gains_are_those_of_the_head_at_every_bin() {
        let (fs, len) = (48_000.0, 2400);
        for (pinna, shoulder) in [(None, 0.0), (Some(PinnaSet::Set0), 0.0), (Some(PinnaSet::Set1), 0.3)] {
            let head = Head { pinna, shoulder, ..Head::default() };
            let mut receiver = HeadReceiver::new(head, fs, len, None);
            receiver.set_listener(Pose::looking([1.0, 2.0, 3.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]).unwrap());
            for position in [[1.0_f32, 4.0, 3.0], [-2.0, 1.0, 3.5], [1.5, 0.0, 2.0]] {
                let local = receiver.listener.to_local(position.map(f64::from));
                for ear in [Ear::Left, Ear::Right] {
                    let filter = head.ear(ear, local, fs);
                    let (re, im) = receiver.response(ear, Some(position));
                    for k in (0..=1200).step_by(7) {
                        let expected = head.response(&filter, k as f64 * fs / len as f64, fs);
                        let error = (f64::from(re[k]) - expected[0]).hypot(f64::from(im[k]) - expected[1]);
                        assert!(error < 2e-5, "{position:?} {ear:?} bin {k}: {error}");
                    }
                }
            }
        }
    }

    #[test]
    fn distance_scales_both_ears() {
        let head = Head::default();
        let mut near = HeadReceiver::new(head, 48_000.0, 960, None);
        let mut far = HeadReceiver::new(head, 48_000.0, 960, Some(Distance::default()));
        let a: Vec<f32> = near.response(Ear::Left, Some([0.0, 4.0, 0.0])).0.to_vec();
        let b: Vec<f32> = far.response(Ear::Left, Some([0.0, 4.0, 0.0])).0.to_vec();
        assert!(a.iter().zip(&b).all(|(a, b)| (a - 4.0 * b).abs() < 1e-6));
    }
}
